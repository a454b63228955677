//! The verbs as documents show them.

use std::fmt::Write;

#[cfg(test)]
use super::ExplorerPage;
#[cfg(test)]
use super::entry::{DefaultKey, KeyArguments, KeyScope};
#[cfg(test)]
use super::table::VERBS;
use super::table::typed;

/// The verbs that can be typed as a section of a manual page.
pub(crate) fn man_section() -> String {
    let mut section =
        ".SH EXPLORER VERBS\nTyped after : in the explorer, or a line each with \\-\\-plain.\n".to_string();
    for entry in typed() {
        let names: Vec<String> = std::iter::once(&entry.name).chain(entry.aliases).map(|name| bold(name)).collect();
        let arguments = roff(entry.arguments);
        let _ = write!(section, ".TP\n{} {arguments}\n{}\n", names.join(", "), roff(entry.help));
    }
    section
}

fn bold(name: &str) -> String {
    format!("\\fB{}\\fR", roff(name))
}

/// Text that `man` shows as it is.
fn roff(text: &str) -> String {
    let text = text.replace('\\', "\\e").replace('-', "\\-");
    if text.starts_with(['.', '\'']) { format!("\\&{text}") } else { text }
}

/// All verbs and keys as a table in Markdown.
#[cfg(test)]
pub(crate) fn markdown_table() -> String {
    let mut table = "| Verb | Keys | What it does |\n|---|---|---|\n".to_string();
    for entry in VERBS {
        let name = match (entry.is_typed, entry.arguments) {
            (false, _) => String::new(),
            (true, "") => format!("`{}`", entry.name),
            (true, arguments) => format!("`{} {}`", entry.name, arguments.replace('|', "\\|")),
        };
        let keys: Vec<String> = entry.keys.iter().map(keys).collect();
        let _ = writeln!(table, "| {name} | {} | {} |", keys.join("; "), entry.help);
    }
    table
}

/// Keys, with where they mean it and what they stand for.
#[cfg(test)]
fn keys(key: &DefaultKey) -> String {
    let names: Vec<String> = key.keys.iter().map(|name| format!("`{name}`")).collect();
    let notes: Vec<&str> = [scope(key.scope), arguments(key)].into_iter().flatten().collect();
    let notes = if notes.is_empty() { String::new() } else { format!(" ({})", notes.join(": ")) };
    format!("{}{notes}", names.join(" "))
}

#[cfg(test)]
fn arguments(key: &DefaultKey) -> Option<&'static str> {
    match key.arguments {
        KeyArguments::These("") | KeyArguments::Typed => None,
        KeyArguments::These(_) if key.label == "1-9" => Some("to `9`"),
        KeyArguments::These(arguments) => Some(arguments),
    }
}

#[cfg(test)]
fn scope(scope: KeyScope) -> Option<&'static str> {
    match scope {
        KeyScope::Common => None,
        KeyScope::ExplorerPage(ExplorerPage::Main) => Some("panels"),
        KeyScope::ExplorerPage(ExplorerPage::Branches) => Some("branches"),
        KeyScope::ExplorerPage(ExplorerPage::Mind) => Some("mind"),
        KeyScope::ExplorerPage(ExplorerPage::World) => Some("world"),
        KeyScope::ExplorerPage(ExplorerPage::Compare) => Some("compare"),
        KeyScope::ExplorerPage(ExplorerPage::Chain) => Some("chain"),
        KeyScope::ExplorerPage(ExplorerPage::Frame) => Some("frame"),
        KeyScope::ExplorerPage(ExplorerPage::Actions) => Some("actions"),
        KeyScope::Lists => Some("any page"),
        KeyScope::Watch => Some("a policy acts"),
        KeyScope::Manual => Some("you act"),
        KeyScope::Typing => Some("typing"),
        KeyScope::Help => Some("help"),
        KeyScope::WishList => Some("list of wishes"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Around the table in the document.
    const MARKS: [&str; 2] = ["<!-- verbs: begin -->\n", "<!-- verbs: end -->"];

    #[test]
    fn the_table_has_a_row_for_every_verb() {
        let table = markdown_table();
        assert_eq!(table.lines().count(), VERBS.len() + 2);
        assert!(table.contains("| `do N\\|ACTION` | `up` `w` (you act: MoveAhead); "), "{table}");
        assert!(table.lines().all(|row| row.replace("\\|", "").matches('|').count() == 4), "{table}");
    }

    #[test]
    fn the_document_of_the_explorer_shows_the_table_as_it_is() {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/docs/explorer.md");
        let Ok(text) = std::fs::read_to_string(&path) else { return };
        let [begin, end] = MARKS;
        let shown = text.split_once(begin).and_then(|(_, rest)| rest.split_once(end));
        let (shown, _) = shown.unwrap_or_else(|| panic!("{} has no {begin:?} and {end:?}", path.display()));
        assert_eq!(shown.trim(), markdown_table().trim(), "paste verb::markdown_table() between the marks");
    }

    #[test]
    fn the_manual_names_every_typed_verb() {
        let section = man_section();
        assert!(typed().all(|entry| section.contains(&format!("\\fB{}\\fR", entry.name))), "{section}");
        assert!(!section.lines().any(|line| line.starts_with(".gif")), "a point at a line's start is a request");
    }
}
