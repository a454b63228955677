//! A wish read by a language model: what it is asked, and what is made of its answer.

use std::collections::BTreeSet;

use serde::Deserialize;

use super::reading::{ReadSubtask, WishReading};
use crate::domain::Class;
use crate::domain::skill::SkillKind;
use crate::language::nouns;

/// What is asked for, with examples.
const EXAMPLES: &str = include_str!("../../../assets/prompts/read_wish.txt");
/// Wishes before this one that are told along: "it" is seldom further back.
const BEFORE: usize = 3;
/// An answer with more steps is none.
const LONGEST: usize = 40;

/// A step of an answer.
#[derive(Deserialize)]
struct AnsweredStep {
    skill: String,
    object: String,
    #[serde(default)]
    receptacle: Option<String>,
    #[serde(default)]
    slice: bool,
}

/// The prompt for a text; `house` holds the classes that it may mean, all where that is not known.
pub(crate) fn prompt(text: &str, earlier: &[&str], house: Option<&BTreeSet<Class>>) -> String {
    let names: Vec<&str> = match house {
        Some(house) => house.iter().map(|class| class.name()).collect(),
        None => Class::all().map(Class::name).collect(),
    };
    let before: String =
        earlier[earlier.len().saturating_sub(BEFORE)..].iter().map(|text| format!("Before: {text}\n")).collect();
    format!("{EXAMPLES}Things: {}\n{before}Told: {text}\nSteps:", names.join(", "))
}

/// What an answer says, where it says it in the form that was asked for. How likely it is right nobody knows.
///
/// # Errors
/// Says what is wrong with the answer.
pub(crate) fn reading(
    answer: &str,
    text: &str,
    house: Option<&BTreeSet<Class>>,
    read_by: &str,
) -> Result<WishReading, String> {
    let list = answer.find('[').map(|start| &answer[start..]).ok_or("its answer holds no list of steps")?;
    let mut values = serde_json::Deserializer::from_str(list).into_iter::<Vec<AnsweredStep>>();
    let steps = values.next().ok_or("its answer holds no list of steps")?;
    let steps = steps.map_err(|error| format!("its answer is no list of steps: {error}"))?;
    if steps.len() > LONGEST {
        return Err(format!("its answer has {} steps", steps.len()));
    }
    let subtasks = steps.into_iter().map(subtask).collect::<Result<Vec<_>, String>>()?;
    let named = subtasks.iter().flat_map(|subtask| subtask.object.into_iter().chain(subtask.receptacle));
    let absent: BTreeSet<Class> = named.filter(|class| house.is_some_and(|house| !house.contains(class))).collect();
    Ok(WishReading {
        unread: if subtasks.is_empty() { text.split_whitespace().map(str::to_owned).collect() } else { Vec::new() },
        subtasks,
        confidence: 0.0,
        absent: absent.into_iter().collect(),
        read_by: Some(read_by.into()),
    })
}

fn subtask(step: AnsweredStep) -> Result<ReadSubtask, String> {
    let kind = SkillKind::ALL.into_iter().find(|kind| format!("{kind:?}").eq_ignore_ascii_case(step.skill.trim()));
    let skill = kind.ok_or_else(|| format!("its answer has {:?}, which is no skill", step.skill))?;
    let object = class(&step.object)?;
    let receptacle = match (skill, step.receptacle.as_deref().filter(|name| !name.trim().is_empty())) {
        (SkillKind::Put, Some(name)) => Some(class(name)?),
        _ => None,
    };
    if receptacle == Some(object) {
        return Err(format!("its answer puts the {} into itself", object.spoken()));
    }
    let slice = step.slice && object.info().slices > 0;
    let (looks, place, alternatives) = (Vec::new(), None, Vec::new());
    Ok(ReadSubtask { skill, object: Some(object), receptacle, slice, looks, place, alternatives })
}

/// The class of that name, as the list has it or as people say it. ALFRED calls a sink's basin by a name of its own.
fn class(name: &str) -> Result<Class, String> {
    let name = name.trim();
    let name = name.strip_suffix("Basin").unwrap_or(name);
    let exact = Class::all().find(|class| class.name().eq_ignore_ascii_case(name));
    let spoken = || Class::all().find(|&class| nouns::heads(class).any(|head| head.eq_ignore_ascii_case(name)));
    exact.or_else(spoken).ok_or_else(|| format!("its answer has {name:?}, which is no thing"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn house() -> BTreeSet<Class> {
        ["Mug", "Sink", "Apple"].into_iter().filter_map(Class::named).collect()
    }

    #[test]
    fn the_prompt_names_what_is_in_the_house_and_the_last_wishes_and_ends_where_the_answer_begins() {
        let prompt = prompt("put it there", &["a", "b", "c", "d"], Some(&house()));
        let asked = prompt.strip_prefix(EXAMPLES).unwrap();
        assert!(asked.ends_with("Before: b\nBefore: c\nBefore: d\nTold: put it there\nSteps:"), "{asked}");
        let things = asked.lines().next().unwrap();
        assert!(["Mug", "Sink", "Apple"].iter().all(|name| things.contains(name)) && !things.contains("Fridge"));
    }

    #[test]
    fn an_answer_in_the_form_asked_for_is_read_whatever_stands_around_it() {
        let answer = " Sure: [{\"skill\": \"pickup\", \"object\": \"mug\"}, {\"skill\": \"Put\", \"object\": \"Mug\", \
                      \"receptacle\": \"Fridge\"}] That is all.";
        let basin = "[{\"skill\": \"Put\", \"object\": \"Mug\", \"receptacle\": \"SinkBasin\"}]";
        assert_eq!(super::reading(basin, "x", Some(&house()), "model").unwrap().absent, []);
        let reading = reading(answer, "x", Some(&house()), "model").unwrap();
        assert_eq!(reading.words(), "pick up a mug, put it in the fridge");
        assert_eq!(reading.absent, [Class::named("Fridge").unwrap()]);
        assert_eq!(reading.read_by.as_deref(), Some("model"));
    }

    #[test]
    fn the_examples_of_the_prompt_are_answers_themselves() {
        let answers: Vec<&str> = EXAMPLES.lines().filter_map(|line| line.strip_prefix("Steps:")).collect();
        assert_eq!(answers.len(), 4);
        let words: Vec<String> =
            answers.iter().map(|answer| reading(answer, "a b", None, "m").unwrap().words()).collect();
        assert_eq!(words[1], "slice an apple, heat it, put it on the plate");
        assert_eq!(reading(answers[3], "sing me", None, "m").unwrap().unread, ["sing", "me"]);
    }

    #[test]
    fn what_is_wrong_with_an_answer_is_said() {
        for (answer, why) in [
            ("I cannot do that.", "no list of steps"),
            ("[{\"skill\": \"Put\"", "is no list of steps"),
            ("[{\"skill\": \"Sing\", \"object\": \"Mug\"}]", "\"Sing\", which is no skill"),
            ("[{\"skill\": \"Pickup\", \"object\": \"Unicorn\"}]", "\"Unicorn\", which is no thing"),
            ("[{\"skill\": \"Put\", \"object\": \"Mug\", \"receptacle\": \"mug\"}]", "into itself"),
        ] {
            let error = reading(answer, "x", None, "m").unwrap_err();
            assert!(error.contains(why), "{answer}: {error}");
        }
    }
}
