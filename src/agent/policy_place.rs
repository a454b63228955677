//! Where a policy is that is none of the program's own.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A policy server or an exported policy, as steps and manifests name it, and where it was when it acted.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct PolicyPlace {
    /// Its name.
    pub(crate) policy: String,
    /// SHA-256 of its file and description, or what its server says of its weights.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) checkpoint: Option<String>,
    /// As `--policy` takes it; of a file the whole path.
    pub(crate) place: String,
}

/// Notes where policies are now; what was known of the same ones is forgotten.
pub(crate) fn note(known: &mut Vec<PolicyPlace>, places: impl IntoIterator<Item = PolicyPlace>) {
    for place in places {
        known.retain(|before| (&before.policy, &before.checkpoint) != (&place.policy, &place.checkpoint));
        known.push(place);
    }
}
