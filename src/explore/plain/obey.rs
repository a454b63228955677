//! Each verb, done and told.

use std::io::Write;

use super::Plain;
use super::say::{branches, choices, compare, divergence, here, look, opening, step_line, things, top};
use super::work::chain;
use crate::domain::Action;
use crate::explore::breakpoints::Condition;
use crate::explore::session::Session;
use crate::explore::timeline::words;
use crate::explore::verb::{Page, SAID, Verb};

/// Runs that are not told how far end here.
const FARTHEST: u32 = 1000;

impl Plain {
    pub(crate) fn obey(&mut self, verb: Verb, out: &mut impl Write) -> anyhow::Result<()> {
        match verb {
            Verb::Step(count) => steps(&mut self.engine, count, &[], out)?,
            Verb::ToggleRun | Verb::Continue => steps(&mut self.engine, FARTHEST, &self.breaks, out)?,
            Verb::Until(condition) => {
                steps(&mut self.engine, FARTHEST, &[self.breaks.as_slice(), &[condition]].concat(), out)?
            }
            Verb::Break(condition) => {
                match condition {
                    None => self.breaks.clear(),
                    Some(condition) if self.breaks.contains(&condition) => {
                        self.breaks.retain(|known| *known != condition)
                    }
                    Some(condition) => self.breaks.push(condition),
                }
                let all: Vec<String> = self.breaks.iter().map(ToString::to_string).collect();
                writeln!(out, "runs stop at: {}", if all.is_empty() { "nothing".into() } else { all.join("; ") })?;
            }
            Verb::Navigate(kind) => act(&mut self.engine, Action::navigate(kind), out)?,
            Verb::Interact(number) => {
                let candidates = self.engine.snapshot().candidates;
                let candidate = usize::from(number).checked_sub(1).and_then(|at| candidates.get(at));
                let action = candidate.ok_or_else(|| anyhow::anyhow!("there is no candidate {number}"))?.action();
                act(&mut self.engine, action, out)?;
            }
            Verb::Instruct(text) => {
                let old = self.engine.instruction().to_string();
                let note = self.engine.instruct(&text)?;
                writeln!(out, "instruction: {} (was: {old}; {note})", self.engine.instruction())?;
            }
            Verb::Look => look(&self.engine.snapshot(), out)?,
            Verb::Candidates => {
                let candidates = self.engine.snapshot().candidates;
                if candidates.is_empty() {
                    writeln!(out, "no interaction is possible here")?;
                }
                for (number, candidate) in (1..).zip(&candidates) {
                    let metres = candidate.distance / 1000.0;
                    writeln!(out, "{number}: {} {}, {metres:.1} m", candidate.kind, candidate.class.name())?;
                }
            }
            Verb::Think => {
                let (decision, values) = self.engine.think()?.clone();
                let top = decision.distribution.as_ref().map_or(String::new(), |mind| format!(" ({})", top(mind)));
                let value = values.map_or(String::new(), |values| format!(", V {:.2}", values.state));
                writeln!(out, "next: {}{top}{value}", self.engine.words(decision.action))?;
            }
            Verb::Policy(kind) => {
                self.engine.choose(kind)?;
                writeln!(out, "policy: {}", kind.name())?;
            }
            Verb::Checkpoint(wanted) => {
                self.engine.checkpoint(&wanted)?;
                writeln!(out, "checkpoint: {}", self.engine.author().policy)?;
            }
            Verb::Sample(seed) => {
                self.engine.reseed(seed, true);
                writeln!(out, "actions are drawn with seed {seed} from here on")?;
            }
            Verb::Greedy => {
                self.engine.reseed(self.engine.author().seed, false);
                writeln!(out, "the likeliest actions from here on")?;
            }
            Verb::Back(count) => self.obey(Verb::Seek(self.engine.tree().at().saturating_sub(count)), out)?,
            Verb::Forward(count) => self.obey(Verb::Seek(self.engine.tree().at().saturating_add(count)), out)?,
            Verb::Seek(step) => seek(&mut self.engine, step, out)?,
            Verb::Last => self.obey(Verb::Seek(self.engine.tree().last()), out)?,
            Verb::NextEvent | Verb::LastEvent => {
                let step = self.engine.snapshot().time.event(verb == Verb::NextEvent);
                seek(&mut self.engine, step, out)?;
            }
            Verb::Subtask(number) => {
                let step = self.engine.snapshot().time.subtask(number);
                seek(
                    &mut self.engine,
                    step.ok_or_else(|| anyhow::anyhow!("subtask {number} is not done on this branch"))?,
                    out,
                )?;
            }
            Verb::Branch(wanted) => {
                self.engine.switch(self.engine.branch(&wanted)?)?;
                here(&self.engine, out)?;
            }
            Verb::NextBranch => {
                let next = (self.engine.tree().branch() + 1) % self.engine.tree().branches().len();
                self.engine.switch(next)?;
                here(&self.engine, out)?;
            }
            Verb::Branches => branches(&self.engine, out)?,
            Verb::Name(name) => {
                self.engine.rename(self.engine.tree().branch(), &name)?;
                here(&self.engine, out)?;
            }
            Verb::Diverge(wanted) => divergence(&self.engine.divergence(self.engine.branch(&wanted)?), out)?,
            Verb::Compare(other) => self.compare(other, out)?,
            Verb::Swap => {
                let other =
                    self.other.take().ok_or_else(|| anyhow::anyhow!("there is nothing to swap: compare TEXT first"))?;
                let old = self.engine.instruction().to_string();
                self.obey(Verb::Instruct(other), out)?;
                self.compare(old, out)?;
            }
            Verb::Chain(text) => {
                let chain = self.engine.chain(&text)?;
                if !self.chain.as_ref().is_some_and(|known| known.is_same(&chain)) {
                    self.followed.clear();
                }
                self.chain = Some(chain);
                self.follow(None, None, out)?;
            }
            Verb::WhichLink(draws) => self.follow(None, Some(draws), out)?,
            Verb::Against(wanted) => {
                let rival = self.engine.rival(&wanted)?;
                self.follow(Some(rival), None, out)?;
            }
            Verb::ReplayLink => anyhow::bail!("which one? link N"),
            Verb::ValueMap => self.values(out)?,
            Verb::Facing(heading) => {
                self.heading = heading;
                self.values(out)?;
            }
            Verb::Sort => {
                self.sort = self.sort.next();
                choices(&mut self.engine, self.sort, out)?;
            }
            Verb::Show(page) => self.page(page, out)?,
            Verb::Copy => {
                let now = self.engine.snapshot();
                let last = self.engine.tree().last_taken().map_or(String::new(), |taken| format!(": {}", words(taken)));
                writeln!(out, "{} | {} step {}{last}", now.instruction, now.scene.name, now.step)?;
            }
            Verb::ToggleManual => writeln!(out, "`do` acts, `step` lets the policy act: both at any time")?,
            Verb::Stop => writeln!(out, "nothing goes on in the background here")?,
            Verb::Save(path) => writeln!(out, "{}", self.engine.keep(path)?)?,
            Verb::SaveTask(path) => writeln!(out, "{}", self.engine.keep_task(&path)?)?,
            Verb::Export(path) => writeln!(out, "{}", self.engine.export(&path)?)?,
            Verb::Reset => {
                self.engine.reset();
                opening(&self.engine.snapshot(), out)?;
            }
            Verb::Next => {
                self.engine.next_episode()?;
                opening(&self.engine.snapshot(), out)?;
            }
            Verb::Seed(seed) => {
                self.engine.seed(seed)?;
                opening(&self.engine.snapshot(), out)?;
            }
            Verb::Help => {
                for said in SAID {
                    writeln!(out, "{:<26} {}", format!("{} {}", said.name, said.arguments), said.doc)?;
                }
            }
            Verb::Quit => {}
            Verb::Faster
            | Verb::Slower
            | Verb::Graphics
            | Verb::Overlay
            | Verb::Labels
            | Verb::Bandwidth(_)
            | Verb::FullFrame
            | Verb::Mouse => anyhow::bail!("that is about the screen, and there is none"),
            // Keys of the screen; no line says them.
            Verb::Edit
            | Verb::NextPolicy
            | Verb::Page
            | Verb::Select(_)
            | Verb::Take
            | Verb::NextHeading
            | Verb::Palette(_)
            | Verb::Apply
            | Verb::Cancel
            | Verb::Earlier
            | Verb::Later
            | Verb::Complete => anyhow::bail!("that is a key of the screen, and there is none"),
        }
        Ok(())
    }

    /// The instruction in force and another.
    fn compare(&mut self, other: String, out: &mut impl Write) -> anyhow::Result<()> {
        compare(&self.engine.contrast(&other)?, out)?;
        self.other = Some(other);
        Ok(())
    }

    /// What a page of the screen shows.
    fn page(&mut self, page: Page, out: &mut impl Write) -> anyhow::Result<()> {
        match page {
            Page::Main => {
                here(&self.engine, out)?;
                look(&self.engine.snapshot(), out)
            }
            Page::Branches => branches(&self.engine, out),
            Page::Mind => choices(&mut self.engine, self.sort, out),
            Page::World => things(&self.engine.snapshot(), out),
            Page::Compare => match self.other.clone() {
                Some(other) => self.compare(other, out),
                None => anyhow::bail!("compare with what? compare TEXT"),
            },
            Page::Chain => match self.followed.is_empty() {
                true => anyhow::bail!("there is no chain yet: chain A; B; ..., or chain alone for the task's own"),
                false => chain(&self.followed, out),
            },
        }
    }
}

fn act(engine: &mut Session, action: Action, out: &mut impl Write) -> anyhow::Result<()> {
    anyhow::ensure!(engine.end().is_none(), "the episode is over; `back`, `reset` or `next`");
    let event = engine.act(action)?;
    step_line(engine, &event, None, out)
}

fn seek(engine: &mut Session, step: u32, out: &mut impl Write) -> anyhow::Result<()> {
    engine.seek(step);
    here(engine, out)
}

/// So many steps, or until one of these conditions holds.
fn steps(engine: &mut Session, count: u32, until: &[Condition], out: &mut impl Write) -> anyhow::Result<()> {
    anyhow::ensure!(engine.end().is_none(), "the episode is over; `back`, `reset` or `next`");
    for _ in 0..count {
        let mind = engine.think()?.0.distribution.clone();
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
