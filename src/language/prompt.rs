//! The prompt in which a language model is asked for a summary (the paper's Figure 8), and what of its answer is the summary.

use sha2::{Digest, Sha256};

use super::instruction::normalise;
use super::passage::Summary;

/// The instructions and the four examples.
const EXAMPLES: &str = include_str!("../../assets/prompts/summary.txt");

/// What stands before the steps, and after them.
const STEPS: &str = "\nTask Steps:\n";
const SUMMARY: &str = "Summary:";

/// What every prompt begins with, up to the first step's number.
pub(crate) fn shared() -> String {
    format!("{EXAMPLES}{STEPS}1:")
}

/// Asks for a summary of some sentences.
pub(crate) fn summarise(sentences: &[String]) -> String {
    let steps = sentences.iter().enumerate().map(|(index, text)| format!("{}: {}\n", index + 1, normalise(text)));
    format!("{EXAMPLES}{STEPS}{}{SUMMARY}", steps.collect::<String>())
}

/// What stands before a second step when a model is asked how likely it follows on the first, and that step as it would go on.
pub(crate) fn follow(first: &str, second: &str) -> (String, String) {
    (format!("{EXAMPLES}{STEPS}1: {}\n2:", normalise(first)), format!(" {}", normalise(second)))
}

/// The summaries of the examples, which a model may say again.
pub(crate) fn example_summaries() -> impl Iterator<Item = &'static str> {
    EXAMPLES.lines().filter_map(|line| line.strip_prefix(SUMMARY))
}

/// Identifies the prompt, without the steps: the first 16 digits of a sha256.
pub(crate) fn digest() -> String {
    format!("{:x}", Sha256::digest(summarise(&[])))[..16].to_string()
}

/// Where the first sentence of an answer ends.
fn end(answer: &str) -> Option<usize> {
    answer.find(['.', '!', '?', '\n'])
}

/// Whether an answer holds its first sentence to the end, so that no more of it is needed.
pub(crate) fn is_whole(answer: &str) -> bool {
    end(answer.trim_start()).is_some()
}

/// The summary in an answer: its first sentence, as an instruction. Where the model did not end of itself (`ended`), a sentence
/// without an end is none; nor is one without a word, or the heading of a further example.
pub(crate) fn summary(answer: &str, ended: bool) -> Summary {
    let text = answer.trim_start();
    let sentence = match end(text) {
        Some(end) => text[..end].trim(),
        None if ended => text.trim(),
        None => "",
    };
    let is_heading = sentence.ends_with(':');
    match sentence.chars().any(char::is_alphabetic) && !is_heading {
        true => Summary::Sentence(normalise(sentence)),
        false => Summary::Malformed(answer.to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_numbered_as_instructions_after_the_papers_examples() {
        let prompt = summarise(&["pick up the Bowl".into(), "Turn on the lamp.".into()]);
        assert!(prompt.starts_with("Instructions: summarize the following ordered steps describing common household"));
        assert!(prompt.ends_with("sink.\n\nTask Steps:\n1: Pick up the bowl.\n2: Turn on the lamp.\nSummary:"));
        assert_eq!(prompt.matches("Summary:").count(), 5);
        assert!(prompt.starts_with(&shared()));
        let (before, step) = follow("pick up the bowl", "turn on the lamp");
        assert!(before.starts_with(&shared()) && before.ends_with("1: Pick up the bowl.\n2:"));
        assert_eq!(step, " Turn on the lamp.");
    }

    #[test]
    fn the_first_sentence_of_an_answer_is_the_summary() {
        let sentence = |answer: &str| summary(answer, false);
        let found = Summary::Sentence("Put the mug away.".into());
        for answer in [" Put the Mug  away. Then rest.", "\n Put the mug away\n\nTask Steps:", "put the mug away!"] {
            assert!(is_whole(answer));
            assert_eq!(sentence(answer), found);
        }
        assert!(!is_whole(" Put the mug") && !is_whole("\n"));
        assert_eq!(summary(" put the mug away", true), found);
    }

    #[test]
    fn an_answer_without_a_whole_sentence_is_none() {
        for (answer, ended) in [(" Put the mug", false), ("", true), (" ...", false), ("Task Steps:\n1: Put", true)] {
            assert_eq!(summary(answer, ended), Summary::Malformed(answer.into()), "{answer:?}");
        }
    }
}
