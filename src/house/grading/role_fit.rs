//! Whether an instance may play a role of a task, by either way of grading.

use super::grader::Grader;
use super::{class, strict};
use crate::domain::world::Instance;
use crate::domain::{Scene, World};

/// With strict grading only the expert's own instance may; else see [`class::fits`].
pub(super) fn fits(grader: &Grader, scene: &Scene, world: &World, role: u8, instance: Instance) -> bool {
    match grader.expert_instance(role) {
        Some(original) => strict::resolve(world, original) == Some(instance),
        None => class::fits(grader, scene, world, role, instance),
    }
}
