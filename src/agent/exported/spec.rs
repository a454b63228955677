//! The description beside an exported policy: what its inputs and outputs mean.

use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use serde::{Deserialize, Serialize};

use crate::data::json;

/// What goes into an exported policy and what comes out: `policy.json` beside `policy.onnx`. Every input and output has a first
/// dimension of 1, or of any size.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct PolicySpec {
    /// Version of this format.
    #[schemars(extend("const" = PolicySpec::FORMAT))]
    pub(crate) format_version: u32,
    /// The input `frames`.
    pub(crate) frames: FramesSpec,
    /// How the instruction comes in; a policy without reads none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) instruction: Option<InstructionSpec>,
    /// The actions of the output `actions`, float32 [1, their number], logits; -inf masks. Actions that the environment has and
    /// this list has not are never chosen.
    #[schemars(length(min = 1))]
    pub(crate) actions: Vec<String>,
    /// What actions are done to, in House object classes: the output `arguments`, float32 [1, their number], logits. Without any
    /// there is no such output, and the nearest or first one that is possible is taken.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(crate) arguments: Vec<String>,
    /// There is an output `value`, float32 [1] or [1, 1]: the value of the state.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub(crate) value: bool,
}

/// The input `frames`, float32 [1, 3 x history, height, width]: planes of red, green and blue of the last frames, the oldest
/// first, each value (byte / 255 - mean) / std. Before the first frame there was the first one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct FramesSpec {
    /// Rows. Larger square frames are averaged down to square ones.
    #[schemars(range(min = 1, max = 2048))]
    pub(crate) height: usize,
    /// Pixels in a row.
    #[schemars(range(min = 1, max = 2048))]
    pub(crate) width: usize,
    /// How many frames.
    #[serde(default = "one")]
    #[schemars(range(min = 1, max = 64))]
    pub(crate) history: usize,
    /// Taken off red, green and blue.
    #[serde(default)]
    pub(crate) mean: [f32; 3],
    /// What they are divided by then.
    #[serde(default = "ones")]
    pub(crate) std: [f32; 3],
}

/// How an instruction comes in.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub(crate) enum InstructionSpec {
    /// The input `tokens`, int64 or int32 [1, length]: the instruction in lower case, split at all that is no letter or digit;
    /// 0 pads at the end, 1 is an unknown word, a word of the vocabulary is its place from 2. What is longer is cut.
    Tokens {
        /// The words.
        vocabulary: Vec<String>,
        /// How many tokens.
        #[schemars(range(min = 1, max = 4096))]
        length: usize,
    },
    /// The input `instruction`, float32 [1, size]: what a sentence encoder makes of it.
    Embedding {
        /// The encoder's name among those at hand, such as all-MiniLM-L6-v2.
        encoder: String,
        /// The encoder's width.
        #[schemars(range(min = 1, max = 65536))]
        size: usize,
    },
}

fn one() -> usize {
    1
}

fn ones() -> [f32; 3] {
    [1.0; 3]
}

/// An input or output that a description asks for: its name, and its dimensions after the first.
pub(super) type Port = (&'static str, Vec<usize>);

impl PolicySpec {
    /// The format version this program reads.
    pub(crate) const FORMAT: u32 = 1;
    /// The input of an instruction's words.
    pub(super) const TOKENS: &str = "tokens";

    /// Where the description of an exported policy lies.
    pub(super) fn path_of(model: &Path) -> PathBuf {
        model.with_extension("json")
    }

    /// Reads the description beside an exported policy.
    ///
    /// # Errors
    /// When it is missing or malformed; names the file and the field.
    pub(super) fn beside(model: &Path) -> anyhow::Result<PolicySpec> {
        let path = PolicySpec::path_of(model);
        ensure!(
            path.exists(),
            "{}: missing; it says what goes into {} and what comes out (sprint schema policy)",
            path.display(),
            model.display()
        );
        let spec = json::read::<PolicySpec>(&path, PolicySpec::FORMAT)?.value;
        spec.check().with_context(|| path.display().to_string())?;
        Ok(spec)
    }

    fn check(&self) -> anyhow::Result<()> {
        let FramesSpec { height, width, history, mean, std } = &self.frames;
        ensure!((1..=2048).contains(height) && (1..=2048).contains(width), "frames: {height} x {width} is no size");
        ensure!((1..=64).contains(history), "frames.history: {history} is none of 1 to 64");
        ensure!(mean.iter().all(|mean| mean.is_finite()), "frames.mean: not finite");
        ensure!(std.iter().all(|std| std.is_finite() && *std > 0.0), "frames.std: it must be above 0");
        ensure!(!self.actions.is_empty(), "actions: there is none");
        for (field, names) in [("actions", &self.actions), ("arguments", &self.arguments)] {
            for (i, name) in names.iter().enumerate() {
                ensure!(!names[..i].contains(name), "{field}[{i}]: {name:?} is there already");
            }
        }
        match &self.instruction {
            Some(InstructionSpec::Tokens { length, .. }) => {
                ensure!((1..=4096).contains(length), "instruction.tokens.length: {length} is none of 1 to 4096");
            }
            Some(InstructionSpec::Embedding { encoder, size }) => {
                let is_name = Path::new(encoder).file_name().is_some_and(|name| name == encoder.as_str());
                ensure!(is_name, "instruction.embedding.encoder: {encoder:?} is no encoder's name");
                ensure!((1..=65536).contains(size), "instruction.embedding.size: {size} is no size");
            }
            None => {}
        }
        Ok(())
    }

    /// What goes in.
    pub(super) fn inputs(&self) -> Vec<Port> {
        let FramesSpec { height, width, history, .. } = self.frames;
        let instruction = self.instruction.as_ref().map(|instruction| match instruction {
            InstructionSpec::Tokens { length, .. } => (PolicySpec::TOKENS, vec![*length]),
            InstructionSpec::Embedding { size, .. } => ("instruction", vec![*size]),
        });
        std::iter::once(("frames", vec![3 * history, height, width])).chain(instruction).collect()
    }

    /// What comes out.
    pub(super) fn outputs(&self) -> Vec<Port> {
        let arguments = (!self.arguments.is_empty()).then(|| ("arguments", vec![self.arguments.len()]));
        let value = self.value.then(|| ("value", vec![]));
        std::iter::once(("actions", vec![self.actions.len()])).chain(arguments).chain(value).collect()
    }
}
