//! Where the policies of a run come from.

use crate::agent::Policy;
use crate::agent::policy_source::PolicySource;
use crate::episode::record::Author;

/// Finds the policy of an author; `None` where it is not at hand.
pub(crate) type FindPolicy<'a> = dyn FnMut(&Author) -> anyhow::Result<Option<PolicySource>> + 'a;

/// The policies of authors, each looked for once.
pub(super) struct Sources<'a, 'b> {
    find: &'a mut FindPolicy<'b>,
    known: Vec<(Author, Option<PolicySource>)>,
    /// The names of those that are not at hand.
    pub(super) missing: Vec<String>,
}

impl<'a, 'b> Sources<'a, 'b> {
    pub(super) fn new(find: &'a mut FindPolicy<'b>) -> Sources<'a, 'b> {
        Sources { find, known: Vec::new(), missing: Vec::new() }
    }

    /// Where an author's policies come from; `None` where it is not at hand. The seed is each episode's own.
    pub(super) fn find(&mut self, author: &Author) -> anyhow::Result<Option<PolicySource>> {
        let identity = |author: &Author| Author { seed: 0, ..author.clone() };
        let known = self.known.iter().find(|(known, _)| *known == identity(author));
        if let Some((_, source)) = known {
            return Ok(source.clone());
        }
        let source = (self.find)(author)?;
        if source.is_none() && !self.missing.contains(&author.policy) {
            self.missing.push(author.policy.clone());
        }
        self.known.push((identity(author), source.clone()));
        Ok(source)
    }

    pub(super) fn make(&mut self, author: &Author) -> anyhow::Result<Option<Box<dyn Policy>>> {
        self.find(author)?.map(|source| (source.make)()).transpose()
    }
}
