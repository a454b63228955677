//! The reader: cuts a text into units, and asks the model what each is about.

use std::collections::BTreeSet;
use std::sync::OnceLock;

use super::answers::{ALTERNATIVES, Answer, alternatives, ranked, set_all_apart};
use super::clauses::{Chunk, Clause, clauses};
use super::corrections::corrected;
use super::details::Details;
use super::features::{
    Before, are_about_different_things, are_in_two_places, do_not_mix, features, in_pieces, named_outright, places,
    speaks_of,
};
use super::forbidden::without_the_forbidden;
use super::model::{Model, ModelError, softmax};
use super::reading::{ReadSubtask, WishReading};
use super::shape::Shape;
use super::spelling::Spelling;
use super::tokens::{Token, Typed, tokens};
use super::unread::{Part, is_foreign, is_means, says_nothing, unread};
use crate::domain::skill::SkillKind;
use crate::domain::{Class, Instance, Scene, World};

/// The most clauses that one unit has.
const WIDEST: usize = 6;
/// What another unit costs, as the logarithm of a probability.
const NEW_UNIT: f32 = -0.7;
/// What passing over a clause that names something costs.
const PASSED_OVER: f32 = -3.0;
/// What passing over walking and doors costs: what they say may help to read what follows.
const ASIDE: f32 = -0.2;
/// How likely it must be that something of the house is meant.
const IN_HOUSE: f32 = 0.05;
/// How much likelier a thing is for lying where the text says that it is.
const LIES_THERE: f32 = 20.0;
/// How much likelier a thing is for having been asked for before.
const NAMED_BEFORE: f32 = 4.0;

/// What is known besides the text.
#[derive(Clone, Copy, Debug, Default)]
pub struct Context<'a> {
    /// What was asked for before.
    pub before: &'a [ReadSubtask],
    /// The classes of the house.
    pub house: Option<&'a BTreeSet<Class>>,
    /// Which things lie in or on what, where that is known: "the knife on the counter" is the one that lies there.
    pub lies: &'a [(Class, Class)],
}

/// Which things lie in or on what: for [`Context::lies`].
pub fn lying(scene: &Scene, world: &World) -> Vec<(Class, Class)> {
    let objects = (0..world.objects.len() as u16).map(Instance::Object);
    let pairs = objects.filter_map(|thing| {
        let holder = world.container_of(thing)?;
        Some((world.class_of(scene, thing)?, world.class_of(scene, holder)?))
    });
    pairs.collect()
}

/// Reads wishes.
#[derive(Debug)]
pub struct Reader {
    model: Model,
}

/// A unit as the model sees it.
struct Unit {
    shape: Shape,
    score: f32,
    features: Vec<u32>,
}

/// The best way to cut the clauses up to a place.
#[derive(Clone, Default)]
struct Path {
    score: f32,
    read: Vec<ReadSubtask>,
    probability: f32,
    absent: Vec<Class>,
    parts: Vec<Part>,
}

impl Reader {
    /// The reader that is part of the program.
    ///
    /// # Errors
    /// When its model is damaged.
    pub fn shipped() -> Result<&'static Reader, &'static ModelError> {
        static READER: OnceLock<Result<Reader, ModelError>> = OnceLock::new();
        READER.get_or_init(|| Reader::of(include_bytes!("../../../assets/reader/model.bin"))).as_ref()
    }

    /// A reader with a model's file.
    ///
    /// # Errors
    /// When it is not one, of another version, or damaged.
    pub fn of(file: &[u8]) -> Result<Reader, ModelError> {
        Model::parse(file).map(|model| Reader { model })
    }

    /// The words that it knows.
    pub fn spelling(&self) -> &Spelling {
        &self.model.spelling
    }

    /// Reads a text.
    pub fn read(&self, text: &str, context: &Context<'_>) -> WishReading {
        let Typed { tokens, rest } = tokens(text, &self.model.spelling);
        let wanted = without_the_forbidden(corrected(tokens));
        let clauses = clauses(&wanted);
        let mut paths: Vec<Option<Path>> = vec![None; clauses.len() + 1];
        paths[0] = Some(Path { probability: 1.0, ..Path::default() });
        for end in 1..=clauses.len() {
            let mut best: Option<Path> = None;
            for start in end.saturating_sub(WIDEST)..end {
                let Some(path) = &paths[start] else { continue };
                let some = &clauses[start..end];
                for next in [self.skip(path, some), self.unit(path, some, context), self.each(path, some, context)] {
                    let Some(mut next) = next else { continue };
                    if best.as_ref().is_none_or(|best| next.score > best.score) {
                        next.parts.push((start..end, path.read.len()..next.read.len()));
                        best = Some(next);
                    }
                }
            }
            paths[end] = best;
        }
        let mut path = paths.pop().flatten().unwrap_or_default();
        let (mut unread, left) = unread(&wanted, &clauses, &path.parts, &path.read);
        leave_out_means(&mut path.read);
        let open = path
            .read
            .iter()
            .any(|read| read.object.is_none() || read.skill == SkillKind::Put && read.receptacle.is_none());
        let nothing = path.read.is_empty() || open || !rest.is_empty();
        let confidence = if nothing { 0.0 } else { self.model.calibrated(path.probability * left) };
        unread.extend(rest);
        WishReading { subtasks: path.read, confidence, unread, absent: path.absent, read_by: None }
    }

    /// Passes over clauses that ask for nothing: walking, doors, remarks.
    fn skip(&self, path: &Path, clauses: &[Clause]) -> Option<Path> {
        let [clause] = clauses else { return None };
        let cost = match clause.lemma {
            "go" | "wait" | "open" | "close" => ASIDE,
            _ if is_foreign(clause) || says_nothing(clause) => 0.0,
            "" if !clause.tokens.iter().any(Token::is_name) => 0.0,
            "" | "find" | "make" => PASSED_OVER,
            _ => return None,
        };
        Some(Path { score: path.score + cost, ..path.clone() })
    }

    /// Reads one clause that names several things as a clause for each: "put the fork and the knife in the drawer".
    fn each(&self, path: &Path, clauses: &[Clause], context: &Context<'_>) -> Option<Path> {
        let [clause] = clauses else { return None };
        let apart = clause.apart()?;
        let read = |score: f32| {
            let start = Path { score: 0.0, ..path.clone() };
            let read = apart.iter().try_fold(start, |path, one| self.unit(&path, std::slice::from_ref(one), context));
            Some(Path { score: path.score + score + NEW_UNIT, ..read? })
        };
        if clause.is_of_each || is_certainly_apart(clause) {
            return read(0.0);
        }
        let head = self.model.head("shape")?;
        let many = head.labels().iter().position(|label| Shape::named(label) == Some(Shape::Many))?;
        let p = softmax(&head.scores(&features(clauses, before(path, context))))[many];
        read(p.max(1e-9).ln())
    }

    fn unit(&self, path: &Path, clauses: &[Clause], context: &Context<'_>) -> Option<Path> {
        let says = |clause: &Clause| !clause.lemma.is_empty() || clause.tokens.iter().any(Token::is_name);
        if clauses.iter().any(|clause| is_foreign(clause) || says_nothing(clause)) || !clauses.iter().any(says) {
            return None;
        }
        if are_about_different_things(clauses) || clauses.iter().any(is_certainly_apart) {
            return None;
        }
        let unit = self.shape(clauses, before(path, context))?;
        let mut next = path.clone();
        next.score += unit.score + NEW_UNIT;
        self.fill(&unit, clauses, context, &mut next);
        Some(next)
    }

    fn shape(&self, clauses: &[Clause], before: Before) -> Option<Unit> {
        let features = features(clauses, before);
        let head = self.model.head("shape")?;
        let all = softmax(&head.scores(&features));
        let shapes = head.labels().iter().zip(all).filter_map(|(label, p)| Some((Shape::named(label)?, p)));
        let (place, thing) = speaks_of(clauses);
        let one_place = !are_in_two_places(clauses);
        let may = |shape: Shape| match shape {
            Shape::Many => false,
            Shape::Stack => place && one_place,
            Shape::Changed(kind) => place && is_remote(clauses, kind),
            Shape::Two | Shape::One(SkillKind::Put) => place,
            Shape::Look => thing,
            Shape::One(_) => true,
        };
        let (shape, p) = shapes.filter(|(shape, _)| may(*shape)).max_by(|a, b| a.1.total_cmp(&b.1))?;
        Some(Unit { shape, score: p.max(1e-9).ln(), features })
    }

    /// Turns a unit into subtasks.
    fn fill(&self, unit: &Unit, clauses: &[Clause], context: &Context<'_>, path: &mut Path) {
        let Unit { shape, features, score } = unit;
        let shape = *shape;
        let house = context.house;
        path.probability *= score.exp();
        let [thing, place] = named_outright(clauses);
        let told = Details::of(clauses, house);
        let evidence = |class: Class| {
            let lies = context.lies.iter().any(|(thing, place)| *thing == class && told.places.contains(place));
            let known = path.read.iter().chain(context.before).any(|read| read.object == Some(class));
            (if lies { LIES_THERE } else { 1.0 }) * (if known { NAMED_BEFORE } else { 1.0 })
        };
        let mut absent = path.absent.clone();
        let may = |class: Class| shape.takes_object(class);
        let mut object = self.answer(("object", features), thing, house, &mut absent, may, evidence);
        if shape != Shape::One(SkillKind::Toggle) && before(path, context) == Before::default() && says_only_it(clauses)
        {
            object.leave_open();
        }
        let mut holder = (shape == Shape::Stack).then(|| {
            let may = |class: Class| class.info().pickupable && class.info().receptacle;
            self.answer(("movable", features), None, house, &mut absent, may, |_| 1.0)
        });
        let mut place = shape.has_place().then(|| {
            let may = |class: Class| shape.takes_place(class);
            self.answer(("place", features), place, house, &mut absent, may, |_| 1.0)
        });
        path.absent = absent;
        set_all_apart(&mut object, &mut holder, &mut place);
        for answer in [Some(&object), holder.as_ref(), place.as_ref()].into_iter().flatten() {
            path.probability *= answer.probability;
        }
        let slice = self.model.head("slice").map(|head| softmax(&head.scores(features)));
        let slice = slice.is_some_and(|p| p.get(1).is_some_and(|&p| p > 0.5))
            && object.class.is_some_and(|class| class.info().slices > 0)
            && shape != Shape::One(SkillKind::Slice);
        let stands = told.place.filter(|stands| {
            let goes = [Some(&object), holder.as_ref(), place.as_ref()];
            let used = goes.into_iter().flatten().any(|answer| answer.class == Some(*stands));
            !used && !shape.kinds().any(|kind| is_means(kind, *stands))
        });
        let begin = path.read.len();
        let step = |skill, slice| ReadSubtask {
            skill,
            object: object.class,
            receptacle: None,
            slice,
            looks: told.looks.clone(),
            place: None,
            alternatives: alternatives(&object, false),
        };
        let put = |slice| {
            let mut put = step(SkillKind::Put, slice);
            if let Some(place) = &place {
                put.receptacle = place.class;
                put.alternatives.extend(alternatives(place, true));
                put.alternatives.sort_by(|a, b| b.probability.total_cmp(&a.probability));
            }
            put
        };
        let first = path.read.is_empty() && context.before.is_empty();
        let whole = !matches!(shape, Shape::One(kind) if kind != SkillKind::Put);
        if slice && first && whole {
            path.read.push(step(SkillKind::Slice, false));
        }
        let lifts = told.takes_first && !slice && whole && shape != Shape::Look && shape != Shape::Two;
        if lifts {
            path.read.push(step(SkillKind::Pickup, slice));
        }
        match shape {
            Shape::One(SkillKind::Put) => path.read.push(put(slice)),
            Shape::One(kind) => path.read.push(step(kind, slice)),
            Shape::Changed(kind) => path.read.extend([step(kind, slice), put(slice)]),
            Shape::Two => path.read.extend([put(slice), put(slice)]),
            Shape::Look => {
                let lamp = place.as_ref();
                path.read.push(step(SkillKind::Pickup, slice));
                path.read.push(ReadSubtask {
                    object: lamp.and_then(|lamp| lamp.class),
                    looks: Vec::new(),
                    alternatives: lamp.map(|lamp| alternatives(lamp, false)).unwrap_or_default(),
                    ..step(SkillKind::Toggle, false)
                });
            }
            Shape::Stack => {
                let Some(holder) = &holder else { return };
                let mut inner = step(SkillKind::Put, slice);
                inner.receptacle = holder.class;
                inner.alternatives.extend(alternatives(holder, true));
                let mut outer = put(false);
                outer.object = holder.class;
                outer.looks = Vec::new();
                outer.alternatives.retain(|other| other.is_receptacle);
                outer.alternatives.extend(alternatives(holder, false));
                path.read.extend([inner, outer]);
            }
            Shape::Many => {}
        }
        if let Some(first) = path.read.get_mut(begin) {
            first.place = stands;
        }
    }

    /// Which class a question is answered with; of the house's where that is known, unless none of them can be meant.
    fn answer(
        &self,
        (name, features): (&str, &[u32]),
        outright: Option<Class>,
        house: Option<&BTreeSet<Class>>,
        absent: &mut Vec<Class>,
        may: impl Fn(Class) -> bool,
        evidence: impl Fn(Class) -> f32,
    ) -> Answer {
        let Some(head) = self.model.head(name) else {
            return Answer { class: None, probability: 0.0, others: Vec::new() };
        };
        let all = ranked(head, features, outright, may, evidence);
        let inside = |class: &Option<Class>| class.is_none_or(|class| house.is_none_or(|house| house.contains(&class)));
        let known: f32 = all.iter().filter(|(class, _)| inside(class)).map(|(_, p)| p).sum();
        let chosen: Vec<(Option<Class>, f32)> = if known > IN_HOUSE {
            all.iter().filter(|(class, _)| inside(class)).map(|&(class, p)| (class, p / known)).collect()
        } else {
            let wanted = all.first().and_then(|(class, _)| *class);
            absent.extend(wanted.filter(|class| !absent.contains(class)));
            all
        };
        let (class, probability) = chosen.first().copied().unwrap_or((None, 0.0));
        let others = chosen.iter().skip(1).filter_map(|&(class, p)| Some((class?, p))).take(ALTERNATIVES).collect();
        Answer { class, probability, others }
    }
}

/// Whether a pronoun stands for the thing, and nothing movable is named.
fn says_only_it(clauses: &[Clause]) -> bool {
    let movable = |token: &Token| token.classes.iter().any(|class| class.info().pickupable);
    let tokens = || clauses.iter().flat_map(|clause| &clause.tokens);
    tokens().any(|token| matches!(token.text.as_str(), "it" | "them")) && !tokens().any(movable)
}

/// Whether a place is spoken of besides the one where a thing is changed: "chill it in the fridge" puts nothing anywhere.
fn is_remote(clauses: &[Clause], kind: SkillKind) -> bool {
    let says = |lemma: &str, pieces: &[Chunk]| {
        let mut heads = places(pieces).filter_map(Chunk::head);
        lemma == "put" || heads.any(|head| !head.classes.iter().any(|class| is_means(kind, *class)))
    };
    in_pieces(clauses).iter().any(|(lemma, pieces)| says(lemma, pieces))
}

/// Putting a thing into what then heats, chills or rinses it is part of that.
fn leave_out_means(read: &mut Vec<ReadSubtask>) {
    let means = |put: &ReadSubtask, then: &ReadSubtask| {
        put.skill == SkillKind::Put
            && put.object == then.object
            && put.receptacle.is_some_and(|place| is_means(then.skill, place))
    };
    let mut at = 0;
    while at + 1 < read.len() {
        if means(&read[at], &read[at + 1]) {
            read.remove(at);
        } else {
            at += 1;
        }
    }
}

/// What is known where a path ends.
fn before(path: &Path, context: &Context<'_>) -> Before {
    let last = path.read.last().or(context.before.last());
    Before { object: last.and_then(|read| read.object), place: last.and_then(|read| read.receptacle) }
}

/// Whether a clause names several things of which none goes into another.
fn is_certainly_apart(clause: &Clause) -> bool {
    let names = |part: &Clause| part.tokens.iter().find(|token| token.is_name()).map(|token| token.classes.to_vec());
    let Some(parts) = clause.apart() else { return false };
    if clause.is_of_each {
        return true;
    }
    let things: Vec<Vec<Class>> = parts.iter().filter_map(names).collect();
    let movable = things.iter().flatten().all(|class| class.info().pickupable);
    movable && (clause.lemma != "put" || do_not_mix(&things)) && things.windows(2).all(|pair| pair[0] != pair[1])
}
