//! The explorer without a screen: a verb a line in, plain lines out. For screen readers, scripts, and pipes.

use std::io::{BufRead, Write};

use super::engine::{Engine, Event, Snapshot};
use super::policies::PolicyKind;
use crate::agent::Mind;
use crate::domain::{Action, ActionType, Instance};
use crate::run::rollout::End;

/// Runs that are not told how far end here.
const FARTHEST: u32 = 1000;

/// What a line asks for.
#[derive(Clone, Debug, PartialEq)]
enum Verb {
    Step(u32),
    Run,
    Do(Act),
    Instruct(String),
    Look,
    Candidates,
    Think,
    Policy(PolicyKind),
    Reset,
    Next,
    Seed(u64),
    Help,
    Quit,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Act {
    /// The candidate of that number, from 1.
    Candidate(usize),
    Navigate(ActionType),
}

const HELP: &str = "\
step [N]         take N steps as the policy chooses (1)
run              steps until the episode is over
do N             do interaction N of the candidates
do ACTION        MoveAhead, RotateLeft, RotateRight, LookUp, LookDown
instruct TEXT    tell the agent something else
look             what the agent sees
candidates       the interactions that are possible now
think            what the policy would do next
policy NAME      agent, expert, random
reset            back to the start
next             the next house or task
seed N           the house of another seed
quit             end";

/// Reads a line.
fn parse(line: &str) -> Result<Verb, String> {
    let (verb, rest) = line.split_once(char::is_whitespace).map_or((line, ""), |(verb, rest)| (verb, rest.trim()));
    let number = |text: &str| text.parse::<u64>().map_err(|_| format!("{verb}: {text:?} is not a number"));
    match verb {
        "step" | "s" if rest.is_empty() => Ok(Verb::Step(1)),
        "step" | "s" => Ok(Verb::Step(number(rest)?.min(u64::from(u32::MAX)) as u32)),
        "run" => Ok(Verb::Run),
        "do" => {
            let navigation = ActionType::ALL.into_iter().find(|kind| kind.name().eq_ignore_ascii_case(rest));
            match navigation {
                Some(kind) if kind.is_interaction() => Err(format!("do: {kind} needs a number from `candidates`")),
                Some(kind) => Ok(Verb::Do(Act::Navigate(kind))),
                None => Ok(Verb::Do(Act::Candidate(number(rest)? as usize))),
            }
        }
        "instruct" | "i" => Ok(Verb::Instruct(rest.to_string())),
        "look" => Ok(Verb::Look),
        "candidates" => Ok(Verb::Candidates),
        "think" => Ok(Verb::Think),
        "policy" => PolicyKind::ALL
            .into_iter()
            .find(|kind| kind.name() == rest)
            .map(Verb::Policy)
            .ok_or_else(|| format!("policy: {rest:?} is none of agent, expert, random")),
        "reset" => Ok(Verb::Reset),
        "next" => Ok(Verb::Next),
        "seed" => Ok(Verb::Seed(number(rest)?)),
        "help" | "?" => Ok(Verb::Help),
        "quit" | "q" | "exit" => Ok(Verb::Quit),
        _ => Err(format!("unknown verb {verb:?}; `help` lists the verbs")),
    }
}

/// Obeys lines until `quit` or the end of the input.
///
/// # Errors
/// When reading or writing fails.
pub fn run(mut engine: Engine, kind: PolicyKind, input: impl BufRead, mut out: impl Write) -> anyhow::Result<()> {
    opening(&engine.snapshot(), &mut out)?;
    if let Err(error) = engine.choose(kind) {
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
        Verb::Step(count) => steps(engine, count, out)?,
        Verb::Run => steps(engine, FARTHEST, out)?,
        Verb::Do(act) => {
            anyhow::ensure!(engine.end().is_none(), "the episode is over; `reset` or `next`");
            let action = match act {
                Act::Navigate(kind) => Action::navigate(kind),
                Act::Candidate(number) => {
                    let candidates = engine.snapshot().candidates;
                    let candidate = number.checked_sub(1).and_then(|at| candidates.get(at));
                    candidate.ok_or_else(|| anyhow::anyhow!("there is no candidate {number}"))?.action()
                }
            };
            let event = engine.act(action);
            step_line(engine, &event, None, out)?;
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
            let decision = engine.think()?.clone();
            let top = decision.mind.as_ref().map_or(String::new(), |mind| format!(" ({})", top(mind)));
            writeln!(out, "next: {}{top}", engine.words(decision.action))?;
        }
        Verb::Policy(kind) => {
            engine.choose(kind)?;
            writeln!(out, "policy: {}", kind.name())?;
        }
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
        Verb::Help => writeln!(out, "{HELP}")?,
        Verb::Quit => {}
    }
    Ok(())
}

fn steps(engine: &mut Engine, count: u32, out: &mut impl Write) -> anyhow::Result<()> {
    anyhow::ensure!(engine.end().is_none(), "the episode is over; `reset` or `next`");
    for _ in 0..count {
        let mind = engine.think()?.mind.clone();
        let event = engine.step()?;
        step_line(engine, &event, mind.as_ref(), out)?;
        if engine.end().is_some() {
            break;
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
        writeln!(out, "{}{}, {side}, {distance:.1} m", class.spoken(), state(now, sighting.instance))?;
    }
    Ok(())
}

/// The state of a thing that differs from the usual, in words.
fn state(now: &Snapshot, instance: Instance) -> String {
    let mut words = Vec::new();
    if now.world.is_open(instance) {
        words.push("open");
    }
    if now.world.is_on(instance) {
        words.push("on");
    }
    if let Instance::Object(index) = instance
        && let Some(object) = now.world.object(index)
    {
        for (is, word) in [
            (object.slice_of.is_some(), "a slice"),
            (object.clean, "clean"),
            (object.hot, "hot"),
            (object.cold, "cold"),
        ] {
            if is {
                words.push(word);
            }
        }
    }
    if words.is_empty() { String::new() } else { format!(" ({})", words.join(", ")) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_read_as_verbs_and_mistakes_are_named() {
        assert_eq!(parse("step"), Ok(Verb::Step(1)));
        assert_eq!(parse("step 12"), Ok(Verb::Step(12)));
        assert_eq!(parse("do moveahead"), Ok(Verb::Do(Act::Navigate(ActionType::MoveAhead))));
        assert_eq!(parse("do 3"), Ok(Verb::Do(Act::Candidate(3))));
        assert_eq!(parse("instruct  put the mug away"), Ok(Verb::Instruct("put the mug away".into())));
        assert!(parse("do pickup").unwrap_err().contains("candidates"));
        assert!(parse("step many").unwrap_err().contains("many"));
        assert!(parse("dance").unwrap_err().contains("dance"));
    }
}
