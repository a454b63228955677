//! One test binary: its modules are the scenarios.

mod command_line;
