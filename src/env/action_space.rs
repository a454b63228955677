//! The actions of an environment that has its own: names, with an argument from a list where they take one.

use std::sync::{Mutex, PoisonError};

use anyhow::{Context, ensure};
use serde_json::Value;

use crate::domain::Action;

/// The most actions, and the most values of an argument: both are told by 16 bits.
const MOST: usize = u16::MAX as usize;

/// One action.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct NamedAction {
    /// What it is called.
    pub(crate) name: String,
    /// Which of the lists its argument is from, where it takes one.
    pub(crate) list: Option<usize>,
}

/// The values that an argument may have.
#[derive(Debug)]
pub(crate) struct ArgumentList {
    /// What the list is called.
    pub(crate) name: String,
    /// Any text may be said, not only what is listed.
    pub(crate) is_open: bool,
    /// In their order; an open list grows with every text that is said.
    values: Mutex<Vec<Value>>,
}

/// Everything that an environment lets an agent do.
#[derive(Debug, Default)]
pub(crate) struct ActionSpace {
    actions: Vec<NamedAction>,
    lists: Vec<ArgumentList>,
}

impl ArgumentList {
    /// A list of that name; without values it is open.
    pub(crate) fn new(name: String, values: Option<Vec<Value>>) -> ArgumentList {
        ArgumentList { name, is_open: values.is_none(), values: Mutex::new(values.unwrap_or_default()) }
    }

    /// What is in it now.
    pub(crate) fn values(&self) -> Vec<Value> {
        self.values.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    fn get(&self, place: u16) -> Option<Value> {
        self.values.lock().unwrap_or_else(PoisonError::into_inner).get(usize::from(place)).cloned()
    }

    fn place(&self, value: &Value) -> anyhow::Result<u16> {
        let mut values = self.values.lock().unwrap_or_else(PoisonError::into_inner);
        let found = values.iter().position(|known| known == value);
        let place = match found {
            Some(place) => place,
            None => {
                ensure!(self.is_open, "{value} is none of the values of {:?}", self.name);
                ensure!(value.is_string(), "{value} is no text, which {:?} takes", self.name);
                ensure!(values.len() < MOST, "more texts were said than can be distinguished");
                values.push(value.clone());
                values.len() - 1
            }
        };
        Ok(place as u16)
    }
}

impl ActionSpace {
    /// These actions; each list that they name is one of `lists`.
    ///
    /// # Errors
    /// When there is none, there are too many, or two have one name.
    pub(crate) fn new(actions: Vec<NamedAction>, lists: Vec<ArgumentList>) -> anyhow::Result<ActionSpace> {
        ensure!(!actions.is_empty(), "actions: there is none");
        ensure!(actions.len() <= MOST, "actions: {} are more than {MOST}", actions.len());
        for (i, action) in actions.iter().enumerate() {
            ensure!(!action.name.is_empty(), "actions[{i}].name: empty");
            let twice = actions[..i].iter().any(|other| other.name == action.name);
            ensure!(!twice, "actions[{i}].name: {:?} is there already", action.name);
        }
        for list in &lists {
            let many = list.values().len();
            ensure!(many <= MOST, "arguments.{}: {many} are more than {MOST}", list.name);
            ensure!(list.is_open || many > 0, "arguments.{}: there is no value", list.name);
        }
        Ok(ActionSpace { actions, lists })
    }

    /// The actions, in their order.
    pub(crate) fn actions(&self) -> &[NamedAction] {
        &self.actions
    }

    /// The list that an action's argument is from, where it takes one.
    pub(crate) fn list(&self, action: usize) -> Option<&ArgumentList> {
        self.actions.get(action)?.list.and_then(|list| self.lists.get(list))
    }

    /// The action of that name with that argument.
    ///
    /// # Errors
    /// When there is none; says what there is.
    pub(crate) fn find(&self, name: &str, argument: Option<&Value>) -> anyhow::Result<Action> {
        let found = self.actions.iter().position(|action| action.name == name);
        let place = found.with_context(|| format!("there is no action {name:?}; there are: {}", self.names()))?;
        let argument = match (self.list(place), argument.filter(|value| !value.is_null())) {
            (None, None) => None,
            (None, Some(value)) => anyhow::bail!("{name} takes no argument, but {value} was given"),
            (Some(list), None) => anyhow::bail!("{name} needs an argument of {:?}", list.name),
            (Some(list), Some(value)) => Some(list.place(value).with_context(|| format!("the action {name}"))?),
        };
        Ok(Action::own(place as u16, argument))
    }

    /// An action's name and argument; `None` for what is none of these actions.
    pub(crate) fn parts(&self, action: Action) -> Option<(&str, Option<Value>)> {
        let (place, argument) = action.as_own()?;
        let named = self.actions.get(usize::from(place))?;
        match (self.list(usize::from(place)), argument) {
            (None, None) => Some((&named.name, None)),
            (Some(list), Some(at)) => Some((&named.name, Some(list.get(at)?))),
            _ => None,
        }
    }

    /// An action as a screen shows it.
    pub(crate) fn words(&self, action: Action) -> String {
        match self.parts(action) {
            Some((name, None)) => name.to_owned(),
            Some((name, Some(Value::String(argument)))) => format!("{name} {argument}"),
            Some((name, Some(argument))) => format!("{name} {argument}"),
            None => action.kind.to_string(),
        }
    }

    fn names(&self) -> String {
        let names: Vec<&str> = self.actions.iter().take(30).map(|action| action.name.as_str()).collect();
        names.join(", ")
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// Two moves, one that needs a thing, and one that says anything.
    pub(crate) fn space() -> ActionSpace {
        let action = |name: &str, list| NamedAction { name: name.into(), list };
        let actions =
            vec![action("left", None), action("forward", None), action("open", Some(0)), action("say", Some(1))];
        let things = ArgumentList::new("thing".into(), Some(vec!["door".into(), 7.into()]));
        ActionSpace::new(actions, vec![things, ArgumentList::new("text".into(), None)]).unwrap()
    }

    #[test]
    fn an_action_is_found_by_its_name_and_argument_and_told_by_them() {
        let space = space();
        for (name, argument) in
            [("left", None), ("open", Some(Value::from("door"))), ("open", Some(7.into())), ("say", Some("go".into()))]
        {
            let action = space.find(name, argument.as_ref()).unwrap();
            assert_eq!(space.parts(action), Some((name, argument)));
        }
        assert_eq!(space.words(space.find("open", Some(&"door".into())).unwrap()), "open door");
        assert_eq!(space.parts(Action::own(2, Some(9))), None);
    }

    #[test]
    fn what_is_no_action_is_named() {
        let space = space();
        let told =
            |name: &str, argument: Option<Value>| format!("{:#}", space.find(name, argument.as_ref()).unwrap_err());
        assert!(told("jump", None).contains("no action \"jump\"; there are: left, forward"));
        assert!(told("left", Some("door".into())).contains("takes no argument"));
        assert!(told("open", None).contains("needs an argument of \"thing\""));
        assert!(told("open", Some("window".into())).contains("none of the values"));
    }
}
