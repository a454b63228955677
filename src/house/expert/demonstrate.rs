//! The expert left alone with a task, for whoever needs to know how it is done before an agent tries.

use super::Expert;
use super::no_way::NoWay;
use crate::house::grading::Grader;
use crate::house::session::House;
use crate::language::count::counted;

/// Why the expert did not finish.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum Unfinished {
    /// It knows no way.
    #[error(transparent)]
    NoWay(#[from] NoWay),
    /// It took too long.
    #[error("did not get there in {}: {waits_for}", counted(*limit, "step"))]
    TooLong {
        /// The most steps it had.
        limit: usize,
        /// What the grader waits for.
        waits_for: String,
    },
}

/// Lets the expert act until the grader is satisfied, for at most `limit` steps; `visit` sees the house after each.
///
/// # Errors
/// When it sees no way, or has not finished in time.
pub(crate) fn demonstrate(
    house: &mut House,
    grader: &mut Grader,
    limit: usize,
    visit: &mut dyn FnMut(&House),
) -> Result<(), Unfinished> {
    let mut expert = Expert::new();
    let mut steps = 0;
    while !grader.is_done() {
        if steps >= limit {
            let waits_for = grader.waits_for(house.scene(), house.world());
            return Err(Unfinished::TooLong { limit, waits_for });
        }
        let action = expert.next(house, grader)?;
        let outcome = house.step(action);
        steps += 1;
        grader.observe(house.scene(), house.world(), action, outcome);
        visit(house);
    }
    Ok(())
}
