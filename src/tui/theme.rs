//! Colours with meaning. The text uses the terminal's own sixteen, so that light and dark themes both work; pictures and the
//! map use their own. A last pass brings a drawn screen down to what the terminal can show.

use ratatui::buffer::Buffer;
use ratatui::style::{Color, Modifier, Style};
use serde::Deserialize;
use termprofile::TermProfile;

/// The styles of the screen, by meaning.
pub(crate) struct Theme {
    /// Names of panels.
    pub(crate) title: Style,
    /// Rules, units, hints.
    pub(crate) quiet: Style,
    /// What cannot be chosen now.
    pub(crate) masked: Style,
    /// What is chosen, or the agent itself.
    pub(crate) chosen: Style,
    /// A key to press.
    pub(crate) key: Style,
    /// Bars of probabilities and scores.
    pub(crate) bar: Style,
    /// What was done or went well.
    pub(crate) good: Style,
    /// What was impossible or went wrong.
    pub(crate) bad: Style,
    /// Worth noticing.
    pub(crate) note: Style,
    /// What the agent is told.
    pub(crate) instruction: Style,
}

pub(crate) const THEME: Theme = Theme {
    title: Style::new().fg(Color::Cyan).add_modifier(Modifier::BOLD),
    quiet: Style::new().fg(Color::DarkGray),
    masked: Style::new().fg(Color::DarkGray),
    chosen: Style::new().fg(Color::Yellow).add_modifier(Modifier::BOLD),
    key: Style::new().add_modifier(Modifier::BOLD),
    bar: Style::new().fg(Color::Blue),
    good: Style::new().fg(Color::Green),
    bad: Style::new().fg(Color::Red),
    note: Style::new().fg(Color::Magenta),
    instruction: Style::new().add_modifier(Modifier::BOLD),
};

/// Colours for different eyes and backgrounds. They bend the terminal's sixteen; pictures and the map keep their own.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Scheme {
    /// For any background: in between, where the terminal has the colours for it.
    #[default]
    Auto,
    /// For dark backgrounds.
    Dark,
    /// For light backgrounds: yellow and grey would fade there.
    Light,
    /// Nothing faint.
    HighContrast,
    /// No colour; the letters alone say it.
    NoColour,
}

impl Scheme {
    /// Brings a drawn screen into these colours.
    pub(crate) fn paint(self, buf: &mut Buffer) {
        let bend: fn(Color) -> Color = match self {
            Scheme::Dark => return,
            Scheme::Auto => |colour| match colour {
                Color::Yellow => Color::Rgb(166, 118, 0),
                Color::DarkGray => Color::Rgb(122, 122, 122),
                Color::Cyan => Color::Rgb(0, 138, 158),
                Color::Green => Color::Rgb(0, 142, 60),
                Color::Red => Color::Rgb(214, 58, 50),
                Color::Blue => Color::Rgb(52, 120, 218),
                Color::Magenta => Color::Rgb(186, 80, 190),
                other => other,
            },
            Scheme::Light => |colour| match colour {
                Color::Yellow => Color::Rgb(140, 90, 0),
                Color::DarkGray => Color::Rgb(105, 105, 105),
                Color::Cyan => Color::Rgb(0, 95, 115),
                Color::Green => Color::Rgb(0, 110, 40),
                other => other,
            },
            Scheme::HighContrast => |colour| match colour {
                Color::DarkGray | Color::Gray => Color::Reset,
                Color::Blue => Color::LightBlue,
                Color::Red => Color::LightRed,
                Color::Green => Color::LightGreen,
                Color::Magenta => Color::LightMagenta,
                Color::Cyan => Color::LightCyan,
                Color::Yellow => Color::LightYellow,
                other => other,
            },
            Scheme::NoColour => |colour| match colour {
                Color::Rgb(..) | Color::Indexed(_) => colour,
                _ => Color::Reset,
            },
        };
        for cell in &mut buf.content {
            (cell.fg, cell.bg) = (bend(cell.fg), bend(cell.bg));
        }
    }
}

/// What the terminal can show.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ability {
    pub(crate) colours: TermProfile,
    /// It shows characters beyond ASCII.
    pub(crate) unicode: bool,
}

impl Ability {
    /// Everything.
    pub const FULL: Ability = Ability { colours: TermProfile::TrueColor, unicode: true };

    /// Whether the map and the pictures may rely on colour.
    pub(crate) fn shades(self) -> bool {
        self.colours >= TermProfile::Ansi256 && self.unicode
    }

    /// Brings a drawn screen down to what the terminal can show.
    pub(crate) fn adapt(self, buf: &mut Buffer) {
        if self == Ability::FULL {
            return;
        }
        for cell in &mut buf.content {
            // The number of a kitty picture travels as a colour.
            if cell.fg == Color::Indexed(super::graphics::inline::KITTY_ID) {
                continue;
            }
            if cell.bg != Color::Reset && self.colours <= TermProfile::NoColor {
                // A background that meant something is shown reversed; spaces stay plain.
                if cell.symbol() != " " {
                    cell.modifier |= Modifier::REVERSED;
                }
            }
            cell.fg = shown(cell.fg, self.colours);
            cell.bg = shown(cell.bg, self.colours);
            if !self.unicode && !cell.symbol().is_ascii() && cell.symbol().chars().count() == 1 {
                let plain = cell.symbol().chars().next().map_or(' ', plain);
                cell.set_char(plain);
            }
        }
    }
}

fn shown(colour: Color, colours: TermProfile) -> Color {
    match (colour, colours) {
        (_, TermProfile::NoTty | TermProfile::NoColor) => Color::Reset,
        (Color::Rgb(r, g, b), TermProfile::Ansi256) => Color::Indexed(cube(r, g, b)),
        (Color::Rgb(r, g, b), TermProfile::Ansi16) => sixteenth(r, g, b),
        _ => colour,
    }
}

/// The nearest of the 216 colours and 24 greys of a 256-colour terminal.
fn cube(r: u8, g: u8, b: u8) -> u8 {
    const LEVELS: [u8; 6] = [0, 95, 135, 175, 215, 255];
    let near = |v: u8| (0..6usize).min_by_key(|&i| LEVELS[i].abs_diff(v)).unwrap_or(0);
    let error = |c: [u8; 3]| -> u32 { c.iter().zip([r, g, b]).map(|(a, b)| u32::from(a.abs_diff(b)).pow(2)).sum() };
    let (i, j, k) = (near(r), near(g), near(b));
    let mean = (u16::from(r) + u16::from(g) + u16::from(b)) / 3;
    let grey = (mean.saturating_sub(3) / 10).min(23) as u8;
    let value = 8 + 10 * grey;
    if error([value; 3]) < error([LEVELS[i], LEVELS[j], LEVELS[k]]) {
        232 + grey
    } else {
        (16 + 36 * i + 6 * j + k) as u8
    }
}

fn sixteenth(r: u8, g: u8, b: u8) -> Color {
    const PALETTE: [(Color, [u8; 3]); 16] = [
        (Color::Black, [0, 0, 0]),
        (Color::Red, [170, 0, 0]),
        (Color::Green, [0, 170, 0]),
        (Color::Yellow, [170, 85, 0]),
        (Color::Blue, [0, 0, 170]),
        (Color::Magenta, [170, 0, 170]),
        (Color::Cyan, [0, 170, 170]),
        (Color::Gray, [170, 170, 170]),
        (Color::DarkGray, [85, 85, 85]),
        (Color::LightRed, [255, 85, 85]),
        (Color::LightGreen, [85, 255, 85]),
        (Color::LightYellow, [255, 255, 85]),
        (Color::LightBlue, [85, 85, 255]),
        (Color::LightMagenta, [255, 85, 255]),
        (Color::LightCyan, [85, 255, 255]),
        (Color::White, [255, 255, 255]),
    ];
    let error = |c: [u8; 3]| -> u32 { c.iter().zip([r, g, b]).map(|(a, b)| u32::from(a.abs_diff(b)).pow(2)).sum() };
    PALETTE.iter().min_by_key(|(_, c)| error(*c)).map_or(Color::Reset, |(colour, _)| *colour)
}

/// The nearest ASCII character of one that the screen uses.
fn plain(symbol: char) -> char {
    match symbol {
        '─' => '-',
        '·' | '•' => '.',
        '●' => '@',
        '○' => 'o',
        '×' => 'x',
        '┬' => 'Y',
        '└' => '`',
        '┌' | '┐' | '┘' => '+',
        '│' => '|',
        '▁' | '▂' => '_',
        '▃' | '▅' => '-',
        '▆' | '▇' => '=',
        '█' | '▉' | '▊' | '▋' | '▌' | '▐' | '▀' | '▄' | '▙' | '▟' | '▛' | '▜' | '▚' | '▞' => {
            '#'
        }
        '▍' | '▎' | '▏' => '|',
        '▲' => '^',
        '▼' => 'v',
        '◀' => '<',
        '▶' => '>',
        '→' => '>',
        '◆' => 'X',
        '…' => '~',
        _ => '?',
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_come_down_to_the_nearest_that_there_is() {
        assert_eq!(cube(255, 0, 0), 196);
        assert_eq!(cube(128, 128, 128), 244);
        assert_eq!(sixteenth(250, 250, 250), Color::White);
        assert_eq!(shown(Color::Cyan, TermProfile::NoColor), Color::Reset);
    }

    #[test]
    fn the_colours_of_the_text_are_legible_on_black_and_on_white() {
        // Relative luminance and contrast as in WCAG 2.
        let luminance = |rgb: [u8; 3]| {
            let linear = |value: u8| {
                let share = f32::from(value) / 255.0;
                if share <= 0.04045 { share / 12.92 } else { ((share + 0.055) / 1.055).powf(2.4) }
            };
            0.2126 * linear(rgb[0]) + 0.7152 * linear(rgb[1]) + 0.0722 * linear(rgb[2])
        };
        let styles =
            [THEME.title, THEME.quiet, THEME.masked, THEME.chosen, THEME.bar, THEME.good, THEME.bad, THEME.note];
        for style in styles {
            let mut buf = Buffer::empty(ratatui::layout::Rect::new(0, 0, 1, 1));
            buf[(0, 0)].set_style(style);
            Scheme::default().paint(&mut buf);
            let Color::Rgb(r, g, b) = buf[(0, 0)].fg else { panic!("{style:?}") };
            let here = luminance([r, g, b]);
            let (on_white, on_black) = (1.05 / (here + 0.05), (here + 0.05) / 0.05);
            assert!(on_white >= 3.0 && on_black >= 4.0, "{style:?}: {on_white} on white, {on_black} on black");
        }
    }

    #[test]
    fn a_screen_without_unicode_holds_only_ascii() {
        let mut buf = Buffer::with_lines(["── Mind ─ · ▶ █▌ …"]);
        Ability { colours: TermProfile::Ansi16, unicode: false }.adapt(&mut buf);
        assert_eq!(buf, Buffer::with_lines(["-- Mind - . > ## ~"]));
    }
}
