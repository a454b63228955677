//! The explorer without a screen: a verb a line in, plain lines out. For screen readers, scripts, and pipes.

use std::cell::RefCell;
use std::io::{BufRead, Write};
use std::sync::atomic::AtomicBool;

use super::breakpoints::Condition;
use super::chained::Chained;
use super::engine::{Engine, Event, Snapshot};
use super::inspect::state;
use super::policies::PolicyKind;
use super::timeline::{Divergence, words};
use super::verb::{SAID, Verb, parse};
use super::worker::Report;
use crate::agent::Mind;
use crate::domain::{Action, ActionType, Instance};
use crate::run::chain::{Play, Rate};
use crate::run::contrast::Contrast;
use crate::run::landscape::survey;
use crate::run::rollout::End;

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
    for line in input.lines() {
        let line = line?;
        let line = line.trim();
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        match parse(line) {
            Ok(Verb::Quit) => break,
            Ok(verb) => {
                if let Err(error) = obey(&mut engine, verb, &mut out) {
                    writeln!(out, "error: {error:#}")?;
                }
            }
            Err(complaint) => writeln!(out, "error: {complaint}")?,
        }
        out.flush()?;
    }
    Ok(())
}

fn obey(engine: &mut Engine, verb: Verb, out: &mut impl Write) -> anyhow::Result<()> {
    match verb {
        Verb::Step(count) => steps(engine, count, None, out)?,
        Verb::ToggleRun | Verb::Continue => steps(engine, FARTHEST, None, out)?,
        Verb::Until(condition) => steps(engine, FARTHEST, Some(condition), out)?,
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
        Verb::WhichLink(times) => chain(engine, "", Some(times), out)?,
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

/// Where the explorer is in what was tried.
fn here(engine: &Engine, out: &mut impl Write) -> anyhow::Result<()> {
    let tree = engine.tree();
    let name = tree.branches().get(tree.branch()).map_or("", |branch| branch.name.as_str());
    let last = tree.last_taken().map_or_else(|| "the start".to_string(), words);
    writeln!(out, "at step {} of {} on {name}: {last}", tree.at(), tree.last())?;
    Ok(())
}

fn branches(engine: &Engine, out: &mut impl Write) -> anyhow::Result<()> {
    let tree = engine.tree();
    for (at, branch) in tree.branches().iter().enumerate() {
        let mark = if at == tree.branch() { '*' } else { ' ' };
        let left = branch.left.and_then(|(from, step)| Some((&tree.branches().get(from)?.name, step)));
        let left = left.map_or(String::new(), |(from, step)| format!(", from {from} at step {step}"));
        writeln!(out, "{mark} {}: {}, {} steps{left}: {}", at + 1, branch.name, tree.length(at), branch.why)?;
    }
    Ok(())
}

fn divergence(divergence: &Divergence, out: &mut impl Write) -> anyhow::Result<()> {
    let [one, other] = &divergence.names;
    writeln!(out, "{one} and {other} share {} steps", divergence.shared)?;
    for row in &divergence.rows {
        let [left, right] = row.sides.each_ref().map(|side| side.as_deref().unwrap_or("over"));
        writeln!(out, "step {}: {left} | {right}{}", row.step, if row.same { " | same world" } else { "" })?;
    }
    Ok(())
}

fn compare(contrast: &Contrast, out: &mut impl Write) -> anyhow::Result<()> {
    for (name, side) in ["A", "B"].into_iter().zip(&contrast.sides) {
        let value = side.values.as_ref().map_or(String::new(), |values| format!(", V {:.2}", values.state));
        writeln!(out, "{name}: {} would {}{value}", side.instruction, side.decision.action.kind)?;
    }
    writeln!(out, "A against B {:.2} bits; A against others {:.2} bits", contrast.divergence, contrast.sensitivity)?;
    for row in contrast.rows.iter().take(5) {
        let object = row.class.map_or(String::new(), |class| format!(" {}", class.spoken()));
        writeln!(out, "{}{object}: A {:.2}, B {:.2}", row.kind, row.shares[0], row.shares[1])?;
    }
    Ok(())
}

fn chain(engine: &Engine, text: &str, times: Option<u32>, out: &mut impl Write) -> anyhow::Result<()> {
    let chain = engine.chain(text)?;
    let known = RefCell::new(Chained::default());
    let tell = |report: Report| {
        if let Report::Chained(chained) = report {
            known.replace(*chained);
        }
        true
    };
    Chained::work(&chain, engine.another_policy()?.as_mut(), times, &AtomicBool::new(false), &tell)?;
    let known = known.into_inner();
    let word = |play: &Option<Play>, at: usize| match play.as_ref().and_then(|play| play.outcomes.get(at)) {
        Some(outcome) if !outcome.reached => "not reached".to_string(),
        Some(outcome) => match outcome.done {
            Some(true) => format!("done in {}", outcome.steps),
            Some(false) => format!("failed after {}", outcome.steps),
            None => format!("{} steps", outcome.steps),
        },
        None => "-".into(),
    };
    for (at, link) in known.links.iter().enumerate() {
        write!(
            out,
            "link {}: {link} by link: {}; as one: {}",
            at + 1,
            word(&known.by_link, at),
            word(&known.as_one, at)
        )?;
        if let Some(trials) = &known.trials {
            let rate =
                |rates: &[Rate]| rates.get(at).map_or(String::new(), |rate| format!("{} of {}", rate.done, rate.of));
            write!(out, "; from the expert's entry {}, from its own {}", rate(&trials.expert), rate(&trials.own))?;
        }
        writeln!(out)?;
    }
    match known.trials.as_ref().map(|trials| trials.weakest()) {
        Some(Some(at)) => writeln!(out, "link {} breaks the chain", at + 1)?,
        Some(None) => writeln!(out, "no link breaks")?,
        None => {}
    }
    Ok(())
}

fn values(engine: &Engine, out: &mut impl Write) -> anyhow::Result<()> {
    let house = &engine.rollout().house;
    let mut policy = engine.another_policy()?;
    let (stop, told) = (AtomicBool::new(false), engine.instruction());
    let mut found = survey(policy.as_mut(), house.scene(), house.world(), told, &stop, &mut |_| true)?;
    found.heights.sort_by(|a, b| b.value.total_cmp(&a.value));
    writeln!(out, "{} of {} cells ({})", found.heights.len(), found.of, found.measure.words())?;
    for height in found.heights.iter().take(10) {
        writeln!(out, "cell {},{} facing {:?}: {:.2}", height.cell.x, height.cell.z, height.heading, height.value)?;
    }
    Ok(())
}

fn steps(engine: &mut Engine, count: u32, until: Option<Condition>, out: &mut impl Write) -> anyhow::Result<()> {
    anyhow::ensure!(engine.end().is_none(), "the episode is over; `back`, `reset` or `next`");
    for _ in 0..count {
        let mind = engine.think()?.0.mind.clone();
        let before = engine.facts();
        let event = engine.step()?;
        step_line(engine, &event, mind.as_ref(), out)?;
        if engine.end().is_some() {
            break;
        }
        if let Some(condition) = until {
            // Some conditions ask what the policy makes of the new state.
            engine.think()?;
            if let Some(why) = condition.hit(&before, &engine.facts()) {
                writeln!(out, "stopped: {why}")?;
                break;
            }
        }
        out.flush()?;
    }
    Ok(())
}

/// One line for a step: number, action, outcome, what the policy weighed, how far the task is.
fn step_line(engine: &mut Engine, event: &Event, mind: Option<&Mind>, out: &mut impl Write) -> anyhow::Result<()> {
    write!(out, "step {}: {}: {}", event.step, event.action, event.outcome)?;
    if let Some(mind) = mind {
        write!(out, " | {}", top(mind))?;
    }
    if let Some(forked) = &event.forked {
        write!(out, " | branch {forked}")?;
    }
    if let Some(done) = &event.completed {
        write!(out, " | done: {done}")?;
    }
    let progress = engine.progress();
    if let Some(progress) = &progress {
        let (done, of) = (progress.completed_at.len(), progress.subtasks.len());
        write!(out, " | {done} of {of}")?;
        if engine.end().is_none() {
            write!(out, ", {}", progress.waits_for)?;
        }
    }
    match engine.end() {
        Some(End::Success) => writeln!(out, " | success")?,
        Some(End::Timeout) => writeln!(out, " | out of time")?,
        None => writeln!(out)?,
    }
    Ok(())
}

/// The likeliest actions and, for interactions, the likeliest class.
fn top(mind: &Mind) -> String {
    let mut actions: Vec<(f32, ActionType)> =
        ActionType::ALL.into_iter().filter_map(|kind| Some((mind.actions[kind.index()]?, kind))).collect();
    actions.sort_by(|a, b| b.0.total_cmp(&a.0));
    let words: Vec<String> = actions.iter().take(3).map(|(p, kind)| format!("{kind} {p:.2}")).collect();
    let object = mind.objects.first().map_or(String::new(), |(class, p, _)| format!("; {} {p:.2}", class.name()));
    format!("{}{object}", words.join(", "))
}

fn opening(now: &Snapshot, out: &mut impl Write) -> anyhow::Result<()> {
    writeln!(out, "scene: {} ({}), seed {}", now.scene.name, now.scene.room.spoken(), now.seed)?;
    writeln!(out, "instruction: {}", now.instruction)?;
    match &now.progress {
        Some(progress) => {
            let limit = now.horizon.map_or(String::new(), |horizon| format!(" (at most {horizon} steps)"));
            writeln!(out, "task: {}{limit}", progress.subtasks.join("; "))?;
        }
        None => writeln!(out, "task: none; the instruction is not graded")?,
    }
    Ok(())
}

/// What is seen, the largest first, with where it is.
fn look(now: &Snapshot, out: &mut impl Write) -> anyhow::Result<()> {
    let pose = now.world.agent;
    writeln!(
        out,
        "at cell {},{} facing {:?}, looking {} degrees down",
        pose.cell.x, pose.cell.z, pose.heading, pose.horizon
    )?;
    let held = now.world.held.and_then(|held| now.world.object(held));
    writeln!(out, "hand: {}", held.map_or("empty", |object| object.class.spoken()))?;
    let mut sightings = now.view.sightings.clone();
    sightings.sort_by_key(|sighting| std::cmp::Reverse(sighting.pixels));
    for sighting in sightings {
        let Some(class) = now.world.class_of(&now.scene, sighting.instance) else { continue };
        let [left, _, right, _] = sighting.bounds.map(usize::from);
        let side = match 3 * (left + right) / (2 * now.frame.width.max(1)) {
            0 => "left",
            1 => "ahead",
            _ => "right",
        };
        let distance = crate::house::view::distance(&now.scene, &now.world, sighting.instance).unwrap_or(0.0) / 1000.0;
        writeln!(out, "{}{}, {side}, {distance:.1} m", class.spoken(), state_words(now, sighting.instance))?;
    }
    Ok(())
}

fn state_words(now: &Snapshot, instance: Instance) -> String {
    let words = state(now, instance);
    if words.is_empty() { words } else { format!(" ({words})") }
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
        assert!(say("until dusk\n").contains("there are: subtask"));
    }
}
