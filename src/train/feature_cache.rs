//! Feature maps: every frame of datasets is drawn and encoded once; the maps are kept in each dataset's cache folder.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::sync_channel;

use anyhow::Context;
use sha2::{Digest, Sha256};
use tch::{Device, Kind, Tensor};

use super::frame_store::FrameStore;
use super::metrics::{ProgressLogger, Scalars};
use crate::data::Dataset;
use crate::data::features::{FeatureHeader, FeatureWriter, Features};
use crate::house::House;
use crate::house::render::Renderer;
use crate::nets::device;
use crate::nets::frozen::FrameEncoder;
use crate::nets::visual::SIDE;

/// Frames that are encoded at once; with more, a core's cache no longer holds what lies between two layers.
const BATCH: usize = 32;
/// Trajectories whose first frames tell whether all still look as they did.
const SAMPLED_TRAJECTORIES: usize = 24;

/// The maps of every frame of the store, in its order; `datasets` are those it was opened with. What is missing is computed.
/// Nothing when it was stopped: the same call goes on from there.
///
/// # Errors
/// When a frame cannot be drawn, or a cache be read or written.
pub(crate) fn features(
    encoder: &dyn FrameEncoder,
    datasets: &[Dataset],
    frame_store: &FrameStore,
    logger: &mut dyn ProgressLogger,
    stop: &AtomicBool,
) -> anyhow::Result<Option<Features>> {
    let mut all: Option<Features> = None;
    for (dataset, trajectories) in datasets.iter().zip(&frame_store.parts) {
        let header = FeatureHeader {
            format_version: FeatureHeader::FORMAT,
            encoder: encoder.digest().to_string(),
            dataset: format!("{}-{}", dataset.digest()?, appearance_digest(frame_store, trajectories)?),
            maps: frame_store.frames_of(trajectories) as u64,
            numbers: (encoder.features() * SIDE * SIDE) as u64,
        };
        let cache = dataset.folder().join("cache");
        let mut found = Features::read(&cache, &header)?;
        if found.is_none() {
            if !encode(encoder, frame_store, trajectories.clone(), &cache, &header, logger, stop)? {
                return Ok(None);
            }
            found = Features::read(&cache, &header)?;
        }
        let found = found.with_context(|| format!("{} changed meanwhile", cache.display()))?;
        match &mut all {
            Some(all) => all.append(found),
            None => all = Some(found),
        }
    }
    Ok(all)
}

/// Identifies how frames look, from a few of them: scenes and their drawing are no part of a dataset's trajectories.
fn appearance_digest(frame_store: &FrameStore, trajectories: &Range<usize>) -> anyhow::Result<String> {
    let mut hash = Sha256::new();
    let mut renderer = Renderer::new(House::FRAME);
    for trajectory in trajectories.clone().step_by(trajectories.len().div_ceil(SAMPLED_TRAJECTORIES).max(1)) {
        hash.update(&renderer.draw(frame_store.scene(trajectory)?, &frame_store.trajectories[trajectory].start).rgb);
    }
    Ok(format!("{:x}", hash.finalize())[..8].to_string())
}

/// Computes the map of every frame of some trajectories into `folder`, a thread a core, each drawing and encoding whole trajectories.
/// What an interrupted call left is taken up. Returns false when it was stopped.
///
/// # Errors
/// When a frame cannot be drawn or the file not be written.
pub(crate) fn encode(
    encoder: &dyn FrameEncoder,
    frame_store: &FrameStore,
    trajectories: Range<usize>,
    folder: &Path,
    header: &FeatureHeader,
    logger: &mut dyn ProgressLogger,
    stop: &AtomicBool,
) -> anyhow::Result<bool> {
    let mut writer = FeatureWriter::open(folder, header.clone())?;
    let frames_until = |end: usize| frame_store.frames_of(&(trajectories.start..end)) as u64;
    let mut written = trajectories.start;
    while written < trajectories.end && frames_until(written + 1) <= writer.maps() {
        written += 1;
    }
    writer.keep(frames_until(written))?;
    let next = AtomicUsize::new(written);
    let threads = rayon::current_num_threads();
    let whole = device::threads();
    let (sender, receiver) = sync_channel(2 * threads);
    let result = std::thread::scope(|scope| {
        for _ in 0..threads {
            let (encoder, sender, next, end) = (encoder.share(), sender.clone(), &next, trajectories.end);
            scope.spawn(move || {
                // The threads are one a core; libtorch should not start more.
                device::set_threads(1);
                let mut renderer = Renderer::new(House::FRAME);
                while !stop.load(Ordering::Relaxed) {
                    let trajectory = next.fetch_add(1, Ordering::Relaxed);
                    let done = trajectory >= end;
                    if done
                        || sender.send((trajectory, maps(&*encoder, frame_store, trajectory, &mut renderer))).is_err()
                    {
                        break;
                    }
                }
            });
        }
        drop(sender);
        let mut waiting = BTreeMap::new();
        for (trajectory, maps) in receiver {
            waiting.insert(trajectory, maps?);
            while let Some(maps) = waiting.remove(&written) {
                writer.add(&maps)?;
                written += 1;
                logger.log(&Scalars::new("features", frames_until(written), header.maps))?;
            }
        }
        anyhow::Ok(written == trajectories.end)
    });
    device::set_threads(whole);
    let finished = result?;
    if finished {
        writer.finish()?;
    }
    Ok(finished)
}

/// The maps of a trajectory's frames: little-endian 16-bit floats.
fn maps(
    encoder: &dyn FrameEncoder,
    frame_store: &FrameStore,
    trajectory: usize,
    renderer: &mut Renderer,
) -> anyhow::Result<Vec<u8>> {
    let (mut images, mut bytes) = (Vec::with_capacity(BATCH), Vec::new());
    frame_store.replay(trajectory, |scene, world, _| {
        images.push(encoder.image(renderer.draw(scene, world)));
        if images.len() == BATCH {
            add_half(&encoder.encode(&images), &mut bytes)?;
            images.clear();
        }
        Ok(())
    })?;
    if !images.is_empty() {
        add_half(&encoder.encode(&images), &mut bytes)?;
    }
    Ok(bytes)
}

/// Appends a tensor's numbers as 16-bit floats.
///
/// # Errors
/// When they cannot be read.
pub(super) fn add_half(tensor: &Tensor, bytes: &mut Vec<u8>) -> anyhow::Result<()> {
    let half = tensor.to_device(Device::Cpu).to_kind(Kind::Half).contiguous();
    let filled = bytes.len();
    bytes.resize(filled + half.numel() * 2, 0);
    half.f_copy_data_u8(&mut bytes[filled..], half.numel())?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nets::visual::{HouseEncoder, VisualSpec};
    use crate::train::visual::testing::{RecordedScalars, frame_store};
    use tch::nn;

    fn encoder() -> impl FrameEncoder {
        tch::manual_seed(2);
        let store = nn::VarStore::new(Device::Cpu);
        let spec = VisualSpec { image_size: 112, channels: vec![4, 4, 8, 16] };
        HouseEncoder::new(&store.root(), &spec).frozen(&store).unwrap()
    }

    fn header() -> FeatureHeader {
        FeatureHeader { format_version: 1, encoder: "e".into(), dataset: "d".into(), maps: 10, numbers: 16 * 49 }
    }

    #[test]
    fn every_frame_gets_its_map() {
        let _chance = crate::nets::testing::chance();
        let (frame_store, encoder, folder) = (frame_store(), encoder(), tempfile::tempdir().unwrap());
        let (mut recorded, stop) = (RecordedScalars(Vec::new()), AtomicBool::new(false));
        assert!(encode(&encoder, &frame_store, 0..2, folder.path(), &header(), &mut recorded, &stop).unwrap());
        let features = Features::read(folder.path(), &header()).unwrap().unwrap();
        let map = |frame| {
            let mut bytes = Vec::new();
            features.gather_all([frame].into_iter(), &mut bytes).unwrap();
            bytes
        };
        assert_eq!(features.len(), 10);
        // Both trajectories start in one state, and four turns lead back to it.
        assert_eq!(map(0), map(5));
        assert_eq!(map(1), map(8));
        assert_ne!(map(0), map(1));
        assert_eq!(recorded.0.iter().map(|note| note.step).collect::<Vec<_>>(), [5, 10]);
    }

    #[test]
    fn an_encoding_that_was_cut_off_goes_on_at_a_whole_trajectory() {
        let _chance = crate::nets::testing::chance();
        let (frame_store, encoder) = (frame_store(), encoder());
        let stop = AtomicBool::new(false);
        let run = |folder: &Path, recorded: &mut RecordedScalars| {
            encode(&encoder, &frame_store, 0..2, folder, &header(), recorded, &stop).unwrap();
            std::fs::read(folder.join(header().file_name())).unwrap()
        };
        let (whole, parts) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let bytes = run(whole.path(), &mut RecordedScalars(Vec::new()));
        let part = parts.path().join(header().file_name() + ".part");
        std::fs::write(&part, &bytes[..bytes.len() * 7 / 10]).unwrap();
        let mut recorded = RecordedScalars(Vec::new());
        assert!(bytes == run(parts.path(), &mut recorded));
        assert_eq!(recorded.0.len(), 1, "only the second trajectory is computed");
    }

    #[test]
    fn when_it_is_stopped_nothing_is_put_in_place() {
        let _chance = crate::nets::testing::chance();
        let (frame_store, encoder, folder) = (frame_store(), encoder(), tempfile::tempdir().unwrap());
        let (mut recorded, stop) = (RecordedScalars(Vec::new()), AtomicBool::new(true));
        assert!(!encode(&encoder, &frame_store, 0..2, folder.path(), &header(), &mut recorded, &stop).unwrap());
        assert!(Features::read(folder.path(), &header()).unwrap().is_none());
    }
}
