//! What an explorer without a screen is asked: by lines of its input, and by those who steer it from another terminal.

use std::collections::VecDeque;
use std::io::{self, BufRead};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, sync_channel};

use super::steering::ExplorerControl;
use crate::control::Order;

/// Something that is asked.
#[derive(Debug)]
pub(crate) enum Asked {
    Line(io::Result<String>),
    Ordered(Order),
    /// No more lines come.
    Over,
}

/// Everything that is asked, in its order.
pub(crate) struct PlainInput {
    asked: Receiver<Asked>,
    /// Lines that came while something else was under way.
    waiting: VecDeque<Asked>,
}

/// Lines and orders that may wait.
const QUEUE: usize = 1024;

impl PlainInput {
    /// Reads `input` in a thread of its own; orders come in by what steers it.
    ///
    /// # Errors
    /// When there is no thread to be had.
    pub(crate) fn steered(input: impl BufRead + Send + 'static) -> io::Result<(PlainInput, Arc<ExplorerControl>)> {
        let (tell, asked) = sync_channel(QUEUE);
        let (orders, ends) = (tell.clone(), tell.clone());
        let read = move || {
            // Whoever has left asks for no more lines.
            let all = input.lines().map(Asked::Line).chain(std::iter::once_with(|| Asked::Over));
            let _ = all.map(|line| tell.send(line)).find(Result::is_err);
        };
        std::thread::Builder::new().name("input".into()).spawn(read)?;
        let control = ExplorerControl::new(move || ends.try_send(Asked::Ordered(Order::Stop)).is_ok());
        control.command(move |order| orders.try_send(Asked::Ordered(order)).is_ok());
        Ok((PlainInput { asked, waiting: VecDeque::new() }, control))
    }

    /// The next thing that is asked; waits for it.
    pub(crate) fn next(&mut self) -> Asked {
        self.waiting.pop_front().unwrap_or_else(|| self.asked.recv().unwrap_or(Asked::Over))
    }

    /// What was ordered while something else is under way; lines wait for its end.
    pub(crate) fn order(&mut self) -> Option<Order> {
        loop {
            match self.asked.try_recv().ok()? {
                Asked::Ordered(order) => return Some(order),
                line => self.waiting.push_back(line),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::Controlled;

    #[test]
    fn orders_are_heard_at_once_and_lines_keep_their_order() {
        let (mut input, control) = PlainInput::steered(io::Cursor::new("one\ntwo\n")).unwrap();
        assert!(matches!(input.next(), Asked::Line(Ok(line)) if line == "one"));
        control.obey(Order::Pause).unwrap();
        let heard = std::iter::from_fn(|| Some(input.order())).flatten().next();
        assert_eq!(heard, Some(Order::Pause));
        assert!(matches!(input.next(), Asked::Line(Ok(line)) if line == "two"));
        assert!(matches!(input.next(), Asked::Over));
        control.obey(Order::Stop).unwrap();
        assert!(matches!(input.next(), Asked::Ordered(Order::Stop)));
    }
}
