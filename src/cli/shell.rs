//! `sprint completions SHELL` and `sprint man`: what shells and `man` read about the program.

use std::io::Write;

use clap::{Args, Command};
use clap_complete::Shell;

use super::exit_status::ExitStatus;
use super::streams::StandardOutput;
use crate::explore::verb;

/// Prints a completion script.
#[derive(Args)]
pub(crate) struct Completions {
    /// The shell to write for
    shell: Shell,
}

impl Completions {
    /// Prints the script to standard output.
    ///
    /// # Errors
    /// When standard output cannot be written.
    pub(crate) fn run(self, mut program: Command) -> anyhow::Result<ExitStatus> {
        let mut script = Vec::new();
        clap_complete::generate(self.shell, &mut program, "sprint", &mut script);
        StandardOutput::lock().write_all(&script)?;
        Ok(ExitStatus::Ok)
    }
}

/// Prints the manual page, each subcommand's after the program's own, and the explorer's verbs.
///
/// # Errors
/// When standard output cannot be written.
pub(crate) fn man(mut program: Command) -> anyhow::Result<ExitStatus> {
    program.build();
    let mut page = Vec::new();
    clap_mangen::Man::new(program.clone()).render(&mut page)?;
    for command in program.get_subcommands().filter(|command| command.get_name() != "help") {
        clap_mangen::Man::new(command.clone()).render(&mut page)?;
    }
    page.extend(verb::man_section().into_bytes());
    StandardOutput::lock().write_all(&page)?;
    Ok(ExitStatus::Ok)
}
