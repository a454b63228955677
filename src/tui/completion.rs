//! What a typed instruction may become.

use super::app::App;
use crate::domain::Class;

impl App {
    /// Instructions that the typed text begins, the last used first: what was told before, then things in view.
    pub(crate) fn completions(&self) -> Vec<String> {
        let typed = self.input.editor.text();
        let mut found: Vec<String> = Vec::new();
        let bare = |text: &str| text.trim_end_matches('.').to_lowercase();
        let mut add = |text: String| {
            if text.len() > typed.len() && !found.iter().any(|known| bare(known) == bare(&text)) {
                found.push(text);
            }
        };
        let begins = |text: &str| text.to_lowercase().starts_with(&typed.to_lowercase());
        self.input.editor.history().iter().rev().filter(|text| begins(text)).for_each(|text| add(text.clone()));
        self.session.examples.iter().filter(|text| begins(text)).for_each(|text| add(text.clone()));
        let (head, word) = typed.rsplit_once(' ').map_or(("", typed), |(head, word)| (head, word));
        if !word.is_empty() {
            for name in self.things_in_view().iter().filter(|name| name.starts_with(&word.to_lowercase())) {
                add(format!("{head}{}{name}", if head.is_empty() { "" } else { " " }));
            }
        }
        found
    }

    /// The names of the things that the frame shows, each once.
    pub(crate) fn things_in_view(&self) -> Vec<&'static str> {
        let Some(now) = &self.session.now else { return Vec::new() };
        let classes = now.view.sightings.iter().filter_map(|seen| now.world.class_of(&now.scene, seen.instance));
        let mut names: Vec<&str> = classes.map(Class::spoken).collect();
        names.sort_unstable();
        names.dedup();
        names
    }
}
