//! The explorer without a screen: a verb a line in, plain lines out. For screen readers, scripts, and pipes.

mod chains;
mod obey;
mod render;

use std::io::Write;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use super::chain_report::ChainReport;
use super::choices::Sort;
use super::exploration::{Exploration, SessionSnapshot};
use super::plain_input::{Asked, PlainInput};
use super::session::{RunMode, Session, SessionCommand, SessionEvent};
use super::steering::ExplorerControl;
use super::timeline::BranchPosition;
use super::verb::{Verb, parse};
use crate::agent::{Decision, Values};
use crate::analysis::value_map::ValueMap;
use crate::control::Order;
use crate::data::text_file;
use crate::domain::Heading;
use render::{at, compare, divergence, opening, reading, step_line, verdict};

/// A session without a screen, and what was last told of it.
struct Plain<'a, W> {
    session: Session,
    events: Receiver<SessionEvent>,
    input: PlainInput,
    control: &'a ExplorerControl,
    out: W,
    state: Option<Box<SessionSnapshot>>,
    decided: Option<(Decision, String, Option<Values>)>,
    position: Option<BranchPosition>,
    /// The other instruction of the last comparison.
    compared: Option<String>,
    /// What each policy made of the chain, the first one's first.
    chains: Vec<ChainReport>,
    map: Option<Arc<ValueMap>>,
    /// The heading whose values are told; the best without one.
    heading: Option<Heading>,
    /// How choices are sorted.
    sort: Sort,
    /// Something that was asked for was not done.
    refused: bool,
    /// Somebody ordered that it ends.
    leaves: bool,
}

/// Whether what was asked for was done. If not, that was told.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Answer {
    Given,
    Refused,
}

/// How long work in the background is waited for before it is asked whether it still goes on.
const PATIENCE: Duration = Duration::from_millis(20);
/// Runs that are not told how far end here.
const FARTHEST: u32 = 1000;

/// Obeys lines, and orders of those who steer it, until `quit` or the end of the input; says whether all of them could be
/// obeyed.
///
/// # Errors
/// When reading or writing fails.
pub(crate) fn run(
    exploration: Exploration,
    input: PlainInput,
    control: &ExplorerControl,
    out: impl Write,
) -> anyhow::Result<bool> {
    let (tell, events) = channel();
    let session = Session::on_request(exploration, Arc::new(move |event| drop(tell.send(event))));
    let mut plain = Plain {
        session,
        events,
        input,
        control,
        out,
        state: None,
        decided: None,
        position: None,
        compared: None,
        chains: Vec::new(),
        map: None,
        heading: None,
        sort: Sort::Probability,
        refused: false,
        leaves: false,
    };
    opening(&plain.state()?, &mut plain.out)?;
    plain.session.begin();
    plain.take_events(Echo::Everything)?;
    plain.out.flush()?;
    while !plain.leaves {
        let line = match plain.input.next() {
            Asked::Over => break,
            Asked::Line(line) => line?,
            Asked::Ordered(order) => {
                plain.carry_out(order)?;
                plain.out.flush()?;
                continue;
            }
        };
        let line = text_file::line(&line).trim();
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        match parse(line) {
            Ok(Verb::Quit) => break,
            Ok(verb) => {
                if let Err(error) = plain.obey(verb) {
                    plain.refused = true;
                    writeln!(plain.out, "error: {error:#}")?;
                }
            }
            Err(complaint) => {
                plain.refused = true;
                writeln!(plain.out, "error: {complaint}")?;
            }
        }
        plain.out.flush()?;
    }
    Ok(!plain.refused)
}

/// What of the events is written.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Echo {
    Everything,
    /// What went wrong.
    Errors,
}

impl<W: Write> Plain<'_, W> {
    /// Does what is ordered while nothing else is under way.
    fn carry_out(&mut self, order: Order) -> anyhow::Result<()> {
        let command = match order {
            Order::Stop => {
                self.leaves = true;
                return Ok(());
            }
            Order::Pause => SessionCommand::Pause,
            Order::Resume => SessionCommand::Run { mode: RunMode::Steps(FARTHEST), until: None },
            Order::Instruct(text) => SessionCommand::Instruct(text),
        };
        self.ask(command).map(drop)
    }

    /// Does what is ordered while something is under way.
    fn hear_orders(&mut self) {
        while let Some(order) = self.input.order() {
            match order {
                Order::Stop => {
                    self.leaves = true;
                    self.session.apply(SessionCommand::Pause);
                    self.session.apply(SessionCommand::Stop);
                }
                Order::Pause => self.session.apply(SessionCommand::Pause),
                Order::Instruct(text) => self.session.apply(SessionCommand::Instruct(text)),
                // It goes on.
                Order::Resume => {}
            }
        }
    }

    /// Asks for something, and writes what comes of it until it is over.
    fn ask(&mut self, command: SessionCommand) -> anyhow::Result<Answer> {
        self.session.apply(command);
        self.take_events(Echo::Everything)
    }

    /// Asks for something that is written otherwise.
    fn ask_quietly(&mut self, command: SessionCommand) -> anyhow::Result<Answer> {
        self.session.apply(command);
        self.take_events(Echo::Errors)
    }

    /// The present state.
    fn state(&mut self) -> anyhow::Result<SessionSnapshot> {
        self.ask_quietly(SessionCommand::Show)?;
        self.state.take().map(|now| *now).ok_or_else(|| anyhow::anyhow!("no state was received"))
    }

    /// What the policy would do now, unless that failed and was told.
    fn decision(&mut self) -> anyhow::Result<Option<(Decision, String, Option<Values>)>> {
        self.ask_quietly(SessionCommand::Decide)?;
        Ok(self.decided.take())
    }

    /// Takes in events until no run and no work is under way.
    fn take_events(&mut self, echo: Echo) -> anyhow::Result<Answer> {
        let mut answer = Answer::Given;
        loop {
            self.hear_orders();
            // Asked first: what ends meanwhile has told everything by then.
            let (runs, works) = (self.session.interval().is_some(), self.session.is_working());
            while let Ok(event) = self.events.try_recv() {
                self.on_event(event, echo, &mut answer)?;
            }
            if runs {
                self.session.advance();
                self.out.flush()?;
            } else if !works {
                return Ok(answer);
            } else if let Ok(event) = self.events.recv_timeout(PATIENCE) {
                self.on_event(event, echo, &mut answer)?;
            }
        }
    }

    fn on_event(&mut self, event: SessionEvent, echo: Echo, answer: &mut Answer) -> anyhow::Result<()> {
        self.control.hear(&event);
        let out = &mut self.out;
        match event {
            SessionEvent::Refused(reason) | SessionEvent::Failed(reason) => {
                (*answer, self.refused) = (Answer::Refused, true);
                writeln!(out, "error: {reason}")?;
            }
            SessionEvent::AlreadyOver(_) => {
                (*answer, self.refused) = (Answer::Refused, true);
                writeln!(out, "error: the wish is over; `instruct` gives the next one, or `back`, `reset`, `next`")?;
            }
            SessionEvent::State(now) => self.state = Some(now),
            SessionEvent::Decided(decision, words, values) => self.decided = Some((decision, words, values)),
            SessionEvent::Chain(report) => self.take_in(*report),
            SessionEvent::ValueMap(map, _) => self.map = Some(map),
            SessionEvent::At(position) => {
                if echo == Echo::Everything {
                    at(&position, out)?;
                }
                self.position = Some(position);
            }
            SessionEvent::Stepped(step) => step_line(&step, out)?,
            SessionEvent::Instructed { old, new, note } => writeln!(out, "instruction: {new} (was: {old}; {note})")?,
            SessionEvent::PolicyChosen(kind) => writeln!(out, "policy: {}", kind.name())?,
            SessionEvent::CheckpointChosen(name) => writeln!(out, "checkpoint: {name}")?,
            SessionEvent::Sampling(Some(seed)) => writeln!(out, "actions are drawn with seed {seed} from here on")?,
            SessionEvent::Sampling(None) => writeln!(out, "the likeliest actions from here on")?,
            SessionEvent::Stopped(why) => writeln!(out, "stopped: {why}")?,
            SessionEvent::Breakpoints(conditions) => {
                let all: Vec<String> = conditions.iter().map(ToString::to_string).collect();
                writeln!(out, "runs stop at: {}", if all.is_empty() { "nothing".into() } else { all.join("; ") })?;
            }
            SessionEvent::Actions(lines) => {
                for (at, line) in lines.iter().enumerate() {
                    let before = at.checked_sub(1).and_then(|before| lines.get(before));
                    writeln!(out, "{}", line.line(at + 1, before).trim_end())?;
                }
            }
            SessionEvent::Diverged(parted) => divergence(&parted, out)?,
            SessionEvent::Compared(contrast) => {
                compare(&contrast, out)?;
                self.compared = Some(contrast.sides[1].instruction.clone());
            }
            SessionEvent::Examples(wishes) => {
                for wish in wishes {
                    writeln!(out, "{wish}")?;
                }
            }
            SessionEvent::Noted(what) => writeln!(out, "{what}")?,
            SessionEvent::Read(wish) => reading(&wish, out)?,
            SessionEvent::AgentDone { likely, graded, .. } => {
                let grader =
                    graded.map_or("it is not graded".into(), |(done, of)| format!("the grader: {done} of {of}"));
                writeln!(out, "the agent says that it is done ({likely:.2}); {grader}")?;
            }
            SessionEvent::Ended(wish) => verdict(&wish, out)?,
            // What is slow is waited for.
            SessionEvent::Running(_) | SessionEvent::Busy(_) | SessionEvent::Working(_) => {}
        }
        Ok(())
    }

    /// Keeps what a policy made of the chain, in place of what it made before; another chain takes the place of all.
    fn take_in(&mut self, report: ChainReport) {
        self.chains.retain(|known| known.is_same_chain(&report));
        match self.chains.iter_mut().find(|known| known.who == report.who) {
            Some(known) => *known = report,
            None => self.chains.push(report),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::run;
    use crate::explore::plain_input::PlainInput;
    use crate::explore::testing;

    fn say(lines: &str) -> String {
        let mut out = Vec::new();
        let (input, control) = PlainInput::steered(std::io::Cursor::new(lines.to_owned())).unwrap();
        run(testing::exploration(), input, &control, &mut out).unwrap();
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
            "left and main share 1 step\nstep 2",
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
        let text = say("break step 9\nbreak step 3\nrun\nbreak\nbreak clear\n");
        assert!(
            text.matches("runs stop at: step 9; step 3\n").count() == 2 && text.contains("stopped: step 3"),
            "{text}"
        );
        assert!(text.ends_with("runs stop at: nothing\n"), "{text}");
        assert!(say("until dusk\n").contains("there are: subtask"));
    }

    #[test]
    fn the_other_instruction_is_adopted_and_the_pages_are_told() {
        let text = say("swap\ncompare open the fridge\nswap\ncompare dance\npage compare\n");
        assert!(text.contains("error: there is nothing to swap"), "{text}");
        assert!(text.contains("instruction: Open the fridge. (was: "), "{text}");
        assert!(text.contains("B: Put the mug in the sink."), "what was in force is the other one now:\n{text}");
        let text = say("step 2\npage actions\nseek 9999\nterms\n");
        assert!(
            text.contains("\n   1 ") && text.contains("\n   2 ") && text.contains("  by random  instruction: "),
            "{text}"
        );
        assert!(text.contains("there is no step 9999: the branch ends at 2"), "{text}");
        assert!(text.contains("\nadvantage      Q less V"), "{text}");
        let text = say("page mind\nsort\npage mind\npage world\npage chain\npage branches\npage panels\n");
        for wanted in ["sorted by probability", "sorted by Q", "fridge", "there is no chain yet", "* 1: main", "hand:"]
        {
            assert!(text.contains(wanted), "no {wanted:?} in:\n{text}");
        }
    }

    #[test]
    fn wishes_for_this_house_are_listed() {
        let text = say("examples\n");
        assert!(text.lines().any(|line| line.to_lowercase().contains("mug")), "{text}");
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
