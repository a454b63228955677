//! Clauses: a text cut where a verb begins something new, what must not be done left out, and each clause in pieces.

use super::lexicon::lexicon;
use super::shape::is_lamp;
use super::tokens::Token;
use crate::domain::class::FixtureEffect;

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
        let mut things: Vec<Vec<Token>> = vec![self.tokens[verb + 1..=first].to_vec()];
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

/// Leaves out what a text says is not to be done: "don't take the knife", "not the knife", "instead of the knife".
pub fn without_the_forbidden(tokens: Vec<Token>) -> Vec<Token> {
    let text = |at: usize| tokens.get(at).map_or("", |token: &Token| token.text.as_str());
    let mut kept: Vec<Token> = Vec::with_capacity(tokens.len());
    // What was named only to say what not to do with it may still be meant by "it".
    let mut named: Option<Token> = None;
    let mut at = 0;
    while at < tokens.len() {
        if let Some(length) = asks_by_denying(&tokens[at..]) {
            at += length;
            continue;
        }
        let forbids = match (text(at), text(at + 1)) {
            ("do" | "must" | "should" | "can" | "will" | "does" | "need" | "would" | "could", "not") => true,
            ("not", next) => next != "only" && next != "far",
            ("instead", "of") | ("rather", "than") | ("without", _) | ("except", _) | ("ignore" | "skip", _) => true,
            ("no", "need") | ("refrain", "from") | ("forget", _) => true,
            ("leave", _) => is_let_alone(&tokens, at),
            _ => false,
        };
        if !forbids {
            if tokens[at].is_name() {
                named = None;
            }
            let stands_for = named.clone().filter(|_| matches!(text(at), "it" | "them"));
            kept.push(stands_for.unwrap_or_else(|| tokens[at].clone()));
            at += 1;
            continue;
        }
        let start = at;
        let anything_before = kept.iter().any(Token::is_name);
        at += 1;
        while at < tokens.len() {
            let new_verb = |from: usize| {
                (from..tokens.len().min(from + 3)).any(|i| lexicon().verb(text(i)).is_some() && starts_verb(&tokens, i))
            };
            let again = || {
                // "don't take the knife take the fork"
                is_plain_request(&tokens, at) && tokens[start..at].iter().any(Token::is_name)
            };
            let ends = tokens[at].ends_sentence()
                || again()
                || matches!(text(at), "but" | "just" | "only" | "instead") && at > start + 1 && text(at + 1) != "of"
                || text(at) == "," && at > start + 1
                || matches!(text(at), "and" | "then") && new_verb(at + 1);
            if ends {
                break;
            }
            at += 1;
        }
        if !anything_before {
            named = tokens[start..at].iter().find(|token| token.is_name()).cloned();
        }
    }
    kept
}

/// How many tokens ask for something by denying its opposite: "do not forget to", "why do not you", "can not you".
fn asks_by_denying(tokens: &[Token]) -> Option<usize> {
    let text = |at: usize| tokens.get(at).map_or("", |token: &Token| token.text.as_str());
    let whom = |at: usize| usize::from(matches!(text(at), "you" | "we" | "i"));
    let not = match text(0) {
        "why" if text(1) == "not" => return Some(2 + whom(2)),
        "why" if text(2) == "not" => return Some(3 + whom(3)),
        "why" if matches!(text(2), "you" | "we") && text(3) == "not" => return Some(4),
        "do" | "must" | "should" | "can" | "will" | "does" | "would" | "could" if text(1) == "not" => 1,
        "not" => 0,
        _ => return None,
    };
    if matches!(text(not + 1), "you" | "we") && not == 1 && text(0) != "do" {
        return Some(3);
    }
    let omits = matches!(text(not + 1), "forget" | "hesitate" | "fail" | "neglect" | "omit");
    (omits && text(not + 2) == "to").then_some(not + 3)
}

/// Whether a verb that can be nothing else stands here with its object: "take the fork".
fn is_plain_request(tokens: &[Token], at: usize) -> bool {
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

/// "leave the lamp off", "leave it alone".
fn is_let_alone(tokens: &[Token], at: usize) -> bool {
    let words = &lexicon().words;
    let mut rest = tokens[at + 1..].iter();
    rest.find(|token| {
        token.is_mark()
            || words.prepositions.contains(&token.text)
            || words.breaks.contains(&token.text)
            || token.text == "alone"
    })
    .is_some_and(|token| {
        let then = rest.next();
        token.text == "alone"
            || token.text == "off" && then.is_none_or(|then| then.is_mark() || words.breaks.contains(&then.text))
    })
}

/// Whether a verb may stand at a place.
fn starts_verb(tokens: &[Token], at: usize) -> bool {
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
    say_what_them_means(&mut all);
    tell_switching(&mut all);
    all
}

/// Where several things were named together, a later "them" stands for each: "wash the mug and the plate and put them away".
fn say_what_them_means(all: &mut [Clause]) {
    let mut named: Vec<Token> = Vec::new();
    for clause in all {
        let them = |token: &Token| matches!(token.text.as_str(), "them" | "both");
        let at = clause.tokens.iter().position(them).filter(|&at| {
            at > 0 && clause.tokens[..at].last().is_some_and(|token| token.lemma().is_some()) && !named.is_empty()
        });
        if let Some(at) = at {
            clause.tokens.splice(at..=at, named.iter().cloned());
            clause.is_of_each = true;
            continue;
        }
        match clause.apart() {
            Some(parts) => {
                named.clear();
                for part in &parts {
                    let name = part.tokens.iter().find(|token| token.is_name());
                    let and = Token::understood("and", clause.tokens[0].at);
                    named.extend((!named.is_empty()).then_some(and));
                    named.extend(name.cloned());
                }
            }
            None if clause.tokens.iter().any(Token::is_name) && clause.lemma != "go" => named.clear(),
            None => {}
        }
    }
}

/// Tells switching off from switching on, and machines and water from lamps: the subtasks know only lamps that go on. "it" is what
/// was last named that has a switch.
fn tell_switching(all: &mut [Clause]) {
    let words = &lexicon().words;
    let mut named: Option<bool> = None;
    for clause in all {
        let tokens = &clause.tokens;
        let lamp = |token: &Token| token.classes.iter().any(|class| is_lamp(*class));
        let machine =
            |token: &Token| token.classes.iter().any(|class| class.info().effect.is_some() || class.info().basin);
        let own = tokens.iter().rev().find(|token| lamp(token) || machine(token)).map(lamp);
        named = own.or(named);
        let is = |token: &Token, texts: &[&str]| texts.contains(&token.text.as_str());
        let ends = |token: Option<&Token>| token.is_none_or(|then| then.is_mark() || words.breaks.contains(&then.text));
        // "the lamp off", not "the book off the lamp"
        let lamp_off = tokens.iter().rposition(lamp).is_some_and(|at| {
            let then = at + 1 + usize::from(tokens.get(at + 1).is_some_and(|token| is(token, &["is"])));
            tokens.get(then).is_some_and(|token| is(token, &["off", "out"])) && ends(tokens.get(then + 1))
        });
        let verb = tokens.iter().position(|token| token.lemma().is_some());
        let says_off = tokens.iter().any(|token| is(token, &["off"]))
            || own == Some(true)
                && verb.is_some_and(|at| tokens.get(at + 1).is_some_and(|token| is(token, &["out", "down"])));
        let nothing_else = tokens.iter().all(|token| {
            token.is_mark()
                || token.lemma().is_some()
                || is(token, &["off", "water", "it", "them"])
                || words.determiners.contains(&token.text)
                || words.plain.contains(&token.text)
                || words.breaks.contains(&token.text)
        });
        let water = tokens.iter().any(|token| is(token, &["water"]));
        let of_machine = own == Some(false) || own.is_none() && nothing_else && (water || named == Some(false));
        match clause.lemma {
            "turn" if says_off && of_machine => clause.lemma = "close",
            "turn" if says_off => clause.lemma = "off",
            _ if lamp_off || own == Some(true) && says_off && matches!(clause.lemma, "" | "close") => {
                clause.lemma = "off";
            }
            // "run the mug under the tap"
            "go" if own == Some(false) || water => {
                let rinses = tokens.iter().any(|token| {
                    is(token, &["water"])
                        || token.classes.iter().any(|class| class.info().effect == Some(FixtureEffect::Rinse))
                });
                let runs = verb.filter(|&at| is(&tokens[at], &["run"]));
                let thing =
                    runs.and_then(|at| tokens[at + 1..].iter().find(|token| !words.determiners.contains(&token.text)));
                let moved = thing.is_some_and(|token| {
                    is(token, &["it", "them"]) || token.classes.iter().any(|class| class.info().pickupable)
                });
                if rinses && moved {
                    clause.lemma = "wash";
                }
            }
            _ => {}
        }
    }
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
            verb = false;
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
        let tokens = without_the_forbidden(tokens(text, Reader::shipped().unwrap().spelling()).tokens);
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
    fn what_must_not_be_done_is_left_out() {
        assert_eq!(read("don't take the knife, take the fork"), ["take: [fork]"]);
        assert_eq!(read("take the fork, not the knife"), ["take: [fork]"]);
        assert_eq!(read("Do not touch the knife. Pick up the spoon instead of the fork"), ["take: [spoon]"]);
    }
}
