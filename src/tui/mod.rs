//! The explorer: a house, an agent in it, and a person at a terminal who tells it what to do.
//!
//! A [`update::Msg`] changes the [`app::App`] by [`update::update`], which is pure and returns effects; [`screen_loop`] performs them. One
//! worker thread owns house and policy; a second one encodes pictures. [`view`] draws the state and nothing else.

pub(crate) mod annotate;
pub mod app;
mod capabilities;
mod completion;
pub(crate) mod remote;
pub mod config;
pub(crate) mod editor;
pub mod graphics;
pub(crate) mod history;
mod key_name;
mod keyboard;
pub(crate) mod keys;
pub mod layout;
mod link_speed;
pub(crate) mod log;
pub(crate) mod opening;
mod paced_display;
mod pacing;
pub(crate) mod screen;
pub mod screen_loop;
mod session_worker;
mod signals;
mod start_page;
mod steering;
mod taken_terminal;
pub mod terminal;
mod terminal_input;
#[cfg(test)]
mod testing;
pub mod theme;
pub mod update;
pub mod view;
pub mod worker;
