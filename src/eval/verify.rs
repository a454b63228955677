//! Verifying a run: its episodes are played again, and must come out the same, step by step.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use anyhow::Context;
use serde::Serialize;

use super::options::Options;
use super::plan::EvaluationPlan;
use super::worker_pool;
use crate::agent::policy_source::PolicySource;
use crate::agent::{Decision, Policy, PolicyState};
use crate::data::json;
use crate::domain::Task;
use crate::episode::branches::{FRAMES, SavedState, look_back};
use crate::episode::record::{Author, Episode, EpisodeKey, TraceStep};
use crate::episode::rollout::Rollout;
use crate::episode::scenes::Setting;
use crate::house::House;
use crate::house::grading::{Grader, Grading};
use crate::language::instruction;
use crate::report::summary::RunSummary;
use crate::run_dir::episode_spec::{EpisodeSpec, episode_specs};
use crate::run_dir::layout::SUMMARY;
use crate::run_dir::manifest::RunManifest;
use crate::run_dir::reader::RecordedRun;

/// What came of verifying.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Verdict {
    /// Episodes that were played again.
    pub(crate) episodes: usize,
    /// Steps that were the same.
    pub(crate) steps: usize,
    /// Of these, steps whose choice was made again too; the others were a person's, or a policy's that is not at hand.
    pub(crate) choices: usize,
    /// What differed, an entry an episode.
    pub(crate) differences: Vec<Difference>,
    /// Policies that were not at hand, so that only what their actions came to was compared.
    pub(crate) missing: Vec<String>,
    /// How many of the episodes were played as the tasks ask: from the start, in the task's own words.
    pub(crate) plain: usize,
    /// How many such episodes the run's summary tells of, where there is one.
    pub(crate) summarised: Option<usize>,
}

impl Verdict {
    /// Whether everything came out the same, and nothing is gone.
    pub(crate) fn is_equal(&self) -> bool {
        self.differences.is_empty() && self.summarised.is_none_or(|count| count == self.plain)
    }
}

/// The first difference of an episode.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct Difference {
    /// Which episode of the run, from 1.
    pub(crate) episode: usize,
    pub(crate) task: String,
    /// At which step, from 1; 0 for the start or the whole.
    pub(crate) step: u32,
    pub(crate) what: &'static str,
    /// What the run says.
    pub(crate) recorded: String,
    /// What it is now.
    pub(crate) found: String,
}

/// How many episodes the summary of a run tells of, where there is one.
fn summarised(run: &Path) -> anyhow::Result<Option<usize>> {
    let path = run.join(SUMMARY);
    let summary = path.exists().then(|| json::read::<RunSummary>(&path, RunSummary::FORMAT)).transpose()?;
    Ok(summary.map(|summary| summary.value.episodes))
}

/// Finds the policy of an author; `None` where it is not at hand.
pub(crate) type FindPolicy<'a> = dyn FnMut(&Author) -> anyhow::Result<Option<PolicySource>> + 'a;

/// Plays every episode of a run again: what an evaluation played by the very code that played it, many at once, so that it
/// decides bit for bit as it did; what a person explored step by step. `progress` hears how many are done.
///
/// # Errors
/// When a task does not fit its scene, the summary is malformed, or a policy cannot be made. What differs is in the verdict.
pub fn verify(
    run: &RecordedRun,
    find: &mut FindPolicy<'_>,
    jobs: usize,
    progress: &mut dyn FnMut(usize),
) -> anyhow::Result<Verdict> {
    let mut verdict = Verdict { summarised: summarised(&run.path)?, ..Verdict::default() };
    let again = evaluated_again(run, find, jobs, progress)?;
    let mut sources = Sources { find, known: Vec::new() };
    for (number, episode) in (1..).zip(&run.episodes) {
        let (at, task, setting) = run.setting(episode).with_context(|| format!("episode {number}"))?;
        let found = match again.get(&episode.key()) {
            Some(found) => verdict.compare(episode, found),
            None => {
                let author = run.author(at, episode);
                let mut again = Again { verdict: &mut verdict, number, episode };
                again.play(task, setting, author, run.manifest.grader, &mut sources)?
            }
        };
        if let Some((step, what, recorded, found)) = found {
            let task = episode.task.clone();
            verdict.differences.push(Difference { episode: number, task, step, what, recorded, found });
        }
        verdict.episodes += 1;
        verdict.plain += usize::from(episode.is_plain());
        progress(verdict.episodes.max(again.len()));
    }
    Ok(verdict)
}

/// The episodes that an evaluation played, played again by the same policy in the same slots; none where the policy is not at
/// hand.
fn evaluated_again(
    run: &RecordedRun,
    find: &mut FindPolicy<'_>,
    jobs: usize,
    progress: &mut dyn FnMut(usize),
) -> anyhow::Result<BTreeMap<EpisodeKey, Episode>> {
    let specs = episode_specs(&run.manifest, &run.set.tasks);
    let recorded: BTreeSet<EpisodeKey> =
        run.episodes.iter().filter(|episode| !is_explored(episode)).map(Episode::key).collect();
    let wanted: Vec<EpisodeSpec> =
        specs.into_iter().filter(|spec| recorded.contains(&spec.key(&run.set.tasks))).collect();
    let mut again = BTreeMap::new();
    if wanted.is_empty() {
        return Ok(again);
    }
    let RunManifest { policy, checkpoint_hash, sampling, .. } = run.manifest.clone();
    let author = Author { policy, checkpoint: checkpoint_hash, seed: 0, sampling };
    let Some(source) = find(&author)? else { return Ok(again) };
    let plan = EvaluationPlan {
        tasks: run.set.tasks.clone().into(),
        scenes: Arc::new(run.scenes.clone()),
        options: Options {
            jobs,
            step_by_step: run.manifest.step_by_step,
            sampling,
            ..Options::plain(run.manifest.grader)
        },
    };
    let stop = Arc::new(AtomicBool::new(false));
    worker_pool::play(&plan, &wanted, &source.make, &stop, &mut |episode| {
        again.insert(episode.key(), episode);
        progress(again.len());
        Ok(())
    })?;
    Ok(again)
}

/// Whether a person explored it: its first step says who chose.
fn is_explored(episode: &Episode) -> bool {
    episode.trace.first().is_some_and(|step| step.author.is_some())
}

impl Verdict {
    /// The first difference between an episode and the same played again.
    fn compare(&mut self, recorded: &Episode, found: &Episode) -> Option<Found> {
        let texts = |what, one: &str, other: &str| Some((0, what, one.to_owned(), other.to_owned()));
        if recorded.start_hash != found.start_hash {
            return texts("start", &recorded.start_hash, &found.start_hash);
        }
        if recorded.instruction != found.instruction {
            return texts("instruction", &recorded.instruction, &found.instruction);
        }
        for (number, step) in (1..).zip(&recorded.trace) {
            let is_choice = number > recorded.prefix_steps;
            let Some(again) = found.trace.get(number as usize - 1) else {
                let why = found.error.clone().unwrap_or_else(|| "the episode is over".into());
                return Some((number, "choice", format!("{:?}", step.action()), why));
            };
            if is_choice && again.action() != step.action() {
                return Some((number, "choice", format!("{:?}", step.action()), format!("{:?}", again.action())));
            }
            self.choices += usize::from(is_choice);
            if let Some(difference) = differs(number, step, again) {
                return Some(difference);
            }
            self.steps += 1;
        }
        // An error ended the recorded one before its time; what was recorded of it has to agree in itself.
        let whole = if recorded.error.is_some() { result_of(recorded) } else { counts(found) };
        (counts(recorded) != whole).then(|| (0, "result", counts(recorded), whole))
    }
}

/// What an episode says that it came to.
fn counts(episode: &Episode) -> String {
    format!("{} subtasks, {} steps, success {}", episode.completed, episode.steps, episode.success)
}

/// What an episode's own steps come to.
fn result_of(episode: &Episode) -> String {
    let own = episode.trace.get(episode.prefix_steps as usize..).unwrap_or_default();
    let completed = own.iter().filter(|step| step.subtask.is_some()).count() as u32;
    let success = episode.error.is_none() && episode.of > 0 && completed == episode.of;
    counts(&Episode { completed, steps: own.len() as u32, success, ..Episode::default() })
}

/// The difference between a recorded step and the same taken again, where there is one.
fn differs(number: u32, recorded: &TraceStep, found: &TraceStep) -> Option<Found> {
    let field = match () {
        () if found.outcome != recorded.outcome => "outcome",
        () if found.subtask != recorded.subtask || found.class != recorded.class => "subtask",
        () => return None,
    };
    let text = |step: &TraceStep| format!("{}, subtask {:?}, class {:?}", step.outcome, step.subtask, step.class);
    Some((number, field, text(recorded), text(found)))
}

/// The policies of authors, each looked for once.
struct Sources<'a, 'b> {
    find: &'a mut FindPolicy<'b>,
    known: Vec<(Author, Option<PolicySource>)>,
}

impl Sources<'_, '_> {
    fn make(&mut self, author: &Author) -> anyhow::Result<Option<Box<dyn Policy>>> {
        let is_known = |(known, _): &&(Author, Option<PolicySource>)| {
            (&known.policy, &known.checkpoint) == (&author.policy, &author.checkpoint)
        };
        let source = match self.known.iter().find(is_known) {
            Some((_, source)) => source.clone(),
            None => {
                let source = (self.find)(author)?;
                self.known.push((author.clone(), source.clone()));
                source
            }
        };
        source.map(|source| (source.make)()).transpose()
    }
}

/// An episode that is played again.
struct Again<'a> {
    verdict: &'a mut Verdict,
    number: usize,
    episode: &'a Episode,
}

/// The step, the field, what was recorded, what was found.
type Found = (u32, &'static str, String, String);

impl Again<'_> {
    fn play(
        &mut self,
        task: &Task,
        setting: Setting,
        mut author: Author,
        grading: Grading,
        sources: &mut Sources<'_, '_>,
    ) -> anyhow::Result<Option<Found>> {
        let episode = self.episode;
        let start = setting.world.digest();
        if start != episode.start_hash {
            return Ok(Some((0, "start", episode.start_hash.clone(), start)));
        }
        let grader = Grader::new(grading, &task.roles, &task.subtasks, task.goal.as_ref());
        let grader = (!task.subtasks.is_empty()).then_some(grader);
        let house = House::new(setting.scene, setting.world);
        let mut rollout = Rollout::in_house(house, episode.instruction.clone(), grader, None);
        let mut policy: Option<Box<dyn Policy>> = None;
        let mut summoned: Option<Author> = None;
        let named = episode.trace.iter().filter_map(|step| step.author.as_ref()).find(|by| !by.is_hand());
        let first = match episode.trace.first().and_then(|step| step.author.as_ref()) {
            None => Some(author.clone()),
            Some(_) => named.cloned(),
        };
        let mut past: VecDeque<SavedState> = VecDeque::new();
        for (number, recorded) in (1..).zip(&episode.trace) {
            if number <= episode.prefix_steps {
                // The expert led here, unseen by the run's policy.
                if let Some(found) = self.act(&mut rollout, number, recorded)? {
                    return Ok(Some(found));
                }
                continue;
            }
            if let Some(told) = &recorded.instruction {
                let own = instruction::normalise(&task.instruction) == instruction::normalise(told);
                rollout.instruction.clone_from(told);
                if !own {
                    rollout.env.grader = None;
                }
            }
            if let Some(by) = &recorded.author {
                author = by.clone();
            }
            // While a person acts, the policy before (or the first one to come) looks on.
            let acts = if author.is_hand() { summoned.clone().or_else(|| first.clone()) } else { Some(author.clone()) };
            if let Some(acts) = acts.filter(|acts| summoned.as_ref() != Some(acts)) {
                policy = sources.make(&acts).with_context(|| format!("episode {}", self.number))?;
                if policy.is_none() && !self.verdict.missing.contains(&acts.policy) {
                    self.verdict.missing.push(acts.policy.clone());
                }
                if let Some(policy) = policy.as_deref_mut() {
                    let before: Vec<SavedState> = past.iter().cloned().collect();
                    look_back(policy, &acts, &mut rollout, &before, number - 1);
                }
                summoned = Some(acts);
            }
            let action = recorded.action();
            if let Some(policy) = policy.as_deref_mut() {
                let chosen = rollout.decide(policy);
                if !author.is_hand() {
                    let chosen = chosen.map(|decision| decision.action);
                    if !chosen.as_ref().is_ok_and(|chosen| *chosen == action) {
                        let found = chosen.map_or_else(|error| format!("{error:#}"), |chosen| format!("{chosen:?}"));
                        return Ok(Some((number, "choice", format!("{action:?}"), found)));
                    }
                    self.verdict.choices += 1;
                }
            }
            past.push_front(SavedState::of(&rollout, &author, PolicyState::Nothing));
            past.truncate(FRAMES - 1);
            if let Some(found) = self.act(&mut rollout, number, recorded)? {
                return Ok(Some(found));
            }
        }
        let (recorded, found) = (counts(episode), result_of(episode));
        Ok((recorded != found).then_some((0, "result", recorded, found)))
    }

    /// Takes a recorded step; what it comes to now, where that is something else.
    fn act(&mut self, rollout: &mut Rollout, number: u32, recorded: &TraceStep) -> anyhow::Result<Option<Found>> {
        let tick = rollout.carry_out(Decision::of(recorded.action()))?;
        let difference = differs(number, recorded, &TraceStep::of(&tick, rollout));
        self.verdict.steps += usize::from(difference.is_none());
        Ok(difference)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::agent::RandomPolicy;
    use crate::agent::learned::tests::undecided;
    use crate::agent::policy_source::MakePolicy;
    use crate::domain::{Action, ActionType, Class, Role, SkillKind, Subtask};
    use crate::episode::branches::{TakenStep, Tree};
    use crate::episode::scenes::Scenes;
    use crate::eval::evaluation::tests::{options, tasks};
    use crate::eval::evaluation::{Evaluation, evaluate};
    use crate::explore::session_export;
    use crate::explore::session_export::SessionExport;
    use crate::house::testing::kitchen;
    use crate::run_dir::writer::RunWriter;

    /// A random walk of eight steps in the kitchen; the fourth and fifth by hand, with another instruction from the sixth on.
    fn walked() -> SessionExport {
        let (scene, world) = kitchen();
        let role = |name: &str| Role { class: Class::named(name).unwrap(), slice: false, bound: None, expert: None };
        let mut task = session_export::ungraded(crate::domain::task::SceneRef::Named(scene.name.clone()));
        task.roles = vec![role("Mug")];
        task.subtasks =
            vec![Subtask { skill: SkillKind::Pickup, object: 0, receptacle: None, closes: false, literal: None }];
        (task.id, task.start, task.instruction) = ("main".into(), Some(world.clone()), "Take the mug.".into());
        let grader = Grader::new(Grading::Class, &task.roles, &task.subtasks, None);
        let mut rollout =
            Rollout::in_house(House::new(scene.clone(), world), task.instruction.clone(), Some(grader), None);
        let mut policy = RandomPolicy::new();
        policy.reset(0, 9);
        let random = Author { policy: "random".into(), checkpoint: None, seed: 9, sampling: false };
        let mut tree = Tree::new(SavedState::of(&rollout, &random, policy.state(0)));
        for step in 0..8 {
            if step == 5 {
                rollout.instruction = "Dance.".into();
                rollout.env.grader = None;
            }
            let mut decision = rollout.decide(&mut policy).unwrap();
            let by_hand = (3..5).contains(&step);
            if by_hand {
                decision.action = Action::navigate(ActionType::LookUp);
            }
            let tick = rollout.carry_out(decision.clone()).unwrap();
            let taken = TakenStep {
                decision,
                step: TraceStep::of(&tick, &rollout),
                instruction: rollout.instruction.as_str().into(),
                author: if by_hand { Author::hand() } else { random.clone() },
                values: None,
            };
            let moment = SavedState::of(&rollout, &random, policy.state(0));
            tree.grow(taken, || moment, String::new);
        }
        SessionExport { scene, tasks: vec![task], episodes: vec![tree.episode(0, "main")] }
    }

    fn random(author: &Author) -> anyhow::Result<Option<PolicySource>> {
        Ok((author.policy == "random").then(PolicySource::random))
    }

    fn verified(explored: &SessionExport) -> Verdict {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run");
        session_export::write(explored, &path).unwrap();
        let run = RecordedRun::open(&path, None).unwrap();
        assert_eq!(run.episodes, explored.episodes);
        verify(&run, &mut random, 2, &mut |_| ()).unwrap()
    }

    #[test]
    fn what_was_explored_is_a_run_that_comes_out_the_same() {
        let verdict = verified(&walked());
        assert_eq!((verdict.episodes, verdict.steps), (1, 8), "{verdict:?}");
        assert_eq!(verdict.choices, 3 + 3, "a person's two steps are not chosen again");
        assert!(verdict.differences.is_empty() && verdict.missing.is_empty(), "{verdict:?}");
    }

    #[test]
    fn a_changed_record_is_found_at_its_first_step() {
        let check = |change: fn(&mut Episode), step: u32, what: &str| {
            let mut explored = walked();
            change(&mut explored.episodes[0]);
            let verdict = verified(&explored);
            let found: Vec<_> =
                verdict.differences.iter().map(|difference| (difference.step, difference.what)).collect();
            assert_eq!(found, [(step, what)]);
        };
        check(|episode| episode.start_hash = "00".into(), 0, "start");
        check(
            |episode| {
                episode.trace[3].outcome = crate::house::Outcome::Impossible(crate::house::outcome::Reason::Blocked)
            },
            4,
            "outcome",
        );
        check(|episode| episode.trace[0].kind = ActionType::Slice, 1, "choice");
        check(|episode| episode.completed += 1, 0, "result");
    }

    #[test]
    fn a_policy_that_is_not_at_hand_is_named_and_its_actions_are_replayed() {
        let explored = walked();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run");
        session_export::write(&explored, &path).unwrap();
        let run = RecordedRun::open(&path, None).unwrap();
        let verdict = verify(&run, &mut |_| Ok(None), 1, &mut |_| ()).unwrap();
        assert_eq!((verdict.steps, verdict.choices, verdict.missing), (8, 0, vec!["random".to_string()]));
    }

    #[test]
    fn an_evaluation_by_any_number_of_threads_verifies_bit_for_bit_near_ties_included() {
        let _chance = crate::nets::testing::chance();
        if undecided().is_none() {
            return;
        }
        crate::nets::device::set_threads(1);
        let make: Arc<MakePolicy> = Arc::new(|| Ok(Box::new(undecided().context("no sentence encoder")?)));
        let source = PolicySource::of("undecided", make.clone());
        let (folder, set) = tasks();
        let file = folder.path().join("tasks.json");
        for jobs in [1, 2, 3] {
            let path = folder.path().join(format!("run-{jobs}"));
            let options = Options { jobs, ..options() };
            let scenes = Scenes::of(&file, &set.value);
            let evaluation = Evaluation::prepare(&set, scenes, options, "undecided", None).unwrap();
            let mut run_folder = RunWriter::open(&path, evaluation.manifest()).unwrap();
            let stop = Arc::new(AtomicBool::new(false));
            evaluate(&evaluation, &make, &mut run_folder, &stop, &mut |_| ()).unwrap();
            let run = RecordedRun::open(&path, Some(&file)).unwrap();
            let verdict = verify(&run, &mut |_| Ok(Some(source.clone())), 4 - jobs, &mut |_| ()).unwrap();
            assert!(verdict.is_equal() && verdict.episodes == 12, "{jobs} jobs: {verdict:?}");
            assert_eq!(verdict.choices, verdict.steps);
        }
    }
}
