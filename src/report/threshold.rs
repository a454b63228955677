//! A figure that a run must reach, so that a script can stop when an agent got worse.

use std::collections::BTreeMap;

use super::summary::RunSummary;

/// A figure that a run must reach, as `METRIC=X`.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Threshold {
    metric: String,
    least: f64,
}

impl Threshold {
    /// What may stand left of the equals sign.
    pub(crate) const METRICS: &str = "success, completed_subtasks, progress, success_by_length.N, progress_by_length.N";

    /// The measured figure when it falls short; `None` when it is reached.
    ///
    /// # Errors
    /// When no episode has that many subtasks.
    pub(crate) fn missed_by(&self, summary: &RunSummary) -> anyhow::Result<Option<f64>> {
        let of_length =
            |map: &BTreeMap<u32, f64>, length: &str| length.parse().ok().and_then(|n: u32| map.get(&n).copied());
        let measured = match self.metric.split_once('.') {
            None => match self.metric.as_str() {
                "success" => Some(summary.success),
                "completed_subtasks" => Some(summary.completed_subtasks.mean),
                _ => Some(summary.progress.mean),
            },
            Some(("success_by_length", length)) => of_length(&summary.success_by_length, length),
            Some((_, length)) => of_length(&summary.progress_by_length, length),
        };
        let measured =
            measured.ok_or_else(|| anyhow::anyhow!("no episode has {}: no task is that long", self.metric))?;
        Ok((measured < self.least).then_some(measured))
    }
}

impl std::fmt::Display for Threshold {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}={}", self.metric, self.least)
    }
}

impl std::str::FromStr for Threshold {
    type Err = String;

    fn from_str(text: &str) -> Result<Threshold, String> {
        let (metric, least) = text.split_once('=').ok_or("write METRIC=X, for example success=0.8")?;
        let known = match metric.split_once('.') {
            None => matches!(metric, "success" | "completed_subtasks" | "progress"),
            Some((map, length)) => {
                matches!(map, "success_by_length" | "progress_by_length") && length.parse::<u32>().is_ok()
            }
        };
        if !known {
            return Err(format!("{metric:?} is not one of {}", Threshold::METRICS));
        }
        let least: f64 = least.parse().map_err(|_| format!("{least:?} is not a number"))?;
        if !least.is_finite() {
            return Err(format!("{least} is not a finite number"));
        }
        Ok(Threshold { metric: metric.to_owned(), least })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::summary::tests::sample;
    use crate::run_dir::manifest::tests::manifest;

    #[test]
    fn a_threshold_is_missed_only_below_it() {
        let (tasks, episodes) = sample();
        let summary = RunSummary::of(&manifest(), &tasks, &episodes, false);
        let missed = |text: &str| text.parse::<Threshold>().unwrap().missed_by(&summary);
        assert_eq!(missed("success=0.5").unwrap(), None);
        assert_eq!(missed("success=0.51").unwrap(), Some(0.5));
        assert_eq!(missed("completed_subtasks=2").unwrap(), Some(1.25));
        assert_eq!(missed("progress_by_length.2=0.7").unwrap(), Some(0.625));
        assert!(missed("success_by_length.3=0.7").unwrap_err().to_string().contains("no task is that long"));
    }

    #[test]
    fn a_threshold_that_names_no_figure_is_refused() {
        for nonsense in ["success", "succes=1", "success=x", "success=NaN", "progress_by_length.x=1", "steps.2=1"] {
            assert!(nonsense.parse::<Threshold>().is_err(), "{nonsense}");
        }
    }
}
