//! Commands that people copy from a page into a shell.

/// A text as one word of a POSIX shell: quoted where it has to be.
pub(crate) fn shell_word(text: &str) -> String {
    let is_plain = |c: char| c.is_alphanumeric() || "_./#:@%+=,-".contains(c);
    match !text.is_empty() && text.chars().all(is_plain) && !text.starts_with(['#', '-']) {
        true => text.to_owned(),
        false => format!("'{}'", text.replace('\'', "'\\''")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shell_takes_the_word_for_what_it_was() {
        assert_eq!(shell_word("runs/b#2"), "runs/b#2");
        for text in ["my runs/b#2", "it's", "$HOME/`x`", "a;b", "", "#1", "~/runs", "two\nlines", "a'b'c"] {
            let shell =
                std::process::Command::new("sh").args(["-c", &format!("printf %s {}", shell_word(text))]).output();
            assert_eq!(String::from_utf8(shell.unwrap().stdout).unwrap(), text);
        }
    }
}
