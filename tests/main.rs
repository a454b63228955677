//! One test binary: its modules are the scenarios.

// Helpers of tests may fail loudly, and say on standard error why a test was skipped.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stderr)]

mod alfred;
mod annotation;
mod babyai;
mod circles;
mod completions;
mod explore;
mod eval;
mod floors;
mod imports;
mod labels;
mod needed;
mod fuzz;
mod command_line;
mod ctl;
mod generated;
mod policy_server;
mod properties;
mod reading;
mod recorded_policies;
mod program;
mod environments;
mod evaluator;
mod faults;
mod finetune;
mod hub;
mod scenarios;
mod serve;
mod training;
mod slow_link;
mod start;
mod terminal;
mod terminal_habits;
mod wish_reader;
mod wishes;
mod workbench;
