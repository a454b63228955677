//! A terminal explorer, trainer and headless evaluator for household agents that follow typed instructions (SPRINT).
//!
//! The floors, ground floor first; imports point down only (`tests/floors.rs` holds them to it):
//!
//! | floor | what lives there |
//! |---|---|
//! | [`domain`] | the words of the program as plain data: classes, actions, scenes, worlds, skills, tasks, trajectories |
//! | [`language`] | instruction text, the phrase grammar, summaries by rules |
//! | [`house`] | the simulator: rules, sight, rendering, graders, the expert, generated houses |
//! | [`mod@env`] | the trait `Environment`, and House as the first one |
//! | [`data`] | dataset folders, the ALFRED importer, task files, training items, labels, feature files |
//! | [`mod@control`] | steering what runs from another terminal, over a socket of its user's own |
//! | [`nets`] | visual encoders, policy and critic, sentence encoders, strict weights files |
//! | [`algo`] | behaviour cloning, IQL, chaining; the update, optimiser, learner |
//! | [`agent`] | what decides the next action: trained, expert, chance |
//! | [`episode`] | the one loop that steps an environment, records, scenes, branches, failures |
//! | [`run_dir`] | run folders: manifest, episodes in order, reader, writer, shards |
//! | [`report`] | summaries, statistics, comparisons, pages, charts, films |
//! | [`eval`] | evaluation on workers, task sets, verification, replay |
//! | [`train`] | presets, data, batches, the trainer; relabelling, collection, pretraining |
//! | [`analysis`] | chains link by link, two instructions in one state, the value of every cell; benchmarks |
//! | `serve` | House for programs in other languages |
//! | [`explore`] | an explorer session without a screen, and the plain mode |
//! | [`tui`] | the explorer's screen |
//! | [`cli`] | the command line |

pub mod domain;
pub mod language;
pub mod house;
mod env;
pub mod data;
mod control;
pub mod nets;
pub mod algo;
pub mod agent;
pub mod episode;
pub mod run_dir;
pub mod report;
pub mod eval;
pub mod train;
pub mod analysis;
mod serve;
pub mod explore;
pub mod tui;
pub mod cli;

#[cfg(test)]
#[path = "../tests/needed.rs"]
mod needed;
