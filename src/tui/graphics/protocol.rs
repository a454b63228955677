//! The ways to show a picture in a terminal.

/// How a picture can be shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Protocol {
    /// The kitty graphics protocol; the terminal scales.
    Kitty,
    /// iTerm2's inline images; the terminal scales.
    Iterm2,
    /// Sixel graphics.
    Sixel,
    /// Coloured block characters.
    HalfBlocks,
    /// A letter for each object class.
    Ascii,
}

impl Protocol {
    /// Every protocol, in the order in which the key goes round.
    pub(crate) const ALL: [Protocol; 5] =
        [Protocol::HalfBlocks, Protocol::Ascii, Protocol::Kitty, Protocol::Iterm2, Protocol::Sixel];

    /// The name that `--graphics` takes.
    pub fn name(self) -> &'static str {
        match self {
            Protocol::Kitty => "kitty",
            Protocol::Iterm2 => "iterm2",
            Protocol::Sixel => "sixel",
            Protocol::HalfBlocks => "halfblocks",
            Protocol::Ascii => "ascii",
        }
    }

    /// The next one, around.
    pub(crate) fn next(self) -> Protocol {
        let at = Protocol::ALL.iter().position(|&protocol| protocol == self).unwrap_or(0);
        Protocol::ALL[(at + 1) % Protocol::ALL.len()]
    }

    /// Whether the picture is drawn by an escape sequence that the screen's own cells do not know of, so that covering and
    /// uncovering it needs a full repaint.
    pub(crate) fn floats(self) -> bool {
        matches!(self, Protocol::Kitty | Protocol::Iterm2 | Protocol::Sixel)
    }
}
