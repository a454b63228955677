//! A person's sitting: which span is asked about, and what was answered. Every answer is on the disk before the next is asked.

use std::collections::HashMap;
use std::path::Path;

use super::spans::AnnotationSpan;
use crate::data::annotations::{self, SpanAnnotation, SpanKey};
use crate::data::line_log::LineLog;

/// What a person made of a span.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Answer {
    Sentence(String),
    Skipped,
}

/// A person's answers to some spans.
pub(crate) struct AnnotationSession {
    person: String,
    spans: Vec<AnnotationSpan>,
    log: LineLog,
    answers: HashMap<SpanKey, Answer>,
    at: usize,
}

impl AnnotationSession {
    /// Takes up what the person wrote before; the first span without an answer is asked about.
    ///
    /// # Errors
    /// When the person's file is malformed, in use, or cannot be written to.
    pub(crate) fn open(dataset: &Path, person: &str, spans: Vec<AnnotationSpan>) -> anyhow::Result<AnnotationSession> {
        let (log, lines) = annotations::open(dataset, person)?;
        let answers = answers(lines);
        let at = spans.iter().position(|span| !answers.contains_key(&span.key)).unwrap_or(spans.len());
        Ok(AnnotationSession { person: person.into(), spans, log, answers, at })
    }

    /// Who writes.
    pub(crate) fn person(&self) -> &str {
        &self.person
    }

    /// The span that is asked about; nothing after the last.
    pub(crate) fn span(&self) -> Option<&AnnotationSpan> {
        self.spans.get(self.at)
    }

    /// The position of the span that is asked about, and how many there are.
    pub(crate) fn place(&self) -> (usize, usize) {
        (self.at, self.spans.len())
    }

    /// What was answered to the span that is asked about.
    pub(crate) fn answer(&self) -> Option<&Answer> {
        self.answers.get(&self.span()?.key)
    }

    /// How many of the spans have a sentence, and how many were skipped.
    pub(crate) fn counts(&self) -> (usize, usize) {
        let answered = self.spans.iter().filter_map(|span| self.answers.get(&span.key));
        let (told, skipped): (Vec<&Answer>, _) = answered.partition(|answer| matches!(answer, Answer::Sentence(_)));
        (told.len(), skipped.len())
    }

    /// Keeps a sentence of the span, and goes to the next.
    ///
    /// # Errors
    /// When it is none, or cannot be written; the span is asked about still.
    pub(crate) fn write(&mut self, text: &str) -> anyhow::Result<()> {
        self.keep(Answer::Sentence(annotations::check_sentence(text)?))
    }

    /// Says of the span that it is no meaningful task, and goes to the next.
    ///
    /// # Errors
    /// When that cannot be written.
    pub(crate) fn skip(&mut self) -> anyhow::Result<()> {
        self.keep(Answer::Skipped)
    }

    fn keep(&mut self, answer: Answer) -> anyhow::Result<()> {
        let Some(span) = self.spans.get(self.at) else { return Ok(()) };
        if self.answers.get(&span.key) != Some(&answer) {
            let text = match &answer {
                Answer::Sentence(text) => Some(text.clone()),
                Answer::Skipped => None,
            };
            self.log.append(&[SpanAnnotation { span: span.key.clone(), text }])?;
            self.answers.insert(span.key.clone(), answer);
        }
        self.at += 1;
        Ok(())
    }

    /// To the span before.
    pub(crate) fn back(&mut self) {
        self.at = self.at.saturating_sub(1);
    }

    /// To the span after, without an answer to this one.
    pub(crate) fn forward(&mut self) {
        self.at = (self.at + 1).min(self.spans.len());
    }

    /// The first span without an answer, or the end.
    pub(crate) fn go_to_first_open(&mut self) {
        let open = self.spans.iter().position(|span| !self.answers.contains_key(&span.key));
        self.at = open.unwrap_or(self.spans.len());
    }
}

/// What counts of a person's lines: the last of each span.
pub(crate) fn answers(lines: Vec<SpanAnnotation>) -> HashMap<SpanKey, Answer> {
    lines.into_iter().map(|line| (line.span, line.text.map_or(Answer::Skipped, Answer::Sentence))).collect()
}

#[cfg(test)]
mod tests {
    use super::super::testing;
    use super::*;
    use crate::language::instruction;

    #[test]
    fn a_person_writes_skips_goes_back_and_goes_on_later() {
        let folder = testing::dataset(&["a", "b"], &[]);
        let spans = testing::spans(folder.path());
        let open = || AnnotationSession::open(folder.path(), "ann", spans.clone());
        let mut session = open().unwrap();
        assert!(open().err().unwrap().to_string().contains("another process"));
        session.write(" Wash\tthe mug. ").unwrap();
        session.skip().unwrap();
        session.forward();
        session.back();
        session.back();
        assert_eq!((session.place(), session.answer()), ((1, 6), Some(&Answer::Skipped)));
        session.write("Clean a mug.").unwrap();
        session.back();
        session.back();
        assert_eq!(session.answer(), Some(&Answer::Sentence("Wash the mug.".into())));
        drop(session);
        let mut session = open().unwrap();
        assert_eq!((session.place(), session.counts()), ((2, 6), (2, 0)));
        session.skip().unwrap();
        assert_eq!(session.counts(), (2, 1));
        let (_, lines) = {
            drop(session);
            annotations::open(folder.path(), "ann").unwrap()
        };
        assert_eq!(lines.len(), 4, "nothing that was written is ever taken away");
    }

    #[test]
    fn what_is_no_sentence_is_refused_and_the_span_stays() {
        let folder = testing::dataset(&["a"], &[]);
        let mut session = AnnotationSession::open(folder.path(), "ann", testing::spans(folder.path())).unwrap();
        for text in ["", "  \u{200b} ", "...", &"a".repeat(instruction::LONGEST + 1)] {
            assert!(session.write(text).is_err(), "{text:?}");
        }
        assert_eq!(session.place(), (0, 3));
        (0..9).for_each(|_| session.forward());
        assert!(session.span().is_none() && session.skip().is_ok());
        session.go_to_first_open();
        assert_eq!(session.place().0, 0);
    }
}
