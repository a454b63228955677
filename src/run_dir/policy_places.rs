//! Where the policies of a run were that are none of the program's own: its `policies.json`. It is no part of the manifest, as it
//! says nothing of what was measured: a run goes on with the same policy elsewhere.

use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::layout::POLICIES;
use crate::agent::policy_place::PolicyPlace;
use crate::data::json;
use crate::episode::record::Author;

/// Where the policies of a run were that are none of the program's own.
#[derive(Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct PolicyPlaces {
    /// Version of the file's format.
    #[schemars(extend("const" = FORMAT))]
    format_version: u32,
    /// A policy each.
    policies: Vec<PolicyPlace>,
}

/// The format version that is read and written.
const FORMAT: u32 = 1;

/// Reads what a run folder says; nothing where all its policies were the program's own.
///
/// # Errors
/// When the file is broken or of another version.
pub(crate) fn read(run: &Path) -> anyhow::Result<Vec<PolicyPlace>> {
    let path = run.join(POLICIES);
    if !path.exists() {
        return Ok(Vec::new());
    }
    Ok(json::read::<PolicyPlaces>(&path, FORMAT)?.value.policies)
}

/// Writes it, where there is anything to say.
///
/// # Errors
/// When the folder cannot be written to.
pub(crate) fn write(run: &Path, policies: &[PolicyPlace]) -> anyhow::Result<()> {
    if policies.is_empty() {
        return Ok(());
    }
    json::write_pretty(&run.join(POLICIES), &PolicyPlaces { format_version: FORMAT, policies: policies.to_vec() })
}

/// Where the policy of an author was.
pub(crate) fn place_of<'a>(policies: &'a [PolicyPlace], author: &Author) -> Option<&'a str> {
    let is_it = |known: &&PolicyPlace| known.policy == author.policy && known.checkpoint == author.checkpoint;
    policies.iter().find(is_it).map(|known| known.place.as_str())
}
