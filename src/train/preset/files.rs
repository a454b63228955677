//! Where presets come from: shipped texts and files, a preset that extends another, and sizes over them.

use std::path::Path;

use anyhow::Context;

use super::Preset;
use crate::data::text_file;

const SHIPPED: [(&str, &str); 10] = [
    ("sprint", include_str!("../../../assets/presets/sprint.toml")),
    ("l-bc", include_str!("../../../assets/presets/l-bc.toml")),
    ("iql-primitive", include_str!("../../../assets/presets/iql-primitive.toml")),
    ("am", include_str!("../../../assets/presets/am.toml")),
    ("l-bc-transformer", include_str!("../../../assets/presets/l-bc-transformer.toml")),
    ("sprint-no-chain", include_str!("../../../assets/presets/sprint-no-chain.toml")),
    ("sprint-no-agg", include_str!("../../../assets/presets/sprint-no-agg.toml")),
    ("sprint-concat-agg", include_str!("../../../assets/presets/sprint-concat-agg.toml")),
    ("sprint-llm-chain", include_str!("../../../assets/presets/sprint-llm-chain.toml")),
    ("l-bc-agg", include_str!("../../../assets/presets/l-bc-agg.toml")),
];
/// Sizes other than the presets' own, which suits two CPU cores.
const SIZES: [(&str, &str); 2] = [
    ("paper", include_str!("../../../assets/presets/sizes/paper.toml")),
    ("narrow", include_str!("../../../assets/presets/sizes/narrow.toml")),
];

impl Preset {
    /// The names of the shipped presets.
    pub fn names() -> Vec<&'static str> {
        SHIPPED.iter().map(|(name, _)| *name).collect()
    }

    /// A shipped preset by name, or one from a file, in its own size.
    ///
    /// # Errors
    /// As [`Preset::sized`].
    pub fn named(name: &str) -> anyhow::Result<Preset> {
        Preset::sized(name, None)
    }

    /// A shipped preset by name, or one from a file, which may extend a shipped one. `size` names a shipped size or a file;
    /// it changes only what the preset has.
    ///
    /// # Errors
    /// When there is no such preset or size, or it is malformed; the field is named.
    pub(crate) fn sized(name: &str, size: Option<&str>) -> anyhow::Result<Preset> {
        let mut table = Preset::table(name).with_context(|| format!("the preset {name}"))?;
        if let Some(size) = size {
            let values = Preset::size(size).with_context(|| format!("the size {size}"))?;
            resize(&mut table, values);
        }
        Preset::of(table).with_context(|| format!("the preset {name}"))
    }

    /// The values of a size, which may extend a shipped one. Each has to be one that some method has.
    fn size(name: &str) -> anyhow::Result<toml::Table> {
        let mut values: toml::Table = shipped(&SIZES, name, "size")?.parse()?;
        match values.remove("extends") {
            None => (),
            Some(toml::Value::String(base)) if SIZES.iter().any(|(size, _)| *size == base) && base != name => {
                let mut whole = Preset::size(&base)?;
                extend(&mut whole, values);
                values = whole;
            }
            Some(other) => anyhow::bail!("extends is {other}, which is no other shipped size"),
        }
        let mut every_method = toml::Table::new();
        for method in Preset::names() {
            extend(&mut every_method, Preset::table(method)?);
        }
        extend(&mut every_method, values.clone());
        Preset::parse(every_method)?;
        Ok(values)
    }

    /// The parts in which a training that was begun computes its updates, from the preset that it keeps; nothing where it keeps none.
    ///
    /// # Errors
    /// When the file cannot be read.
    pub(crate) fn parts_of(kept: &Path) -> anyhow::Result<Option<usize>> {
        let table: toml::Table = match text_file::read(kept) {
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            read => {
                read.with_context(|| kept.display().to_string())?.parse().with_context(|| kept.display().to_string())?
            }
        };
        Ok(Some(table.get("parts").and_then(toml::Value::as_integer).map_or(1, |parts| parts.max(1) as usize)))
    }

    /// A preset's text with what it extends.
    pub(super) fn table(name: &str) -> anyhow::Result<toml::Table> {
        let mut table: toml::Table = shipped(&SHIPPED, name, "preset")?.parse()?;
        match table.remove("extends") {
            None => Ok(table),
            Some(toml::Value::String(base)) if Preset::names().contains(&base.as_str()) && base != name => {
                let mut whole = Preset::table(&base)?;
                extend(&mut whole, table);
                Ok(whole)
            }
            Some(other) => anyhow::bail!("extends is {other}, which is no other shipped preset"),
        }
    }
}

/// A shipped text by name, or a file's.
fn shipped(texts: &[(&'static str, &'static str)], name: &str, what: &str) -> anyhow::Result<String> {
    if let Some((_, text)) = texts.iter().find(|(shipped, _)| *shipped == name) {
        return Ok((*text).to_string());
    }
    let names: Vec<&str> = texts.iter().map(|(name, _)| *name).collect();
    match text_file::read(Path::new(name)) {
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
            anyhow::bail!("there is no {what} {name:?}, nor a file of that name: use {} or a file", names.join(", "))
        }
        read => read.with_context(|| format!("{name} cannot be read")),
    }
}

/// Puts `over` over `table`, section by section; `false` takes a section away.
pub(crate) fn extend(table: &mut toml::Table, over: toml::Table) {
    for (key, value) in over {
        match (table.get_mut(&key), value) {
            (Some(toml::Value::Table(below)), toml::Value::Table(value)) => extend(below, value),
            (Some(toml::Value::Table(_)), toml::Value::Boolean(false)) => drop(table.remove(&key)),
            (_, value) => drop(table.insert(key, value)),
        }
    }
}

/// What a method may lack. A size says how large such a part is where there is one, and never adds it.
const PARTS_OF_METHODS: [&str; 5] = ["critic", "iql", "chaining", "goal_channels", "attention"];

/// Puts the values of a size over those of `table`.
fn resize(table: &mut toml::Table, size: toml::Table) {
    for (key, value) in size {
        match (table.get_mut(&key), value) {
            (Some(toml::Value::Table(below)), toml::Value::Table(value)) => resize(below, value),
            (None, _) if PARTS_OF_METHODS.contains(&key.as_str()) => {}
            (_, value) => drop(table.insert(key, value)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::agent::DecisionRule;
    use crate::agent::config::CheckpointConfig;
    use crate::algo::chain::PairSource;
    use crate::data::selection::{Composites, HistoryStart, ObjectTarget};
    use crate::nets::precision::Precision;
    use crate::train::preset::VisualBackbone;

    #[test]
    fn every_shipped_preset_parses_in_every_size_and_is_what_its_name_says() {
        for name in Preset::names() {
            let preset = Preset::named(name).unwrap();
            assert_eq!(preset.name, name);
            let paper = Preset::sized(name, Some("paper")).unwrap();
            assert_eq!((paper.training.batch_size, paper.policy.embedding), (1024, 768), "{name}");
            assert_eq!(paper.method(), preset.method(), "{name}");
            assert!(paper.critic.is_none_or(|critic| !critic.shared_trunk), "{name}");
            assert_eq!(
                (preset.data.object_target, paper.data.object_target),
                (ObjectTarget::Next, ObjectTarget::Current),
                "{name}"
            );
            assert!(paper.iql.is_none_or(|iql| iql.advantage_scale == 0.0), "{name}");
            assert_eq!(
                (paper.visual_backbone, paper.data.history_start, paper.hold_out),
                (VisualBackbone::ResNet18, HistoryStart::Trajectory, 0),
                "{name}"
            );
            assert_eq!((preset.decision, preset.loop_guard), (DecisionRule::Mass, true), "{name}");
            assert_eq!((paper.decision, paper.loop_guard), (DecisionRule::Paper, false), "{name}");
            assert!(paper.chaining.is_none_or(|chaining| chaining.pairs == PairSource::InBatch), "{name}");
        }
        let method = |name| Preset::named(name).unwrap().method();
        let methods = [
            "sprint",
            "sprint-no-agg",
            "sprint-no-chain",
            "iql-primitive",
            "l-bc",
            "l-bc-agg",
            "am",
            "l-bc-transformer",
        ];
        assert_eq!(methods.map(method), ["sprint", "sprint", "iql", "iql", "bc", "bc", "am", "transformer-bc"]);
        let composites = |name| Preset::named(name).unwrap().data.composites;
        let selections = ["sprint", "l-bc", "iql-primitive", "sprint-no-agg", "sprint-concat-agg"].map(composites);
        assert_eq!(
            selections,
            [Composites::Labels, Composites::None, Composites::None, Composites::None, Composites::Concat]
        );
    }

    #[test]
    fn an_older_agent_is_trained_on_in_the_narrow_size() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/agents/clone");
        let config = CheckpointConfig::read(&folder).unwrap();
        let sized = Preset::sized("l-bc", Some("narrow")).unwrap();
        assert!(config.policy.fits(&sized.policy));
    }

    #[test]
    fn every_recipe_is_a_preset() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/recipes");
        let recipes: Vec<_> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
        assert!(!recipes.is_empty());
        for recipe in recipes {
            Preset::named(recipe.to_str().unwrap()).unwrap();
        }
    }

    #[test]
    fn a_size_may_hold_what_a_method_lacks_and_no_field_that_none_has() {
        let folder = tempfile::tempdir().unwrap();
        let sized = |text: &str| {
            let file = folder.path().join("small.toml");
            std::fs::write(&file, text).unwrap();
            Preset::sized("l-bc", file.to_str())
        };
        let small = sized("[policy]\nhidden = [8]\ngoal_channels = [2, 2, 2, 2]\n[chaining]\nbatch_size = 4").unwrap();
        assert_eq!((small.policy.hidden, small.policy.goal_channels, small.chaining), (vec![8], None, None));
        for (text, field, section) in [("batch = 4", "batch", "batch"), ("[critic]\nheight = 4", "height", "critic")] {
            let error = format!("{:#}", sized(text).unwrap_err());
            assert!(error.contains("small.toml: unknown field"), "{error}");
            assert!(error.contains(&format!("`{field}`")) && error.contains(section), "{error}");
        }
        assert!(format!("{:#}", sized("[policy]\nhidden = 8").unwrap_err()).contains("hidden"));
    }

    #[test]
    fn a_size_sets_what_a_preset_leaves_to_its_default_and_may_extend_a_shipped_size() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("own.toml");
        let sized = |text: &str| {
            std::fs::write(&file, text).unwrap();
            Preset::sized("l-bc", file.to_str())
        };
        let own = sized("extends = \"paper\"\nprecision = \"mixed\"\n[policy]\nhidden = [8]").unwrap();
        assert_eq!((own.policy.hidden, own.policy.embedding), (vec![8], 768));
        assert_eq!((own.visual_backbone, own.precision), (VisualBackbone::ResNet18, Precision::Mixed));
        let error = format!("{:#}", sized("extends = \"moon\"").unwrap_err());
        assert!(error.contains("extends is \"moon\", which is no other shipped size"), "{error}");
    }
}
