//! One test binary: its modules are the scenarios.

mod generated;
mod properties;
mod scenarios;
