//! Annotation without a screen: the steps are said in lines, and a line is the sentence. For scripts and screen readers.

use std::io::{BufRead, Write};

use super::session::{AnnotationSession, Answer};

/// What can be typed beside a sentence.
const COMMANDS: &str = ":skip, :back, :next, :quit";

/// Asks about one span after the other until the person leaves or nothing is left.
///
/// # Errors
/// When input or output fail.
pub(crate) fn run(session: &mut AnnotationSession, input: impl BufRead, mut out: impl Write) -> anyhow::Result<()> {
    writeln!(out, "Sum the steps up in one sentence, as you would ask somebody to do them. Or: {COMMANDS}")?;
    let mut lines = input.lines();
    while let Some(span) = session.span() {
        let (at, of) = session.place();
        writeln!(out, "{} of {of}:", at + 1)?;
        for (number, sentence) in (1..).zip(span.sentences()) {
            writeln!(out, "  {number} {sentence}")?;
        }
        match session.answer() {
            Some(Answer::Sentence(text)) => writeln!(out, "  you wrote: {text}")?,
            Some(Answer::Skipped) => writeln!(out, "  you skipped it")?,
            None => {}
        }
        out.flush()?;
        let Some(line) = lines.next().transpose()? else { break };
        match line.trim() {
            ":skip" => session.skip()?,
            ":back" => session.back(),
            ":next" => session.forward(),
            ":quit" => break,
            command if command.starts_with(':') => {
                writeln!(out, "there is no {command}; type a sentence, or {COMMANDS}")?
            }
            text => {
                if let Err(problem) = session.write(text) {
                    writeln!(out, "{problem:#}")?;
                }
            }
        }
    }
    let (written, skipped) = session.counts();
    writeln!(out, "{written} written, {skipped} skipped of {}", session.place().1)?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::testing;
    use super::*;

    #[test]
    fn lines_are_sentences_or_commands() {
        let folder = testing::dataset(&["a"], &[]);
        let mut session = AnnotationSession::open(folder.path(), "ann", testing::spans(folder.path())).unwrap();
        let mut out = Vec::new();
        let typed = "Wash the mug.\n:skip\n:back\n\n:sing\nClean a cup.\n:quit\nnever read\n";
        run(&mut session, typed.as_bytes(), &mut out).unwrap();
        let said = String::from_utf8(out).unwrap();
        for part in ["1 of 3:", "you skipped it", "type one sentence", "there is no :sing", "2 written, 0 skipped of 3"]
        {
            assert!(said.contains(part), "no {part:?} in\n{said}");
        }
    }
}
