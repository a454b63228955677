//! Wishes: what a person tells the agent in an episode, one after the other; how each was read, and what came of it.

mod reading;
mod record;
mod why;

pub(crate) use reading::{Expect, read, repick};
pub(crate) use record::{NOTHING_ASKED, Wish, WishGrading, WishVerdict, Wishes};
pub(crate) use why::explain;
