//! The learned part: a linear softmax for each question, over hashed features.
//!
//! The file (`assets/reader/model.bin`, little-endian): the four bytes `SPRD`; `format_version` u32; the words, as u32 count and
//! for each a u8 length and its UTF-8; the number of heads u8, and for each its name and its labels (u8 count; names as a u8
//! length and UTF-8), f32 bias a label, f32 scale, u32 features, and for each a u32 hash (rising), a u8 count, and as many pairs
//! of u8 label and i8 weight (times the scale); then the two f32 of the calibration. Nothing may follow.

use super::spelling::Spelling;

const MAGIC: &[u8] = b"SPRD";
const FORMAT: u32 = 1;

/// Why a file is no model.
#[derive(Debug, PartialEq, Eq, thiserror::Error)]
pub enum ModelError {
    /// It is something else.
    #[error("not a reader's model: it does not begin with SPRD")]
    Magic,
    /// It is of another version.
    #[error("the reader's model has format version {0}; this program reads version {FORMAT}: train it again")]
    Version(u32),
    /// It ends early, goes on too long, or does not hold together.
    #[error("the reader's model is damaged at byte {0}: train it again, or fetch it again")]
    Damaged(usize),
}

/// One question and the weights that answer it.
#[derive(Debug, Default)]
pub struct Head {
    name: String,
    labels: Vec<String>,
    bias: Vec<f32>,
    scale: f32,
    hashes: Vec<u32>,
    /// Where each feature's pairs begin; one more at the end.
    starts: Vec<u32>,
    pairs: Vec<(u8, i8)>,
}

impl Head {
    /// The answers, in the order of the probabilities.
    pub fn labels(&self) -> &[String] {
        &self.labels
    }

    /// The logarithm of what speaks for each label, not yet normalised.
    pub fn scores(&self, features: &[u32]) -> Vec<f32> {
        let mut scores = self.bias.clone();
        for feature in features {
            let Ok(at) = self.hashes.binary_search(feature) else { continue };
            for &(label, weight) in &self.pairs[self.starts[at] as usize..self.starts[at + 1] as usize] {
                scores[usize::from(label)] += f32::from(weight) * self.scale;
            }
        }
        scores
    }
}

/// Probabilities of scores.
pub fn softmax(scores: &[f32]) -> Vec<f32> {
    let most = scores.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    let all: Vec<f32> = scores.iter().map(|score| (score - most).exp()).collect();
    let sum: f32 = all.iter().sum();
    all.into_iter().map(|one| one / sum.max(f32::MIN_POSITIVE)).collect()
}

/// All questions.
#[derive(Debug, Default)]
pub struct Model {
    /// The known words.
    pub spelling: Spelling,
    heads: Vec<Head>,
    calibration: [f32; 2],
}

/// Reads a file from its beginning.
struct Bytes<'a> {
    all: &'a [u8],
    at: usize,
}

impl<'a> Bytes<'a> {
    fn take(&mut self, length: usize) -> Result<&'a [u8], ModelError> {
        let taken = self.all.get(self.at..self.at.saturating_add(length)).ok_or(ModelError::Damaged(self.at))?;
        self.at += length;
        Ok(taken)
    }

    fn four(&mut self) -> Result<[u8; 4], ModelError> {
        let at = self.at;
        self.take(4)?.try_into().map_err(|_| ModelError::Damaged(at))
    }

    fn u8(&mut self) -> Result<u8, ModelError> {
        Ok(self.take(1)?[0])
    }

    fn u32(&mut self) -> Result<u32, ModelError> {
        self.four().map(u32::from_le_bytes)
    }

    fn f32(&mut self) -> Result<f32, ModelError> {
        let at = self.at;
        let number = f32::from_le_bytes(self.four()?);
        if number.is_finite() { Ok(number) } else { Err(ModelError::Damaged(at)) }
    }

    fn text(&mut self) -> Result<String, ModelError> {
        let at = self.at;
        let length = usize::from(self.u8()?);
        let bytes = self.take(length)?;
        std::str::from_utf8(bytes).map(str::to_string).map_err(|_| ModelError::Damaged(at))
    }

    fn head(&mut self) -> Result<Head, ModelError> {
        let name = self.text()?;
        let count = self.u8()?;
        let labels = (0..count).map(|_| self.text()).collect::<Result<Vec<_>, _>>()?;
        let bias = (0..count).map(|_| self.f32()).collect::<Result<Vec<_>, _>>()?;
        let scale = self.f32()?;
        let mut head = Head { name, labels, bias, scale, ..Head::default() };
        for _ in 0..self.u32()? {
            let at = self.at;
            let hash = self.u32()?;
            if head.hashes.last().is_some_and(|&last| last >= hash) {
                return Err(ModelError::Damaged(at));
            }
            head.hashes.push(hash);
            head.starts.push(head.pairs.len() as u32);
            for _ in 0..self.u8()? {
                let at = self.at;
                let (label, weight) = (self.u8()?, self.u8()? as i8);
                if label >= count {
                    return Err(ModelError::Damaged(at));
                }
                head.pairs.push((label, weight));
            }
        }
        head.starts.push(head.pairs.len() as u32);
        Ok(head)
    }
}

impl Model {
    /// Reads a model's file.
    ///
    /// # Errors
    /// When it is not one, of another version, or damaged.
    pub fn parse(file: &[u8]) -> Result<Model, ModelError> {
        let mut bytes = Bytes { all: file, at: 0 };
        if bytes.take(MAGIC.len()) != Ok(MAGIC) {
            return Err(ModelError::Magic);
        }
        let version = bytes.u32()?;
        if version != FORMAT {
            return Err(ModelError::Version(version));
        }
        let count = bytes.u32()?;
        let words = (0..count).map(|_| bytes.text()).collect::<Result<Vec<_>, _>>()?;
        let heads = (0..bytes.u8()?).map(|_| bytes.head()).collect::<Result<Vec<_>, _>>()?;
        let calibration = [bytes.f32()?, bytes.f32()?];
        if bytes.at != file.len() {
            return Err(ModelError::Damaged(bytes.at));
        }
        Ok(Model { spelling: Spelling::of(words), heads, calibration })
    }

    /// The question of that name.
    pub fn head(&self, name: &str) -> Option<&Head> {
        self.heads.iter().find(|head| head.name == name)
    }

    /// How often readings of that raw probability are right.
    pub fn calibrated(&self, raw: f32) -> f32 {
        let raw = raw.clamp(1e-6, 1.0 - 1e-6);
        let [slope, offset] = self.calibration;
        1.0 / (1.0 + (-(slope * (raw / (1.0 - raw)).ln() + offset)).exp())
    }
}
