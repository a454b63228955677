//! One test binary: its modules are the scenarios.

mod eval;
mod floors;
mod properties;
mod scenarios;
