//! Why an expert cannot go on, in words.

/// Why the expert cannot go on.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NoWay {
    /// There is nothing left to do.
    #[error("every subtask is done")]
    Finished,
    /// The strict grader will not credit anything any more.
    #[error("the whole goal is met: strict grading credits nothing more")]
    CutShort,
    /// No thing would serve, or none would take what is held.
    #[error("there is no way to {subtask}: nothing here would serve for it")]
    Nothing {
        /// What was to be done, in words.
        subtask: String,
    },
    /// The things are there, but cannot be used from anywhere.
    #[error("there is no way to {subtask}: no place from which the agent sees and reaches what it needs")]
    NoStand {
        /// What was to be done, in words.
        subtask: String,
    },
}
