//! One test binary: its modules are the scenarios.

mod properties;
mod scenarios;
