//! The same without a screen: a line in, plain lines out.

use std::io::Write;

use super::command::RemoteCommand;
use super::exploration::{RemoteExploration, RemoteStepTaken};
use super::view::RemoteChoice;
use crate::agent::policy_source::PolicySource;
use crate::control::Order;
use crate::data::text_file;
use crate::explore::plain_input::{Asked, PlainInput};
use crate::explore::steering::ExplorerControl;
use crate::language::count::counted;

/// The most steps of a run that nothing stops.
const MOST: u32 = 100_000;

/// Who asks, and who hears of it.
struct Plain<'a, W> {
    agent: &'a PolicySource,
    input: PlainInput,
    control: &'a ExplorerControl,
    out: W,
    /// Somebody ordered that it ends.
    leaves: bool,
}

/// Obeys lines, and orders of those who steer it, until `quit` or the end of the input; says whether all of them could be
/// obeyed.
///
/// # Errors
/// When reading or writing fails.
pub(crate) fn run(
    mut exploration: RemoteExploration,
    agent: &PolicySource,
    input: PlainInput,
    control: &ExplorerControl,
    out: impl Write,
) -> anyhow::Result<bool> {
    let mut plain = Plain { agent, input, control, out, leaves: false };
    let mut obeyed = true;
    writeln!(plain.out, "{}, seed {}", exploration.name(), exploration.seed())?;
    writeln!(plain.out, "instruction: {}", exploration.instruction())?;
    while !plain.leaves {
        plain.out.flush()?;
        plain.note(&exploration, false);
        let command = match plain.input.next() {
            Asked::Over => break,
            Asked::Ordered(Order::Stop) => break,
            Asked::Ordered(Order::Pause) => continue,
            Asked::Ordered(Order::Resume) => Ok(RemoteCommand::Run),
            Asked::Ordered(Order::Instruct(text)) => Ok(RemoteCommand::Instruct(text)),
            Asked::Line(line) => {
                let line = line?;
                let line = text_file::line(&line).trim();
                if line.is_empty() || line.starts_with('#') {
                    continue;
                }
                RemoteCommand::parse(line)
            }
        };
        let done = match command {
            Ok(RemoteCommand::Quit) => break,
            Ok(command) => plain.obey(&mut exploration, command),
            Err(complaint) => Err(anyhow::anyhow!(complaint)),
        };
        if let Err(error) = done {
            obeyed = false;
            writeln!(plain.out, "error: {error:#}")?;
            control.say(format!("problem: {error:#}"));
        }
    }
    plain.out.flush()?;
    Ok(obeyed)
}

impl<W: Write> Plain<'_, W> {
    fn obey(&mut self, exploration: &mut RemoteExploration, command: RemoteCommand) -> anyhow::Result<()> {
        let exact_before = exploration.exactness();
        match command {
            RemoteCommand::Step(count) => self.steps(exploration, count)?,
            RemoteCommand::Run => self.steps(exploration, MOST)?,
            RemoteCommand::Pause | RemoteCommand::Quit => {}
            RemoteCommand::Move(by) => {
                let step = i64::from(exploration.tree().present().step) + by;
                exploration.seek(step.clamp(0, i64::from(u32::MAX)) as u32);
                at(exploration, &mut self.out)?;
            }
            RemoteCommand::Goto(step) => {
                exploration.seek(step);
                at(exploration, &mut self.out)?;
            }
            RemoteCommand::Act(text) => {
                let action = exploration.action(&text)?;
                let taken = exploration.act(action)?;
                self.told(exploration, &taken)?;
            }
            RemoteCommand::Instruct(text) => {
                exploration.instruct(&text)?;
                writeln!(self.out, "instruction: {}", exploration.instruction())?;
                self.control.say(format!("instruction: {}", exploration.instruction()));
            }
            RemoteCommand::Compare(text) => {
                for (told, choices) in exploration.compared(&text)? {
                    writeln!(self.out, "instruction: {told}")?;
                    list(&choices, &mut self.out)?;
                }
            }
            RemoteCommand::Chance => {
                exploration.choose(PolicySource::random())?;
                writeln!(self.out, "{} acts", exploration.policy())?;
            }
            RemoteCommand::Agent => {
                exploration.choose(self.agent.clone())?;
                writeln!(self.out, "{} acts", exploration.policy())?;
            }
            RemoteCommand::Begin(seed) => begin(exploration, seed, &mut self.out)?,
            RemoteCommand::Next => begin(exploration, exploration.seed().wrapping_add(1), &mut self.out)?,
            RemoteCommand::Reset => {
                exploration.seek(0);
                at(exploration, &mut self.out)?;
            }
            RemoteCommand::Branch(number) => {
                exploration.switch(number.wrapping_sub(1))?;
                at(exploration, &mut self.out)?;
            }
            RemoteCommand::Branches => {
                let tree = exploration.tree();
                for (place, branch) in (1..).zip(tree.branches()) {
                    let mark = if place == tree.branch() + 1 { "*" } else { " " };
                    writeln!(
                        self.out,
                        "{mark} {place} {}: {}, {}",
                        branch.name,
                        counted(tree.state(branch.tip).step, "step"),
                        branch.why
                    )?;
                }
            }
            RemoteCommand::Break(condition) => {
                let set = exploration.conditions.iter().position(|known| *known == condition);
                match set {
                    Some(at) => drop(exploration.conditions.remove(at)),
                    None => exploration.conditions.push(condition),
                }
                let all: Vec<String> = exploration.conditions.iter().map(ToString::to_string).collect();
                writeln!(self.out, "stops at: {}", if all.is_empty() { "nothing".into() } else { all.join(", ") })?;
            }
            RemoteCommand::Save(path) => {
                let wrote = exploration.save(path)?;
                writeln!(self.out, "{wrote}")?;
            }
            RemoteCommand::Look => look(exploration, &mut self.out)?,
        }
        let exact = exploration.exactness();
        if exact != exact_before {
            writeln!(self.out, "going back: {exact}")?;
        }
        Ok(())
    }

    fn steps(&mut self, exploration: &mut RemoteExploration, count: u32) -> anyhow::Result<()> {
        for _ in 0..count {
            let taken = exploration.step()?;
            self.told(exploration, &taken)?;
            self.note(exploration, true);
            if exploration.end().is_some() || self.is_paused(exploration)? {
                break;
            }
            if let Some(condition) = exploration.stopped_by() {
                writeln!(self.out, "stopped at: {condition}")?;
                self.control.say(format!("stopped at: {condition}"));
                break;
            }
        }
        Ok(())
    }

    /// Hears what is ordered while it runs; whether the run ends here.
    fn is_paused(&mut self, exploration: &mut RemoteExploration) -> anyhow::Result<bool> {
        while let Some(order) = self.input.order() {
            match order {
                Order::Resume => {}
                Order::Instruct(text) => self.obey(exploration, RemoteCommand::Instruct(text))?,
                Order::Pause => return Ok(true),
                Order::Stop => {
                    self.leaves = true;
                    return Ok(true);
                }
            }
        }
        Ok(false)
    }

    /// Tells those who steer it how it stands.
    fn note(&self, exploration: &RemoteExploration, runs: bool) {
        self.control.note(|seen| {
            (seen.runs, seen.step) = (runs, exploration.tree().present().step);
            seen.instruction = Some(exploration.instruction().to_owned());
            seen.acts = format!("{}, {}", exploration.name(), exploration.policy());
        });
    }

    fn told(&mut self, exploration: &RemoteExploration, taken: &RemoteStepTaken) -> anyhow::Result<()> {
        let mut line = taken.in_words();
        if let Some(branch) = &taken.forked {
            line += &format!("; branch {branch} begins");
        }
        writeln!(self.out, "{line}")?;
        self.control.say(line);
        if let Some(end) = exploration.end() {
            writeln!(self.out, "over: {end}")?;
            self.control.say(format!("over: {end}"));
        }
        Ok(())
    }
}

fn begin(exploration: &mut RemoteExploration, seed: u64, out: &mut impl Write) -> anyhow::Result<()> {
    exploration.begin(seed)?;
    writeln!(out, "seed {seed}; instruction: {}", exploration.instruction())?;
    Ok(())
}

fn at(exploration: &RemoteExploration, out: &mut impl Write) -> anyhow::Result<()> {
    let tree = exploration.tree();
    let branch = &tree.branches()[tree.branch()];
    writeln!(out, "at step {} of {}, branch {}", tree.present().step, tree.length(), branch.name)?;
    Ok(())
}

fn look(exploration: &mut RemoteExploration, out: &mut impl Write) -> anyhow::Result<()> {
    let shown = exploration.picture();
    at(exploration, out)?;
    if let Some(text) = &shown.observation.text {
        writeln!(out, "{}", text.trim_end())?;
    }
    if let Some(picture) = &shown.observation.picture {
        writeln!(out, "picture: {} x {}", picture.width, picture.height)?;
    }
    for thing in &shown.observation.things {
        writeln!(out, "in view: {}", thing.name)?;
    }
    for subtask in &shown.observation.subtasks {
        writeln!(out, "{} {}", if subtask.is_done { "done:" } else { "to do:" }, subtask.text)?;
    }
    list(&shown.choices, out)?;
    if let Some(problem) = &shown.undecided {
        writeln!(out, "{} cannot decide: {problem}", shown.policy)?;
    }
    writeln!(out, "earned {}; going back: {}", shown.earned, shown.exactness)?;
    Ok(())
}

fn list(choices: &[RemoteChoice], out: &mut impl Write) -> anyhow::Result<()> {
    for choice in choices.iter().take(40) {
        let share = choice.probability.map_or("     ".into(), |share| format!("{share:.3}"));
        writeln!(out, "  {share} {}{}", choice.words, if choice.is_chosen { "  <" } else { "" })?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::env::remote::RemoteSettings;
    use crate::env::remote::testing::{Fault, serve};
    use crate::eval::verify::verify;
    use crate::run_dir::reader::RecordedRun;

    fn told(fault: Fault, lines: &str) -> (bool, String) {
        let agent = PolicySource::random();
        let exploration =
            RemoteExploration::new(&serve(fault), RemoteSettings::default(), agent.clone(), 2, None).unwrap();
        let mut out = Vec::new();
        let (input, control) = PlainInput::steered(std::io::Cursor::new(lines.to_owned())).unwrap();
        let obeyed = run(exploration, &agent, input, &control, &mut out).unwrap();
        (obeyed, String::from_utf8(out).unwrap())
    }

    #[test]
    fn an_episode_is_acted_in_gone_back_in_and_forked() {
        let (obeyed, told) =
            told(Fault::None, "act right\nact right\nback\nact left\nbranches\nbranch 1\ngoto 9\nlook\n");
        assert!(obeyed, "{told}");
        for wanted in [
            "instruction: go to the right end",
            "step 2: right: ok",
            "at step 1 of 2, branch 1",
            "step 2: left: ok; branch 2 begins",
            "* 2 2: 2 steps, left (you)",
            "at step 2 of 2, branch 1",
            "picture: 4 x 3",
            "0.500 left",
            "going back: exact: by snapshots",
        ] {
            assert!(told.contains(wanted), "{wanted}: {told}");
        }
    }

    #[test]
    fn without_snapshots_the_same_actions_are_taken_again_and_said_to_be_the_same_or_not() {
        let lines = "act right\nact right\nact right\nact right\nback 1\nact left\n";
        let (_, same) = told(Fault::Foreign, lines);
        assert!(same.contains("branch 2 begins") && same.contains("going back: exact so far"), "{same}");
        let (_, other) = told(Fault::Chance, lines);
        assert!(other.contains("going back: not exact: taken again, step 3 showed something else"), "{other}");
    }

    #[test]
    fn what_cannot_be_obeyed_is_told_and_the_rest_goes_on() {
        let (obeyed, told) = told(
            Fault::None,
            "act jump\nfly\nbreak reward\nact right\nact right\nact right\nact right\nact right\nact right\n",
        );
        assert!(!obeyed);
        for wanted in [
            "error: there is no action \"jump\"; there are: left, right",
            "error: \"fly\" is none of",
            "stops at: reward",
            "reward 1, part done",
            "over: done",
            "error: the episode is over (done)",
        ] {
            assert!(told.contains(wanted), "{wanted}: {told}");
        }
    }

    #[test]
    fn what_was_explored_is_a_run_that_verifies_and_opens_again() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run");
        let (name, agent) = (serve(Fault::None), PolicySource::random().at("ws://node7:8000".into()));
        let mut exploration = RemoteExploration::new(&name, RemoteSettings::default(), agent.clone(), 2, None).unwrap();
        for _ in 0..3 {
            exploration.step().unwrap();
        }
        exploration.seek(1);
        let right = exploration.action("right").unwrap();
        exploration.instruct("go home").unwrap();
        exploration.act(right).unwrap();
        exploration.save(Some(path.clone())).unwrap();
        let run = RecordedRun::open(&path, None).unwrap();
        assert_eq!(run.episodes.len(), 2);
        assert_eq!(run.places, Vec::from_iter(agent.place()), "where its policy was is kept");
        let verdict = verify(&run, &mut |_| Ok(None), 1, &RemoteSettings::default(), &mut |_| ()).unwrap();
        assert!(verdict.is_equal(), "{verdict:?}");
        let (task, author) = (run.task(&run.episodes[1]).unwrap(), run.author(0, &run.episodes[1]));
        let opened =
            RemoteExploration::open(task, &run.episodes[1], &author, RemoteSettings::default(), agent, 2).unwrap();
        assert_eq!((opened.tree().present().step, opened.instruction()), (2, "Go home."));
        assert_eq!(opened.exactness(), "exact: by snapshots");
    }
}
