//! A clause: a verb with what follows it, in pieces.

use super::lexicon::lexicon;
use super::tokens::Token;

/// A piece of a clause: a noun and what leads to it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Chunk {
    /// The preposition before it; empty right after the verb, "and" after one.
    pub lead: String,
    /// Its words, without articles; a pronoun stands alone.
    pub words: Vec<Token>,
}

impl Chunk {
    /// The word that says what it is: the last name, else the last word.
    pub fn head(&self) -> Option<&Token> {
        self.words.iter().rev().find(|word| word.is_name()).or(self.words.last())
    }

    /// Whether it stands for what was named before.
    pub fn is_pronoun(&self) -> bool {
        matches!(self.words.as_slice(), [word] if lexicon().words.pronouns.contains(&word.text))
    }
}

/// A verb with what follows it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Clause {
    /// What the verb comes to; empty when there is none.
    pub lemma: &'static str,
    /// The tokens, the verb's included.
    pub tokens: Vec<Token>,
    /// A mark that ends a sentence follows.
    pub ends_sentence: bool,
    /// The things that it names are several, and none goes into another.
    pub is_of_each: bool,
}

impl Clause {
    /// A clause for each of the things that it names together: "put the fork and the knife in the drawer" is two.
    pub fn apart(&self) -> Option<Vec<Clause>> {
        let words = &lexicon().words;
        if matches!(self.lemma, "" | "go" | "wait" | "open" | "close") {
            return None;
        }
        let led = |token: &Token| words.prepositions.contains(&token.text) || words.breaks.contains(&token.text);
        let first = self.tokens.iter().position(Token::is_name)?;
        let verb = self.tokens.iter().position(|token| token.lemma().is_some()).unwrap_or(0);
        if self.tokens[..first]
            .iter()
            .skip(verb + 1)
            .any(|token| words.prepositions.contains(&token.text) && token.text != "of")
        {
            return None;
        }
        let joins = |token: &Token| token.text == "and" || token.text == ",";
        let both = |token: &&Token| token.text != "both";
        let mut things: Vec<Vec<Token>> = vec![self.tokens[verb + 1..=first].iter().filter(both).cloned().collect()];
        let mut at = first + 1;
        while self.tokens.get(at).is_some_and(joins) {
            let start = at + self.tokens[at..].iter().take_while(|token| joins(token)).count();
            let length = self.tokens[start..]
                .iter()
                .take_while(|token| !token.is_name() && !led(token) && !token.is_mark())
                .count();
            if !self.tokens.get(start + length).is_some_and(Token::is_name) {
                break;
            }
            things.push(self.tokens[start..=start + length].to_vec());
            at = start + length + 1;
        }
        if things.len() < 2 {
            return None;
        }
        let clause = |thing: Vec<Token>| Clause {
            lemma: self.lemma,
            tokens: self.tokens[..=verb]
                .iter()
                .cloned()
                .chain(thing)
                .chain(self.tokens[at..].iter().cloned())
                .collect(),
            ends_sentence: self.ends_sentence,
            is_of_each: false,
        };
        Some(things.into_iter().map(clause).collect())
    }
}
