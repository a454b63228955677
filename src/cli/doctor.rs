//! `sprint doctor`: what was found on this machine, and the remedy for what was not.

use std::io::Write;

use clap::Args;
use serde::Serialize;
use serde_json::{Map, json};

use super::exit_status::ExitStatus;
use super::{logging, streams};
use crate::agent::policy_source;
use crate::nets::{device, home, sentence};

/// Prints what was found.
#[derive(Args)]
pub(crate) struct Doctor {
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// One thing that the program needs or uses.
#[derive(Serialize)]
struct Finding {
    #[serde(skip)]
    name: &'static str,
    ok: bool,
    found: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    remedy: Option<String>,
}

impl Finding {
    fn good(name: &'static str, found: impl Into<String>) -> Finding {
        Finding { name, ok: true, found: found.into(), remedy: None }
    }

    fn bad(name: &'static str, found: impl Into<String>, remedy: &str) -> Finding {
        Finding { name, ok: false, found: found.into(), remedy: Some(remedy.into()) }
    }
}

impl Doctor {
    /// Prints the findings.
    ///
    /// # Errors
    /// When something is missing: names it.
    pub(crate) fn run(self) -> anyhow::Result<ExitStatus> {
        let findings =
            [libtorch(), computes_on(), encoder(), graphics(), threads(), cache(), checkpoints(), log_file()];
        let mut out = streams::out();
        if self.json {
            let mut object = Map::new();
            object.insert("ok".into(), json!(findings.iter().all(|finding| finding.ok)));
            for finding in &findings {
                object.insert(finding.name.into(), serde_json::to_value(finding)?);
            }
            writeln!(out, "{}", serde_json::Value::Object(object))?;
        } else {
            for finding in &findings {
                writeln!(out, "{} {:<12} {}", if finding.ok { "ok  " } else { "MISS" }, finding.name, finding.found)?;
                if let Some(remedy) = &finding.remedy {
                    writeln!(out, "     {:<12} remedy: {remedy}", "")?;
                }
            }
        }
        let missing: Vec<&str> = findings.iter().filter(|finding| !finding.ok).map(|finding| finding.name).collect();
        anyhow::ensure!(
            missing.is_empty(),
            "not everything is in place: {} (see the remedies above)",
            missing.join(", ")
        );
        Ok(ExitStatus::Ok)
    }
}

fn libtorch() -> Finding {
    let folder = device::libtorch_folder();
    match device::version_in(&folder) {
        Some(version) if version == device::LIBTORCH_VERSION => {
            Finding::good("libtorch", format!("{version} in {}", folder.display()))
        }
        Some(version) => Finding::bad(
            "libtorch",
            format!("{version} in {}, where {} is needed", folder.display(), device::LIBTORCH_VERSION),
            "unset LIBTORCH and run `make build`",
        ),
        None => {
            Finding::good("libtorch", format!("loaded from {} (its version is not written there)", folder.display()))
        }
    }
}

fn computes_on() -> Finding {
    Finding::good("device", device::device_report())
}

fn encoder() -> Finding {
    let folder = sentence::default_folder();
    match sentence::verify_default(&folder) {
        Ok(()) => Finding::good("encoder", format!("all-MiniLM-L6-v2, checksums right, in {}", folder.display())),
        Err(error) => Finding::bad("encoder", format!("{error:#}"), "run `make setup`"),
    }
}

fn graphics() -> Finding {
    let (protocol, reason) = crate::tui::graphics::detect::guess(|name| std::env::var(name).ok());
    Finding::good("terminal", format!("{} ({reason})", protocol.name()))
}

fn threads() -> Finding {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    Finding::good("threads", format!("{cores} cores; libtorch computes with {}", device::threads()))
}

fn cache() -> Finding {
    let folder = home::cache_folder();
    let probe = std::fs::create_dir_all(&folder).and_then(|()| tempfile::tempfile_in(&folder).map(drop));
    match probe {
        Ok(()) => Finding::good("cache", folder.display().to_string()),
        Err(error) => Finding::bad(
            "cache",
            format!("{} cannot be written: {error}", folder.display()),
            "set SPRINT_HOME to a folder that you may write to",
        ),
    }
}

fn checkpoints() -> Finding {
    let found: Vec<String> = policy_source::checkpoints().iter().map(|path| path.display().to_string()).collect();
    if found.is_empty() {
        let remedy = "run in the repository's folder, or train one with `sprint collect` and `sprint pretrain`";
        return Finding::bad("checkpoints", "none in checkpoints/", remedy);
    }
    Finding::good("checkpoints", found.join(", "))
}

fn log_file() -> Finding {
    let path = logging::path();
    match logging::open() {
        Ok(_) => Finding::good("log", path.display().to_string()),
        Err(error) => Finding::good("log", format!("none: {} cannot be written ({error})", path.display())),
    }
}
