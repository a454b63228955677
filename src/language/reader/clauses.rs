//! A text cut into clauses where a verb begins something new, and each clause in pieces.

pub use super::clause::{Chunk, Clause};
use super::lexicon::lexicon;
use super::pronouns::{say_what_it_means, say_what_them_means};
use super::switching::tell_switching;
use super::tokens::Token;

/// Whether a verb that can be nothing else stands here with its object: "take the fork".
pub(super) fn is_plain_request(tokens: &[Token], at: usize) -> bool {
    let words = &lexicon().words;
    matches!(tokens[at].text.as_str(), "put" | "place" | "pick" | "take" | "grab" | "get")
        && tokens
            .get(at + 1)
            .is_some_and(|next| words.determiners.contains(&next.text) || words.pronouns.contains(&next.text))
        && !at.checked_sub(1).is_some_and(|before| {
            let before = &tokens[before].text;
            words.determiners.contains(before) || words.prepositions.contains(before)
        })
}

/// Whether a verb may stand at a place.
pub(super) fn starts_verb(tokens: &[Token], at: usize) -> bool {
    let words = &lexicon().words;
    let Some(before) = at.checked_sub(1).and_then(|before| tokens.get(before)) else { return true };
    // "clean the mug" begins something; "the clean mug" and "a cut of bread" do not.
    let follows = tokens.get(at + 1).is_none_or(|next| {
        let text = &next.text;
        words.determiners.contains(text)
            || words.pronouns.contains(text)
            || words.particles.contains(text)
            || next.is_mark()
            || words.prepositions.contains(text) && text != "of"
    });
    let noun = tokens[at].text == "slice" && tokens.get(at + 1).is_some_and(|next| next.text == "of");
    let led = before.is_mark() || words.before_verb.contains(&before.text);
    let plain = words.plain.contains(&before.text) && !words.determiners.contains(&before.text);
    let pronoun = words.pronouns.contains(&before.text);
    if is_plain_request(tokens, at) {
        return true;
    }
    !noun && (led || (plain || pronoun || before.is_name()) && follows && tokens[at].classes.is_empty())
}

/// A clause begins at each verb that does not say what something is for.
pub fn clauses(tokens: &[Token]) -> Vec<Clause> {
    let mut all: Vec<Clause> = vec![Clause::default()];
    for (at, token) in tokens.iter().enumerate() {
        let lemma = token.lemma().filter(|_| starts_verb(tokens, at));
        let lemma = lemma.or_else(|| (token.text == "microwave" && starts_clause(tokens, at)).then_some("heat"));
        let Some(last) = all.last_mut() else { break };
        if lemma.is_none()
            && matches!(token.text.as_str(), "and" | ",")
            && last.lemma == "put"
            && says_where(&last.tokens)
            && goes_on(&tokens[at + 1..])
        {
            // "put the mug in the sink and the plate in the cabinet"
            let verb = Token::understood("put", token.at);
            all.push(Clause { lemma: "put", tokens: vec![verb], ..Clause::default() });
            continue;
        }
        let purpose =
            at > 0 && tokens[at - 1].text == "to" && !last.lemma.is_empty() && !matches!(last.lemma, "go" | "open");
        match lemma.filter(|_| !purpose) {
            Some(lemma) if last.lemma.is_empty() && !last.tokens.iter().any(Token::is_name) => {
                last.lemma = lemma;
                last.tokens.push(token.clone());
            }
            Some(lemma) => {
                all.push(Clause { lemma, tokens: vec![token.clone()], ..Clause::default() });
            }
            None if token.ends_sentence() => {
                last.ends_sentence = true;
                all.push(Clause::default());
            }
            None => last.tokens.push(token.clone()),
        }
    }
    all.retain(|clause| clause.tokens.iter().any(|token| !token.is_mark()));
    say_what_it_means(&mut all);
    say_what_them_means(&mut all);
    tell_switching(&mut all);
    all
}

/// Whether something is named after a preposition.
fn says_where(tokens: &[Token]) -> bool {
    let prepositions = &lexicon().words.prepositions;
    let leads = tokens.iter().position(|token| prepositions.contains(&token.text) && token.text != "of");
    leads.is_some_and(|at| tokens[at..].iter().any(Token::is_name))
}

/// Whether a thing and its place follow at once: "the plate in the cabinet".
fn goes_on(tokens: &[Token]) -> bool {
    let words = &lexicon().words;
    let movable = |token: &Token| token.classes.iter().any(|class| class.info().pickupable);
    let determined = tokens.first().is_some_and(|token| words.determiners.contains(&token.text));
    let bare = tokens.iter().find(|token| token.is_name()).is_some_and(movable);
    let thing = tokens.iter().take(4).position(Token::is_name).filter(|_| determined || bare);
    let Some(at) = thing.filter(|&at| tokens[..at].iter().all(|token| token.lemma().is_none())) else {
        return false;
    };
    tokens.get(at + 1).is_some_and(|next| matches!(next.text.as_str(), "in" | "on" | "into" | "onto" | "inside"))
        && tokens[at + 2..].iter().take(4).any(Token::is_name)
}

/// Whether "microwave" is a verb here.
fn starts_clause(tokens: &[Token], at: usize) -> bool {
    let words = &lexicon().words;
    let before = at.checked_sub(1).map(|before| &tokens[before]);
    let leads = before.is_none_or(|token| {
        token.is_mark()
            || words.before_verb.contains(&token.text) && token.text != "to"
            || words.plain.contains(&token.text)
                && !words.determiners.contains(&token.text)
                && !words.prepositions.contains(&token.text)
    });
    let follows = tokens.get(at + 1).is_some_and(|next| {
        words.determiners.contains(&next.text) || words.pronouns.contains(&next.text) || next.is_name()
    });
    leads && follows
}

/// A clause in pieces.
pub fn chunks(clause: &Clause) -> Vec<Chunk> {
    let words = &lexicon().words;
    let mut all = Vec::new();
    let mut chunk = Chunk::default();
    let mut verb = !clause.lemma.is_empty();
    for token in &clause.tokens {
        let text = token.text.as_str();
        if verb && token.lemma().is_some_and(|lemma| comes_to(lemma, clause.lemma)) {
            // What is said before the verb addresses somebody: "hey robot, take".
            verb = false;
            all.clear();
            chunk = Chunk::default();
        } else if token.is_mark() || words.breaks.contains(text) {
            flush(&mut chunk, &mut all);
            chunk.lead = if token.is_mark() { "and".into() } else { text.into() };
        } else if words.pronouns.contains(text) {
            flush(&mut chunk, &mut all);
            let lead = std::mem::take(&mut chunk.lead);
            all.push(Chunk { lead, words: vec![token.clone()] });
        } else if words.prepositions.contains(text) {
            let place = !chunk.words.is_empty() && chunk.words.iter().all(|word| words.places.contains(&word.text));
            if place {
                let side = |word: &Token| word.text == "side" && chunk.lead != "to" && chunk.lead != "by";
                let beside = !chunk.words.iter().any(side)
                    && chunk.words.iter().any(|word| matches!(word.text.as_str(), "left" | "right" | "front"));
                if beside && matches!(chunk.lead.as_str(), "to" | "in" | "on" | "by" | "from") && text == "of" {
                    chunk.lead = "by".into();
                } else if text != "of" {
                    chunk.lead = text.into();
                }
                chunk.words.clear();
            } else if chunk.words.is_empty() {
                if !(text == "of" || text == "to" && !chunk.lead.is_empty()) || chunk.lead.is_empty() {
                    chunk.lead = text.into();
                }
            } else {
                flush(&mut chunk, &mut all);
                chunk.lead = text.into();
            }
        } else if words.determiners.contains(text) {
            if !chunk.words.is_empty() {
                flush(&mut chunk, &mut all);
                chunk.lead = "the".into();
            }
        } else if !(words.particles.contains(text) && chunk.words.is_empty()) {
            if words.particles.contains(text) {
                flush(&mut chunk, &mut all);
            } else {
                chunk.words.push(token.clone());
            }
        }
    }
    flush(&mut chunk, &mut all);
    all
}

/// Whether a verb may make a clause of that kind: switching off and closing are told from switching on by other words.
fn comes_to(verb: &str, lemma: &str) -> bool {
    verb == lemma || matches!(lemma, "off" | "close") || lemma == "wash" && verb == "go"
}

fn flush(chunk: &mut Chunk, all: &mut Vec<Chunk>) {
    if !chunk.words.is_empty() {
        all.push(std::mem::take(chunk));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::language::reader::tokens::tokens;
    use crate::language::reader::units::Reader;

    fn read(text: &str) -> Vec<String> {
        let tokens = tokens(text, Reader::shipped().unwrap().spelling()).tokens;
        clauses(&tokens)
            .iter()
            .map(|clause| {
                let pieces = chunks(clause);
                let pieces = pieces.iter().map(|chunk| {
                    let words: Vec<&str> = chunk.words.iter().map(|word| word.text.as_str()).collect();
                    format!("{}[{}]", chunk.lead, words.join(" "))
                });
                format!("{}: {}", clause.lemma, pieces.collect::<Vec<_>>().join(" "))
            })
            .collect()
    }

    #[test]
    fn a_clause_begins_at_each_verb() {
        let all = read("Please grab the red mug on the table, wash it and put it in the sink. Turn on the lamp");
        assert_eq!(all, ["take: [red mug] on[table]", "wash: [it]", "put: [it] in[sink]", "turn: on[lamp]"]);
        assert_eq!(read("put a clean mug on the back of the toilet"), ["put: [clean mug] on[back_of_the_toilet]"]);
        assert_eq!(read("put it on the right side of the desk"), ["put: [it] on[desk]"]);
        assert_eq!(read("pick up a slice of bread"), ["take: [slice] of[bread]"]);
    }

    #[test]
    fn a_verb_that_is_understood_begins_a_clause_too() {
        let two = ["put: [mug] in[sink]", "put: [plate] in[cabinet]"];
        assert_eq!(read("put the mug in the sink and the plate in the cabinet"), two);
        assert_eq!(read("put mug in sink, plate in cabinet"), two);
    }

    #[test]
    fn them_is_each_of_the_things_named_and_it_is_what_was_closed() {
        let all = read("wash the mug and the plate and put them in the cabinet");
        assert_eq!(all, ["wash: [mug] and[plate]", "put: [mug] and[plate] in[cabinet]"]);
        assert_eq!(read("close the laptop and pick it up"), ["close: [laptop]", "take: [laptop]"]);
    }

    #[test]
    fn switching_off_is_not_switching_on() {
        let lemma = |text: &str| clauses(&tokens(text, Reader::shipped().unwrap().spelling()).tokens)[0].lemma;
        for text in [
            "switch the floor lamp off",
            "turn off the desk lamp",
            "lights off",
            "put the lamp out",
            "power down the lamp",
        ] {
            assert_eq!(lemma(text), "off", "{text}");
        }
        assert_eq!([lemma("turn on the lamp"), lemma("get the book off the lamp")], ["turn", "take"]);
        assert_eq!([lemma("turn off the tap"), lemma("turn the water off")], ["close", "close"]);
        assert_eq!(lemma("run the mug under the tap"), "wash");
    }
}
