//! The `sprint` program: parse, run, print the error chain once, exit.

use std::process::ExitCode;

fn main() -> ExitCode {
    sprint_explorer::cli::main()
}
