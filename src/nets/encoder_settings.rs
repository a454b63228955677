//! Settings of a sentence encoder's folder beside the network's own: how long a text may be, and what else its authors' library
//! would do. What would change an embedding and is not done here is refused; what is not read at all is named.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use serde::de::DeserializeOwned;
use serde_json::Value;

use crate::data::{plain_file, text_file};

/// A JSON object of a folder whose settings are taken one by one.
pub(super) struct Settings {
    path: PathBuf,
    fields: BTreeMap<String, Value>,
}

impl Settings {
    /// Parses the contents of the file at `path`.
    ///
    /// # Errors
    /// When it is no JSON object; names the file.
    pub(super) fn parse(path: &Path, bytes: &[u8]) -> anyhow::Result<Settings> {
        let context = || path.display().to_string();
        let fields = serde_json::from_slice(text_file::content(bytes).with_context(context)?).with_context(context)?;
        Ok(Settings { path: path.to_owned(), fields })
    }

    /// Reads the file at `path`; without one, no setting is made.
    ///
    /// # Errors
    /// As [`parse`](Settings::parse).
    pub(super) fn read(path: &Path) -> anyhow::Result<Settings> {
        if !path.exists() {
            return Ok(Settings { path: path.to_owned(), fields: BTreeMap::new() });
        }
        let bytes = plain_file::read(path).with_context(|| format!("{} cannot be read", path.display()))?;
        Settings::parse(path, &bytes)
    }

    /// Takes a setting; nothing where it is not made.
    ///
    /// # Errors
    /// When it is of another type; names file and field.
    pub(super) fn take<T: DeserializeOwned>(&mut self, field: &str) -> anyhow::Result<Option<T>> {
        match self.fields.remove(field) {
            None | Some(Value::Null) => Ok(None),
            Some(value) => {
                serde_json::from_value(value).map(Some).with_context(|| format!("{}: {field}", self.path.display()))
            }
        }
    }

    /// Takes a limit in tokens. Where there is none, some programs write a huge number.
    ///
    /// # Errors
    /// When it is no positive number; names file and field.
    pub(super) fn limit(&mut self, field: &str) -> anyhow::Result<Option<usize>> {
        let Some(limit) = self.take::<f64>(field)? else { return Ok(None) };
        ensure!(limit >= 1.0, "{}: {field} is {limit}, not a number of tokens", self.path.display());
        Ok(Some(limit as usize))
    }

    /// Takes a setting that only one value of is supported.
    ///
    /// # Errors
    /// When it has another; names file and field.
    pub(super) fn only(&mut self, field: &str, supported: &Value) -> anyhow::Result<()> {
        match self.fields.remove(field) {
            None | Some(Value::Null) => Ok(()),
            Some(found) if found == *supported => Ok(()),
            Some(found) => anyhow::bail!(
                "{}: {field} is {found}, which is not supported: only {supported} is",
                self.path.display()
            ),
        }
    }

    /// Passes over settings that change no embedding.
    pub(super) fn pass_over(&mut self, fields: &[&str]) {
        fields.iter().for_each(|&field| drop(self.fields.remove(field)));
    }

    /// What was not taken, as `file: fields`.
    pub(super) fn unread(&self) -> Option<String> {
        let fields: Vec<&str> =
            self.fields.iter().filter(|(_, value)| !value.is_null()).map(|(name, _)| &**name).collect();
        let file = self.path.file_name().unwrap_or_default().to_string_lossy();
        (!fields.is_empty()).then(|| format!("{file}: {}", fields.join(", ")))
    }
}

/// How texts are read before they are embedded.
pub(super) struct TextSettings {
    pub(super) lower_case: bool,
    /// The longest text in tokens, where the module's own file says it.
    pub(super) own_limit: Option<usize>,
    /// The same where the tokenizer's settings do, which are not part of an encoder's digest.
    pub(super) tokenizer_limit: Option<usize>,
    /// Settings that nothing reads.
    pub(super) unread: Vec<String>,
}

impl TextSettings {
    /// Reads `sentence_bert_config.json` (its contents are `own`), `tokenizer_config.json` and
    /// `config_sentence_transformers.json`, any of which may be absent.
    ///
    /// # Errors
    /// When one is malformed, or asks for what is not built here.
    pub(super) fn read(folder: &Path, root: &Path, own: Option<(PathBuf, Vec<u8>)>) -> anyhow::Result<TextSettings> {
        let mut own = match own {
            Some((path, bytes)) => Settings::parse(&path, &bytes)?,
            None => Settings::read(&root.join("sentence_bert_config.json"))?,
        };
        let lower_case = own.take("do_lower_case")?.unwrap_or(false);
        let own_limit = own.limit("max_seq_length")?;
        own.only("transformer_task", &"feature-extraction".into())?;
        own.pass_over(&["modality_config", "module_output_name", "unpad_inputs"]);

        let mut tokens = Settings::read(&root.join("tokenizer_config.json"))?;
        let tokenizer_limit = tokens.limit("model_max_length")?;
        tokens.only("truncation_side", &"right".into())?;

        let mut whole = Settings::read(&folder.join("config_sentence_transformers.json"))?;
        let prompt: Option<String> = whole.take("default_prompt_name")?;
        let prompts: BTreeMap<String, Option<String>> = whole.take("prompts")?.unwrap_or_default();
        let prefix = prompt.as_ref().and_then(|name| prompts.get(name)).and_then(Option::as_deref).unwrap_or_default();
        ensure!(
            prefix.is_empty(),
            "{}: default_prompt_name puts {prefix:?} before each text, which is not supported",
            folder.join("config_sentence_transformers.json").display()
        );
        whole.only("truncate_dim", &Value::Null)?;
        whole.pass_over(&["__version__", "similarity_fn_name", "model_type"]);
        Ok(TextSettings {
            lower_case,
            own_limit,
            tokenizer_limit,
            // The tokenizer's own file says what its settings say; of these only the limit is read.
            unread: [own.unread(), whole.unread()].into_iter().flatten().collect(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(files: &[(&str, &str)]) -> anyhow::Result<TextSettings> {
        let folder = tempfile::tempdir().unwrap();
        for (name, text) in files {
            std::fs::write(folder.path().join(name), text).unwrap();
        }
        TextSettings::read(folder.path(), folder.path(), None)
    }

    #[test]
    fn every_files_limit_counts_and_no_limit_may_be_a_huge_number() {
        let limits = |own: &str, tokens: &str| {
            let files = [("sentence_bert_config.json", own), ("tokenizer_config.json", tokens)];
            let TextSettings { own_limit, tokenizer_limit, .. } = read(&files).unwrap();
            (own_limit, tokenizer_limit)
        };
        assert_eq!(limits(r#"{"max_seq_length": 256}"#, r#"{"model_max_length": 7}"#), (Some(256), Some(7)));
        let silent = limits(r#"{"max_seq_length": null}"#, r#"{"model_max_length": 7, "tokenizer_class": "X"}"#);
        assert_eq!(silent, (None, Some(7)));
        let endless = limits("\u{feff}{}", r#"{"model_max_length": 1000000000000000019884624838656}"#);
        assert!(endless.1.is_some_and(|limit| limit > 1_000_000), "{endless:?}");
    }

    #[test]
    fn settings_that_would_change_an_embedding_are_refused_and_others_named() {
        let told = |file: &str, text: &str| format!("{:#}", read(&[(file, text)]).err().unwrap());
        for (file, text, field) in [
            ("tokenizer_config.json", r#"{"truncation_side": "left"}"#, "truncation_side"),
            ("tokenizer_config.json", r#"{"model_max_length": -1}"#, "model_max_length"),
            ("tokenizer_config.json", r#"{"model_max_length": "7"}"#, "model_max_length"),
            ("sentence_bert_config.json", r#"{"max_seq_length": 0}"#, "max_seq_length"),
            ("sentence_bert_config.json", r#"{"transformer_task": "fill-mask"}"#, "transformer_task"),
            (
                "config_sentence_transformers.json",
                r#"{"default_prompt_name": "query", "prompts": {"query": "query: "}}"#,
                "default_prompt_name",
            ),
        ] {
            let error = told(file, text);
            assert!(error.contains(file) && error.contains(field), "{error}");
        }
        let unread = read(&[
            ("sentence_bert_config.json", r#"{"max_seq_length": 9, "colour": "red"}"#),
            (
                "config_sentence_transformers.json",
                r#"{"prompts": {"query": ""}, "size": 1, "similarity_fn_name": "cosine"}"#,
            ),
        ]);
        let named = ["sentence_bert_config.json: colour", "config_sentence_transformers.json: size"];
        assert_eq!(unread.unwrap().unread, named);
    }
}
