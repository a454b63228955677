//! Each verb, as what it asks of the session and what is told of it.

use std::io::Write;

use super::chains::{chains, values};
use super::render::{branches, candidates, choices, look, next, opening, things};
use super::{Answer, FARTHEST, Plain};
use crate::explore::session::{RunMode, SessionCommand};
use crate::explore::terms::TERMS;
use crate::explore::verb::{ExplorerPage, Verb, table};

impl<W: Write> Plain<'_, W> {
    pub(super) fn obey(&mut self, verb: Verb) -> anyhow::Result<()> {
        let run = |count: u32, until| SessionCommand::Run { mode: RunMode::Steps(count), until };
        match verb {
            Verb::Ask(command) => return self.ask_and_show(command),
            Verb::Step(0) => {}
            Verb::Step(1) => drop(self.ask(SessionCommand::Step)?),
            Verb::Step(count) => drop(self.ask(run(count, None))?),
            Verb::ToggleRun | Verb::Continue => drop(self.ask(run(FARTHEST, None))?),
            Verb::Until(condition) => drop(self.ask(run(FARTHEST, Some(condition)))?),
            Verb::Back(count) => {
                let by = -i32::try_from(count).unwrap_or(i32::MAX);
                self.ask(SessionCommand::Along { by, steps: false })?;
            }
            Verb::Forward(count) => {
                let by = i32::try_from(count).unwrap_or(i32::MAX);
                self.ask(SessionCommand::Along { by, steps: false })?;
            }
            Verb::Interact(number) => {
                let now = self.state()?;
                let candidate = usize::from(number).checked_sub(1).and_then(|at| now.candidates.get(at));
                let action = candidate.ok_or_else(|| anyhow::anyhow!("there is no candidate {number}"))?.action();
                self.ask(SessionCommand::Act(action))?;
            }
            Verb::Look => look(&self.state()?, &mut self.out)?,
            Verb::Candidates => candidates(&self.state()?, &mut self.out)?,
            Verb::Branches => branches(&self.state()?.time, &mut self.out)?,
            Verb::Wishes => {
                for wish in &self.state()?.wishes {
                    writeln!(self.out, "{}", serde_json::to_string(&**wish)?)?;
                }
            }
            Verb::Think => {
                if let Some((decision, words, values)) = self.decision()? {
                    next(&decision, &words, values.as_ref(), &mut self.out)?;
                }
            }
            Verb::ValueMap => self.write_values()?,
            Verb::Facing(heading) => {
                self.heading = heading;
                self.write_values()?;
            }
            Verb::Sort => {
                self.sort = self.sort.next();
                self.write_choices()?;
            }
            Verb::Show(page) => self.page(page)?,
            Verb::Copy => {
                let now = self.state()?;
                self.ask_quietly(SessionCommand::Where)?;
                let last = self.position.as_ref().and_then(|at| at.last_step.as_deref());
                let last = last.map_or(String::new(), |words| format!(": {words}"));
                writeln!(self.out, "{} | {} step {}{last}", now.instruction, now.scene.name, now.step)?;
            }
            Verb::ToggleManual => writeln!(self.out, "`do` acts, `step` lets the policy act: both at any time")?,
            Verb::Help => {
                for entry in table::typed() {
                    writeln!(self.out, "{:<26} {}", format!("{} {}", entry.name, entry.arguments), entry.help)?;
                }
            }
            Verb::Terms => {
                for (term, meaning) in TERMS {
                    writeln!(self.out, "{term:<14} {meaning}")?;
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
            | Verb::Suspend
            | Verb::List
            | Verb::Mouse => anyhow::bail!("that is about the screen, and there is none"),
            // Keys of the screen; no line says them.
            Verb::Edit
            | Verb::NextPolicy
            | Verb::NextInteractions
            | Verb::Select(_)
            | Verb::Take
            | Verb::ReplayLink
            | Verb::OpenLink
            | Verb::TurnHelp
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

    /// Asks, and shows what events alone do not say.
    fn ask_and_show(&mut self, command: SessionCommand) -> anyhow::Result<()> {
        let opens = matches!(command, SessionCommand::Reset | SessionCommand::Next | SessionCommand::Seed(_));
        let leaves = opens && command != SessionCommand::Reset;
        let follows =
            matches!(command, SessionCommand::Chain(_) | SessionCommand::WhichLink(_) | SessionCommand::Against(_));
        if command == SessionCommand::Stop {
            writeln!(self.out, "nothing goes on in the background here")?;
            return Ok(());
        }
        if self.ask(command)? == Answer::Refused {
            return Ok(());
        }
        if leaves {
            self.chains.clear();
        }
        if opens {
            opening(&self.state()?, &mut self.out)?;
        }
        if follows {
            chains(&self.chains, &mut self.out)?;
        }
        Ok(())
    }

    fn write_values(&mut self) -> anyhow::Result<()> {
        if self.ask(SessionCommand::ValueMap)? == Answer::Given
            && let Some(map) = &self.map
        {
            values(map, self.heading, &mut self.out)?;
        }
        Ok(())
    }

    fn write_choices(&mut self) -> anyhow::Result<()> {
        if let Some((decision, _, values)) = self.decision()? {
            choices(&self.state()?, &decision, values.as_ref(), self.sort, &mut self.out)?;
        }
        Ok(())
    }

    /// What a page of the screen shows.
    fn page(&mut self, page: ExplorerPage) -> anyhow::Result<()> {
        match page {
            ExplorerPage::Main | ExplorerPage::Frame => {
                self.ask(SessionCommand::Where)?;
                look(&self.state()?, &mut self.out)
            }
            ExplorerPage::Actions => self.ask(SessionCommand::Actions).map(drop),
            ExplorerPage::Branches => branches(&self.state()?.time, &mut self.out),
            ExplorerPage::Mind => self.write_choices(),
            ExplorerPage::World => things(&self.state()?, &mut self.out),
            ExplorerPage::Compare => match self.compared.clone() {
                Some(other) => self.ask(SessionCommand::Compare(other)).map(drop),
                None => anyhow::bail!("compare with what? compare TEXT"),
            },
            ExplorerPage::Chain => match self.chains.is_empty() {
                true => anyhow::bail!("there is no chain yet: chain A; B; ..., or chain alone for the task's own"),
                false => chains(&self.chains, &mut self.out),
            },
        }
    }
}
