//! A file that computes a policy, whatever its format.

/// One step's input.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Input {
    Floats(Vec<f32>),
    Tokens(Vec<i32>),
}

/// Computes a policy.
pub(super) trait Model: Send {
    /// The outputs of the description, in its order, for its inputs in its order.
    ///
    /// # Errors
    /// When it fails, or an output holds something else than float32.
    fn run(&mut self, inputs: Vec<Input>) -> anyhow::Result<Vec<Vec<f32>>>;
}

/// A library's complaint in one line.
pub(super) fn in_one_line(problem: &str) -> String {
    problem.lines().map(str::trim).find(|line| !line.is_empty()).unwrap_or("it fails without a word").to_owned()
}
