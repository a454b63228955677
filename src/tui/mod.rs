//! The explorer: a house, an agent in it, and a person at a terminal who tells it what to do.
//!
//! A [`app::Msg`] changes the [`app::App`] by [`app::update`], which is pure and returns effects; `screen` performs them. One
//! worker thread owns house and policy; a second one encodes pictures. [`view`] draws the state and nothing else.

pub mod app;
pub mod editor;
pub mod engine;
pub mod graphics;
pub mod keys;
pub mod layout;
pub mod openings;
pub mod plain;
pub mod policies;
pub mod screen;
pub mod terminal;
#[cfg(test)]
mod testing;
pub mod theme;
pub mod verb;
pub mod view;
pub mod worker;
