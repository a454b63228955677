//! What each source file names: its imports and paths, read from its tokens. Tests are left out, since they may look up.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use proc_macro2::{Delimiter, TokenStream, TokenTree};

/// A path in a file, such as `crate::house::House`, with the name it goes by there.
#[derive(Debug, PartialEq)]
pub(crate) struct Named {
    pub(crate) line: usize,
    pub(crate) segments: Vec<String>,
    pub(crate) alias: String,
    /// Whether it is a `pub use`.
    pub(crate) exported: bool,
}

pub(crate) struct Source {
    pub(crate) path: PathBuf,
    /// Its module below the crate, such as `house::grading`.
    pub(crate) module: String,
    pub(crate) named: Vec<Named>,
    /// The modules that this file declares for tests only.
    test_modules: Vec<String>,
}

impl Source {
    pub(crate) fn floor(&self) -> &str {
        self.module.split("::").next().unwrap_or_default()
    }

    /// A path of this file as a path below the crate; nothing for one that begins elsewhere.
    pub(crate) fn below_crate(&self, segments: &[String]) -> Option<Vec<String>> {
        let ups = segments.iter().take_while(|segment| *segment == "super").count();
        let module = || self.module.split("::").map(str::to_owned);
        let depth = self.module.split("::").count();
        match segments[0].as_str() {
            "crate" => Some(segments[1..].to_vec()),
            "self" => Some(module().chain(segments[1..].iter().cloned()).collect()),
            "super" => Some(module().take(depth.checked_sub(ups)?).chain(segments[ups..].iter().cloned()).collect()),
            _ => None,
        }
    }

    /// Whether it is the `mod.rs` of a folder.
    pub(crate) fn is_folder(&self) -> bool {
        self.path.ends_with("mod.rs")
    }
}

/// The sources of the crate, in order, without those that only tests use.
pub(crate) fn sources() -> Vec<Source> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut found = Vec::new();
    let mut folders = vec![root.clone()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| extension == "rs") {
                let mut parts = path.strip_prefix(&root).unwrap().with_extension("");
                if parts.ends_with("mod") {
                    parts.pop();
                }
                let module = parts.iter().map(|part| part.to_str().unwrap()).collect::<Vec<_>>().join("::");
                found.push(read(path.clone(), module, &std::fs::read_to_string(&path).unwrap()));
            }
        }
    }
    let tests: BTreeSet<String> = found
        .iter()
        .flat_map(|source| source.test_modules.iter().map(|name| format!("{}::{name}", source.module)))
        .collect();
    found.retain(|source| !tests.contains(&source.module));
    assert!(found.len() > 20, "the sources were not found");
    found.sort_by(|a, b| a.module.cmp(&b.module));
    found
}

pub(crate) fn read(path: PathBuf, module: String, text: &str) -> Source {
    let tokens: TokenStream = text.parse().unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let mut source = Source { path, module, named: Vec::new(), test_modules: Vec::new() };
    walk(tokens, &mut source);
    source
}

fn walk(tokens: TokenStream, source: &mut Source) {
    let tokens: Vec<TokenTree> = tokens.into_iter().collect();
    let mut at = 0;
    while at < tokens.len() {
        match &tokens[at] {
            TokenTree::Punct(mark) if mark.as_char() == '#' && is_for_tests(tokens.get(at + 1)) => {
                let end = item_end(&tokens, at + 2);
                let item = tokens.get(at + 2..end).unwrap_or_default();
                if let (Some(TokenTree::Punct(_)), Some(place)) =
                    (tokens.get(end), item.iter().position(|token| is_word(token, "mod")))
                {
                    source.test_modules.push(item[place + 1].to_string());
                }
                at = end + 1;
            }
            token
                if is_word(token, "use")
                    && !matches!(tokens.get(at + 1), Some(TokenTree::Punct(mark)) if mark.as_char() == '<') =>
            {
                let end = at + tokens[at..].iter().position(|token| is_mark(token, ';')).unwrap_or(tokens.len() - at);
                let before = match at.checked_sub(1).map(|before| &tokens[before]) {
                    // `pub(crate) use`
                    Some(TokenTree::Group(_)) if at > 1 => Some(&tokens[at - 2]),
                    other => other,
                };
                let exported = before.is_some_and(|token| is_word(token, "pub"));
                leaves(&tokens[at + 1..end], &[], exported, &mut source.named);
                at = end + 1;
            }
            TokenTree::Ident(first) => {
                let line = first.span().start().line;
                let mut segments = vec![first.to_string()];
                at += 1;
                while let [TokenTree::Punct(a), TokenTree::Punct(b), TokenTree::Ident(next), ..] = &tokens[at..]
                    && (a.as_char(), b.as_char()) == (':', ':')
                {
                    segments.push(next.to_string());
                    at += 3;
                }
                if segments.len() > 1 {
                    source.named.push(Named { line, alias: String::new(), segments, exported: false });
                }
            }
            TokenTree::Group(group) => {
                walk(group.stream(), source);
                at += 1;
            }
            _ => at += 1,
        }
    }
}

/// The paths of a `use`, one for each name that it brings in.
fn leaves(tokens: &[TokenTree], before: &[String], exported: bool, named: &mut Vec<Named>) {
    for tree in tokens.split(|token| is_mark(token, ',')).filter(|tree| !tree.is_empty()) {
        let mut segments = before.to_vec();
        let mut alias = None;
        let line = tree[0].span().start().line;
        for (place, token) in tree.iter().enumerate() {
            match token {
                TokenTree::Group(group) if group.delimiter() == Delimiter::Brace => {
                    let inner: Vec<TokenTree> = group.stream().into_iter().collect();
                    leaves(&inner, &segments, exported, named);
                    segments.clear();
                }
                TokenTree::Ident(word) if word == "as" => {
                    alias = Some(tree[place + 1].to_string());
                    break;
                }
                // `self` in a list is the list's own module.
                TokenTree::Ident(word) if word == "self" && !segments.is_empty() => {}
                TokenTree::Ident(word) => segments.push(word.to_string()),
                _ => {}
            }
        }
        if let Some(last) = segments.last().cloned() {
            named.push(Named { line, segments, alias: alias.unwrap_or(last), exported });
        }
    }
}

/// The place of the semicolon or the braces that end an item.
fn item_end(tokens: &[TokenTree], start: usize) -> usize {
    let ends = |token: &TokenTree| {
        is_mark(token, ';') || matches!(token, TokenTree::Group(group) if group.delimiter() == Delimiter::Brace)
    };
    tokens.iter().skip(start).position(ends).map_or(tokens.len(), |place| start + place)
}

fn is_for_tests(attribute: Option<&TokenTree>) -> bool {
    let Some(TokenTree::Group(group)) = attribute else { return false };
    group.stream().to_string().replace(' ', "") == "cfg(test)"
}

fn is_word(token: &TokenTree, word: &str) -> bool {
    matches!(token, TokenTree::Ident(ident) if ident == word)
}

fn is_mark(token: &TokenTree, mark: char) -> bool {
    matches!(token, TokenTree::Punct(punct) if punct.as_char() == mark)
}

#[test]
fn the_reader_of_imports_sees_them() {
    let paths = |text: &str| -> Vec<String> {
        let source = read("src/house/bounds.rs".into(), "house::bounds".into(), text);
        source.named.iter().map(|named| named.segments.join("::")).collect()
    };
    assert_eq!(
        paths("use crate::house::{Outcome,\n    House as Home};"),
        ["crate::house::Outcome", "crate::house::House"]
    );
    assert_eq!(
        paths("pub(crate) use crate::{\n  agent, run::{self, stats::*}};"),
        ["crate::agent", "crate::run", "crate::run::stats"]
    );
    assert_eq!(
        paths("fn a() { b!(\"{}\", crate::language::c(crate::domain::X)) }"),
        ["crate::language::c", "crate::domain::X"]
    );
    assert_eq!(paths("#[cfg(test)]\nmod tests { use crate::tui::X; }\nuse super::Y;"), ["super::Y"]);
    assert!(paths("// crate::tui::x\nconst A: &str = \"crate::tui::x\"; /* crate::tui::x */").is_empty());
}
