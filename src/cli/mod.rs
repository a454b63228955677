//! The command line: clap structs become configs; one file a subcommand opens inputs, calls the library, prints.

use std::process::ExitCode;

use clap::{CommandFactory, Parser, Subcommand};

use exit_status::ExitStatus;

mod annotate;
mod average;
mod bench;
mod chains;
mod checkpoint;
mod collect;
mod compare;
mod controlled;
mod critic;
mod ctl;
mod doctor;
mod embed;
mod encode;
mod environment;
mod explore;
mod eval;
mod exit_status;
mod export;
mod finetune;
mod import;
mod jobs;
mod labels;
mod language_model;
mod logging;
mod plot;
mod merge;
mod open;
mod policies;
mod policy_name;
mod pretrain;
mod progress;
mod read;
mod recorded;
mod recorded_policy;
mod relabel;
mod replay;
mod report;
mod schema;
mod serve;
mod shell;
mod stop;
mod streams;
mod tasks;
mod validate;
mod value_names;
mod verify;
mod wish_reader;

/// Explore, train and evaluate household agents that follow typed instructions.
#[derive(Parser)]
#[command(name = "sprint", version, about, arg_required_else_help = true)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

/// One variant a subcommand; each carries the arguments that its own file defines.
#[derive(Subcommand)]
enum Command {
    /// Watch an agent in a house, and tell it what to do
    Explore(explore::Explore),
    /// Print what was found on this machine; exits 1 with the remedy when something is missing
    Doctor(doctor::Doctor),
    /// Measure how fast the program is on this machine
    Bench(bench::Bench),
    /// Play a task set, and write a run folder with every episode and a summary
    Eval(eval::Eval),
    /// Compare runs of the same tasks, episode by episode
    Compare(compare::CompareArgs),
    /// Join the shares of a run that several machines played
    Merge(merge::MergeArgs),
    /// Draw a run's plots and write it as one HTML page
    Report(report::ReportArgs),
    /// Print the JSON Schema of a file that the program reads or writes
    Schema(schema::Schema),
    /// Show a recorded episode in the explorer, at any of its steps
    Open(open::Open),
    /// Play a run's episodes again, and say whether they come out the same
    Verify(verify::Verify),
    /// Write a recorded episode as a picture, a film, a strip, a transcript, or a page
    Export(export::Export),
    /// Serve House to programs in other languages, over OpenEnv's protocol and a local socket
    Serve(serve::Serve),
    /// Sample, check and show task sets
    Tasks(tasks::Tasks),
    /// Make a dataset folder of ALFRED's published files
    Import(import::Import),
    /// Collect demonstrations in generated houses
    Collect(collect::Collect),
    /// Let people say in a sentence what is done in a dataset's runs of skills
    Annotate(annotate::Annotate),
    /// Label a dataset's runs of skills, to learn from them
    Relabel(relabel::Relabel),
    /// Look at a dataset's labels
    Labels(labels::Labels),
    /// Rank pairs of instructions to chain by a language model
    Chains(chains::Chains),
    /// Draw and encode every frame of a dataset, ahead of a training
    Encode(encode::Encode),
    /// Train an agent on a dataset
    Pretrain(pretrain::Pretrain),
    /// Finetune an agent on tasks, by online reinforcement learning
    Finetune(finetune::Finetune),
    /// Average the policies of checkpoints that were trained on from a common start
    Average(average::Average),
    /// Measure whether a critic tells skills that can follow another from those that cannot
    Critic(critic::CriticArgs),
    /// Draw the curves of trainings to SVG and PNG
    Plot(plot::PlotCurves),
    /// Re-run recorded demonstrations in the simulator
    Replay(replay::ReplayArgs),
    /// Embed sentences: a sentence a line in, a JSON array a line out
    Embed(embed::EmbedArgs),
    /// Read wishes: a sentence a line in, its subtasks as a JSON object a line out
    Read(read::ReadArgs),
    /// Watch and steer what runs here, from another terminal
    Ctl(ctl::Ctl),
    /// Print a completion script for a shell
    Completions(shell::Completions),
    /// Print the manual page (roff)
    Man,
}

/// Parses the command line, runs the command, and prints an error's chain once.
pub fn main() -> ExitCode {
    let cli = Cli::parse();
    logging::start();
    let ending = run(cli.command);
    // What a thread that hangs still holds would outlive the program.
    crate::env::remote::end_children();
    match ending {
        Ok(ending) => ending.into(),
        Err(error) if reader_left(&error) => ExitStatus::Ok.into(),
        Err(error) => {
            tracing::error!("{error:#}");
            complain(&error);
            ExitCode::FAILURE
        }
    }
}

fn run(command: Command) -> anyhow::Result<ExitStatus> {
    match command {
        Command::Explore(explore) => explore.run(),
        Command::Doctor(doctor) => doctor.run(),
        Command::Bench(bench) => bench.run(),
        Command::Eval(eval) => eval.run(),
        Command::Compare(compare) => compare.run(),
        Command::Merge(merge) => merge.run(),
        Command::Report(report) => report.run(),
        Command::Schema(schema) => schema.run(),
        Command::Open(open) => open.run(),
        Command::Verify(verify) => verify.run(),
        Command::Export(export) => export.run(),
        Command::Serve(serve) => serve.run(),
        Command::Tasks(tasks) => tasks.run(),
        Command::Import(import) => import.run(),
        Command::Collect(collect) => collect.run(),
        Command::Annotate(annotate) => annotate.run(),
        Command::Relabel(relabel) => relabel.run(),
        Command::Labels(labels) => labels.run(),
        Command::Chains(chains) => chains.run(),
        Command::Encode(encode) => encode.run(),
        Command::Pretrain(pretrain) => pretrain.run(),
        Command::Finetune(finetune) => finetune.run(),
        Command::Average(average) => average.run(),
        Command::Critic(critic) => critic.run(),
        Command::Plot(plot) => plot.run(),
        Command::Replay(replay) => replay.run(),
        Command::Embed(embed) => embed.run(),
        Command::Read(read) => read.run(),
        Command::Ctl(ctl) => ctl.run(),
        Command::Completions(completions) => completions.run(Cli::command()),
        Command::Man => shell::man(Cli::command()),
    }
}

/// Whether all that went wrong is that whoever reads a command's answers as they come (`| head`) has seen enough.
fn reader_left(error: &anyhow::Error) -> bool {
    let kind = error.root_cause().downcast_ref::<std::io::Error>().map(std::io::Error::kind);
    kind == Some(std::io::ErrorKind::BrokenPipe)
}

/// The one place that prints an error: its chain, outermost first.
fn complain(error: &anyhow::Error) {
    streams::say(&format!("error: {error:#}"));
}
