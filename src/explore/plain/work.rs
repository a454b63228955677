//! Chains and value maps in lines of text.

use std::io::Write;
use std::sync::atomic::AtomicBool;

use super::Plain;
use crate::agent::registry::{Loaded, PolicyIdentity};
use crate::analysis::chain::{ChainRun, Draws, LinkRate, LinkSuccess};
use crate::analysis::value_map::survey;
use crate::explore::chained::Chained;

impl Plain {
    /// Follows the chain by the policy that acts or another; with `draws`, also which link breaks.
    pub(crate) fn follow(
        &mut self,
        rival: Option<Loaded>,
        draws: Option<Draws>,
        out: &mut impl Write,
    ) -> anyhow::Result<()> {
        let Some(followed) = &self.chain else {
            anyhow::bail!("there is no chain yet: chain A; B; ..., or chain alone for the task's own");
        };
        let own = self.engine.who();
        let (who, mut policy) = match rival {
            Some(Loaded { policy, checkpoint }) => {
                (PolicyIdentity { name: policy.name().to_string(), checkpoint }, policy)
            }
            None => (own.clone(), self.engine.another_policy()?),
        };
        anyhow::ensure!(
            draws.is_some() || self.followed.is_empty() || !self.followed.iter().any(|known| known.who == who),
            "{} acts already: name another",
            who.name
        );
        let at = self.followed.iter().position(|known| known.who == who);
        let known = at.and_then(|at| self.followed.get(at)).cloned();
        let known = known.unwrap_or_else(|| Chained::new(followed, who));
        let found = known.work(followed, policy.as_mut(), draws, &AtomicBool::new(false), &|_| true)?;
        match at.and_then(|at| self.followed.get_mut(at)) {
            Some(place) => *place = found,
            None => self.followed.push(found),
        }
        chain(&self.followed, out)
    }

    /// The cells that are worth most.
    pub(crate) fn values(&self, out: &mut impl Write) -> anyhow::Result<()> {
        let house = &self.engine.rollout().env.house;
        let mut policy = self.engine.another_policy()?;
        let (stop, told) = (AtomicBool::new(false), self.engine.instruction());
        let mut found = survey(policy.as_mut(), house.scene(), house.world(), told, &stop, &mut |_| true)?;
        found.heights.sort_by(|a, b| b.facing(self.heading).1.total_cmp(&a.facing(self.heading).1));
        writeln!(out, "{} of {} cells ({})", found.heights.len(), found.of, found.measure.words())?;
        for height in found.heights.iter().take(10) {
            let (heading, value) = height.facing(self.heading);
            writeln!(out, "cell {},{} facing {}: {value:.2}", height.cell.x, height.cell.z, heading.name())?;
        }
        Ok(())
    }
}

/// How each link came out, by every policy that followed the chain.
pub(crate) fn chain(followed: &[Chained], out: &mut impl Write) -> anyhow::Result<()> {
    let word = |play: &Option<ChainRun>, at: usize| match play.as_ref().and_then(|play| play.outcomes.get(at)) {
        Some(outcome) if !outcome.reached => "not reached".to_string(),
        Some(outcome) => match outcome.done {
            Some(true) => format!("done in {}", outcome.steps),
            Some(false) => format!("failed after {}", outcome.steps),
            None => format!("{} steps", outcome.steps),
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
