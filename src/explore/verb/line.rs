//! What follows a verb, read as what it asks for.

use crate::agent::registry::PolicyKind;
use crate::analysis::chain::Draws;
use crate::explore::breakpoints::Condition;

/// Draws of a link where nobody says how many.
pub(crate) const DRAWS: u32 = 8;

/// A verb and what follows it.
pub(super) struct VerbLine<'a> {
    pub(super) verb: &'a str,
    pub(super) rest: &'a str,
}

impl VerbLine<'_> {
    pub(super) fn number(&self) -> Result<u32, String> {
        self.number_in(self.rest)
    }

    fn number_in(&self, text: &str) -> Result<u32, String> {
        text.parse().map_err(|_| format!("{}: {text:?} is not a number", self.verb))
    }

    /// A number above 0, or one.
    pub(super) fn count(&self) -> Result<u32, String> {
        if self.rest.is_empty() { Ok(1) } else { self.count_in(self.rest) }
    }

    fn count_in(&self, text: &str) -> Result<u32, String> {
        match self.number_in(text)? {
            0 => Err(format!("{}: 0 times is nothing to do", self.verb)),
            count => Ok(count),
        }
    }

    /// A number, where there is one.
    pub(super) fn optional_count(&self) -> Result<Option<usize>, String> {
        if self.rest.is_empty() { Ok(None) } else { Ok(Some(self.count_in(self.rest)? as usize)) }
    }

    /// A large number, which complaints call so.
    pub(super) fn seed(&self, called: &str) -> Result<u64, String> {
        self.rest.parse().map_err(|_| format!("{}: {:?} is not {called}", self.verb, self.rest))
    }

    /// Any text but none.
    pub(super) fn text(&self) -> Result<String, String> {
        match self.rest {
            "" => Err(format!("{}: what? say it after the verb", self.verb)),
            text => Ok(text.to_string()),
        }
    }

    pub(super) fn condition(&self) -> Result<Condition, String> {
        Condition::parse(self.rest)
    }

    pub(super) fn policy(&self) -> Result<PolicyKind, String> {
        let found = PolicyKind::ALL.into_iter().find(|kind| kind.name() == self.rest);
        found.ok_or_else(|| format!("policy: {:?} is none of agent, expert, random", self.rest))
    }

    /// `[TIMES]`
    pub(super) fn draws_of_all(&self) -> Result<Draws, String> {
        Ok(Draws { times: if self.rest.is_empty() { DRAWS } else { self.count_in(self.rest)? }, only: None })
    }

    /// `N [TIMES]`
    pub(super) fn draws_of_one(&self) -> Result<Draws, String> {
        let (link, times) = self.rest.split_once(' ').unwrap_or((self.rest, ""));
        let only = self.number_in(link)?.checked_sub(1).ok_or("link: links are numbered from 1")?;
        let times = if times.is_empty() { DRAWS } else { self.count_in(times.trim())? };
        Ok(Draws { times, only: Some(only as usize) })
    }
}
