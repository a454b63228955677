//! One text as the links of a chain.

use crate::language::instruction;

/// Splits a text into the links of a chain: at semicolons, line breaks, full stops and the word "then".
pub(crate) fn split(text: &str) -> Vec<String> {
    let mut text = text.replace(['\n', '\r', '.', '!', '?'], ";");
    for joint in [", and then ", " and then ", ", then ", " then "] {
        text = text.replace(joint, ";");
    }
    let parts = text.split(';').map(|part| part.trim().trim_start_matches("then ").trim_matches([',', ' ']));
    parts.filter(|part| !part.is_empty()).map(instruction::normalise).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(text: &str, expected: &[&str]) {
        assert_eq!(split(text), expected, "{text:?}");
    }

    #[test]
    fn a_text_falls_into_links() {
        check("pick up the knife; slice the tomato", &["Pick up the knife.", "Slice the tomato."]);
        check("Take the mug, then put it in the sink.", &["Take the mug.", "Put it in the sink."]);
        check("take the mug\nand wash it\n", &["Take the mug.", "And wash it."]);
        check("open the fridge and then close it. Done", &["Open the fridge.", "Close it.", "Done."]);
        check(" ; . ", &[]);
    }
}
