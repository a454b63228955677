//! Chains and value maps in lines of text.

use std::io::Write;

use crate::analysis::chain::{ChainRun, LinkRate, LinkSuccess};
use crate::analysis::value_map::ValueMap;
use crate::domain::Heading;
use crate::explore::chain_report::ChainReport;
use crate::language::count::counted;

/// The cells that are worth most.
pub(super) fn values(map: &ValueMap, heading: Option<Heading>, out: &mut impl Write) -> anyhow::Result<()> {
    let mut cells = map.cells.clone();
    cells.sort_by(|a, b| b.facing(heading).1.total_cmp(&a.facing(heading).1));
    writeln!(out, "{} of {} cells ({})", cells.len(), map.of, map.measure.words())?;
    for cell in cells.iter().take(10) {
        let (heading, value) = cell.facing(heading);
        writeln!(out, "cell {},{} facing {}: {value:.2}", cell.cell.x, cell.cell.z, heading.name())?;
    }
    Ok(())
}

/// How each link came out, by every policy that followed the chain.
pub(super) fn chains(followed: &[ChainReport], out: &mut impl Write) -> anyhow::Result<()> {
    let word = |play: &Option<ChainRun>, at: usize| match play.as_ref().and_then(|play| play.outcomes.get(at)) {
        Some(outcome) if !outcome.reached => "not reached".to_string(),
        Some(outcome) => match outcome.done {
            Some(true) => format!("done in {}", outcome.steps),
            Some(false) => format!("failed after {}", outcome.steps),
            None => counted(outcome.steps, "step"),
        },
        None => "-".into(),
    };
    for (at, link) in followed.first().map_or(&[][..], |known| &known.links).iter().enumerate() {
        write!(out, "link {}: {link}", at + 1)?;
        for known in followed {
            write!(
                out,
                " {} by link: {}; as one: {}",
                known.who.name,
                word(&known.by_link, at),
                word(&known.as_one, at)
            )?;
            if let Some(trials) = &known.trials {
                let rate = |rates: &[LinkRate]| {
                    rates.get(at).map_or(String::new(), |rate| format!("{} of {}", rate.done, rate.of))
                };
                write!(out, "; from the expert's entry {}, from its own {}", rate(&trials.expert), rate(&trials.own))?;
            }
            if let Some(handover) = known.by_link.as_ref().and_then(|play| play.outcomes.get(at)?.handover) {
                let (target, next, joined) = (handover.target(), handover.next, handover.joined);
                write!(out, "; target {target:.2}, eq. 4 min Q {next:.2}, eq. 5 min Q {joined:.2}")?;
            }
            write!(out, ".")?;
        }
        writeln!(out)?;
    }
    for known in followed {
        match known.trials.as_ref().filter(|trials| trials.is_complete()).map(LinkSuccess::weakest) {
            Some(Some(at)) => writeln!(out, "{}: link {} breaks the chain", known.who.name, at + 1)?,
            Some(None) => writeln!(out, "{}: no link breaks", known.who.name)?,
            None => {}
        }
    }
    Ok(())
}
