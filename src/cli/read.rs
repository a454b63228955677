//! `sprint read`: a wish a line in, how it is read as a JSON object a line out.

use std::collections::BTreeSet;
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context as _, anyhow, bail};
use clap::Args;
use serde::Serialize;

use super::exit_status::ExitStatus;
use super::streams::{Printable, StandardOutput};
use super::wish_reader::WishReaderArgs;
use crate::data::{dataset, text_file};
use crate::domain::{Class, Room};
use crate::house::generate;
use crate::language::instruction::{self, InstructionError};
use crate::language::reader::features::Before;
use crate::language::reader::spelling::Spelling;
use crate::language::reader::{Context, Reader, WishReading, features_of, lying};

/// Reads wishes.
#[derive(Args)]
pub(crate) struct ReadArgs {
    /// The house that they are said in: ROOM:SEED for a generated one (kitchen:7), or a scene file
    #[arg(long, value_name = "ROOM:SEED|FILE")]
    scene: Option<String>,
    #[command(flatten)]
    reader: WishReaderArgs,
    /// Print each line's features instead, for training; the words that count as spelt right are in this file, a word a line
    #[arg(long, value_name = "FILE", hide = true)]
    features: Option<PathBuf>,
}

/// A line of the answer.
#[derive(Serialize)]
struct Line<'a> {
    text: &'a str,
    /// The reading in words.
    words: String,
    /// Why the language model that was to read it did not.
    #[serde(skip_serializing_if = "Option::is_none")]
    unasked: Option<String>,
    #[serde(flatten)]
    reading: &'a WishReading,
}

/// What is known of a house.
struct House {
    classes: BTreeSet<Class>,
    /// Which things lie in or on what; nothing for a scene file.
    lies: Vec<(Class, Class)>,
}

/// A line of an example to train on.
#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct Example {
    text: String,
    #[serde(default)]
    object: Option<Class>,
    #[serde(default)]
    place: Option<Class>,
}

impl ReadArgs {
    /// Reads standard input to standard output, a line at a time.
    ///
    /// # Errors
    /// When the scene cannot be read, or a line is not UTF-8, too long for an instruction, or holds control characters.
    pub(crate) fn run(self) -> anyhow::Result<ExitStatus> {
        if let Some(words) = &self.features {
            return print_features(words);
        }
        let house = self.scene.as_deref().map(house).transpose()?;
        let context = house.as_ref().map_or_else(Context::default, |house| Context {
            house: Some(&house.classes),
            lies: &house.lies,
            ..Context::default()
        });
        let served = self.reader.open()?;
        let reader = Reader::shipped().map_err(|error| anyhow!("{error}"))?;
        let mut out = Printable::new(StandardOutput::lock());
        for (number, text) in (1..).zip(BufReader::new(std::io::stdin()).lines()) {
            let text = text.with_context(|| format!("line {number} is not UTF-8 text"))?;
            let text = text_file::line(&text);
            match instruction::parse(text) {
                // An empty line asks for nothing.
                Ok(_) | Err(InstructionError::Empty) => {}
                Err(error) => bail!("line {number}: {error}"),
            }
            let own = || reader.read(text, &context);
            let (reading, unasked) = match served.as_ref().filter(|_| !text.trim().is_empty()) {
                None => (own(), None),
                Some(served) => match served.read(text, &[], context.house) {
                    Ok(reading) => (reading, None),
                    Err(why) => (own(), Some(why)),
                },
            };
            let line = Line { text, words: reading.words(), unasked, reading: &reading };
            serde_json::to_writer(&mut out, &line)?;
            out.write_all(b"\n")?;
            out.flush()?;
        }
        Ok(ExitStatus::Ok)
    }
}

/// A generated house holds what it holds; a scene file's furniture is there, and everything movable.
fn house(name: &str) -> anyhow::Result<House> {
    if let Some((room, seed)) = name.split_once(':')
        && let Ok(room) = room.parse::<Room>()
    {
        let seed =
            seed.parse().with_context(|| format!("--scene {name}: {seed:?} is not a seed: use a whole number"))?;
        let (scene, world) = generate::house(room, seed);
        let fixtures = scene.fixtures.iter().map(|fixture| fixture.class);
        let classes = fixtures.chain(world.objects.iter().map(|object| object.class)).collect();
        return Ok(House { classes, lies: lying(&scene, &world) });
    }
    let file = Path::new(name);
    let (Some(folder), Some(stem)) = (file.parent(), file.file_stem().and_then(|stem| stem.to_str())) else {
        bail!("--scene {name}: neither a generated house (kitchen:7) nor a scene file");
    };
    let scene = dataset::read_scene(folder, stem)
        .with_context(|| format!("--scene {name}: neither a generated house (kitchen:7) nor a scene file"))?;
    // A scene file says which furniture there is; what lies on it is another in every episode.
    let movable = Class::all().filter(|class| class.info().pickupable);
    let classes = scene.fixtures.iter().map(|fixture| fixture.class).chain(movable).collect();
    Ok(House { classes, lies: Vec::new() })
}

fn print_features(words: &Path) -> anyhow::Result<ExitStatus> {
    let known = text_file::read(words).with_context(|| words.display().to_string())?;
    let spelling = Spelling::of(known.lines().map(str::to_string));
    let mut out = std::io::BufWriter::new(StandardOutput::lock());
    for (number, line) in (1..).zip(BufReader::new(std::io::stdin()).lines()) {
        let line = line.with_context(|| format!("line {number} is not UTF-8 text"))?;
        let Example { text, object, place } =
            serde_json::from_str(text_file::line(&line)).with_context(|| format!("line {number}"))?;
        let all: Vec<String> =
            features_of(&text, Before { object, place }, &spelling).iter().map(u32::to_string).collect();
        writeln!(out, "{}", all.join(" "))?;
    }
    out.flush()?;
    Ok(ExitStatus::Ok)
}
