//! Wishes: what a person tells the agent in an episode, one after the other; how each was read, and what came of it.

mod reading;
mod record;
mod served_reader;
mod why;

pub(crate) use reading::{Expect, read, read_by, repick};
pub(crate) use record::{NOTHING_ASKED, Wish, WishGrading, WishVerdict, Wishes};
pub(crate) use served_reader::ServedReader;
pub(crate) use why::explain;
