//! In which line of a JSON text a field stands, for messages about files that people wrote.

use std::collections::BTreeMap;

/// The lines, from 1, of the wanted fields (as in `tasks[1].roles[0].class`); a field that is not there has the line of
/// the nearest thing around it that is. The text must be JSON.
pub(crate) fn lines_of<'a>(text: &str, wanted: impl IntoIterator<Item = &'a str>) -> BTreeMap<&'a str, usize> {
    let mut known = BTreeMap::new();
    let mut scan = Scan { bytes: text.as_bytes(), at: 0, line: 1, known: &mut known };
    scan.value("");
    let nearest = |field: &str| {
        let mut around = field;
        loop {
            if let Some(&line) = known.get(around) {
                return line;
            }
            match around.rfind(['.', '[']) {
                Some(end) => around = &around[..end],
                None => return known.get("").copied().unwrap_or(1),
            }
        }
    };
    wanted.into_iter().map(|field| (field, nearest(field))).collect()
}

struct Scan<'a> {
    bytes: &'a [u8],
    at: usize,
    line: usize,
    known: &'a mut BTreeMap<String, usize>,
}

impl Scan<'_> {
    fn peek(&self) -> Option<u8> {
        self.bytes.get(self.at).copied()
    }

    fn advance(&mut self) {
        self.line += usize::from(self.peek() == Some(b'\n'));
        self.at += 1;
    }

    fn blank(&mut self) {
        while self.peek().is_some_and(|byte| byte.is_ascii_whitespace() || byte == b',' || byte == b':') {
            self.advance();
        }
    }

    fn text(&mut self) -> String {
        let start = self.at + 1;
        self.advance();
        while self.peek().is_some_and(|byte| byte != b'"') {
            if self.peek() == Some(b'\\') {
                self.advance();
            }
            self.advance();
        }
        let text = String::from_utf8_lossy(&self.bytes[start.min(self.bytes.len())..self.at.min(self.bytes.len())]);
        self.advance();
        text.into_owned()
    }

    fn value(&mut self, path: &str) {
        self.blank();
        self.known.insert(path.to_owned(), self.line);
        match self.peek() {
            Some(b'{') => {
                self.advance();
                self.blank();
                while self.peek() == Some(b'"') {
                    let name = self.text();
                    let under = if path.is_empty() { name } else { format!("{path}.{name}") };
                    self.value(&under);
                    self.blank();
                }
                self.advance();
            }
            Some(b'[') => {
                self.advance();
                self.blank();
                let mut place = 0;
                while self.peek().is_some_and(|byte| byte != b']') {
                    self.value(&format!("{path}[{place}]"));
                    place += 1;
                    self.blank();
                }
                self.advance();
            }
            Some(b'"') => drop(self.text()),
            _ => {
                while self.peek().is_some_and(|byte| !b",]} \t\r\n".contains(&byte)) {
                    self.advance();
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_field_is_found_in_its_line_and_a_missing_one_where_it_should_be() {
        let text = "{\n \"name\": \"a \\\" } b\",\n \"tasks\": [\n  {\"id\": 1},\n  {\n   \"roles\": [ {\n \"class\": \"x\" } ] }\n ]\n}";
        let fields = ["name", "tasks[0].id", "tasks[1].roles[0].class", "tasks[1].horizon", "nothing"];
        let lines = lines_of(text, fields);
        assert_eq!(fields.map(|field| lines[field]), [2, 4, 7, 5, 1]);
    }
}
