//! For tests: a session in the hand-made kitchen, with a frame and sightings that do not depend on how things are drawn.

use std::sync::Arc;

use super::episode_source::{EpisodeOrigin, EpisodeSource};
use super::exploration::{Exploration, SessionSnapshot};
use super::session::SessionEvent;
use crate::agent::registry::{Policies, PolicyKind};
use crate::agent::value_estimates::ChoiceValue;
use crate::agent::{ActionDistribution, Decision, Values};
use crate::domain::task::SceneRef;
use crate::domain::{Action, ActionType, Class, Role, SkillKind, Subtask, Trajectory};
use crate::episode::scenes::Scenes;
use crate::house::testing::{kitchen, named};
use crate::house::view::{Candidate, Frame, Sighting, View, code};

/// An exploration in the kitchen with the task to put a mug into the sink.
pub(crate) fn exploration() -> Exploration {
    let (scene, world) = kitchen();
    let role = |name: &str| Role { class: Class::named(name).unwrap(), slice: false, bound: None, expert: None };
    let subtask = |skill, receptacle| Subtask { skill, object: 0, receptacle, closes: false, literal: None };
    let trajectory = Trajectory {
        id: "kitchen".into(),
        split: "test".into(),
        scene: SceneRef::Named(scene.name.clone()),
        start: world,
        actions: vec![Action::navigate(ActionType::MoveAhead); 24],
        roles: vec![role("Mug"), role("Sink")],
        skills: vec![subtask(SkillKind::Pickup, None), subtask(SkillKind::Put, Some(1))],
        skill_starts: vec![0, 12],
        goal: None,
        annotations: vec![crate::domain::trajectory::Annotation {
            goal: "put the mug in the sink".into(),
            steps: vec![],
        }],
        boxes: vec![],
        choices: vec![],
    };
    let start = EpisodeOrigin::Recorded { scene, trajectories: vec![trajectory] };
    let source = EpisodeSource::new(start, 5, Scenes::in_folder(None));
    let policies = Policies::new(Vec::new());
    Exploration::new(source, policies, PolicyKind::Random, None).unwrap()
}

/// The exploration's state with a made-up frame: a mug on a table before a wall.
pub(crate) fn snapshot(exploration: &mut Exploration) -> SessionSnapshot {
    let mut now = exploration.snapshot();
    let (scene, world) = (&now.scene, &now.world);
    let seen = ["DiningTable", "Mug", "Plate", "Fridge"].map(|name| named(scene, world, name));
    let boxes: [[u16; 4]; 4] = [[40, 160, 299, 260], [80, 130, 110, 165], [180, 150, 240, 170], [230, 20, 299, 150]];
    now.view = View {
        sightings: seen
            .into_iter()
            .zip(boxes)
            .map(|(instance, bounds)| Sighting { instance, pixels: 900, bounds })
            .collect(),
    };
    let side = 300;
    let mut frame = Frame {
        width: side,
        height: side,
        rgb: Vec::with_capacity(3 * side * side),
        depth: vec![3.0; side * side],
        ids: vec![0; side * side],
    };
    for y in 0..side {
        for x in 0..side {
            let inside = |[l, t, r, b]: [u16; 4]| {
                (usize::from(l)..=usize::from(r)).contains(&x) && (usize::from(t)..=usize::from(b)).contains(&y)
            };
            let hit = [1, 2, 3, 0].into_iter().find(|&i| inside(boxes[i]));
            frame.ids[y * side + x] = hit.map_or(0, |i| code(seen[i]));
            frame.rgb.extend(
                hit.map_or([90, 80, 70], |i| [[150, 110, 70], [200, 60, 50], [220, 220, 225], [180, 190, 200]][i]),
            );
        }
    }
    now.frame = Arc::new(frame);
    let candidate = |kind, at: usize, distance| {
        let class = world.class_of(scene, seen[at]).unwrap();
        Candidate { kind, instance: seen[at], class, distance }
    };
    now.candidates = vec![
        candidate(ActionType::Pickup, 1, 820.0),
        candidate(ActionType::Pickup, 2, 1040.0),
        candidate(ActionType::Open, 3, 1310.0),
    ];
    now
}

/// What a policy might think of that.
pub(crate) fn decided(now: &SessionSnapshot) -> SessionEvent {
    let mut actions = [None; ActionType::COUNT];
    let shares = [(0, 0.08), (1, 0.02), (2, 0.12), (3, 0.01), (4, 0.06), (5, 0.66), (7, 0.05)];
    for (at, p) in shares {
        actions[at] = Some(p);
    }
    let class = |name: &str| Class::named(name).unwrap();
    let objects = vec![
        (class("Mug"), 0.71, true),
        (class("Cup"), 0.14, false),
        (class("Plate"), 0.08, true),
        (class("Bowl"), 0.04, false),
        (class("CoffeeMachine"), 0.03, false),
    ];
    let weighs = |kind: ActionType| objects.iter().map(move |&(class, p, _)| (kind, class, p));
    let choices = [ActionType::Pickup, ActionType::Open].into_iter().flat_map(weighs).collect();
    let action = now.candidates[0].action();
    SessionEvent::Decided(
        Decision {
            own: None,
            action,
            distribution: Some(ActionDistribution { actions, objects, choices, entropy: 1.13, greedy: action }),
            values: None,
            done: None,
        },
        "Pickup Mug".into(),
        None,
    )
}

/// What critics might say of it.
pub(crate) fn values(now: &SessionSnapshot) -> Values {
    let kinds = [(ActionType::MoveAhead, 0.44), (ActionType::RotateLeft, 0.31), (ActionType::RotateRight, 0.47)];
    let navigation = kinds.into_iter().map(|(kind, q)| ChoiceValue { kind, class: None, q });
    let interactions = now.candidates.iter().zip([0.71, 0.28, -0.02]);
    let interactions = interactions.map(|(one, q)| ChoiceValue { kind: one.kind, class: Some(one.class), q });
    Values { state: 0.52, choices: navigation.chain(interactions).collect() }
}
