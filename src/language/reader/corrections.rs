//! Corrections in mid-sentence: "take the mug, no wait, the cup" asks for the cup.

use super::lexicon::lexicon;
use super::tokens::Token;

/// What takes back what was just said, in plain words; marks between the words do not count.
const TAKES_BACK: [&[&str]; 12] = [
    &["no"],
    &["no", "wait"],
    &["no", "sorry"],
    &["wait", "no"],
    &["i", "mean"],
    &["i", "meant"],
    &["or", "rather"],
    &["sorry"],
    &["oops"],
    &["scratch", "that"],
    &["make", "that"],
    &["actually"],
];

/// Puts right what a text corrects: a name, a place, or a whole request in another's stead. Where it is not clear what is taken
/// back, the words that take it back become unknown ones.
pub(super) fn corrected(tokens: Vec<Token>) -> Vec<Token> {
    let mut kept: Vec<Token> = Vec::with_capacity(tokens.len());
    let mut at = 0;
    while at < tokens.len() {
        let length = taken_back(&kept, &tokens[at..]);
        if length == 0 {
            kept.push(tokens[at].clone());
            at += 1;
            continue;
        }
        let rest = &tokens[at + length..];
        match replace(&mut kept, rest) {
            Some(used) => at += length + used,
            None => {
                let doubted = tokens[at..at + length].iter().filter(|token| !token.is_mark());
                kept.extend(doubted.map(|token| Token { unknown: true, ..token.clone() }));
                at += length;
            }
        }
    }
    kept
}

/// How many tokens from here take back what was said; 0 when they do not.
fn taken_back(kept: &[Token], rest: &[Token]) -> usize {
    if !kept.iter().any(|token| token.is_name() || token.lemma().is_some()) {
        return 0;
    }
    let marked = kept.last().is_some_and(Token::is_mark);
    // Two words are clear without a mark before them, but for "make that".
    let clear = |words: &&&[&str]| marked || words.len() > 1 && words[0] != "make";
    let longest = TAKES_BACK.iter().filter(clear).filter_map(|words| says(rest, words)).max();
    let Some(mut length) = longest else { return 0 };
    let strong = length > 1 || rest[0].text != "no" && rest[0].text != "actually";
    while says(&rest[length..], &["sorry"]).is_some() || rest.get(length).is_some_and(Token::is_mark) {
        length += 1;
    }
    let words = &lexicon().words;
    if apologises(&rest[..length], &rest[length..]) {
        return 0;
    }
    // "no knife" and "no more" take nothing back; "no, the fork" does.
    let clear = rest[length - 1].is_mark()
        || rest.get(length).is_some_and(|next| {
            let determined = words.determiners.contains(&next.text) && next.text != "other" && next.text != "any";
            determined || words.prepositions.contains(&next.text)
        });
    if strong || clear { length } else { 0 }
}

/// "sorry for the trouble" and "sorry to bother you" take nothing back; "sorry, to the fridge" names another place.
fn apologises(said: &[Token], rest: &[Token]) -> bool {
    let words = &lexicon().words;
    let is_sorry = said.iter().rfind(|token| !token.is_mark()).is_some_and(|token| token.text == "sorry");
    let leads_on = |token: &Token| {
        token.is_mark() || token.lemma().is_some() && !token.is_name() || words.prepositions.contains(&token.text)
    };
    let Some((first, rest)) = rest.split_first().filter(|_| is_sorry) else { return false };
    let named = rest.iter().take_while(|token| !leads_on(token)).find(|token| token.is_name());
    let is_place = named.is_some_and(|token| token.classes.iter().any(|class| class.info().receptacle));
    matches!(first.text.as_str(), "for" | "to") && !is_place
}

/// How many tokens these words take, marks between them included.
fn says(tokens: &[Token], words: &[&str]) -> Option<usize> {
    let mut at = 0;
    for (nth, word) in words.iter().enumerate() {
        while nth > 0 && tokens.get(at).is_some_and(|token| token.text == ",") {
            at += 1;
        }
        if tokens.get(at)?.text != *word {
            return None;
        }
        at += 1;
    }
    Some(at)
}

/// Puts the rest's first words in the place of what they correct; how many they are.
fn replace(kept: &mut Vec<Token>, rest: &[Token]) -> Option<usize> {
    let words = &lexicon().words;
    let is_preposition = |token: &Token| words.prepositions.contains(&token.text) && token.text != "of";
    let first = rest.first()?;
    let marks = kept.iter().rev().take_while(|token| token.is_mark()).count();
    let said = kept.len() - marks;
    if let Some(lemma) = first.lemma().filter(|_| !first.is_name()) {
        // "take the mug, no, take the cup"
        let at = kept[..said].iter().rposition(|token| token.lemma() == Some(lemma))?;
        return Some(begin_anew(kept, at, rest));
    }
    let begin = said - kept[..said].iter().rev().take_while(|token| !token.is_mark()).count();
    if is_preposition(first) {
        let at = begin + kept[begin..said].iter().rposition(is_preposition)?;
        if rest.get(1).is_some_and(|next| words.pronouns.contains(&next.text)) {
            kept[at] = first.clone();
            return Some(2);
        }
        return Some(begin_anew(kept, at, rest));
    }
    let length = rest.iter().position(Token::is_name)? + 1;
    let leads_on = |token: &Token| token.is_mark() || is_preposition(token) || token.lemma().is_some();
    if rest[..length - 1].iter().any(leads_on) {
        return None;
    }
    let movable = |token: &Token| token.classes.iter().any(|class| class.info().pickupable);
    let alike = |token: &Token| token.is_name() && movable(token) == movable(&rest[length - 1]);
    let at = begin + kept[begin..said].iter().rposition(alike)?;
    let before = |token: &&Token| !(leads_on(token) || token.is_name() || words.breaks.contains(&token.text));
    let start = at - kept[begin..at].iter().rev().take_while(before).count();
    kept.truncate(said);
    kept.splice(start..=at, rest[..length].iter().cloned());
    Some(length)
}

/// Takes back everything from `at` on; how many of the rest's first words stand for what was said there.
fn begin_anew(kept: &mut Vec<Token>, at: usize, rest: &[Token]) -> usize {
    let meant = kept[at..].iter().find(|token| token.is_name()).cloned();
    kept.truncate(at);
    let (Some(meant), [first, it, ..]) = (meant, rest) else { return 0 };
    if !matches!(it.text.as_str(), "it" | "them") {
        return 0;
    }
    kept.extend([first.clone(), meant]);
    2
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::language::reader::tokens::tokens;
    use crate::language::reader::units::Reader;

    fn read(text: &str) -> String {
        let tokens = corrected(tokens(text, Reader::shipped().unwrap().spelling()).tokens);
        tokens.iter().map(|token| token.text.as_str()).collect::<Vec<_>>().join(" ")
    }

    #[test]
    fn what_is_taken_back_is_replaced() {
        assert_eq!(read("take the mug, no wait, the cup"), "take the cup");
        assert_eq!(
            read("take the mug from the desk... sorry, the pen and wash it"),
            "take the pen from the desk and wash it"
        );
        assert_eq!(read("put the mug in the sink, no, in the fridge"), "put the mug in the fridge");
        assert_eq!(read("put the mug in the sink, sorry, to the fridge"), "put the mug to the fridge");
        assert_eq!(read("put the mug under the desk - I mean, put it on the desk"), "put mug on the desk");
        assert_eq!(read("take the fork, no, take the spoon"), "take the spoon");
    }

    #[test]
    fn a_no_that_takes_nothing_back_stays() {
        for text in [
            "take the mug , no knife",
            "actually take the mug",
            "there is no mug",
            "put the mug in the sink , sorry for the trouble",
            "put the mug in the sink , sorry to bother you",
        ] {
            assert_eq!(read(text), text);
        }
    }
}
