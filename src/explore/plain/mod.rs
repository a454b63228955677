//! The explorer without a screen: a verb a line in, plain lines out. For screen readers, scripts, and pipes.

mod obey;
mod say;
mod work;

use std::io::{BufRead, Write};

use super::breakpoints::Condition;
use super::chained::Chained;
use super::choices::Sort;
use super::session::Session;
use super::verb::{Verb, parse};
use crate::agent::registry::PolicyKind;
use crate::analysis::chain::Chain;
use crate::domain::Heading;
use say::opening;

/// What a session without a screen remembers beside the episode.
struct Plain {
    engine: Session,
    /// Where runs stop.
    breaks: Vec<Condition>,
    /// The other instruction of the last comparison.
    other: Option<String>,
    /// The chain that was followed last.
    chain: Option<Chain>,
    /// What each policy made of it, the first one's first.
    followed: Vec<Chained>,
    /// The heading whose values are told; the best without one.
    heading: Option<Heading>,
    /// How choices are sorted.
    sort: Sort,
}

/// Obeys lines until `quit` or the end of the input.
///
/// # Errors
/// When reading or writing fails.
pub fn run(engine: Session, kind: PolicyKind, input: impl BufRead, mut out: impl Write) -> anyhow::Result<()> {
    let mut plain = Plain {
        engine,
        breaks: Vec::new(),
        other: None,
        chain: None,
        followed: Vec::new(),
        heading: None,
        sort: Sort::Probability,
    };
    opening(&plain.engine.snapshot(), &mut out)?;
    if !plain.engine.has_policy()
        && let Err(error) = plain.engine.choose(kind)
    {
        writeln!(out, "error: {error:#}")?;
    }
    out.flush()?;
    for line in input.lines() {
        let line = line?;
        let line = line.trim();
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        match parse(line) {
            Ok(Verb::Quit) => break,
            Ok(verb) => {
                if let Err(error) = plain.obey(verb, &mut out) {
                    writeln!(out, "error: {error:#}")?;
                }
            }
            Err(complaint) => writeln!(out, "error: {complaint}")?,
        }
        out.flush()?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::explore::testing;

    fn say(lines: &str) -> String {
        let mut out = Vec::new();
        run(testing::engine(), PolicyKind::Random, lines.as_bytes(), &mut out).unwrap();
        String::from_utf8(out).unwrap()
    }

    #[test]
    fn time_travel_and_branches_speak_the_same_verbs() {
        let text = say(
            "step 3\nback 2\ndo RotateLeft\ndo LookUp\nname left\nbranches\ndiverge main\nbranch 1\nlast\nseek 1\nback\n",
        );
        for wanted in [
            "at step 1 of 3 on main",
            "branch b1: ",
            "* 2: left, 3 steps, from main at step 1",
            "left and main share 1 steps",
            "at step 3 of 3 on main",
            "at step 0 of 3 on main: the start",
        ] {
            assert!(text.contains(wanted), "no {wanted:?} in:\n{text}");
        }
    }

    #[test]
    fn a_run_stops_where_it_is_told_to() {
        let text = say("until step 4\n");
        assert!(text.contains("step 4: ") && text.ends_with("stopped: step 4\n"), "{text}");
        let text = say("break step 9\nbreak step 3\nrun\nbreak\n");
        assert!(text.contains("runs stop at: step 9; step 3") && text.contains("stopped: step 3"), "{text}");
        assert!(text.ends_with("runs stop at: nothing\n"), "{text}");
        assert!(say("until dusk\n").contains("there are: subtask"));
    }

    #[test]
    fn the_other_instruction_is_adopted_and_the_pages_are_told() {
        let text = say("swap\ncompare open the fridge\nswap\ncompare dance\npage compare\n");
        assert!(text.contains("error: there is nothing to swap"), "{text}");
        assert!(text.contains("instruction: Open the fridge. (was: "), "{text}");
        assert!(text.contains("B: Put the mug in the sink."), "what was in force is the other one now:\n{text}");
        let text = say("page mind\nsort\npage mind\npage world\npage chain\npage branches\npage panels\n");
        for wanted in ["sorted by probability", "sorted by Q", "fridge", "there is no chain yet", "* 1: main", "hand:"]
        {
            assert!(text.contains(wanted), "no {wanted:?} in:\n{text}");
        }
    }

    #[test]
    fn a_chain_is_followed_by_two_and_its_links_are_replayed() {
        let text = say("links 1\nchain\nagainst expert\nlink 1 2\npage chain\nagainst random\n");
        assert!(text.starts_with("scene: ") && text.contains("error: there is no chain yet"), "{text}");
        for wanted in
            ["random by link: ", "expert by link: done in", "from the expert's entry", " of 2", "acts already"]
        {
            assert!(text.contains(wanted), "no {wanted:?} in:\n{text}");
        }
    }
}
