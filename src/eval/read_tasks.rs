//! Tasks that say an instruction and no subtasks: they are graded as their instruction is read.

use std::collections::BTreeMap;

use crate::domain::Task;
use crate::episode::scenes::{Scenes, Setting};
use crate::episode::wish::{self, ServedReader, Wish};
use crate::language::instruction;

/// Gives the tasks that only say an instruction the subtasks as which it is read; what was read, by the tasks' places.
pub(super) fn read_all(
    tasks: &mut [Task],
    scenes: &Scenes,
    reader: Option<&ServedReader>,
) -> anyhow::Result<BTreeMap<usize, Wish>> {
    let mut found = BTreeMap::new();
    for (i, task) in tasks.iter_mut().enumerate().filter(|(_, task)| task.subtasks.is_empty() && task.env.is_none()) {
        let setting = scenes.setting(task)?;
        let wish = read_instruction(task, &setting, reader)
            .map_err(|problem| anyhow::anyhow!("tasks[{i}].subtasks: {problem}"))?;
        (task.roles, task.subtasks) = (wish.roles.clone(), wish.subtasks.clone());
        task.expert_steps = wish.expert_steps.unwrap_or(task.expert_steps);
        found.insert(i, wish);
    }
    Ok(found)
}

/// What a task without subtasks asks, as its instruction is read where it begins.
///
/// # Errors
/// When it cannot be graded as it is read; says why.
pub(crate) fn read_instruction(task: &Task, setting: &Setting, reader: Option<&ServedReader>) -> Result<Wish, String> {
    let text = instruction::normalise(&task.instruction);
    let wish = match reader {
        None => wish::read(&text, 0, std::iter::empty(), &setting.scene, &setting.world),
        Some(served) => wish::read_by(served, &text, 0, &[], &setting.scene, &setting.world),
    };
    match &wish.ungraded {
        Some(why) => {
            let unasked = wish.unasked.as_ref().map_or(String::new(), |why| format!("; by the program, as {why}"));
            Err(format!("none, and {:?} cannot be graded as it is read: {why}{unasked}", task.instruction))
        }
        None => Ok(wish),
    }
}
