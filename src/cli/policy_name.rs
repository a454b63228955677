//! Who acts, as `--policy` names it.

use std::ffi::OsStr;
use std::path::PathBuf;
use std::str::FromStr;
use std::time::Duration;

use clap::builder::{PossibleValue, TypedValueParser};
use clap::error::ErrorKind;
use clap::{Arg, Args, Command, Error};

use crate::agent::exported::{ExportedPolicy, Format};
use crate::agent::policy_source::{self, PolicySource};
use crate::agent::registry::NamedAgent;
use crate::agent::served::{PolicyAddress, ServedPolicy};

/// Who acts.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum PolicyName {
    /// The trained agent.
    Agent,
    /// Shortest paths and interactions, knowing everything.
    Expert,
    /// A possible action by chance.
    Random,
    /// A person, at first.
    Manual,
    /// An external policy.
    External(ExternalPolicy),
}

/// A policy that is none of the program's own.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum ExternalPolicy {
    /// A policy server.
    Server(PolicyAddress),
    /// A policy that was exported to a file.
    File(Format, PathBuf),
}

impl PolicyName {
    /// Whether its actions can be drawn by chance instead of taking the likeliest.
    pub(crate) fn can_sample(&self) -> bool {
        matches!(self, PolicyName::Agent | PolicyName::External(ExternalPolicy::File(..)))
    }
}

/// Seconds that a policy server may take for an answer, unless told otherwise.
const PATIENCE: u64 = 60;

/// How an external policy is dealt with.
#[derive(Args, Clone, Copy, Debug)]
pub(crate) struct ExternalPolicyOptions {
    /// How long a policy server may take for an answer
    #[arg(long, value_name = "SECONDS", value_parser = clap::value_parser!(u64).range(1..=86_400), default_value_t = PATIENCE)]
    pub(super) policy_timeout: u64,
    /// Run the code that a TorchScript policy holds
    #[arg(long)]
    pub(super) trust: bool,
}

impl Default for ExternalPolicyOptions {
    /// Nothing is named.
    fn default() -> ExternalPolicyOptions {
        ExternalPolicyOptions { policy_timeout: PATIENCE, trust: false }
    }
}

impl ExternalPolicy {
    /// The kinds, as names of policies and of places begin.
    const KINDS: [&str; 3] = ["ws", Format::Onnx.name(), Format::TorchScript.name()];

    /// The kind of a policy that a run names so; `None` for the program's own.
    pub(crate) fn kind_of(policy: &str) -> Option<&'static str> {
        let (kind, _) = policy.split_once(':')?;
        ExternalPolicy::KINDS.into_iter().find(|known| *known == kind)
    }

    /// The same, with a file by its absolute path: found from any folder.
    fn absolute(&self) -> ExternalPolicy {
        match self {
            ExternalPolicy::Server(address) => ExternalPolicy::Server(address.clone()),
            ExternalPolicy::File(format, path) => {
                ExternalPolicy::File(*format, std::path::absolute(path).unwrap_or_else(|_| path.clone()))
            }
        }
    }

    /// Opens it.
    ///
    /// # Errors
    /// When it cannot be used; says what to do.
    pub(crate) fn open(&self, options: ExternalPolicyOptions, sampling: bool) -> anyhow::Result<PolicySource> {
        let source = match self {
            ExternalPolicy::File(Format::TorchScript, path) if !options.trust => anyhow::bail!(
                "{}: a TorchScript file is a program that runs with your rights: add --trust where you trust its maker, or \
                 export the policy as ONNX",
                path.display()
            ),
            ExternalPolicy::File(format, path) => ExportedPolicy::source(path, *format, sampling),
            ExternalPolicy::Server(address) => {
                ServedPolicy::source(address, Duration::from_secs(options.policy_timeout))
            }
        };
        Ok(source?.at(self.absolute().to_string()))
    }

    /// The same for an explorer, which opens it when it is to act.
    pub(crate) fn agent(&self, options: ExternalPolicyOptions) -> NamedAgent {
        let own = self.absolute();
        policy_source::agent_of(own.to_string(), move || own.open(options, false))
    }
}

impl std::fmt::Display for ExternalPolicy {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            ExternalPolicy::Server(address) => address.fmt(f),
            ExternalPolicy::File(format, path) => write!(f, "{}:{}", format.name(), path.display()),
        }
    }
}

impl FromStr for ExternalPolicy {
    type Err = String;

    fn from_str(text: &str) -> Result<ExternalPolicy, String> {
        if text.starts_with("ws:") || text.starts_with("wss:") {
            return text.parse().map(ExternalPolicy::Server);
        }
        for format in [Format::Onnx, Format::TorchScript] {
            let file = text.strip_prefix(format.name()).and_then(|rest| rest.strip_prefix(':'));
            if let Some(file) = file {
                return match file {
                    "" => Err(format!("{text}FILE: the file is missing")),
                    file => Ok(ExternalPolicy::File(format, file.into())),
                };
            }
        }
        Err(format!(
            "{text:?} is no external policy: it is ws:HOST:PORT for a policy server, or onnx:FILE for an exported policy"
        ))
    }
}

/// The names without anything behind them, with what help says of each.
static NAMES: [(&str, &str, PolicyName); 4] = [
    ("agent", "The trained agent", PolicyName::Agent),
    ("expert", "Shortest paths and interactions, knowing everything", PolicyName::Expert),
    ("random", "A possible action by chance", PolicyName::Random),
    ("manual", "You, at first", PolicyName::Manual),
];

/// Reads `--policy`.
#[derive(Clone, Copy)]
pub(crate) struct PolicyNameParser {
    /// Whether a person may act.
    manual: bool,
}

impl PolicyNameParser {
    /// Of a command in which nobody sits at the keys.
    pub(crate) const HEADLESS: PolicyNameParser = PolicyNameParser { manual: false };
    /// Of the explorer.
    pub(crate) const EXPLORER: PolicyNameParser = PolicyNameParser { manual: true };

    fn names(self) -> impl Iterator<Item = &'static (&'static str, &'static str, PolicyName)> {
        NAMES.iter().filter(move |(_, _, name)| self.manual || *name != PolicyName::Manual)
    }

    fn read(self, text: &str) -> Result<PolicyName, String> {
        if let Some((_, _, name)) = self.names().find(|(known, _, _)| *known == text) {
            return Ok(name.clone());
        }
        if text.starts_with("wss:") || ExternalPolicy::kind_of(text).is_some() {
            return text.parse().map(PolicyName::External);
        }
        let known: Vec<&str> = self.names().map(|(name, _, _)| *name).collect();
        Err(format!(
            "{text:?} is no policy: it is {}, ws:HOST:PORT for a policy server, or onnx:FILE for an exported policy",
            known.join(", ")
        ))
    }
}

impl TypedValueParser for PolicyNameParser {
    type Value = PolicyName;

    fn parse_ref(&self, command: &Command, _: Option<&Arg>, value: &OsStr) -> Result<PolicyName, Error> {
        let fails =
            |problem: String| Error::raw(ErrorKind::InvalidValue, format!("--policy: {problem}\n")).with_cmd(command);
        let text = value.to_str().ok_or_else(|| fails("it is no text".into()))?;
        self.read(text).map_err(fails)
    }

    fn possible_values(&self) -> Option<Box<dyn Iterator<Item = PossibleValue> + '_>> {
        let own = self.names().map(|(name, help, _)| PossibleValue::new(*name).help(*help));
        let external = [
            ("ws:HOST:PORT", "A policy server that speaks vla-eval's or openpi's protocol"),
            ("onnx:FILE", "A policy exported to ONNX, with FILE.json beside it (sprint schema policy)"),
            ("torchscript:FILE", "The same as TorchScript, which runs code: only with --trust"),
        ];
        Some(Box::new(own.chain(external.map(|(name, help)| PossibleValue::new(name).help(help)))))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn own_policies_are_named_and_others_by_where_they_are() {
        let read = |text: &str| PolicyNameParser::HEADLESS.read(text);
        assert_eq!(read("expert"), Ok(PolicyName::Expert));
        assert!(matches!(read("ws:127.0.0.1:8000"), Ok(PolicyName::External(ExternalPolicy::Server(_)))));
        let file = |format| Ok(PolicyName::External(ExternalPolicy::File(format, "a/b.onnx".into())));
        assert_eq!(read("onnx:a/b.onnx"), file(Format::Onnx));
        assert_eq!(read("torchscript:a/b.onnx"), file(Format::TorchScript));
        assert!(read("onnx:").unwrap_err().contains("the file is missing"));
        assert_eq!(PolicyNameParser::EXPLORER.read("manual"), Ok(PolicyName::Manual));
    }

    #[test]
    fn what_is_no_policy_is_refused_with_what_there_is() {
        let refusal = PolicyNameParser::HEADLESS.read("manual").unwrap_err();
        assert!(refusal.contains("agent, expert, random, ws:HOST:PORT"), "{refusal}");
        assert!(PolicyNameParser::HEADLESS.read("wss:host:1").unwrap_err().contains("ssh -L"));
    }
}
