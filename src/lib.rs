//! A terminal explorer, trainer and headless evaluator for household agents that follow typed instructions.
//!
//! The floors, ground floor first; imports point down only.

pub mod agent;
pub mod algo;
pub mod cli;
pub mod data;
pub mod domain;
pub mod house;
pub mod language;
pub mod nets;
pub mod run;
pub mod tui;
