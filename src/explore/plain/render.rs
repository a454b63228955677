//! States, steps and tables in lines of text.

use std::io::Write;

use crate::agent::{ActionDistribution, Decision, Values};
use crate::analysis::instruction_ab::Contrast;
use crate::domain::{ActionType, Instance};
use crate::episode::wish::{Wish, WishVerdict};
use crate::explore::choices::{Sort, choices as table};
use crate::explore::exploration::{SessionSnapshot, StepTaken};
use crate::explore::inspect;
use crate::explore::inspect::state;
use crate::explore::timeline::{BranchPosition, Divergence, Timeline};
use crate::language::count::counted;

/// How what was told is understood, and what is open.
pub(super) fn reading(wish: &Wish, out: &mut impl Write) -> anyhow::Result<()> {
    if !wish.understood.is_empty() {
        let sure = wish.confidence.map_or(String::new(), |confidence| format!(" ({:.0} % sure)", 100.0 * confidence));
        let by = wish.read_by.as_ref().map_or(String::new(), |name| format!(" (by {name})"));
        writeln!(out, "understood{by}: {}{sure}", wish.understood)?;
    }
    if let Some(why) = &wish.unasked {
        writeln!(out, "read by the program itself: {why}")?;
    }
    if !wish.unread.is_empty() {
        writeln!(out, "not understood: {}", wish.unread.join(" "))?;
    }
    match &wish.ungraded {
        Some(why) => {
            let meant = if wish.is_unsure() { "`meant 1` if it does, or " } else { "" };
            writeln!(out, "not graded: {why}; {meant}say `done` or `failed` when it is")?;
        }
        None => {
            let expert = wish.expert_steps.map_or("sees no way".into(), |steps| counted(steps, "step"));
            let limit = wish.limit().map_or(String::new(), |limit| format!(", at most {limit}"));
            writeln!(out, "graded: {} (expert: {expert}{limit})", wish.subtasks_in_words().join("; "))?;
        }
    }
    for (number, words) in wish.alternatives() {
        writeln!(out, "or meant {number}: {words}")?;
    }
    Ok(())
}

/// What a wish came to, in a line or two.
pub(super) fn verdict(wish: &Wish, out: &mut impl Write) -> anyhow::Result<()> {
    writeln!(out, "wish: {} | {}, {}", wish.instruction, wish.verdict_in_words(), counted(wish.steps, "step"))?;
    if let Some(advice) = &wish.advice {
        writeln!(out, "why: {advice}")?;
    }
    Ok(())
}

/// Where the explorer is in what was tried.
pub(super) fn at(position: &BranchPosition, out: &mut impl Write) -> anyhow::Result<()> {
    let last = position.last_step.as_deref().unwrap_or("the start");
    writeln!(out, "at step {} of {} on {}: {last}", position.step, position.of, position.branch)?;
    Ok(())
}

pub(super) fn branches(time: &Timeline, out: &mut impl Write) -> anyhow::Result<()> {
    for (at, branch) in time.branches.iter().enumerate() {
        let mark = if at == time.branch { '*' } else { ' ' };
        let left = branch.left.and_then(|(from, step)| Some((&time.branches.get(from)?.name, step)));
        let left = left.map_or(String::new(), |(from, step)| format!(", from {from} at step {step}"));
        let steps = counted(branch.last, "step");
        writeln!(out, "{mark} {}: {}, {steps}{left}: {}", at + 1, branch.name, branch.why)?;
    }
    Ok(())
}

pub(super) fn divergence(divergence: &Divergence, out: &mut impl Write) -> anyhow::Result<()> {
    let [one, other] = &divergence.names;
    writeln!(out, "{one} and {other} share {}", counted(divergence.shared, "step"))?;
    for row in &divergence.rows {
        let [left, right] = row.sides.each_ref().map(|side| side.as_deref().unwrap_or("over"));
        writeln!(out, "step {}: {left} | {right}{}", row.step, if row.same { " | same world" } else { "" })?;
    }
    Ok(())
}

pub(super) fn compare(contrast: &Contrast, out: &mut impl Write) -> anyhow::Result<()> {
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

/// One line for a step: number, action, outcome, what the policy weighed, how far the task is.
pub(super) fn step_line(taken: &StepTaken, out: &mut impl Write) -> anyhow::Result<()> {
    write!(out, "step {}: {}: {}", taken.step, taken.action, taken.outcome)?;
    if let Some(distribution) = &taken.distribution {
        write!(out, " | {}", top(distribution))?;
    }
    if let Some(forked) = &taken.forked {
        write!(out, " | branch {forked}")?;
    }
    if let Some(done) = &taken.completed {
        write!(out, " | done: {done}")?;
    }
    if let Some(progress) = &taken.progress {
        let (done, of) = (progress.completed_at.len(), progress.subtasks.len());
        write!(out, " | {done} of {of}")?;
        if taken.end.is_none() {
            write!(out, ", {}", progress.waits_for)?;
        }
    }
    match taken.end {
        Some(WishVerdict::Done) => writeln!(out, " | success")?,
        Some(verdict) => writeln!(out, " | {}", verdict.words())?,
        None => writeln!(out)?,
    }
    Ok(())
}

/// What the policy would do next.
pub(super) fn next(
    decision: &Decision,
    words: &str,
    values: Option<&Values>,
    out: &mut impl Write,
) -> anyhow::Result<()> {
    let top = decision.distribution.as_ref().map_or(String::new(), |distribution| format!(" ({})", top(distribution)));
    let value = values.map_or(String::new(), |values| format!(", V {:.2}", values.state));
    let done = decision.end_in_words().map_or(String::new(), |done| format!(", {done}"));
    writeln!(out, "next: {words}{top}{value}{done}")?;
    Ok(())
}

/// The interactions that are possible now, by number.
pub(super) fn candidates(now: &SessionSnapshot, out: &mut impl Write) -> anyhow::Result<()> {
    if now.candidates.is_empty() {
        writeln!(out, "no interaction is possible here")?;
    }
    for (number, candidate) in (1..).zip(&now.candidates) {
        let metres = candidate.distance / 1000.0;
        writeln!(out, "{number}: {} {}, {metres:.1} m", candidate.kind, candidate.class.name())?;
    }
    Ok(())
}

/// The likeliest actions and, for interactions, the likeliest class.
fn top(distribution: &ActionDistribution) -> String {
    let mut actions: Vec<(f32, ActionType)> =
        ActionType::ALL.into_iter().filter_map(|kind| Some((distribution.actions[kind.index()]?, kind))).collect();
    actions.sort_by(|a, b| b.0.total_cmp(&a.0));
    let words: Vec<String> = actions.iter().take(3).map(|(p, kind)| format!("{kind} {p:.2}")).collect();
    let object =
        distribution.objects.first().map_or(String::new(), |(class, p, _)| format!("; {} {p:.2}", class.name()));
    format!("{}{object}", words.join(", "))
}

pub(super) fn opening(now: &SessionSnapshot, out: &mut impl Write) -> anyhow::Result<()> {
    writeln!(out, "scene: {} ({}), seed {}", now.scene.name, now.scene.room.spoken(), now.seed)?;
    writeln!(out, "instruction: {}", now.instruction)?;
    match &now.progress {
        Some(progress) => {
            let limit = now.horizon.map_or(String::new(), |horizon| format!(" (at most {})", counted(horizon, "step")));
            writeln!(out, "task: {}{limit}", progress.subtasks.join("; "))?;
        }
        None => writeln!(out, "task: none; the instruction is not graded")?,
    }
    Ok(())
}

/// Every legal choice: how likely, how good.
pub(super) fn choices(
    now: &SessionSnapshot,
    decision: &Decision,
    values: Option<&Values>,
    sort: Sort,
    out: &mut impl Write,
) -> anyhow::Result<()> {
    let entropy = decision
        .distribution
        .as_ref()
        .map_or(String::new(), |distribution| format!(", entropy {:.2}", distribution.entropy));
    let value = values.map_or("no critic".to_string(), |values| format!("V {:.2}", values.state));
    writeln!(out, "{}: {value}{entropy}; sorted by {}", now.acts, sort.name())?;
    for choice in table(now, decision, values, sort) {
        let mark = if choice.chosen { '>' } else { ' ' };
        let object = choice.class.map_or(String::new(), |class| format!(" {}", class.spoken()));
        let number = |name: &str, x: Option<f32>| x.map_or(String::new(), |x| format!(", {name} {x:.2}"));
        let (p, q) = (number("p", choice.probability), number("min Q", choice.q));
        writeln!(out, "{mark} {}{object}{p}{q}{}", choice.kind, number("advantage", choice.advantage))?;
    }
    Ok(())
}

/// Everything in the house: where it is, and what can be done to it or why not.
pub(super) fn things(now: &SessionSnapshot, out: &mut impl Write) -> anyhow::Result<()> {
    for thing in inspect::things(now) {
        let state = if thing.state.is_empty() { String::new() } else { format!(" ({})", thing.state) };
        let seen = if thing.seen { "" } else { ", not in view" };
        // What stands by itself is in no place.
        let place = if thing.place.is_empty() { String::new() } else { format!(", {}", thing.place) };
        let (name, metres) = (thing.class.spoken(), thing.metres);
        writeln!(out, "{name}{state}{place}, {metres:.1} m{seen}: {}", thing.verdict())?;
    }
    Ok(())
}

/// What is seen, the largest first, with where it is.
pub(super) fn look(now: &SessionSnapshot, out: &mut impl Write) -> anyhow::Result<()> {
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

fn state_words(now: &SessionSnapshot, instance: Instance) -> String {
    let words = state(now, instance);
    if words.is_empty() { words } else { format!(" ({words})") }
}
