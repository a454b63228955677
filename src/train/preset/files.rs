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
    ("et", include_str!("../../../assets/presets/et.toml")),
    ("sprint-no-chain", include_str!("../../../assets/presets/sprint-no-chain.toml")),
    ("sprint-no-agg", include_str!("../../../assets/presets/sprint-no-agg.toml")),
    ("sprint-concat-agg", include_str!("../../../assets/presets/sprint-concat-agg.toml")),
    ("sprint-llm-chain", include_str!("../../../assets/presets/sprint-llm-chain.toml")),
    ("l-bc-agg", include_str!("../../../assets/presets/l-bc-agg.toml")),
];
/// Sizes other than the presets' own, which suits two CPU cores.
const SIZES: [(&str, &str); 1] = [("paper", include_str!("../../../assets/presets/sizes/paper.toml"))];

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

    /// The values of a size. Each has to be one that some method has; a method without it passes it over.
    fn size(name: &str) -> anyhow::Result<toml::Table> {
        let values: toml::Table = shipped(&SIZES, name, "size")?.parse()?;
        let mut every_method = toml::Table::new();
        for method in Preset::names() {
            extend(&mut every_method, Preset::table(method)?);
        }
        extend(&mut every_method, values.clone());
        Preset::parse(every_method)?;
        Ok(values)
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

/// Puts the values of a size over those that `table` has.
fn resize(table: &mut toml::Table, size: toml::Table) {
    for (key, value) in size {
        match (table.get_mut(&key), value) {
            (Some(toml::Value::Table(below)), toml::Value::Table(value)) => resize(below, value),
            (Some(own), value) => *own = value,
            (None, _) => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::algo::chain::PairSource;
    use crate::data::selection::{Composites, ObjectTarget};

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
            assert!(paper.chaining.is_none_or(|chaining| chaining.pairs == PairSource::InBatch), "{name}");
        }
        let method = |name| Preset::named(name).unwrap().method();
        let methods = ["sprint", "sprint-no-agg", "sprint-no-chain", "iql-primitive", "l-bc", "l-bc-agg", "am", "et"];
        assert_eq!(methods.map(method), ["sprint", "sprint", "iql", "iql", "bc", "bc", "am", "et"]);
        let composites = |name| Preset::named(name).unwrap().data.composites;
        let selections = ["sprint", "l-bc", "iql-primitive", "sprint-no-agg", "sprint-concat-agg"].map(composites);
        assert_eq!(
            selections,
            [Composites::Labels, Composites::None, Composites::None, Composites::None, Composites::Concat]
        );
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
}
