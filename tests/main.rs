//! One test binary: its modules are the scenarios.

mod explore;
mod eval;
mod floors;
mod command_line;
mod generated;
mod properties;
mod scenarios;
