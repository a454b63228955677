//! A terminal explorer, trainer and headless evaluator for household agents that follow typed instructions (SPRINT).
//!
//! The floors, ground floor first; imports point down only (`tests/floors.rs` holds them to it):
//!
//! | floor | what lives there |
//! |---|---|
//! | [`domain`] | the words of the program as plain data: classes, actions, scenes, worlds, skills, tasks, trajectories |
//! | [`language`] | instruction text, the phrase grammar, summaries by rules |
//! | [`house`] | the simulator: rules, sight, rendering, graders, the expert, generated houses |
//! | [`data`] | dataset folders, the ALFRED importer, task files, training items, labels, feature files |
//! | [`nets`] | visual encoders, FiLM policy, sentence encoders, strict weights files |
//! | [`algo`] | losses, optimiser, learner |
//! | [`agent`] | what decides the next action: trained, expert, chance |
//! | [`run`] | the one loop that steps an environment, and the runs that use it |
//! | [`tui`] | the explorer |
//! | [`cli`] | the command line |

pub mod domain;
pub mod language;
pub mod house;
pub mod data;
pub mod nets;
pub mod algo;
pub mod agent;
pub mod run;
pub mod tui;
pub mod cli;
