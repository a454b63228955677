//! What the page of a chain looks like.

use crate::analysis::chain::{LinkRate, LinkSuccess};
use crate::explore::chain_report::ChainReport;
use crate::explore::session::SessionEvent;
use crate::explore::verb::{ExplorerPage, Verb};
use crate::tui::testing::{chained, screen};
use crate::tui::update::{Msg, on_action, update};
use crate::tui::view::tests::{SIZES, check, forked};

#[test]
fn a_chain_shows_each_link_and_which_one_breaks() {
    let rate = |done| LinkRate { done, of: 8 };
    let trials =
        LinkSuccess { expert: vec![rate(8), rate(6), rate(7)], own: vec![rate(8), rate(1), LinkRate::default()] };
    let chained = ChainReport { trials: Some(trials), ..chained("first", false, false) };
    for (width, height) in SIZES {
        let (mut app, _) = forked(width, height);
        on_action(&mut app, Verb::Show(ExplorerPage::Chain));
        update(&mut app, Msg::Session(SessionEvent::Chain(Box::new(chained.clone()))));
        check(&format!("chain-{width}x{height}"), &screen(&mut app));
    }
    let (mut app, _) = forked(60, 20);
    on_action(&mut app, Verb::Show(ExplorerPage::Chain));
    update(&mut app, Msg::Session(SessionEvent::Chain(Box::new(chained))));
    let text = screen(&mut app);
    for part in ["expert's", "own entry", "6/8 75%", "1/8 12%", "link 2 breaks the chain"] {
        assert!(text.contains(part), "no {part} on a small screen:\n{text}");
    }
}

#[test]
fn two_policies_follow_the_same_chain_side_by_side() {
    for (width, height) in [(80, 24), (120, 36), (200, 60)] {
        let (mut app, _) = forked(width, height);
        on_action(&mut app, Verb::Show(ExplorerPage::Chain));
        for report in [chained("sprint", true, true), chained("first", false, false)] {
            update(&mut app, Msg::Session(SessionEvent::Chain(Box::new(report))));
        }
        check(&format!("chains-{width}x{height}"), &screen(&mut app));
        let again = ChainReport { trials: Some(LinkSuccess::default()), ..chained("first", false, false) };
        update(&mut app, Msg::Session(SessionEvent::Chain(Box::new(again))));
        assert_eq!(app.chain.own.as_ref().unwrap().who.name, "sprint", "each stays on its side");
        assert!(app.chain.rival.as_ref().unwrap().trials.is_some());
        let elsewhere = ChainReport { start: "another kitchen".into(), ..chained("sprint", true, true) };
        update(&mut app, Msg::Session(SessionEvent::Chain(Box::new(elsewhere))));
        assert!(app.chain.rival.is_none(), "another start is another chain");
    }
}
