//! A summary as a page for people and as a table for spreadsheets.

use std::collections::BTreeMap;

use super::estimates::SkillRate;
use super::groups::GroupFigures;
use super::markdown_table::{aligned_table, between, percent, table};
use super::stats::Interval;
use super::summary::RunSummary;
use crate::domain::SkillKind;

impl RunSummary {
    /// The page that people read.
    pub(crate) fn markdown(&self) -> String {
        let partial =
            "\n**Partial: the run was interrupted. The same command with this folder as --out continues it.**\n";
        let mut parts = vec![
            format!("# {} on {}\n", self.policy, self.task_set) + if self.partial { partial } else { "" },
            table(["measure", "value", "95 % interval"], self.overall_rows()),
            self.length_table(),
            table(["skill", "reached", "completed", "rate", "95 % interval"], skill_rows(&self.skills)),
        ];
        if !self.failures.is_empty() {
            let rows = self.failures.iter().map(|(failure, class)| {
                let example = format!("{} (seed {})", class.example_task, class.example_seed);
                [failure.words().into(), class.episodes.to_string(), percent(class.share), example]
            });
            parts.push(table(["why it fell short", "episodes", "share", "for example"], rows));
        }
        if !self.instruction_variants.is_empty() {
            let rows = self.instruction_variants.iter().map(|(variant, group)| group_row(variant.name().into(), group));
            parts.push(table(
                ["instruction variant", "episodes", "success", "95 % interval", "progress", "95 % interval"],
                rows,
            ));
        }
        if !self.start_subtasks.is_empty() {
            let rows = self.start_subtasks.iter().map(|(from, start)| {
                let (first, rest) = (start.first_subtask, &start.remaining);
                let shares = [percent(first.rate), between(first.interval), percent(rest.success)];
                let [rate, interval, all] = shares;
                [from.to_string(), first.reached.to_string(), rate, interval, all]
            });
            let head = ["start subtask", "episodes", "that one done", "95 % interval", "all the rest done"];
            parts.push(table(head, rows));
            let head = ["first skill", "reached", "completed", "rate", "95 % interval"];
            parts.push(table(head, skill_rows(&self.first_subtask_skills)));
        }
        let rows = self.scenes.iter().map(|(scene, group)| group_row(scene.clone(), group));
        parts.push(table(["scene", "episodes", "success", "95 % interval", "progress", "95 % interval"], rows));
        if !self.errored_episodes.is_empty() {
            let rows = self.errored_episodes.iter().map(|episode| {
                let error = episode.error.replace('|', "/").replace('\n', " ");
                [episode.task.clone(), episode.seed.to_string(), episode.attempts.to_string(), error]
            });
            parts.push(table(["errored", "seed", "attempts", "reported"], rows));
        }
        parts.push(format!(
            "Grader: {}{}. Intervals: rates by {}; means by {}.\nEpisodes: sha256 {}.\n",
            self.grader,
            self.end.in_words(),
            self.interval_methods.rates,
            self.interval_methods.means,
            self.episodes_hash
        ));
        parts.join("\n")
    }

    /// The measures of the whole run.
    fn overall_rows(&self) -> Vec<[String; 3]> {
        let completed = self.completed_subtasks;
        let [low, high] = completed.interval;
        let mut whole = vec![
            ["episodes".into(), self.episodes.to_string(), String::new()],
            ["errors (no success)".into(), self.errors.to_string(), String::new()],
            ["success".into(), percent(self.success), between(self.success_interval)],
            ["completed subtasks".into(), format!("{:.2}", completed.mean), format!("{low:.2} to {high:.2}")],
            ["progress".into(), percent(self.progress.mean), between(self.progress.interval)],
            ["steps".into(), format!("{:.1}", self.steps_mean), String::new()],
        ];
        if let Some(earned) = self.earned {
            let [low, high] = earned.interval;
            whole.push(["return".into(), format!("{:.3}", earned.mean), format!("{low:.3} to {high:.3}")]);
        }
        if self.earned.is_none() || self.expert_steps_mean > 0.0 {
            whole.push(["steps of the expert".into(), format!("{:.1}", self.expert_steps_mean), String::new()]);
        }
        if let Some(ratio) = self.steps_over_expert {
            let [low, high] = ratio.interval;
            let name = "steps of successes / expert's".into();
            whole.push([name, format!("{:.2}", ratio.mean), format!("{low:.2} to {high:.2}")]);
        }
        whole
    }

    /// Progress by length, a column each as the paper's table has it.
    fn length_table(&self) -> String {
        let lengths: Vec<u32> = self.episodes_by_length.keys().copied().collect();
        let row = |name: &str, cell: &dyn Fn(u32) -> String| -> Vec<String> {
            std::iter::once(name.to_owned()).chain(lengths.iter().map(|&length| cell(length))).collect()
        };
        let share = |map: &BTreeMap<u32, f64>, length| format!("{:.2}", map.get(&length).copied().unwrap_or_default());
        let interval = |length| {
            let [low, high] = self.progress_interval_by_length.get(&length).copied().unwrap_or_default();
            format!("{low:.2} to {high:.2}")
        };
        let rows = [
            row("episodes", &|length| self.episodes_by_length.get(&length).copied().unwrap_or_default().to_string()),
            row("progress", &|length| share(&self.progress_by_length, length)),
            row("95 % interval", &interval),
            row("success", &|length| share(&self.success_by_length, length)),
        ];
        aligned_table(&row("subtasks of the task", &|length| length.to_string()), &rows)
    }

    /// One row for each figure of the whole, of each length, and of each kind of skill.
    ///
    /// # Errors
    /// Never in practice: it writes to memory.
    pub(crate) fn csv(&self) -> anyhow::Result<Vec<u8>> {
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
        let scenes = self.scenes.iter().map(|(name, group)| (format!("scene {name}"), group));
        let words =
            self.instruction_variants.iter().map(|(variant, group)| (format!("variant {}", variant.name()), group));
        let starts =
            self.start_subtasks.iter().map(|(from, start)| (format!("start_subtask {from}"), &start.remaining));
        for (name, group) in scenes.chain(words).chain(starts) {
            row(&name, "success", group.episodes, group.success, Some(group.success_interval))?;
            row(&name, "progress", group.episodes, group.progress.mean, Some(group.progress.interval))?;
        }
        for (failure, class) in &self.failures {
            row(failure.words(), "share", class.episodes, class.share, None)?;
        }
        Ok(table.into_inner()?)
    }
}

fn skill_rows(skills: &BTreeMap<SkillKind, SkillRate>) -> Vec<[String; 5]> {
    let row = |(kind, skill): (&SkillKind, &SkillRate)| {
        let (reached, completed) = (skill.reached.to_string(), skill.completed.to_string());
        [format!("{kind:?}"), reached, completed, percent(skill.rate), between(skill.interval)]
    };
    skills.iter().map(row).collect()
}

fn group_row(name: String, group: &GroupFigures) -> [String; 6] {
    let (success, progress) = (percent(group.success), percent(group.progress.mean));
    let intervals = (between(group.success_interval), between(group.progress.interval));
    [name, group.episodes.to_string(), success, intervals.0, progress, intervals.1]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::summary::tests::sample;
    use crate::run_dir::manifest::tests::manifest;

    #[test]
    fn the_page_and_the_table_look_as_agreed() {
        let (tasks, episodes) = sample();
        let summary = RunSummary::of(&manifest(), &tasks, &episodes, true);
        insta::assert_snapshot!("page", summary.markdown());
        insta::assert_snapshot!("table", String::from_utf8(summary.csv().unwrap()).unwrap());
    }
}
