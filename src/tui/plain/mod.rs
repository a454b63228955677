//! The explorer without a screen: a verb a line in, plain lines out. For screen readers, scripts, and pipes.

mod say;
mod work;

use std::io::{BufRead, Write};

use crate::domain::Action;
use crate::tui::breakpoints::Condition;
use crate::tui::engine::Engine;
use crate::tui::policies::PolicyKind;
use crate::tui::verb::{SAID, Verb, parse};
use say::{branches, compare, divergence, here, look, opening, step_line, top};
use work::{chain, values};

/// Runs that are not told how far end here.
const FARTHEST: u32 = 1000;

/// Obeys lines until `quit` or the end of the input.
///
/// # Errors
/// When reading or writing fails.
pub fn run(mut engine: Engine, kind: PolicyKind, input: impl BufRead, mut out: impl Write) -> anyhow::Result<()> {
    opening(&engine.snapshot(), &mut out)?;
    if !engine.has_policy()
        && let Err(error) = engine.choose(kind)
    {
        writeln!(out, "error: {error:#}")?;
    }
    out.flush()?;
    let mut breaks = Vec::new();
    for line in input.lines() {
        let line = line?;
        let line = line.trim();
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        match parse(line) {
            Ok(Verb::Quit) => break,
            Ok(verb) => {
                if let Err(error) = obey(&mut engine, &mut breaks, verb, &mut out) {
                    writeln!(out, "error: {error:#}")?;
                }
            }
            Err(complaint) => writeln!(out, "error: {complaint}")?,
        }
        out.flush()?;
    }
    Ok(())
}

fn obey(engine: &mut Engine, breaks: &mut Vec<Condition>, verb: Verb, out: &mut impl Write) -> anyhow::Result<()> {
    match verb {
        Verb::Step(count) => steps(engine, count, &[], out)?,
        Verb::ToggleRun | Verb::Continue => steps(engine, FARTHEST, breaks, out)?,
        Verb::Until(condition) => steps(engine, FARTHEST, &[breaks.as_slice(), &[condition]].concat(), out)?,
        Verb::Break(condition) => {
            match condition {
                None => breaks.clear(),
                Some(condition) => breaks.push(condition),
            }
            let all: Vec<String> = breaks.iter().map(ToString::to_string).collect();
            writeln!(out, "runs stop at: {}", if all.is_empty() { "nothing".into() } else { all.join("; ") })?;
        }
        Verb::Navigate(kind) => act(engine, Action::navigate(kind), out)?,
        Verb::Interact(number) => {
            let candidates = engine.snapshot().candidates;
            let candidate = usize::from(number).checked_sub(1).and_then(|at| candidates.get(at));
            let action = candidate.ok_or_else(|| anyhow::anyhow!("there is no candidate {number}"))?.action();
            act(engine, action, out)?;
        }
        Verb::Instruct(text) => {
            let old = engine.instruction().to_string();
            let note = engine.instruct(&text)?;
            writeln!(out, "instruction: {} (was: {old}; {note})", engine.instruction())?;
        }
        Verb::Look => look(&engine.snapshot(), out)?,
        Verb::Candidates => {
            let candidates = engine.snapshot().candidates;
            if candidates.is_empty() {
                writeln!(out, "no interaction is possible here")?;
            }
            for (number, candidate) in (1..).zip(&candidates) {
                let metres = candidate.distance / 1000.0;
                writeln!(out, "{number}: {} {}, {metres:.1} m", candidate.kind, candidate.class.name())?;
            }
        }
        Verb::Think => {
            let (decision, values) = engine.think()?.clone();
            let top = decision.mind.as_ref().map_or(String::new(), |mind| format!(" ({})", top(mind)));
            let value = values.map_or(String::new(), |values| format!(", V {:.2}", values.state));
            writeln!(out, "next: {}{top}{value}", engine.words(decision.action))?;
        }
        Verb::Policy(kind) => {
            engine.choose(kind)?;
            writeln!(out, "policy: {}", kind.name())?;
        }
        Verb::Checkpoint(wanted) => {
            engine.checkpoint(&wanted)?;
            writeln!(out, "checkpoint: {}", engine.author().policy)?;
        }
        Verb::Sample(seed) => {
            engine.reseed(seed, true);
            writeln!(out, "actions are drawn with seed {seed} from here on")?;
        }
        Verb::Greedy => {
            engine.reseed(0, false);
            writeln!(out, "the likeliest actions from here on")?;
        }
        Verb::Back(count) => seek(engine, engine.tree().at().saturating_sub(count), out)?,
        Verb::Forward(count) => seek(engine, engine.tree().at().saturating_add(count), out)?,
        Verb::Seek(step) => seek(engine, step, out)?,
        Verb::Last => seek(engine, engine.tree().last(), out)?,
        Verb::NextEvent | Verb::LastEvent => {
            let step = engine.snapshot().time.event(verb == Verb::NextEvent);
            seek(engine, step, out)?;
        }
        Verb::Subtask(number) => {
            let step = engine.snapshot().time.subtask(number);
            seek(engine, step.ok_or_else(|| anyhow::anyhow!("subtask {number} is not done on this branch"))?, out)?;
        }
        Verb::Branch(wanted) => {
            engine.switch(engine.branch(&wanted)?)?;
            here(engine, out)?;
        }
        Verb::NextBranch => {
            let next = (engine.tree().branch() + 1) % engine.tree().branches().len();
            engine.switch(next)?;
            here(engine, out)?;
        }
        Verb::Branches => branches(engine, out)?,
        Verb::Name(name) => {
            engine.rename(engine.tree().branch(), &name)?;
            here(engine, out)?;
        }
        Verb::Diverge(wanted) => divergence(&engine.divergence(engine.branch(&wanted)?), out)?,
        Verb::Compare(other) => compare(&engine.contrast(&other)?, out)?,
        Verb::Chain(text) => chain(engine, &text, None, out)?,
        Verb::WhichLink(draws) => chain(engine, "", Some(draws), out)?,
        Verb::ValueMap => values(engine, out)?,
        Verb::Save(path) => writeln!(out, "{}", engine.keep(path)?)?,
        Verb::SaveTask(path) => writeln!(out, "{}", engine.keep_task(&path)?)?,
        Verb::Export(path) => writeln!(out, "{}", engine.export(&path)?)?,
        Verb::Reset => {
            engine.reset();
            opening(&engine.snapshot(), out)?;
        }
        Verb::Next => {
            engine.next_episode()?;
            opening(&engine.snapshot(), out)?;
        }
        Verb::Seed(seed) => {
            engine.seed(seed)?;
            opening(&engine.snapshot(), out)?;
        }
        Verb::Help => {
            for said in SAID {
                writeln!(out, "{:<26} {}", format!("{} {}", said.name, said.arguments), said.doc)?;
            }
        }
        Verb::Quit => {}
        _ => anyhow::bail!("that needs a screen"),
    }
    Ok(())
}

fn act(engine: &mut Engine, action: Action, out: &mut impl Write) -> anyhow::Result<()> {
    anyhow::ensure!(engine.end().is_none(), "the episode is over; `back`, `reset` or `next`");
    let event = engine.act(action);
    step_line(engine, &event, None, out)
}

fn seek(engine: &mut Engine, step: u32, out: &mut impl Write) -> anyhow::Result<()> {
    engine.seek(step);
    here(engine, out)
}

/// So many steps, or until one of these conditions holds.
fn steps(engine: &mut Engine, count: u32, until: &[Condition], out: &mut impl Write) -> anyhow::Result<()> {
    anyhow::ensure!(engine.end().is_none(), "the episode is over; `back`, `reset` or `next`");
    for _ in 0..count {
        let mind = engine.think()?.0.mind.clone();
        let before = engine.facts();
        let event = engine.step()?;
        step_line(engine, &event, mind.as_ref(), out)?;
        if engine.end().is_some() {
            break;
        }
        if !until.is_empty() {
            // Some conditions ask what the policy makes of the new state.
            engine.think()?;
            let now = engine.facts();
            if let Some(why) = until.iter().find_map(|condition| condition.hit(&before, &now)) {
                writeln!(out, "stopped: {why}")?;
                break;
            }
        }
        out.flush()?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tui::testing;

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
}
