//! Pictures as escape sequences: the frame at its own size, scaled by the terminal (kitty, iTerm2).

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};

use super::coarse::COARSEST;
use super::job::Job;
use super::labels::over_pixels;

/// The number under which kitty keeps the frame; each new frame replaces the one before.
pub(crate) const KITTY_ID: u8 = 83;
/// The most that kitty takes in one piece of a transmission, in base64 characters.
const PIECE: usize = 4096;

/// Transmits the frame: in tmux with placeholders for this many cells, which it moves like any text; otherwise to be laid over
/// cells by [`lay`], which older terminals know too. The terminal is told not to answer.
pub(crate) fn kitty(job: &Job) -> String {
    let data = STANDARD.encode(png(job));
    let (columns, rows) = (job.cells.width, job.cells.height);
    let mut sequence = String::with_capacity(data.len() + 256);
    let mut pieces = data.as_bytes().chunks(PIECE).peekable();
    let place = if job.in_tmux { format!("a=T,U=1,c={columns},r={rows}") } else { "a=t".into() };
    let mut control = format!("{place},f=100,i={KITTY_ID},q=2,");
    while let Some(piece) = pieces.next() {
        let more = u8::from(pieces.peek().is_some());
        let piece = format!("\x1b_G{control}m={more};{}\x1b\\", String::from_utf8_lossy(piece));
        sequence.push_str(&if job.in_tmux { through_tmux(&piece) } else { piece });
        control = "q=2,".into();
    }
    sequence
}

/// The pixels that are sent, and their width and height: of a coarse frame one for each of its larger pixels, as the terminal
/// scales. Numbers on things would not be legible then, and keep the frame's own size.
fn sent(job: &Job) -> (Vec<u8>, usize, usize) {
    let pixels = over_pixels(&job.labels, &job.frame);
    let side = side(job);
    if side == 1 {
        return (pixels, job.frame.width, job.frame.height);
    }
    let (width, height) = (job.frame.width.div_ceil(side), job.frame.height.div_ceil(side));
    let mut smaller = Vec::with_capacity(3 * width * height);
    for y in 0..height {
        for x in 0..width {
            let from = 3 * (y * side * job.frame.width + x * side);
            smaller.extend_from_slice(&pixels[from..from + 3]);
        }
    }
    (smaller, width, height)
}

/// Pixels of the frame to one that is sent.
fn side(job: &Job) -> usize {
    if job.labels.is_empty() { 1 << job.coarseness.min(COARSEST) } else { 1 }
}

/// The rows of pixels that are sent.
pub(crate) fn rows_sent(job: &Job) -> usize {
    job.frame.height.div_ceil(side(job))
}

/// Lays the uppermost `pixels` rows of the transmitted frame over so many cells from the cursor on, which stays where it is.
pub(crate) fn lay(columns: u16, rows: u16, pixels: usize) -> String {
    format!("\x1b_Ga=p,i={KITTY_ID},p=1,C=1,c={columns},r={rows},h={pixels},q=2\x1b\\")
}

/// A sequence that tmux hands on to its terminal (where `allow-passthrough` is on).
fn through_tmux(sequence: &str) -> String {
    format!("\x1bPtmux;{}\x1b\\", sequence.replace('\x1b', "\x1b\x1b"))
}

/// Makes kitty forget the frame.
pub(crate) fn kitty_forget(in_tmux: bool) -> String {
    let sequence = format!("\x1b_Ga=d,d=I,i={KITTY_ID},q=2\x1b\\");
    if in_tmux { through_tmux(&sequence) } else { sequence }
}

/// Draws the frame where the cursor is, in iTerm2's way.
pub(crate) fn iterm2(job: &Job) -> String {
    let data = png(job);
    let (columns, rows, size) = (job.cells.width, job.cells.height, data.len());
    let data = STANDARD.encode(data);
    format!(
        "\x1b]1337;File=inline=1;size={size};width={columns};height={rows};preserveAspectRatio=0;doNotMoveCursor=1:{data}\x07"
    )
}

fn png(job: &Job) -> Vec<u8> {
    let (pixels, width, height) = sent(job);
    let mut data = Vec::new();
    let encoder = PngEncoder::new_with_quality(&mut data, CompressionType::Default, FilterType::Adaptive);
    match encoder.write_image(&pixels, width as u32, height as u32, ExtendedColorType::Rgb8) {
        Ok(()) => data,
        Err(_) => Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tui::app::App;
    use crate::tui::graphics::Protocol;
    use crate::tui::testing;
    use crate::tui::theme::Ability;

    fn job(protocol: Protocol) -> Job {
        let app: App = testing::app(120, 36, protocol, Ability::FULL);
        app.job().unwrap()
    }

    #[test]
    fn kitty_gets_a_png_in_small_pieces_and_is_told_not_to_answer() {
        let sequence = kitty(&job(Protocol::Kitty));
        let pieces: Vec<&str> = sequence.split_terminator("\x1b\\").collect();
        assert!(pieces[0].starts_with("\x1b_Ga=t,f=100,i=83,q=2,"), "{}", &pieces[0][..60]);
        let mut data = String::new();
        for (at, piece) in pieces.iter().enumerate() {
            let (control, piece) = piece.split_once(';').unwrap();
            assert!(control.contains("q=2") && piece.len() <= PIECE);
            assert_eq!(control.ends_with("m=0"), at == pieces.len() - 1);
            data.push_str(piece);
        }
        let png = STANDARD.decode(data).unwrap();
        let image = image::load_from_memory(&png).unwrap();
        assert_eq!((image.width(), image.height()), (300, 300));
    }

    #[test]
    fn tmux_hands_on_every_piece() {
        let mut job = job(Protocol::Kitty);
        job.in_tmux = true;
        let sequence = kitty(&job);
        assert!(sequence.starts_with("\x1bPtmux;\x1b\x1b_Ga=T,U=1,") && sequence.ends_with("\x1b\x1b\\\x1b\\"));
    }

    #[test]
    fn iterm2_scales_to_cells() {
        let job_of = job(Protocol::Iterm2);
        let sequence = iterm2(&job_of);
        assert!(sequence.starts_with("\x1b]1337;File=inline=1;size=") && sequence.ends_with('\x07'));
        let size = format!(";width={};height={};", job_of.cells.width, job_of.cells.height);
        assert!(sequence.contains(&size), "{}", &sequence[..90]);
    }
}
