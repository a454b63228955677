//! Logit adjustment after training (Menon et al. 2021): a clone walks ahead for half of what it was shown and is never sure
//! when to turn, so that the likeliest action is to walk on past the turn. Taking part of what is merely frequent off the
//! logits lets rarer actions win where the view speaks for them.

use serde::{Deserialize, Serialize};

use crate::domain::ActionType;

/// How often each action was shown, and how much of that is taken off when an agent decides.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct LogitAdjustment {
    /// The share of the log shares that is taken off: 0 none, 1 all, as if every action had been shown alike.
    pub(crate) strength: f32,
    /// Each action's share of the labels, in the order of the action head; 0 where it never was.
    pub(crate) action_frequencies: Vec<f32>,
}

impl LogitAdjustment {
    /// Takes what is frequent off the logits of the action head; those of the most frequent action stay as they are, since
    /// only differences count, and so does one that was never shown, of which nothing is known.
    pub(crate) fn apply(&self, logits: &mut [f32]) {
        let most = self.action_frequencies.iter().copied().fold(f32::MIN_POSITIVE, f32::max);
        for (logit, share) in logits.iter_mut().zip(&self.action_frequencies) {
            if *share > 0.0 {
                *logit -= self.strength * (share / most).ln();
            }
        }
    }

    /// What is wrong with it, if something is.
    ///
    /// # Errors
    /// When the strength is no share, or there is not one share for each action.
    pub(crate) fn check(&self) -> Result<(), String> {
        if !(0.0..=1.0).contains(&self.strength) {
            return Err(format!("logit_adjustment.strength is {}, which is not a share", self.strength));
        }
        let (found, wanted) = (self.action_frequencies.len(), ActionType::COUNT);
        if found != wanted {
            return Err(format!("logit_adjustment.action_frequencies has {found} numbers, not {wanted}"));
        }
        match self.action_frequencies.iter().find(|share| !(0.0..=1.0).contains(*share)) {
            Some(share) => Err(format!("logit_adjustment.action_frequencies has {share}, which is not a share")),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn logit_adjustment(strength: f32) -> LogitAdjustment {
        let mut shares = vec![0.05; ActionType::COUNT];
        shares[0] = 0.45;
        LogitAdjustment { strength, action_frequencies: shares }
    }

    /// Logits of an agent that knows nothing but how often actions were shown.
    fn knowing_only_shares() -> Vec<f32> {
        logit_adjustment(0.0).action_frequencies.iter().map(|share| share.ln()).collect()
    }

    #[test]
    fn at_full_strength_what_is_merely_frequent_counts_for_nothing() {
        let mut logits = knowing_only_shares();
        logit_adjustment(1.0).apply(&mut logits);
        assert!(logits.iter().all(|logit| (logit - logits[0]).abs() < 1e-6), "{logits:?}");
    }

    #[test]
    fn at_part_of_it_a_rare_action_wins_with_less_evidence_and_at_none_nothing_changes() {
        // One action is e^1 times as likely as its share alone makes it; e^2.2 would be needed.
        let with_evidence = |strength| {
            let mut logits = knowing_only_shares();
            logits[1] += 1.0;
            logit_adjustment(strength).apply(&mut logits);
            logits
        };
        assert!(with_evidence(0.0)[1] < with_evidence(0.0)[0]);
        assert!(with_evidence(0.6)[1] > with_evidence(0.6)[0]);
        let mut untouched = knowing_only_shares();
        logit_adjustment(0.0).apply(&mut untouched);
        assert_eq!(untouched, knowing_only_shares());
    }

    #[test]
    fn an_action_that_was_never_shown_gains_nothing() {
        let mut unseen = logit_adjustment(1.0);
        unseen.action_frequencies[3] = 0.0;
        let mut logits = vec![0.0; ActionType::COUNT];
        unseen.apply(&mut logits);
        assert_eq!((logits[0], logits[3]), (0.0, 0.0));
        assert!(logits[2] > 0.0);
        unseen.check().unwrap();
    }

    #[test]
    fn what_no_training_could_have_seen_is_refused_in_words() {
        logit_adjustment(0.4).check().unwrap();
        let refused = |strength, shares: &[f32]| {
            LogitAdjustment { strength, action_frequencies: shares.to_vec() }.check().unwrap_err()
        };
        assert_eq!(refused(1.5, &[0.1; 12]), "logit_adjustment.strength is 1.5, which is not a share");
        assert_eq!(refused(f32::NAN, &[0.1; 12]), "logit_adjustment.strength is NaN, which is not a share");
        assert_eq!(refused(0.5, &[0.1; 11]), "logit_adjustment.action_frequencies has 11 numbers, not 12");
        assert_eq!(refused(0.5, &[-0.5; 12]), "logit_adjustment.action_frequencies has -0.5, which is not a share");
    }
}
