//! A summary as a page for people and as a table for spreadsheets.

use std::collections::BTreeMap;

use super::report::Summary;
use super::stats::Interval;

impl Summary {
    /// The page that people read.
    pub fn markdown(&self) -> String {
        let mut whole = vec![["episodes".into(), self.episodes.to_string(), String::new()]];
        whole.push(["errors (counted as they stood)".into(), self.errors.to_string(), String::new()]);
        whole.push(["success".into(), percent(self.success), between(self.success_interval)]);
        let completed = self.completed_subtasks;
        let [low, high] = completed.interval;
        whole.push(["completed subtasks".into(), format!("{:.2}", completed.mean), format!("{low:.2} to {high:.2}")]);
        whole.push(["progress".into(), percent(self.progress.mean), between(self.progress.interval)]);
        whole.push(["steps".into(), format!("{:.1}", self.steps_mean), String::new()]);
        whole.push(["steps of the expert".into(), format!("{:.1}", self.expert_steps_mean), String::new()]);
        let lengths = self.episodes_by_length.iter().map(|(length, episodes)| {
            let share = |map: &BTreeMap<u32, f64>| percent(map.get(length).copied().unwrap_or_default());
            let (success, progress) = (share(&self.success_by_length), share(&self.progress_by_length));
            [length.to_string(), episodes.to_string(), success, progress]
        });
        let skills = self.skills.iter().map(|(kind, skill)| {
            let (reached, completed) = (skill.reached.to_string(), skill.completed.to_string());
            [format!("{kind:?}"), reached, completed, percent(skill.rate), between(skill.interval)]
        });
        let partial =
            "\n**Partial: the run was interrupted. The same command with this folder as --out continues it.**\n";
        format!(
            "# {policy} on {set}\n{partial}\n{whole}\n{lengths}\n{skills}\n\
             Grader: {grader}. Intervals: rates by {rates}; means by {means}.\n",
            policy = self.policy,
            set = self.task_set,
            partial = if self.partial { partial } else { "" },
            whole = table(["measure", "value", "95 % interval"], whole),
            lengths = table(["subtasks of the task", "episodes", "success", "progress"], lengths),
            skills = table(["skill", "reached", "completed", "rate", "95 % interval"], skills),
            grader = self.grader,
            rates = self.interval_methods.rates,
            means = self.interval_methods.means,
        )
    }

    /// One row for each figure of the whole, of each length, and of each kind of skill.
    ///
    /// # Errors
    /// Never in practice: it writes to memory.
    pub fn csv(&self) -> anyhow::Result<Vec<u8>> {
        let mut table = csv::Writer::from_writer(Vec::new());
        table.write_record(["group", "measure", "count", "value", "low", "high"])?;
        let mut row = |group: &str, measure: &str, count: usize, value: f64, interval: Option<Interval>| {
            let [low, high] = interval.map_or_else(Default::default, |ends| ends.map(|end| end.to_string()));
            table.write_record([group, measure, &count.to_string(), &value.to_string(), &low, &high])
        };
        row("all", "success", self.episodes, self.success, Some(self.success_interval))?;
        let (completed, progress) = (self.completed_subtasks, self.progress);
        row("all", "completed_subtasks", self.episodes, completed.mean, Some(completed.interval))?;
        row("all", "progress", self.episodes, progress.mean, Some(progress.interval))?;
        row("all", "errors", self.episodes, self.errors as f64, None)?;
        row("all", "steps", self.episodes, self.steps_mean, None)?;
        row("all", "expert_steps", self.episodes, self.expert_steps_mean, None)?;
        for (length, &count) in &self.episodes_by_length {
            let group = format!("length {length}");
            let value = |map: &BTreeMap<u32, f64>| map.get(length).copied().unwrap_or_default();
            row(&group, "success", count, value(&self.success_by_length), None)?;
            row(&group, "progress", count, value(&self.progress_by_length), None)?;
        }
        for (kind, skill) in &self.skills {
            row(&format!("{kind:?}"), "completed", skill.reached, skill.rate, Some(skill.interval))?;
        }
        Ok(table.into_inner()?)
    }
}

fn percent(share: f64) -> String {
    format!("{:.1} %", 100.0 * share)
}

fn between([low, high]: Interval) -> String {
    format!("{:.1} to {:.1} %", 100.0 * low, 100.0 * high)
}

/// A Markdown table whose columns line up in plain text too; all but the first are aligned right.
fn table<const N: usize>(head: [&str; N], rows: impl IntoIterator<Item = [String; N]>) -> String {
    let rows: Vec<[String; N]> = rows.into_iter().collect();
    let width = |i: usize| rows.iter().map(|row| row[i].chars().count()).chain([head[i].len()]).max().unwrap_or(0);
    let line = |cells: [&str; N]| {
        let padded = (0..N).map(|i| match i {
            0 => format!("{:<1$}", cells[i], width(i)),
            _ => format!("{:>1$}", cells[i], width(i)),
        });
        format!("| {} |\n", padded.collect::<Vec<_>>().join(" | "))
    };
    let rules = (0..N).map(|i| match i {
        0 => "-".repeat(width(i) + 2),
        _ => format!("{}:", "-".repeat(width(i) + 1)),
    });
    let rule = format!("|{}|\n", rules.collect::<Vec<_>>().join("|"));
    let body = rows.iter().map(|row| line(std::array::from_fn(|i| row[i].as_str())));
    std::iter::once(line(head)).chain([rule]).chain(body).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run::folder::tests::manifest;
    use crate::run::report::tests::sample;

    #[test]
    fn the_page_and_the_table_look_as_agreed() {
        let (tasks, episodes) = sample();
        let summary = Summary::of(&manifest(), &tasks, &episodes, true);
        insta::assert_snapshot!("page", summary.markdown());
        insta::assert_snapshot!("table", String::from_utf8(summary.csv().unwrap()).unwrap());
    }
}
