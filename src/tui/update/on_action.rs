//! What a person asked for, done.

use super::effect::{Effect, ExitReason, send};
use super::lines::{complete, read_palette, uncover};
use super::pages::{select, show, turn_to};
use crate::analysis::chain::Draws;
use crate::domain::Heading;
use crate::explore::session::{RunMode, SessionCommand, StepRate};
use crate::explore::verb;
use crate::explore::verb::{DRAWS, ExplorerPage, Verb};
use crate::tui::app::{App, HelpState};
use crate::tui::graphics::overlay::Overlay;
use crate::tui::keys::Mode;
use crate::tui::log::Tone;
use crate::tui::view::help::turn_help;

/// Does what a person asked for.
pub(crate) fn on_action(app: &mut App, verb: Verb) -> Vec<Effect> {
    if asks_first(app, &verb) {
        app.input.asked = Some(verb);
        return vec![];
    }
    match verb {
        Verb::Ask(command) => ask(app, command),
        Verb::ToggleRun | Verb::Continue => run(app, verb == Verb::Continue),
        Verb::Until(condition) => send(SessionCommand::Run { mode: RunMode::Policy, until: Some(condition) }),
        Verb::Step(count @ 2..) => send(SessionCommand::Run { mode: RunMode::Steps(count), until: None }),
        Verb::Step(_) => send(SessionCommand::Step),
        // Relative: more keys may come than states are shown. At the branch's end a step forward is the policy's.
        Verb::Back(steps) => send(SessionCommand::Along { by: -(steps as i32), steps: true }),
        Verb::Forward(steps) => send(SessionCommand::Along { by: steps as i32, steps: true }),
        Verb::Faster => set_rate(app, app.session.rate.faster()),
        Verb::Slower => set_rate(app, app.session.rate.slower()),
        Verb::NextPolicy => ask(app, SessionCommand::Choose(app.session.policy.next())),
        Verb::Interact(number) => interact(app, number),
        Verb::NextInteractions => {
            app.main.interactions = (app.main.interactions + 1) % app.pages().max(1);
            vec![Effect::Encode]
        }
        Verb::ToggleManual => {
            let mut effects = if app.page == ExplorerPage::Frame { vec![] } else { turn_to(app, ExplorerPage::Main) };
            app.input.mode = if app.input.mode == Mode::Manual { Mode::Watch } else { Mode::Manual };
            effects.extend(app.session.run_mode.map(|_| Effect::Send(SessionCommand::Pause)));
            effects
        }
        Verb::Show(page) => show(app, page),
        Verb::Branches | Verb::Wishes => show(app, ExplorerPage::Branches),
        Verb::Think => show(app, ExplorerPage::Mind),
        Verb::Look | Verb::Candidates => show(app, ExplorerPage::World),
        Verb::Select(by) if app.input.mode == Mode::WishList => {
            let most = app.input.wishes.len().saturating_sub(1);
            app.input.selected_wish = app.input.selected_wish.saturating_add_signed(isize::from(by)).min(most);
            vec![]
        }
        Verb::Select(by) => select(app, by),
        Verb::Take if app.page == ExplorerPage::Actions => send(SessionCommand::Seek(app.actions.selected as u32 + 1)),
        Verb::Take => send(SessionCommand::Switch((app.branches.selected + 1).to_string())),
        Verb::Sort => {
            app.mind.sort = app.mind.sort.next();
            vec![]
        }
        Verb::ReplayLink => {
            let draws = Draws { times: DRAWS, only: Some(app.chain.selected) };
            ask(app, SessionCommand::WhichLink(draws))
        }
        Verb::ValueMap => {
            app.value_map.toggle();
            send(if app.value_map.is_painted { SessionCommand::ValueMap } else { SessionCommand::StopValueMap })
        }
        Verb::Facing(heading) => paint_heading(app, heading),
        // The first press only paints.
        Verb::NextHeading if !app.value_map.is_painted => paint_heading(app, app.value_map.heading),
        Verb::NextHeading => paint_heading(app, app.value_map.next_heading()),
        Verb::Edit => {
            app.input.open(Mode::Typing);
            app.input.editor.open("");
            uncover(app)
        }
        Verb::Palette(text) => {
            app.input.open(Mode::Palette);
            app.input.selected_verb = 0;
            app.input.palette.open(&text);
            uncover(app)
        }
        Verb::Help | Verb::Terms => {
            app.input.open(Mode::Help);
            app.input.help = HelpState { shows_terms: verb == Verb::Terms, part: 0 };
            uncover(app)
        }
        Verb::TurnHelp => {
            turn_help(app);
            vec![]
        }
        Verb::OpenLink => ask(app, SessionCommand::OpenLink(app.chain.selected)),
        Verb::Cancel => {
            app.input.close();
            uncover(app)
        }
        Verb::Apply => apply(app),
        Verb::Earlier => {
            travel(app, -1);
            vec![]
        }
        Verb::Later => {
            travel(app, 1);
            vec![]
        }
        Verb::Complete => {
            complete(app);
            vec![]
        }
        Verb::Suspend => vec![Effect::Stop],
        Verb::Quit => vec![Effect::Quit(ExitReason::Asked)],
        Verb::List => vec![Effect::Send(SessionCommand::Stop), Effect::Quit(ExitReason::ToList)],
        Verb::Copy => copy(app),
        Verb::Graphics | Verb::Overlay | Verb::Labels | Verb::Bandwidth(_) | Verb::FullFrame | Verb::Mouse => {
            change_display(app, &verb)
        }
    }
}

/// Whether a verb would leave what is in no run folder, and was not asked for twice. On a screen too small to ask on, it would
/// be asked in vain.
fn asks_first(app: &App, verb: &Verb) -> bool {
    let leaves = matches!(verb, Verb::Quit | Verb::List | Verb::Ask(SessionCommand::Next | SessionCommand::Seed(_)));
    let is_unsaved = app.session.now.as_ref().is_some_and(|now| !now.unsaved.is_empty());
    leaves && is_unsaved && app.layout().is_some() && app.input.confirms.as_ref() != Some(verb)
}

/// Asks the session, on the page that shows what comes of it.
fn ask(app: &mut App, command: SessionCommand) -> Vec<Effect> {
    let mut effects = match &command {
        SessionCommand::Diverge(_) => turn_to(app, ExplorerPage::Branches),
        SessionCommand::OpenLink(_) => turn_to(app, ExplorerPage::Main),
        SessionCommand::Compare(_) => turn_to(app, ExplorerPage::Compare),
        SessionCommand::Chain(_) | SessionCommand::WhichLink(_) | SessionCommand::Against(_) => {
            turn_to(app, ExplorerPage::Chain)
        }
        SessionCommand::Choose(kind) => {
            app.session.choose(*kind);
            vec![]
        }
        _ => vec![],
    };
    effects.push(Effect::Send(command));
    effects
}

/// Lets it go on by itself, or pauses it.
fn run(app: &mut App, by_policy: bool) -> Vec<Effect> {
    if app.session.run_mode.is_some() && !by_policy {
        return send(SessionCommand::Pause);
    }
    if app.input.mode == Mode::Manual {
        app.input.mode = Mode::Watch;
    }
    let in_the_past = app.session.now.as_ref().is_some_and(|now| (now.time.at as usize) < now.time.steps.len());
    let mode = if in_the_past && !by_policy { RunMode::Replay } else { RunMode::Policy };
    send(SessionCommand::Run { mode, until: None })
}

fn set_rate(app: &mut App, rate: StepRate) -> Vec<Effect> {
    app.session.rate = rate;
    send(SessionCommand::StepRate(rate))
}

/// The interaction of that number on the page that is shown.
fn interact(app: &mut App, number: u8) -> Vec<Effect> {
    let candidate = app.page_of_candidates().get(usize::from(number).wrapping_sub(1)).copied();
    match candidate {
        Some(candidate) => send(SessionCommand::Act(candidate.action())),
        None => {
            app.note(Tone::Note, format!("no interaction has the number {number} now"));
            vec![]
        }
    }
}

fn paint_heading(app: &mut App, heading: Option<Heading>) -> Vec<Effect> {
    app.value_map.heading = heading;
    if app.value_map.is_painted {
        return vec![];
    }
    app.value_map.toggle();
    send(SessionCommand::ValueMap)
}

/// Does what was typed.
fn apply(app: &mut App) -> Vec<Effect> {
    if app.input.mode == Mode::Palette {
        let Some(verb) = read_palette(app) else { return vec![] };
        app.input.close();
        let mut effects = uncover(app);
        effects.extend(on_action(app, verb));
        return effects;
    }
    if app.input.mode == Mode::WishList {
        let wish = app.input.wishes.get(app.input.selected_wish).cloned().unwrap_or_default();
        app.input.open(Mode::Typing);
        app.input.editor.open(&wish);
        return uncover(app);
    }
    app.input.close();
    match app.input.editor.text().trim() {
        "" => vec![],
        text => send(SessionCommand::Instruct(text.to_string())),
    }
}

/// Up or down: among the verbs of the palette, or the instructions that were given before.
fn travel(app: &mut App, by: isize) {
    if app.input.mode == Mode::Palette {
        let most = verb::matching(app.input.palette.text()).len().saturating_sub(1);
        app.input.selected_verb = app.input.selected_verb.saturating_add_signed(by).min(most);
    } else {
        app.input.editor.travel(by);
    }
}

fn copy(app: &mut App) -> Vec<Effect> {
    let Some(now) = &app.session.now else { return vec![] };
    let last = app.log.done_at(now.step).map_or(String::new(), |entry| format!(": {} · {}", entry.text, entry.outcome));
    let text = format!("{} | {} step {}{last}", now.instruction, now.scene.name, now.step);
    app.note(Tone::Note, "copied");
    vec![Effect::Copy(text)]
}

/// What is about the screen alone.
fn change_display(app: &mut App, verb: &Verb) -> Vec<Effect> {
    match verb {
        Verb::Graphics => {
            let graphics = &mut app.terminal.graphics;
            graphics.protocol = graphics.protocol.next();
            graphics.reason = "chosen by key g".into();
            app.frame.picture = None;
            return vec![Effect::Encode, Effect::Repaint];
        }
        Verb::Overlay => {
            app.main.overlay = app.main.overlay.next();
            let looks_back = app.main.overlay == Overlay::Frames;
            return vec![Effect::Send(SessionCommand::LookBack(looks_back)), Effect::Encode];
        }
        Verb::Mouse => {
            app.terminal.mouse = !app.terminal.mouse;
            let text = if app.terminal.mouse { "the mouse is heard" } else { "the mouse is the terminal's again" };
            app.note(Tone::Note, text);
            return vec![Effect::Mouse(app.terminal.mouse)];
        }
        Verb::Labels => app.main.numbers = !app.main.numbers,
        Verb::Bandwidth(kilobytes) => {
            app.traffic.limit = (*kilobytes > 0).then(|| 1000 * u64::from(*kilobytes));
            app.traffic.coarseness = 0;
        }
        _ => (app.traffic.is_full, app.traffic.coarseness) = (true, 0),
    }
    vec![Effect::Encode]
}
