//! The replay of a finetuning: every step that was collected, appended to two files. Killed at any time, what was appended
//! after the last saved state is dropped, and collected again.

use std::fs::File;
use std::io::{BufRead, BufReader, Seek, SeekFrom, Write};
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use tch::{Device, Kind, Tensor};

use crate::algo::batch::Transitions;
use crate::data::plain_file;
use crate::nets::shared_rows::SharedRows;
use crate::nets::visual::SIDE;

/// One step of a rollout.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ReplayStep {
    /// The action, by its place in the action head.
    pub(super) action: u8,
    /// The class of its target, by its place in the object head; 0 for navigation.
    pub(super) object: u8,
    /// 1 / N where it completed one of N subtasks.
    pub(super) reward: f32,
    /// It completed the last one. A rollout that ends at its horizon has no such step.
    pub(super) terminal: bool,
}

/// A rollout, without what was seen.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ReplayEpisode {
    /// The share of random actions.
    pub(super) epsilon: f64,
    /// Subtasks that were completed.
    pub(super) completed: u32,
    /// Of how many.
    pub(super) of: u32,
    /// What was done; one frame more was seen.
    pub(super) steps: Vec<ReplayStep>,
}

impl ReplayEpisode {
    /// The sum of its rewards: the share of the subtasks that was completed.
    pub(super) fn episode_return(&self) -> f64 {
        f64::from(self.completed) / f64::from(self.of.max(1))
    }
}

/// All rollouts of one task's training.
pub(super) struct Replay {
    /// Feature maps, 16-bit floats, frame after frame.
    maps: File,
    /// A rollout a line.
    lines: File,
    folder: PathBuf,
    episodes: Vec<ReplayEpisode>,
    /// The steps before each rollout, and at the end all steps.
    steps_before: Vec<u64>,
    /// Bytes of a map.
    width: usize,
}

impl Replay {
    /// Opens the files in `folder`, or begins them, and keeps the first rollouts of them; a map has so many numbers.
    ///
    /// # Errors
    /// When they cannot be read or written, or hold fewer rollouts.
    pub(super) fn open(folder: &Path, numbers: usize, keep: u64) -> anyhow::Result<Replay> {
        let open = |name: &str| {
            let path = folder.join(name);
            let options = plain_file::change(&path);
            options.with_context(|| format!("{} cannot be written", path.display()))
        };
        let (maps, lines) = (open("replay_maps.bin")?, open("replay.jsonl")?);
        let mut replay = Replay {
            maps,
            lines,
            folder: folder.to_owned(),
            episodes: Vec::new(),
            steps_before: vec![0],
            width: 2 * numbers,
        };
        let kept = replay.read(keep)?;
        let frames = replay.frames_before(replay.episodes.len()) * replay.width as u64;
        let cut = |file: &mut File, length: u64| -> std::io::Result<()> {
            ensure_length(file, length)?;
            file.set_len(length)?;
            file.seek(SeekFrom::Start(length)).map(drop)
        };
        cut(&mut replay.lines, kept).with_context(|| replay.complaint())?;
        cut(&mut replay.maps, frames).with_context(|| replay.complaint())?;
        Ok(replay)
    }

    /// Reads the first rollouts; returns the bytes of their lines.
    fn read(&mut self, keep: u64) -> anyhow::Result<u64> {
        let mut reader = BufReader::new(self.lines.try_clone()?);
        let (mut line, mut bytes) = (String::new(), 0);
        for number in 1..=keep {
            line.clear();
            let read = reader.read_line(&mut line).with_context(|| self.complaint())?;
            let there = read > 0 && line.ends_with('\n');
            ensure!(there, "{}: holds {} rollouts, and the saved state knows {keep}", self.complaint(), number - 1);
            let episode =
                serde_json::from_str(&line).with_context(|| format!("{}: line {number}", self.complaint()))?;
            self.count(episode);
            bytes += read as u64;
        }
        Ok(bytes)
    }

    fn complaint(&self) -> String {
        self.folder.join("replay.jsonl").display().to_string()
    }

    fn count(&mut self, episode: ReplayEpisode) {
        self.steps_before.push(self.steps() + episode.steps.len() as u64);
        self.episodes.push(episode);
    }

    /// The number of the first frame of a rollout: each has one more than it has steps.
    fn frames_before(&self, episode: usize) -> u64 {
        self.steps_before[episode] + episode as u64
    }

    /// All rollouts, in their order.
    pub(super) fn episodes(&self) -> &[ReplayEpisode] {
        &self.episodes
    }

    /// How many steps were collected.
    pub(super) fn steps(&self) -> u64 {
        self.steps_before[self.steps_before.len() - 1]
    }

    /// The steps of the first rollouts.
    pub(super) fn steps_of_first(&self, episodes: u64) -> u64 {
        self.steps_before[(episodes as usize).min(self.episodes.len())]
    }

    /// Appends a rollout with the maps of its frames, 16-bit floats.
    ///
    /// # Errors
    /// When there is not one frame more than steps, a map is no number, or the disk is full.
    pub(super) fn append(&mut self, episode: ReplayEpisode, maps: &[u8]) -> anyhow::Result<()> {
        let frames = episode.steps.len() + 1;
        ensure!(maps.len() == frames * self.width, "{} bytes are not {frames} maps of {}", maps.len(), self.width);
        let mut line = serde_json::to_vec(&episode)?;
        line.push(b'\n');
        self.maps.write_all(maps).and_then(|()| self.lines.write_all(&line)).with_context(|| self.complaint())?;
        self.count(episode);
        Ok(())
    }

    /// Brings everything onto the disk: a state that is saved after it finds it there.
    ///
    /// # Errors
    /// When the disk is full.
    pub(super) fn sync(&self) -> anyhow::Result<()> {
        self.maps.sync_data().and_then(|()| self.lines.sync_data()).with_context(|| self.complaint())
    }

    /// Transitions of any rollouts, each step as likely, whose observations are of `history` frames; before the first of a
    /// rollout there was the first one. `conditioning` [1, ...] is the task's.
    ///
    /// # Errors
    /// When there are none, or the disk fails.
    pub(super) fn draw(
        &self,
        rng: &mut ChaCha8Rng,
        size: usize,
        history: i64,
        conditioning: &Tensor,
    ) -> anyhow::Result<Transitions> {
        ensure!(self.steps() > 0, "nothing was collected yet");
        let drawn: Vec<u64> = (0..size).map(|_| rng.random_range(0..self.steps())).collect();
        self.transitions(&drawn, history, conditioning)
    }

    /// The transitions of some steps, by their numbers.
    fn transitions(&self, numbers: &[u64], history: i64, conditioning: &Tensor) -> anyhow::Result<Transitions> {
        let (mut bytes, mut steps) = (Vec::new(), Vec::with_capacity(numbers.len()));
        for &number in numbers {
            let episode = self.steps_before.partition_point(|&before| before <= number) - 1;
            let at = number - self.steps_before[episode];
            steps.push(self.episodes[episode].steps[at as usize]);
            self.stack(self.frames_before(episode), at + 1, history as u64 + 1, &mut bytes)?;
        }
        let (n, device) = (numbers.len() as i64, conditioning.device());
        let maps = Tensor::f_from_data_size(&bytes, &[n, history + 1, self.width as i64 / 2], Kind::Half)?;
        let maps = maps.to_device(device).view([n, history + 1, -1, SIDE, SIDE]);
        let column = |of: fn(&ReplayStep) -> f32| {
            Tensor::from_slice(&steps.iter().map(of).collect::<Vec<f32>>()).to_device(device)
        };
        let indices = |of: fn(&ReplayStep) -> u8| column_of_indices(&steps, of, device);
        Ok(Transitions {
            observation: maps.narrow(1, 0, history),
            next: Some(maps.narrow(1, 1, history)),
            rows: None,
            conditioning: SharedRows::repeated(conditioning, n),
            actions: indices(|step| step.action),
            objects: indices(|step| step.object),
            object_target: indices(|step| step.object),
            reward: column(|step| step.reward),
            terminal: column(|step| f32::from(u8::from(step.terminal))),
            executed: Tensor::ones([n], (Kind::Float, device)),
        })
    }

    /// Appends the maps of the last `count` frames up to `last` of the rollout whose first frame is `first`.
    fn stack(&self, first: u64, last: u64, count: u64, into: &mut Vec<u8>) -> anyhow::Result<()> {
        let missing = count.saturating_sub(last + 1);
        let from = (last + 1).saturating_sub(count);
        let begun = into.len();
        into.resize(begun + count as usize * self.width, 0);
        let whole = begun + missing as usize * self.width;
        let at = (first + from) * self.width as u64;
        self.maps.read_exact_at(&mut into[whole..], at).with_context(|| self.complaint())?;
        for gap in 0..missing as usize {
            into.copy_within(whole..whole + self.width, begun + gap * self.width);
        }
        Ok(())
    }
}

fn column_of_indices(steps: &[ReplayStep], of: fn(&ReplayStep) -> u8, device: Device) -> Tensor {
    Tensor::from_slice(&steps.iter().map(|step| i64::from(of(step))).collect::<Vec<i64>>()).to_device(device)
}

/// A file that is shorter than what is to be kept of it has lost something.
fn ensure_length(file: &File, length: u64) -> std::io::Result<()> {
    let found = file.metadata()?.len();
    match found < length {
        true => Err(std::io::Error::other(format!("its maps are {found} bytes, and should be {length} at least"))),
        false => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;

    /// One channel.
    const NUMBERS: usize = (SIDE * SIDE) as usize;

    fn step(action: u8, reward: f32, terminal: bool) -> ReplayStep {
        ReplayStep { action, object: action % 2, reward, terminal }
    }

    fn episode(steps: Vec<ReplayStep>) -> ReplayEpisode {
        let completed = steps.iter().filter(|step| step.reward > 0.0).count() as u32;
        ReplayEpisode { epsilon: 0.25, completed, of: 2, steps }
    }

    /// Maps that are filled with the numbers from `first` on.
    fn maps(first: i64, count: i64) -> Vec<u8> {
        let numbers = Tensor::arange_start(first, first + count, (Kind::Half, Device::Cpu));
        let all = numbers.unsqueeze(1).expand([count, NUMBERS as i64], false).contiguous();
        let mut bytes = vec![0; all.numel() * 2];
        all.copy_data_u8(&mut bytes, all.numel());
        bytes
    }

    /// Two rollouts: of three steps, whose frames are 0 to 3, and of one step, whose frames are 10 and 11.
    fn filled(folder: &Path) -> Replay {
        let mut replay = Replay::open(folder, NUMBERS, 0).unwrap();
        replay
            .append(episode(vec![step(0, 0.0, false), step(1, 0.5, false), step(2, 0.5, true)]), &maps(0, 4))
            .unwrap();
        replay.append(episode(vec![step(3, 0.0, false)]), &maps(10, 2)).unwrap();
        replay
    }

    fn frames(observation: &Tensor) -> Vec<Vec<f64>> {
        let size = observation.size();
        (0..size[0])
            .map(|n| (0..size[1]).map(|k| observation.get(n).get(k).get(0).get(0).double_value(&[0])).collect())
            .collect()
    }

    #[test]
    fn transitions_have_their_own_frames_and_before_a_rollout_its_first_one() {
        let folder = tempfile::tempdir().unwrap();
        let replay = filled(folder.path());
        let found = replay.transitions(&[0, 1, 2, 3], 3, &Tensor::zeros([1, 4], (Kind::Float, Device::Cpu))).unwrap();
        assert_eq!(
            frames(&found.observation),
            [[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 2.0], [10.0, 10.0, 10.0]].map(Vec::from)
        );
        assert_eq!(
            frames(found.next.as_ref().unwrap()),
            [[0.0, 0.0, 1.0], [0.0, 1.0, 2.0], [1.0, 2.0, 3.0], [10.0, 10.0, 11.0]].map(Vec::from)
        );
        let numbers = |tensor: &Tensor| Vec::<f32>::try_from(tensor.to_kind(Kind::Float)).unwrap();
        assert_eq!(numbers(&found.actions), [0.0, 1.0, 2.0, 3.0]);
        assert_eq!(numbers(&found.reward), [0.0, 0.5, 0.5, 0.0]);
        assert_eq!(numbers(&found.terminal), [0.0, 0.0, 1.0, 0.0], "a rewarded step need not end it, nor a timeout");
        assert_eq!((found.conditioning.count(), found.conditioning.numbers().size()), (1, vec![4]));
        assert_eq!((replay.steps(), replay.steps_of_first(1), replay.steps_of_first(9)), (4, 3, 4));
        assert_eq!(replay.episodes().iter().map(ReplayEpisode::episode_return).collect::<Vec<_>>(), [1.0, 0.0]);
    }

    #[test]
    fn what_came_after_the_saved_state_is_dropped_and_what_it_knows_must_be_there() {
        let folder = tempfile::tempdir().unwrap();
        drop(filled(folder.path()));
        let files = || ["replay_maps.bin", "replay.jsonl"].map(|name| std::fs::read(folder.path().join(name)).unwrap());
        let whole = files();
        // Killed in the middle of a line and of a map.
        for (name, bytes) in ["replay_maps.bin", "replay.jsonl"].iter().zip(&whole) {
            std::fs::write(folder.path().join(name), [&bytes[..], &[7; 9]].concat()).unwrap();
        }
        let again = Replay::open(folder.path(), NUMBERS, 2).unwrap();
        assert_eq!((again.steps(), files() == whole), (4, true));
        let mut fewer = Replay::open(folder.path(), NUMBERS, 1).unwrap();
        assert_eq!(fewer.steps(), 3);
        fewer.append(again.episodes()[1].clone(), &maps(10, 2)).unwrap();
        assert!(files() == whole, "what is collected again is what was dropped");
        let error = format!("{:#}", Replay::open(folder.path(), NUMBERS, 3).err().unwrap());
        assert!(error.contains("holds 2 rollouts, and the saved state knows 3"), "{error}");
        std::fs::write(folder.path().join("replay_maps.bin"), &whole[0][..20]).unwrap();
        let error = format!("{:#}", Replay::open(folder.path(), NUMBERS, 2).err().unwrap());
        assert!(error.contains("20 bytes, and should be"), "{error}");
    }

    #[test]
    fn what_is_drawn_depends_on_the_random_numbers_alone() {
        let folder = tempfile::tempdir().unwrap();
        let replay = filled(folder.path());
        let conditioning = Tensor::zeros([1, 4], (Kind::Float, Device::Cpu));
        let draw = |seed| replay.draw(&mut ChaCha8Rng::seed_from_u64(seed), 40, 5, &conditioning).unwrap();
        let (one, other) = (draw(1), draw(1));
        assert!(one.observation == other.observation && one.actions == other.actions);
        let actions = Vec::<i64>::try_from(&one.actions).unwrap();
        assert!((0..4).all(|action| actions.contains(&action)), "{actions:?}");
        let empty = tempfile::tempdir().unwrap();
        assert!(
            Replay::open(empty.path(), NUMBERS, 0)
                .unwrap()
                .draw(&mut ChaCha8Rng::seed_from_u64(1), 1, 5, &conditioning)
                .is_err()
        );
    }
}
