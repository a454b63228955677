//! A recording as plain lines.

use std::fmt::Write;

use crate::episode::frames::FrameSequence;

/// The transcript: what was told, and a line a step.
pub(crate) fn write(recording: &FrameSequence) -> String {
    let mut text = format!("{}\n{}\n", recording.told(), recording.title);
    for (number, subtask) in (1..).zip(&recording.subtasks) {
        let _ = writeln!(text, "subtask {number}: {subtask}");
    }
    for wish in &recording.wishes {
        let _ = writeln!(text, "wish {wish}");
    }
    text.push('\n');
    let mut told = recording.told();
    for shot in &recording.shots[1.min(recording.shots.len())..] {
        if shot.told != told {
            told.clone_from(&shot.told);
            let _ = writeln!(text, "      instruction: {told}");
        }
        let done = shot.done.as_ref().map_or(String::new(), |done| format!(" · done: {done}"));
        let _ = writeln!(text, "{:>4}  {}{done}", shot.step, shot.words());
    }
    text
}
