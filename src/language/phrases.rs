//! Sentences that a person would type for a subtask or a chain of them. The same random numbers give the same sentence.

use rand::Rng;
use rand_chacha::ChaCha8Rng;

use super::grammar::{Slots, grammar, with_article};
use super::place_slots::{destination_slots, origin_slots};
use super::summary;
use super::task_wording::TaskWording;
use crate::domain::skill::{Role, SkillKind, Subtask};
use crate::domain::{Class, Instance, Parent, Scene, World};

/// An instruction for a whole chain.
pub(crate) fn instruction(roles: &[Role], subtasks: &[Subtask], rng: &mut ChaCha8Rng) -> String {
    TaskWording { roles, subtasks, origins: &[] }.instruction(rng)
}

/// A sentence for one subtask.
pub(crate) fn sentence(roles: &[Role], subtask: &Subtask, rng: &mut ChaCha8Rng) -> String {
    let story = TaskWording { roles, subtasks: std::slice::from_ref(subtask), origins: &[] };
    finish(story.clause(0, false, rng), rng)
}

/// What each role's instance lies in at the start, by class, from the expert's instances; nothing for slices and fixtures.
pub(crate) fn origins(scene: &Scene, world: &World, roles: &[Role]) -> Vec<Option<Class>> {
    let origin = |role: &Role| {
        let original = role.expert.filter(|original| original.slice.is_none())?;
        let Instance::Object(index) = original.instance else { return None };
        match world.object(index)?.parent {
            Parent::In(holder) => world.class_of(scene, holder).filter(|class| class.in_vocabulary()),
            _ => None,
        }
    };
    roles.iter().map(origin).collect()
}

impl TaskWording<'_> {
    /// An instruction for the whole chain: a summary of what it comes to, or its steps one after another.
    pub(crate) fn instruction(&self, rng: &mut ChaCha8Rng) -> String {
        let text = match self.subtasks.len() {
            0 => String::new(),
            1 => self.clause(0, false, rng),
            _ if rng.random_bool(0.5) => summary::summary(self, rng),
            _ => self.sequence(rng),
        };
        finish(text, rng)
    }

    /// A sentence for each subtask.
    pub(crate) fn sentences(&self, rng: &mut ChaCha8Rng) -> Vec<String> {
        let steps = 0..self.subtasks.len();
        steps.map(|step| finish(self.clause(step, false, rng), rng)).collect()
    }

    /// The steps one after another; what was named just before is "it".
    fn sequence(&self, rng: &mut ChaCha8Rng) -> String {
        let mut text = String::new();
        let count = self.subtasks.len();
        for step in 0..count {
            let joint = match step {
                0 => "",
                _ if step + 1 == count => "last",
                _ => "then",
            };
            if !joint.is_empty() {
                text.push_str(&grammar().say(joint, &Slots::new(), rng));
            }
            let same = step > 0 && self.subtasks[step].object == self.subtasks[step - 1].object;
            let named_last = step > 0 && self.subtasks[step - 1].receptacle.is_none();
            text.push_str(&self.clause(step, same && named_last && rng.random_bool(0.7), rng));
        }
        text
    }

    /// A clause for one step, without a capital or a full stop.
    fn clause(&self, step: usize, as_it: bool, rng: &mut ChaCha8Rng) -> String {
        let subtask = &self.subtasks[step];
        let mut slots = Slots::new();
        let object = if as_it { "it".to_string() } else { self.thing(subtask.object, step, rng) };
        if self.class(subtask.object).info().tags.iter().any(|tag| tag == "food") {
            slots.insert("food", object.clone());
        }
        slots.insert("object", object);
        let origin = self.origins.get(usize::from(subtask.object)).copied().flatten();
        let untouched = !self.subtasks[..step].iter().any(|earlier| earlier.object == subtask.object);
        if let Some(origin) = origin.filter(|_| untouched && !as_it) {
            slots.extend(origin_slots(origin, rng));
        }
        if let Some(receptacle) = subtask.receptacle {
            slots.extend(destination_slots(self.class(receptacle), rng));
        }
        match subtask.skill {
            SkillKind::Slice => {
                slots.insert("tool", self.knife(step, rng));
            }
            SkillKind::Toggle if step > 0 && self.holds_before(step) => {
                let held = self.subtasks[step - 1].object;
                slots.insert("held", if rng.random_bool(0.5) { "it".into() } else { self.thing(held, step, rng) });
                return grammar().say("toggle_with", &slots, rng);
            }
            _ => {}
        }
        grammar().say(rule(subtask.skill), &slots, rng)
    }

    /// The knife in the hand at a step.
    fn knife(&self, step: usize, rng: &mut ChaCha8Rng) -> String {
        let before = self.subtasks[..step].iter().rev().map(|subtask| subtask.object);
        let bound = (0..self.roles.len() as u8).rev().filter(|&role| self.roles[usize::from(role)].bound.is_some());
        let knife = before.chain(bound).find(|&role| self.class(role).is_knife());
        knife.map_or("a knife".into(), |role| {
            let name = self.class(role).spoken();
            if rng.random_bool(0.4) { with_article(name) } else { format!("the {name}") }
        })
    }
}

fn rule(skill: SkillKind) -> &'static str {
    match skill {
        SkillKind::Pickup => "pickup",
        SkillKind::Put => "put",
        SkillKind::Slice => "slice",
        SkillKind::Toggle => "toggle",
        SkillKind::Clean => "clean",
        SkillKind::Heat => "heat",
        SkillKind::Cool => "cool",
    }
}

/// Manners, capitals and full stops as people type them.
fn finish(clause: String, rng: &mut ChaCha8Rng) -> String {
    if clause.is_empty() {
        return clause;
    }
    // Only an order can be put politely; a remark cannot.
    let remarks = ["i ", "you ", "see ", "the ", "a ", "an ", "another ", "one ", "from ", "let there ", "go "];
    let is_order = !remarks.iter().any(|remark| clause.starts_with(remark)) && !clause.contains("? ");
    let mut say = |rule: &str, chance: f64| match rng.random_bool(chance) {
        true => grammar().say(rule, &Slots::new(), rng),
        false => String::new(),
    };
    let manners = if is_order { say("manners", 0.35) } else { String::new() };
    let thanks = if manners.is_empty() && is_order { say("thanks", 0.2) } else { String::new() };
    let asks = manners.starts_with("could")
        || manners.starts_with("would")
        || manners.starts_with("can")
        || thanks.ends_with("you");
    let text = format!("{manners}{clause}{thanks}");
    match rng.random_range(0..20) {
        // Hasty.
        0..=5 => text,
        // Loud.
        6 => format!("{}!", text.to_uppercase()),
        7 => format!("{}!", sentence_case(&text)),
        _ => format!("{}{}", sentence_case(&text), if asks { "?" } else { "." }),
    }
}

/// Capitals at the start of each sentence, and for "I".
fn sentence_case(text: &str) -> String {
    let mut starts = true;
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        if starts && c.is_alphabetic() {
            out.extend(c.to_uppercase());
            starts = false;
        } else {
            out.push(c);
            starts |= matches!(c, '.' | '?' | '!');
        }
    }
    out.replace(" i ", " I ").replace(" i'd ", " I'd ")
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;
    use crate::house::testing::{closing, put_subtask, role, slice_role, subtask};

    fn chain() -> (Vec<Role>, Vec<Subtask>) {
        let roles =
            [role("Knife"), role("Apple"), role("CounterTop"), slice_role("Apple"), role("Bowl"), role("Fridge")];
        let subtasks = [
            subtask(SkillKind::Pickup, 0),
            subtask(SkillKind::Slice, 1),
            put_subtask(0, 2),
            subtask(SkillKind::Pickup, 3),
            subtask(SkillKind::Heat, 3),
            put_subtask(3, 4),
            subtask(SkillKind::Pickup, 4),
            closing(put_subtask(4, 5)),
        ];
        (roles.to_vec(), subtasks.to_vec())
    }

    /// Whether a text names a class by one of its names.
    fn names(text: &str, class: Class) -> bool {
        let text = text.to_lowercase();
        let plural = grammar().plural(class).to_lowercase();
        grammar().names(class).any(|name| text.contains(&name.to_lowercase())) || text.contains(&plural)
    }

    #[test]
    fn a_sentence_names_its_object_and_its_destination() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for class in Class::all().filter(|class| class.in_vocabulary()) {
            let roles = [Role { class, slice: false, bound: None, expert: None }, role("Microwave")];
            for skill in SkillKind::ALL {
                let step = if skill == SkillKind::Put { put_subtask(0, 1) } else { subtask(skill, 0) };
                for _ in 0..10 {
                    let text = sentence(&roles, &step, &mut rng);
                    assert!(names(&text, class), "{text}");
                    assert!(skill != SkillKind::Put || names(&text, roles[1].class), "{text}");
                }
            }
        }
    }

    #[test]
    fn an_instruction_for_a_chain_names_what_matters() {
        let (roles, subtasks) = chain();
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        for length in 1..=subtasks.len() {
            for _ in 0..200 {
                let text = instruction(&roles, &subtasks[..length], &mut rng);
                assert!(!text.contains(['{', '}']) && !text.contains("  ") && !text.contains(" a a"), "{text}");
                let wanted = if length <= 2 { usize::from(length == 2) } else { 1 };
                assert!(names(&text, roles[wanted].class) || length == 3 && names(&text, roles[0].class), "{text}");
                assert!(length < 8 || ["Bowl", "Fridge"].iter().all(|c| names(&text, role(c).class)), "{text}");
            }
        }
    }

    #[test]
    fn phrasings_are_many_and_the_same_for_the_same_random_numbers() {
        let (roles, subtasks) = chain();
        let texts = |seed| -> Vec<String> {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            (0..300).map(|_| sentence(&roles, &subtasks[0], &mut rng)).collect()
        };
        assert_eq!(texts(3), texts(3));
        let different: std::collections::BTreeSet<String> =
            texts(3).iter().map(|text| super::super::instruction::normalise(text)).collect();
        assert!(different.len() > 100, "{}", different.len());
    }

    #[test]
    fn twenty_phrasings() {
        let (roles, subtasks) = chain();
        let origins = [Some(role("Drawer").class), Some(role("CounterTop").class)];
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        let texts: Vec<String> = (0..20)
            .map(|number| match number % 5 {
                0 => TaskWording { roles: &roles, subtasks: &subtasks[..1], origins: &origins }.instruction(&mut rng),
                1 => sentence(&roles, &subtasks[number % 8], &mut rng),
                2 => TaskWording { roles: &roles, subtasks: &subtasks[..2], origins: &origins }.instruction(&mut rng),
                3 => instruction(&roles, &subtasks[3..6], &mut rng),
                _ => instruction(&roles, &subtasks, &mut rng),
            })
            .collect();
        insta::assert_snapshot!(texts.join("\n"));
    }
}
