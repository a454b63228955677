//! From typed text to tokens: lower case, people's words replaced, slips put right, names joined.

use super::lexicon::lexicon;
use super::spelling::Spelling;
use crate::domain::Class;

/// More words than this are not read.
pub const LONGEST: usize = 400;

/// One word, name or mark.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Token {
    /// The plain word; a name's words are joined by `_`, in the singular.
    pub text: String,
    /// The word as it was typed, where it is nothing that the reader knows.
    pub unknown: Option<String>,
    /// It is a name in the plural.
    pub many: bool,
    /// The classes that bear the name.
    pub classes: &'static [Class],
}

impl Token {
    /// Whether it ends a sentence or sets something off.
    pub fn is_mark(&self) -> bool {
        self.text.len() == 1 && self.text.starts_with(['.', ',', ';', '!', '?', ':'])
    }

    /// Whether it ends a sentence.
    pub fn ends_sentence(&self) -> bool {
        self.text.len() == 1 && self.text.starts_with(['.', ';', '!', '?'])
    }

    /// Whether a class is named.
    pub fn is_name(&self) -> bool {
        !self.classes.is_empty()
    }
}

/// Words and marks as they stand, in lower case.
pub fn raw_words(text: &str) -> Vec<String> {
    let mut words: Vec<String> = Vec::new();
    let mut inside = false;
    for c in text.chars().flat_map(char::to_lowercase) {
        let c = if c == '\u{2019}' { '\'' } else { c };
        let c = if c == '\n' { '.' } else { c };
        let letter = c.is_alphanumeric() || (c == '\'' && inside);
        match words.last_mut().filter(|_| letter && inside) {
            Some(word) => word.push(c),
            None if letter || ".,;!?:".contains(c) => words.push(c.to_string()),
            None => {}
        }
        inside = letter;
        if words.len() > LONGEST {
            words.pop();
            break;
        }
    }
    for word in &mut words {
        if word.len() > 1 {
            *word = word.trim_end_matches('\'').to_string();
        }
    }
    words
}

/// The tokens of a text.
pub fn tokens(text: &str, spelling: &Spelling) -> Vec<Token> {
    let lexicon = lexicon();
    let typed = raw_words(text);
    let is_word = |word: &str| word.chars().any(char::is_alphabetic);
    let mut unknown = vec![false; typed.len()];
    let mut spelt = Vec::with_capacity(typed.len());
    for (at, word) in typed.iter().enumerate() {
        let possessive = word.strip_suffix("'s").filter(|stem| spelling.knows(stem));
        let known = spelling.knows(word) || !is_word(word);
        let right = if known { Some(word.as_str()) } else { possessive.or_else(|| spelling.correct(word)) };
        unknown[at] = right.is_none();
        spelt.push(right.unwrap_or(word).to_string());
    }
    let words = lexicon.replace_marked(&spelt);
    let mut tokens = Vec::with_capacity(words.len());
    let mut at = 0;
    while at < words.len() {
        let (word, from) = &words[at];
        if let Some((length, name, many, classes)) = lexicon.name_at(&words[at..]) {
            tokens.push(Token { text: name.to_string(), unknown: None, many, classes });
            at += length;
            continue;
        }
        let unknown = unknown.get(*from).copied().unwrap_or(false).then(|| typed[*from].clone());
        tokens.push(Token { text: word.clone(), unknown, many: false, classes: &[] });
        at += 1;
    }
    tokens
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> String {
        let tokens = tokens(text, &Spelling::of([]));
        tokens.iter().map(|token| token.text.as_str()).collect::<Vec<_>>().join(" ")
    }

    #[test]
    fn peoples_words_become_plain_ones_and_names_are_joined() {
        assert_eq!(read("Chuck the spuds in the Icebox!"), "put the potato in the fridge !");
        assert_eq!(read("Don't nab the bars of soap"), "do not grab the bar_of_soap");
    }

    #[test]
    fn slips_are_put_right_and_what_is_unknown_is_kept() {
        assert_eq!(read("put teh mgu in the mircowave"), "put the mug in the microwave");
        let all = tokens("frobnicate the potatos", &Spelling::of([]));
        assert_eq!(all[0].unknown.as_deref(), Some("frobnicate"));
        assert_eq!(all[2].text, "potato");
    }
}
