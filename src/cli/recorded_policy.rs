//! The policy that a recorded run was made with, found again.

use std::path::{Path, PathBuf};

use anyhow::{bail, ensure};
use clap::Args;

use super::checkpoint;
use super::policy_name::{ExternalPolicy, ExternalPolicyOptions};
use crate::agent::exported;
use crate::agent::policy_source::{self, PolicySource};
use crate::agent::registry::NamedAgent;
use crate::agent::served::PolicyAddress;
use crate::episode::record::Author;
use crate::run_dir::manifest::RunManifest;
use crate::run_dir::policy_places::place_of;
use crate::run_dir::reader::RecordedRun;

/// Where the policy of a run is now.
#[derive(Args)]
pub(crate) struct RecordedPolicy {
    /// The checkpoint of the run's agent: its folder or its name [default: the one of the run's hash among checkpoints/]
    #[arg(long, value_name = "DIR|NAME")]
    checkpoint: Option<PathBuf>,
    /// The run's policy server or exported policy: ws:HOST:PORT, onnx:FILE or torchscript:FILE [default: where it was]
    #[arg(long, value_name = "POLICY")]
    policy: Option<ExternalPolicy>,
    #[command(flatten)]
    options: ExternalPolicyOptions,
}

impl From<ExternalPolicyOptions> for RecordedPolicy {
    /// Where it was.
    fn from(options: ExternalPolicyOptions) -> RecordedPolicy {
        RecordedPolicy { checkpoint: None, policy: None, options }
    }
}

/// A policy that is none of the program's own, and where it is looked for.
#[derive(Clone)]
pub(super) struct SoughtPolicy {
    author: Author,
    /// Nothing where neither the run nor the person says.
    at: Option<ExternalPolicy>,
    options: ExternalPolicyOptions,
}

impl RecordedPolicy {
    /// The folder of the checkpoint that was named.
    ///
    /// # Errors
    /// When it has a name of the Hub's, and cannot be fetched.
    pub(super) fn checkpoint(&self) -> anyhow::Result<Option<PathBuf>> {
        self.checkpoint.as_deref().map(checkpoint::folder).transpose()
    }

    /// Checks that what was named can be the run's policy.
    ///
    /// # Errors
    /// When an external policy was named for a run of the program's own.
    pub(super) fn check(&self, manifest: &RunManifest) -> anyhow::Result<()> {
        let acted = manifest.policy.as_str();
        let is_remote = acted == RunManifest::EXPLORED || ExternalPolicy::kind_of(acted).is_some();
        ensure!(
            self.policy.is_none() || is_remote,
            "--policy says where a run's policy server or exported policy is, but this run's policy was {acted}: leave it out"
        );
        Ok(())
    }

    /// The policy of an author, if it is none of the program's own.
    ///
    /// # Errors
    /// When the run's file of places is malformed.
    pub(super) fn remote(&self, run: &RecordedRun, author: &Author) -> anyhow::Result<Option<SoughtPolicy>> {
        if ExternalPolicy::kind_of(&author.policy).is_none() {
            return Ok(None);
        }
        let recorded = place_of(&run.places, author).map(|place| place.parse().map_err(anyhow::Error::msg));
        let at = self.policy.clone().map(Ok).or(recorded).transpose()?;
        Ok(Some(SoughtPolicy { author: author.clone(), at, options: self.options }))
    }

    /// The policy of an author; `None` where it is not at hand, which `say` is told if there is more to say.
    ///
    /// # Errors
    /// When it was named, or is the program's own, and cannot be used.
    pub(super) fn find(
        &self,
        run: &RecordedRun,
        author: &Author,
        checkpoint: Option<&Path>,
        say: &dyn Fn(&str),
    ) -> anyhow::Result<Option<PolicySource>> {
        let Some(sought) = self.remote(run, author)? else {
            let decides = (author.sampling, author.deciding);
            return policy_source::find(&author.policy, author.checkpoint.as_deref(), decides, checkpoint);
        };
        match sought.open() {
            Ok(source) => Ok(Some(source)),
            Err(error) if self.policy.is_some() => Err(error),
            Err(error) => {
                say(&format!("{error:#}"));
                Ok(None)
            }
        }
    }
}

impl SoughtPolicy {
    /// Opens it, if it is still the one that acted.
    ///
    /// # Errors
    /// When it is gone, another one, or cannot be used; says what to type instead.
    pub(super) fn open(&self) -> anyhow::Result<PolicySource> {
        let Author { policy, checkpoint, sampling, .. } = &self.author;
        let name_it = match ExternalPolicy::kind_of(policy) {
            Some("ws") | None => "--policy ws:HOST:PORT".to_owned(),
            Some(format) => format!("--policy {format}:FILE"),
        };
        let Some(at) = &self.at else {
            bail!("the run does not say where its policy {policy} was: name it with {name_it}");
        };
        if let (ExternalPolicy::File(_, path), Some(wanted)) = (at, checkpoint) {
            let file = path.display();
            ensure!(path.exists(), "{file}: the run's policy is gone: name it with {name_it}");
            // Before anything of it runs.
            let found = exported::hash(path)?;
            ensure!(
                found == *wanted,
                "{file}: not the policy that the run was made with (the SHA-256 of it and its description is {found}, the \
                 run's {wanted}): name that one's file with {name_it}"
            );
            return at.open(self.options, *sampling);
        }
        let source = at.open(self.options, *sampling)?;
        // A server without a name is called by where it listens.
        let is_alike = source.name == *policy || (is_address(&source.name) && is_address(policy));
        ensure!(
            is_alike && source.checkpoint_hash == *checkpoint,
            "{at}: this policy is {}, the run's {}: start that one again, or name where it is with {name_it}",
            told(&source.name, source.checkpoint_hash.as_deref()),
            told(policy, checkpoint.as_deref())
        );
        Ok(source)
    }

    /// The same for an explorer, which opens it when it is to act.
    pub(super) fn agent(self) -> NamedAgent {
        let name = self.at.as_ref().map_or_else(|| self.author.policy.clone(), ExternalPolicy::to_string);
        policy_source::agent_of(name, move || self.open())
    }
}

/// Whether a server that has that name gave none.
fn is_address(name: &str) -> bool {
    let address = name.parse::<PolicyAddress>().map(|address| address.to_string());
    address.is_ok_and(|address| address.trim_start_matches("ws://") == name.trim_start_matches("ws:"))
}

fn told(name: &str, hash: Option<&str>) -> String {
    hash.map_or_else(|| name.to_owned(), |hash| format!("{name} with the hash {hash}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sought(at: &str, author: Author, options: ExternalPolicyOptions) -> SoughtPolicy {
        SoughtPolicy { author, at: Some(at.parse().unwrap()), options }
    }

    #[test]
    fn code_is_trusted_anew_and_only_the_same_code() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("policy.pt");
        std::fs::write(&path, b"code").unwrap();
        let spec = br#"{"format_version": 1, "frames": {"height": 2, "width": 2}, "actions": ["MoveAhead"]}"#;
        std::fs::write(path.with_extension("json"), spec).unwrap();
        let author = Author { checkpoint: Some(exported::hash(&path).unwrap()), ..Author::of("torchscript:policy", 0) };
        let at = format!("torchscript:{}", path.display());
        let refusal = |trust: bool| {
            let options = ExternalPolicyOptions { trust, ..ExternalPolicyOptions::default() };
            let error = sought(&at, author.clone(), options).open().err().unwrap();
            format!("{error:#}")
        };
        assert!(refusal(false).contains("add --trust"), "{}", refusal(false));
        assert!(refusal(true).contains("it is no TorchScript"), "{}", refusal(true));
        std::fs::write(&path, b"other code").unwrap();
        assert!(refusal(true).contains("not the policy that the run was made with"), "it does not run");
    }

    #[test]
    fn a_server_without_a_name_is_known_by_that() {
        assert!(is_address("ws:127.0.0.1:8000") && is_address("ws:node7:9000/policy"));
        assert!(!is_address("ws:walker") && !is_address("onnx:left"));
    }
}
