//! How long an update takes with each preset in its own size once its critic is warm, and how long its batch takes to
//! gather. `cargo bench --bench training -- [PRESET ...]`, where a preset may be a file.

#![allow(clippy::print_stdout)]

mod baseline;

use baseline::CriterionBaselines;
use sprint_explorer::nets::device::best_device;
use sprint_explorer::train::preset::Preset;
use sprint_explorer::train::update_timing::{self, UpdateTiming};
use tch::Device;

const STEPS: u64 = 30;

fn main() -> anyhow::Result<()> {
    let mut asked: Vec<String> = std::env::args().skip(1).filter(|name| !name.starts_with("--")).collect();
    if asked.is_empty() {
        asked = Preset::names().into_iter().map(String::from).collect();
    }
    let device = best_device();
    let mut baselines = CriterionBaselines::open()?;
    println!("{device:?}, {} threads; milliseconds, medians of {STEPS} and the least", tch::get_num_threads());
    println!("{:<18} {:>6} {:>7} {:>8} {:>8} {:>9}", "preset", "batch", "pairs", "update", "least", "gathering");
    for name in asked {
        measure(&update_timing::warm(Preset::named(&name)?), device, &mut baselines)?;
    }
    Ok(())
}

fn measure(preset: &Preset, device: Device, baselines: &mut CriterionBaselines) -> anyhow::Result<()> {
    let UpdateTiming { update, least_update, gathering, least_gathering } =
        update_timing::measure(preset, device, STEPS)?;
    let (batch, pairs) =
        (preset.training.batch_size, preset.chaining.as_ref().map_or(0, |chaining| chaining.batch_size));
    let [update, least, gather] = [update, least_update, gathering].map(|time| time.as_secs_f64() * 1e3);
    println!("{:<18} {batch:>6} {pairs:>7} {update:>8.1} {least:>8.1} {gather:>9.1}", preset.name);
    // Baselines are of the CPU.
    if device == Device::Cpu {
        let threads = tch::get_num_threads();
        for (part, time) in [("update", least_update), ("gathering", least_gathering)] {
            baselines.compare(&format!("training/{}/{part} on {threads} threads", preset.name), time)?;
        }
    }
    Ok(())
}
