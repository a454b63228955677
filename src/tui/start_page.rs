//! The page before any house is open: a list of what there is to start with, and a line to search it.

use crossterm::event::{KeyCode, KeyEvent, KeyEventKind, KeyModifiers};

use super::editor::Editor;
use crate::explore::start_list::{Start, StartEntry, matching};

/// The list, and what was typed to search it.
pub(crate) struct StartPage {
    entries: Vec<StartEntry>,
    typed: Editor,
    /// The entries that fit, the best first.
    pub(crate) found: Vec<StartEntry>,
    /// The one of them that is selected.
    pub(crate) selected: usize,
    /// What is being opened.
    pub(crate) opening: Option<String>,
    /// Why the last one could not be opened.
    pub(crate) complaint: Option<String>,
}

/// What a key comes to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum StartAnswer {
    Stay,
    Open(Start),
    Leave,
}

/// Lines that page up and page down go.
const PAGE: isize = 10;

impl StartPage {
    /// Everything is listed; the first is selected.
    pub(crate) fn new(entries: Vec<StartEntry>) -> StartPage {
        let mut typed = Editor::default();
        typed.open("");
        StartPage { found: entries.clone(), entries, typed, selected: 0, opening: None, complaint: None }
    }

    /// What was typed.
    pub(crate) fn typed(&self) -> &Editor {
        &self.typed
    }

    /// How many there are in all.
    pub(crate) fn total(&self) -> usize {
        self.entries.len()
    }

    /// Takes in a key. While something is opened only `ctrl-c` counts.
    pub(crate) fn on_key(&mut self, key: KeyEvent) -> StartAnswer {
        if key.kind == KeyEventKind::Release {
            return StartAnswer::Stay;
        }
        let control = key.modifiers.contains(KeyModifiers::CONTROL);
        match (key.code, control) {
            (KeyCode::Char('c'), true) => return StartAnswer::Leave,
            _ if self.opening.is_some() => return StartAnswer::Stay,
            (KeyCode::Up, _) | (KeyCode::Char('p'), true) => self.select(-1),
            (KeyCode::Down, _) | (KeyCode::Char('n'), true) => self.select(1),
            (KeyCode::PageUp, _) => self.select(-PAGE),
            (KeyCode::PageDown, _) => self.select(PAGE),
            (KeyCode::Tab, _) => self.next_kind(),
            (KeyCode::Enter, _) => return self.open(self.selected),
            (KeyCode::Esc, _) if self.typed.text().is_empty() => return self.open(0),
            (KeyCode::Esc, _) | (KeyCode::Char('u'), true) => {
                self.typed.open("");
                self.search();
            }
            _ => {
                self.typed.key(key);
                self.search();
            }
        }
        StartAnswer::Stay
    }

    /// Takes in what was pasted.
    pub(crate) fn on_paste(&mut self, text: &str) {
        if self.opening.is_none() {
            self.typed.paste(text);
            self.search();
        }
    }

    /// What was asked for could not be opened.
    pub(crate) fn fail(&mut self, why: String) {
        self.opening = None;
        self.complaint = Some(why);
    }

    fn search(&mut self) {
        self.found = matching(&self.entries, self.typed.text());
        self.selected = 0;
        self.complaint = None;
    }

    fn select(&mut self, by: isize) {
        self.selected = self.selected.saturating_add_signed(by).min(self.found.len().saturating_sub(1));
    }

    /// To the first of the next kind, around.
    fn next_kind(&mut self) {
        let Some(kind) = self.found.get(self.selected).map(|entry| entry.start.kind()) else { return };
        let after = (self.selected..self.found.len()).find(|&at| self.found[at].start.kind() != kind);
        self.selected = after.unwrap_or(0);
    }

    fn open(&mut self, at: usize) -> StartAnswer {
        let Some(entry) = self.found.get(at) else { return StartAnswer::Stay };
        self.selected = at;
        self.complaint = None;
        self.opening = Some(entry.name.clone());
        StartAnswer::Open(entry.start.clone())
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::domain::Room;

    /// A list with something of every kind.
    pub(crate) fn page() -> StartPage {
        let entry = |start: Start, name: &str, note: &str| StartEntry { start, name: name.into(), note: note.into() };
        let house = |room: Room| entry(Start::House { room, seed: 0 }, room.spoken(), "generated");
        let mut entries = vec![entry(
            Start::Session("session.json".into()),
            "kitchen 3",
            "step 12, 2 branches: Put the mug in the sink, then open the fridge.",
        )];
        entries.extend([Room::Kitchen, Room::Bedroom, Room::LivingRoom, Room::Bathroom].map(house));
        entries.extend(
            (1..=20).map(|n| entry(Start::FloorPlan(format!("FloorPlan{n}")), &format!("FloorPlan{n}"), "in data")),
        );
        entries.push(entry(Start::Task { file: "eval_100.json".into(), number: 1 }, "eval_100", "in data/tasks"));
        entries.push(entry(Start::Checkpoint("checkpoints/alfred".into()), "alfred", "in checkpoints"));
        let run = Start::Run { folder: "runs/eval-20260101-101010".into(), number: 1 };
        entries.push(entry(run, "eval-20260101-101010", "alfred · eval_100, 100 tasks"));
        StartPage::new(entries)
    }

    pub(crate) fn type_text(page: &mut StartPage, text: &str) {
        for c in text.chars() {
            assert_eq!(page.on_key(KeyCode::Char(c).into()), StartAnswer::Stay);
        }
    }

    #[test]
    fn escape_or_enter_opens_the_first_and_control_c_leaves() {
        for key in [KeyCode::Esc, KeyCode::Enter] {
            let opened = page().on_key(key.into());
            assert_eq!(opened, StartAnswer::Open(Start::Session("session.json".into())));
        }
        let leave = KeyEvent::new(KeyCode::Char('c'), KeyModifiers::CONTROL);
        assert_eq!(page().on_key(leave), StartAnswer::Leave);
        let mut opening = page();
        opening.on_key(KeyCode::Enter.into());
        assert_eq!(opening.on_key(KeyCode::Enter.into()), StartAnswer::Stay, "one at a time");
        assert_eq!(opening.on_key(leave), StartAnswer::Leave);
    }

    #[test]
    fn typing_searches_escape_clears_and_a_number_is_the_seed() {
        let mut page = page();
        type_text(&mut page, "bath 12");
        assert_eq!(page.found[0].start, Start::House { room: Room::Bathroom, seed: 12 });
        assert_eq!(page.on_key(KeyCode::Esc.into()), StartAnswer::Stay);
        assert_eq!(page.found.len(), page.total());
        type_text(&mut page, "eval #7");
        assert!(matches!(&page.found[0].start, Start::Task { number: 7, .. } | Start::Run { number: 7, .. }));
        type_text(&mut page, "zz");
        assert_eq!(page.on_key(KeyCode::Enter.into()), StartAnswer::Stay, "nothing fits");
    }

    #[test]
    fn keys_move_along_the_list_and_tab_to_the_next_kind() {
        let mut page = page();
        let control = |c| KeyEvent::new(KeyCode::Char(c), KeyModifiers::CONTROL);
        page.on_key(control('n'));
        page.on_key(KeyCode::Down.into());
        page.on_key(control('p'));
        assert_eq!(page.selected, 1);
        page.on_key(KeyCode::Tab.into());
        assert_eq!(page.found[page.selected].start.kind(), "floor plan");
        for kind in ["tasks", "checkpoint", "run", "last session"] {
            page.on_key(KeyCode::Tab.into());
            assert_eq!(page.found[page.selected].start.kind(), kind);
        }
        page.on_key(KeyCode::PageDown.into());
        page.on_key(KeyCode::PageUp.into());
        page.on_key(KeyCode::Up.into());
        assert_eq!(page.selected, 0);
    }
}
