//! Time travel: states are looked at as they were remembered; the environment is brought to one when it has to act there.

use anyhow::Context;

use super::exploration::RemoteExploration;
use crate::agent::Decision;
use crate::env::Environment;
use crate::env::remote::RemoteEnvironment;
use crate::episode::record::TraceStep;
use crate::episode::rollout::Rollout;

impl RemoteExploration {
    /// Takes a step of the branch in hand in hand, or its end.
    pub(crate) fn seek(&mut self, step: u32) {
        self.tree.seek(step);
        self.settle();
    }

    /// Takes another branch in hand.
    ///
    /// # Errors
    /// When there is none of that place.
    pub(crate) fn switch(&mut self, branch: usize) -> anyhow::Result<()> {
        let many = self.tree.branches().len();
        anyhow::ensure!(self.tree.switch(branch), "there is no branch {}; there are {many}", branch + 1);
        self.settle();
        Ok(())
    }

    /// Brings the environment to the state in hand: by a snapshot where it makes any, else by the same actions from the same
    /// seed. What differs then is noted, and exactness no longer claimed.
    pub(super) fn bring(&mut self) -> anyhow::Result<()> {
        let here = self.tree.here();
        let is_broken = self.rollout.env.session().is_broken();
        if self.real == here && !is_broken {
            return Ok(());
        }
        if !is_broken
            && let Some(snapshot) = self.tree.present().snapshot.clone()
            && self.rollout.env.restore(&snapshot).is_ok()
        {
            self.real = here;
            return self.compare(self.tree.present().step);
        }
        let way = self.tree.way(here);
        // From where the environment is, if that is on the way.
        let from = match way.iter().position(|&state| state == self.real) {
            Some(at) if !is_broken => at,
            _ => {
                let session = self.sessions.get(0, &self.name)?;
                let env = RemoteEnvironment::begin(session, self.seed)?;
                self.rollout = Rollout::new(env, String::new(), None);
                self.note(0, self.rollout.env.fingerprint() == Some(self.tree.start().observation.digest.clone()));
                0
            }
        };
        for &state in &way[from + 1..] {
            let (action, step, record) = {
                let state = self.tree.state(state);
                let taken = state.taken.as_ref().context("a state that nothing led to")?;
                (taken.record.action_in(&self.rollout.env)?, state.step, taken.record.clone())
            };
            let tick = self.rollout.carry_out(Decision::of(action)).with_context(|| format!("step {step} again"))?;
            let again = TraceStep::of(&tick, &self.rollout);
            self.note(step, again.own == record.own && again.outcome == record.outcome);
        }
        self.real = here;
        self.was_retraced = true;
        self.compare(self.tree.present().step)
    }

    /// Notes the first step at which what is seen differs from what was remembered.
    fn note(&mut self, step: u32, is_same: bool) {
        if !is_same && self.differs_at.is_none() {
            self.differs_at = Some(step);
        }
    }

    /// What is in hand is what is seen now, whatever was remembered.
    fn compare(&mut self, step: u32) -> anyhow::Result<()> {
        let seen = self.seen()?;
        let is_same = seen.digest == self.tree.present().observation.digest;
        self.note(step, is_same);
        if !is_same || self.tree.present().observation.picture.is_none() {
            self.tree.see_again(seen);
        }
        Ok(())
    }

    /// How far going back can be trusted, in words.
    pub(crate) fn exactness(&self) -> String {
        let session = self.rollout.env.session();
        match (self.differs_at, session.capabilities.snapshot, session.capabilities.deterministic) {
            (Some(0), ..) => "not exact: the same seed begins otherwise".into(),
            (Some(step), ..) => format!("not exact: taken again, step {step} showed something else"),
            (None, true, _) => "exact: by snapshots".into(),
            (None, false, _) if self.was_retraced => "exact so far: the same actions showed the same".into(),
            (None, false, Some(true)) => "exact: it says that it is deterministic".into(),
            (None, false, Some(false)) => "not exact: it says that it is not deterministic".into(),
            (None, false, None) => "by the same actions again; not tried yet".into(),
        }
    }
}
