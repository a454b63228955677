//! `sprint completions SHELL` and `sprint man`: what shells and `man` read about the program.

use std::io::Write;

use clap::{Args, CommandFactory};
use clap_complete::Shell;

use super::{Cli, Ending};

/// Prints a completion script.
#[derive(Args)]
pub struct Completions {
    /// The shell to write for
    shell: Shell,
}

impl Completions {
    /// Prints the script to standard output.
    ///
    /// # Errors
    /// When standard output cannot be written.
    pub fn run(self) -> anyhow::Result<Ending> {
        let mut script = Vec::new();
        clap_complete::generate(self.shell, &mut Cli::command(), "sprint", &mut script);
        std::io::stdout().write_all(&script)?;
        Ok(Ending::Ok)
    }
}

/// Prints the manual page, each subcommand's after the program's own.
///
/// # Errors
/// When standard output cannot be written.
pub fn man() -> anyhow::Result<Ending> {
    let mut program = Cli::command();
    program.build();
    let mut page = Vec::new();
    clap_mangen::Man::new(program.clone()).render(&mut page)?;
    for command in program.get_subcommands().filter(|command| command.get_name() != "help") {
        clap_mangen::Man::new(command.clone()).render(&mut page)?;
    }
    std::io::stdout().write_all(&page)?;
    Ok(Ending::Ok)
}
