//! What was recorded, for people: a picture, a film, a strip of pictures, a transcript, or a page that replays it.

mod captions;
mod film;
mod html;
mod strip;
mod text;

use std::path::Path;

use anyhow::bail;

use crate::data::atomic_file;
use crate::episode::frames::FrameSequence;

/// Writes a recording in the form that the file's ending asks for: `.gif` a film with captions, `.strip.png` the frames at
/// which subtasks were done, `.png` the frame at step `at`, `.txt` a transcript, `.html` a page that replays it. Returns the
/// file's size in bytes.
///
/// # Errors
/// When the ending is none of these, or the file cannot be written.
pub(crate) fn write(recording: &FrameSequence, at: u32, path: &Path) -> anyhow::Result<u64> {
    if let Some(folder) = path.parent().filter(|folder| !folder.as_os_str().is_empty() && !folder.is_dir()) {
        bail!("{}: there is no folder {}; make it first", path.display(), folder.display());
    }
    let name = path.file_name().map_or_else(String::new, |name| name.to_string_lossy().to_lowercase());
    let is_text = name.ends_with(".txt") || name.ends_with(".md");
    if !is_text && !recording.has_pictures() {
        bail!("{}: this environment shows no pictures; only .txt can be written", path.display());
    }
    let bytes = if name.ends_with(".strip.png") {
        strip::draw(recording).png()?
    } else if name.ends_with(".png") {
        strip::frame(recording, at)?.png()?
    } else if name.ends_with(".gif") {
        film::draw(recording)?
    } else if is_text {
        text::write(recording).into_bytes()
    } else if name.ends_with(".html") {
        html::write(recording)?.into_bytes()
    } else {
        bail!("{}: the ending says what is written; there are .gif, .png, .strip.png, .txt and .html", path.display());
    };
    atomic_file::write(path, &bytes)?;
    Ok(bytes.len() as u64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::episode::frames::tests::recording;

    #[test]
    fn every_ending_writes_a_file_of_its_kind() {
        let folder = tempfile::tempdir().unwrap();
        let recording = recording();
        for (name, start) in [
            ("a.gif", &b"GIF89a"[..]),
            ("a.png", &b"\x89PNG"[..]),
            ("a.strip.png", &b"\x89PNG"[..]),
            ("a.txt", &b"Put the mug in the sink."[..]),
            ("a.html", &b"<!doctype html>"[..]),
        ] {
            let path = folder.path().join(name);
            let size = write(&recording, 1, &path).unwrap();
            let bytes = std::fs::read(&path).unwrap();
            assert_eq!(bytes.len() as u64, size);
            assert!(bytes.starts_with(start), "{name}: {:?}", &bytes[..20]);
        }
        let error = write(&recording, 0, &folder.path().join("a.doc")).unwrap_err().to_string();
        assert!(error.contains(".strip.png"), "{error}");
        let error = write(&recording, 0, &folder.path().join("misspelt/a.gif")).unwrap_err().to_string();
        assert!(error.contains("there is no folder") && !folder.path().join("misspelt").exists(), "{error}");
    }

    #[test]
    fn a_page_needs_nothing_but_itself_and_shows_text_as_text() {
        let mut recording = recording();
        recording.shots[0].told = "</script><b>x</b>".into();
        let page = html::write(&recording).unwrap();
        assert!(!page.contains("http") && !page.contains("</script><b>"), "{}", &page[..400]);
        let dark = page.split_once("prefers-color-scheme:dark").unwrap().1;
        assert!(dark.contains("li.now.bad,li.now.done{color:#17181b}"), "the step at hand is dark on light there");
        assert_eq!(page.matches("data:image/png;base64,").count(), recording.shots.len());
    }
}
