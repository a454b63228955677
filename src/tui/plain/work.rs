//! Chains and value maps in lines of text.

use std::cell::RefCell;
use std::io::Write;
use std::sync::atomic::AtomicBool;

use crate::run::chain::Draws;
use crate::run::chain::{Play, Rate};
use crate::run::landscape::survey;
use crate::tui::chained::Chained;
use crate::tui::engine::Engine;
use crate::tui::worker::Report;

pub(super) fn chain(engine: &Engine, text: &str, draws: Option<Draws>, out: &mut impl Write) -> anyhow::Result<()> {
    let chain = engine.chain(text)?;
    let known = RefCell::new(Chained::default());
    let tell = |report: Report| {
        if let Report::Chained(chained) = report {
            known.replace(*chained);
        }
        true
    };
    Chained::work(&chain, engine.another_policy()?.as_mut(), draws, &AtomicBool::new(false), &tell)?;
    let known = known.into_inner();
    let word = |play: &Option<Play>, at: usize| match play.as_ref().and_then(|play| play.outcomes.get(at)) {
        Some(outcome) if !outcome.reached => "not reached".to_string(),
        Some(outcome) => match outcome.done {
            Some(true) => format!("done in {}", outcome.steps),
            Some(false) => format!("failed after {}", outcome.steps),
            None => format!("{} steps", outcome.steps),
        },
        None => "-".into(),
    };
    for (at, link) in known.links.iter().enumerate() {
        write!(
            out,
            "link {}: {link} by link: {}; as one: {}",
            at + 1,
            word(&known.by_link, at),
            word(&known.as_one, at)
        )?;
        if let Some(trials) = &known.trials {
            let rate =
                |rates: &[Rate]| rates.get(at).map_or(String::new(), |rate| format!("{} of {}", rate.done, rate.of));
            write!(out, "; from the expert's entry {}, from its own {}", rate(&trials.expert), rate(&trials.own))?;
        }
        writeln!(out)?;
    }
    match known.trials.as_ref().map(|trials| trials.weakest()) {
        Some(Some(at)) => writeln!(out, "link {} breaks the chain", at + 1)?,
        Some(None) => writeln!(out, "no link breaks")?,
        None => {}
    }
    Ok(())
}

pub(super) fn values(engine: &Engine, out: &mut impl Write) -> anyhow::Result<()> {
    let house = &engine.rollout().house;
    let mut policy = engine.another_policy()?;
    let (stop, told) = (AtomicBool::new(false), engine.instruction());
    let mut found = survey(policy.as_mut(), house.scene(), house.world(), told, &stop, &mut |_| true)?;
    found.heights.sort_by(|a, b| b.facing(None).1.total_cmp(&a.facing(None).1));
    writeln!(out, "{} of {} cells ({})", found.heights.len(), found.of, found.measure.words())?;
    for height in found.heights.iter().take(10) {
        let (heading, value) = height.facing(None);
        writeln!(out, "cell {},{} facing {}: {value:.2}", height.cell.x, height.cell.z, heading.name())?;
    }
    Ok(())
}
