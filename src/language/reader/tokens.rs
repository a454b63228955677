//! From typed text to tokens: lower case, people's words replaced, slips put right, names joined.

use super::lexicon::lexicon;
use super::spelling::Spelling;
use crate::domain::Class;

/// Words behind this many are not read; they are [`Typed::rest`].
pub const LONGEST: usize = 400;

/// One word, name or mark.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Token {
    /// The plain word; a name's words are joined by `_`, in the singular.
    pub text: String,
    /// What was typed for it; empty where it is only understood.
    pub typed: String,
    /// Which of the typed words it begins with.
    pub at: usize,
    /// The reader knows no such word.
    pub unknown: bool,
    /// It is a name in the plural.
    pub many: bool,
    /// The classes that bear the name.
    pub classes: &'static [Class],
}

impl Token {
    /// A word that nobody typed.
    pub fn understood(text: &str, at: usize) -> Token {
        Token { text: text.into(), at, ..Token::default() }
    }

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

    /// Whether a verb's form stands here.
    pub fn lemma(&self) -> Option<&'static str> {
        lexicon().verb(&self.text)
    }
}

/// A word or mark as it stands in the text.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
struct Word {
    lower: String,
    typed: String,
}

/// A text's words and marks.
fn raw_words(text: &str) -> Vec<Word> {
    let mut words: Vec<Word> = Vec::new();
    let mut inside = false;
    for typed in text.chars() {
        let c = match typed {
            '\u{2019}' => '\'',
            '\n' => '.',
            other => other,
        };
        let letter = c.is_alphanumeric() || (c == '\'' && inside);
        if !(letter && inside) && (letter || ".,;!?:".contains(c)) {
            words.push(Word::default());
        }
        if let Some(word) = words.last_mut().filter(|_| letter || ".,;!?:".contains(c)) {
            word.lower.extend(c.to_lowercase());
            word.typed.push(typed);
        }
        inside = letter;
    }
    for word in &mut words {
        if word.lower.len() > 1 {
            word.lower.truncate(word.lower.trim_end_matches('\'').len());
            word.typed.truncate(word.typed.trim_end_matches(['\'', '\u{2019}']).len());
        }
    }
    words
}

/// A text in tokens.
#[derive(Clone, Debug, Default)]
pub struct Typed {
    /// The tokens of as many words as are read.
    pub tokens: Vec<Token>,
    /// The words behind those.
    pub rest: Vec<String>,
}

/// The tokens of a text.
pub fn tokens(text: &str, spelling: &Spelling) -> Typed {
    let lexicon = lexicon();
    let mut typed = raw_words(text);
    let rest = typed.split_off(typed.len().min(LONGEST)).into_iter().map(|word| word.typed).collect();
    let is_word = |word: &str| word.chars().any(char::is_alphabetic);
    let mut unknown = vec![false; typed.len()];
    let mut spelt = Vec::with_capacity(typed.len());
    for (at, Word { lower, .. }) in typed.iter().enumerate() {
        let possessive = lower.strip_suffix("'s").filter(|stem| spelling.knows(stem));
        let known = spelling.knows(lower) || !is_word(lower);
        let right = if known { Some(lower.as_str()) } else { possessive.or_else(|| spelling.correct(lower)) };
        unknown[at] = right.is_none();
        spelt.push(right.unwrap_or(lower).to_string());
    }
    let words = lexicon.replace_marked(&spelt);
    let as_typed =
        |from: usize, to: usize| typed[from..to].iter().map(|word| word.typed.as_str()).collect::<Vec<_>>().join(" ");
    let mut tokens = Vec::with_capacity(words.len());
    let mut at = 0;
    while at < words.len() {
        let (word, span) = &words[at];
        if let Some((length, name, many, classes)) = lexicon.name_at(&words[at..]) {
            let end = words[at + length - 1].1.end;
            let typed = as_typed(span.start, end);
            tokens.push(Token { text: name.to_string(), typed, at: span.start, unknown: false, many, classes });
            at += length;
            continue;
        }
        let unknown = unknown.get(span.start).copied().unwrap_or(false);
        let typed = as_typed(span.start, span.end);
        tokens.push(Token { text: word.clone(), typed, at: span.start, unknown, ..Token::default() });
        at += 1;
    }
    Typed { tokens, rest }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> String {
        tokens(text, &Spelling::of([])).tokens.iter().map(|token| token.text.as_str()).collect::<Vec<_>>().join(" ")
    }

    #[test]
    fn peoples_words_become_plain_ones_and_names_are_joined() {
        assert_eq!(read("Chuck the spuds in the Icebox!"), "put the potato in the fridge !");
        assert_eq!(read("Don't nab the bars of soap"), "do not grab the bar_of_soap");
    }

    #[test]
    fn slips_are_put_right_and_what_is_unknown_is_kept() {
        assert_eq!(read("put teh mgu in the mircowave"), "put the mug in the microwave");
        let all = tokens("Frobnicate the potatos", &Spelling::of([])).tokens;
        assert!(all[0].unknown);
        assert_eq!([&all[0].typed, &all[2].typed], ["Frobnicate", "potatos"]);
        assert_eq!(all[2].text, "potato");
    }

    #[test]
    fn what_stands_for_several_words_keeps_them_as_typed() {
        let all = tokens("Get rid of the BARS of soap", &Spelling::of([])).tokens;
        let typed: Vec<&str> = all.iter().map(|token| token.typed.as_str()).collect();
        assert_eq!(typed, ["Get rid of", "the", "BARS of soap"]);
    }

    #[test]
    fn what_is_behind_the_longest_text_is_kept_apart() {
        let all = tokens(&format!("{}and slice it", "put the mug down ".repeat(100)), &Spelling::of([]));
        assert_eq!((all.tokens.len(), all.rest.join(" ")), (LONGEST, "and slice it".into()));
    }
}
