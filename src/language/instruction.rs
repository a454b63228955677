//! Instructions: typed text in the form that agents are trained on.

/// The longest instruction that is accepted, in characters; a sentence encoder reads some 1,000 at most.
pub(crate) const LONGEST: usize = 2_000;

/// Why a text is no instruction.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum InstructionError {
    /// Nothing is left of it.
    #[error("the instruction is empty: say what is to be done")]
    Empty,
    /// It is absurdly long.
    #[error("the instruction has {characters} characters, {LONGEST} are the most: shorten it")]
    TooLong {
        /// How long it is.
        characters: usize,
    },
    /// It holds characters that steer terminals or hide text.
    #[error("the instruction holds the control character U+{code:04X} at character {position}: remove it")]
    Control {
        /// Which character.
        code: u32,
        position: usize,
    },
}

/// Brings a text into the form of the paper's instructions: trimmed, lower case, single spaces, ending in a full
/// stop unless it ends in one of `.?!`, with a capital first letter. Control and invisible formatting characters are dropped.
/// Empty text stays empty. Applying it twice changes nothing more.
pub(crate) fn normalise(text: &str) -> String {
    let spaced = text.chars().map(|c| if c.is_whitespace() { ' ' } else { c });
    let clean: String = spaced.filter(|&c| !is_control(c)).collect();
    let words: Vec<&str> = clean.split(' ').filter(|word| !word.is_empty()).collect();
    let lower = words.join(" ").to_lowercase();
    let mut letters = lower.chars();
    let Some(first) = letters.next() else { return String::new() };
    let mut sentence = String::with_capacity(lower.len() + 1);
    sentence.push(capital(first));
    sentence.push_str(letters.as_str());
    if !sentence.ends_with(['.', '?', '!']) {
        sentence.push('.');
    }
    sentence
}

/// Reads an instruction from a file or a command line: strict where [`normalise`] is lenient.
///
/// # Errors
/// When it is empty, longer than [`LONGEST`], or holds control characters.
pub(crate) fn parse(text: &str) -> Result<String, InstructionError> {
    let characters = text.chars().count();
    if characters > LONGEST {
        return Err(InstructionError::TooLong { characters });
    }
    if let Some((index, c)) = text.chars().enumerate().find(|&(_, c)| is_control(c) && !c.is_whitespace()) {
        return Err(InstructionError::Control { code: u32::from(c), position: index + 1 });
    }
    let sentence = normalise(text);
    if sentence.is_empty() { Err(InstructionError::Empty) } else { Ok(sentence) }
}

/// A text that somebody else wrote, as it may be kept and shown: trimmed, its line breaks and tabs spaces, without control and
/// invisible formatting characters; its letters as they were.
pub(crate) fn visible(text: &str) -> String {
    let plain = text.chars().filter_map(|c| match c {
        c if c.is_whitespace() && is_control(c) => Some(' '),
        c => (!is_control(c)).then_some(c),
    });
    plain.collect::<String>().trim().to_owned()
}

/// Characters that steer terminals, turn text round or show nothing.
pub(crate) fn is_control(c: char) -> bool {
    let invisible = matches!(c, '\u{ad}' | '\u{61c}' | '\u{200b}'..='\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2060}'..='\u{206f}' | '\u{feff}' | '\u{fff9}'..='\u{fffb}');
    c.is_control() || invisible
}

/// The capital of a letter, where it is one letter that goes back to the same small one.
fn capital(c: char) -> char {
    let only = |mut letters: std::char::ToUppercase| letters.next().filter(|_| letters.next().is_none());
    let back = |upper: char| upper.to_lowercase().eq(std::iter::once(c));
    only(c.to_uppercase()).filter(|&upper| back(upper)).unwrap_or(c)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn an_instruction_is_trimmed_lowered_ended_and_capitalised() {
        assert_eq!(normalise("  PUT the  Apple\tin the fridge "), "Put the apple in the fridge.");
        assert_eq!(normalise("Where is it?"), "Where is it?");
        assert_eq!(normalise(" \n "), "");
        assert_eq!(normalise("cut\u{1b}[31m \u{202e}bread"), "Cut[31m bread.");
        assert_eq!(normalise("straße"), "Straße.");
        assert_eq!(normalise("ßa"), "ßa.");
    }

    #[test]
    fn what_others_wrote_is_kept_without_what_steers_a_terminal_or_shows_nothing() {
        let odd = "\u{8}Take\tthe \u{200b}Mu\u{ad}g,\r\nplease\u{1b}[31m.\u{feff} ";
        assert_eq!(visible(odd), "Take the Mug,  please[31m.");
        assert!(parse(&visible(odd)).is_ok() && parse(odd).is_err());
    }

    #[test]
    fn absurd_instructions_are_refused_in_words() {
        assert_eq!(parse("heat the mug"), Ok("Heat the mug.".into()));
        assert_eq!(parse(" "), Err(InstructionError::Empty));
        let error = parse(&"a ".repeat(5_000)).unwrap_err();
        assert_eq!(error.to_string(), "the instruction has 10000 characters, 2000 are the most: shorten it");
        let error = parse("heat\u{7}").unwrap_err();
        assert_eq!(error.to_string(), "the instruction holds the control character U+0007 at character 5: remove it");
    }

    proptest! {
        #[test]
        fn normalising_twice_changes_nothing_more(text in any::<String>()) {
            let once = normalise(&text);
            prop_assert_eq!(normalise(&once), once);
        }

        #[test]
        fn any_text_is_read_or_refused(text in "(?s).*") {
            if let Ok(sentence) = parse(&text) {
                prop_assert!(sentence.ends_with(['.', '?', '!']));
                prop_assert!(!sentence.chars().any(char::is_control));
            }
        }
    }
}
