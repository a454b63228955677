//! A terminal explorer, trainer and headless evaluator for household agents that follow typed instructions.
//!
//! The floors, ground floor first; imports point down only.

pub mod domain;
pub mod house;
pub mod language;
pub mod data;
pub mod nets;
pub mod algo;
pub mod agent;
pub mod run;
pub mod tui;
pub mod cli;
