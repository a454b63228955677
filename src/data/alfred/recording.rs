//! A recorded trajectory, checked: GotoLocation merged, names and numbers read, nothing resolved against a scene yet.

use super::files::{Coordinate, HighAction, LowAction, SceneData, TrajData};
use super::layout::{cell_at, heading_at};
use super::merge::GotoMerge;
use super::names::{FARTHEST, Name, class_named};
use crate::domain::place::Pose;
use crate::domain::skill::GoalKind;
use crate::domain::trajectory::Annotation;
use crate::domain::{ActionType, Class, Goal, Point, Room, SkillKind};
use crate::language::instruction;

/// A state of a scene: what every file holds, test splits included.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordedStart {
    /// `FloorPlan7`.
    pub floor_plan: String,
    /// The kind of room.
    pub(crate) room: Room,
    /// The agent's y in millimetres.
    pub(crate) agent_y: i32,
    /// Where the agent starts.
    pub(crate) agent: Pose,
    /// Every movable object of a known class.
    pub(crate) objects: Vec<Placed>,
    /// Classes of lamps that shine.
    pub(crate) lit: Vec<Class>,
}

/// A movable object at the start.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Placed {
    pub(crate) class: Class,
    /// ALFRED's `objectName`: one mesh.
    pub(crate) mesh: String,
    /// Its pivot.
    pub(crate) at: Point,
    /// Euler angles in tenths of a degree.
    pub(crate) turn: [i16; 3],
}

/// One action of the expert.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RecordedStep {
    /// What was done.
    pub(crate) kind: ActionType,
    /// To what; the receptacle, for a Put.
    pub(crate) target: Option<Name>,
    /// Which merged skill it belongs to.
    pub skill: usize,
    /// The target's box in the frame before it: left, top, right, bottom edges.
    pub(crate) bounds: Option<[u16; 4]>,
}

/// One merged skill as planned.
#[derive(Clone, Debug, PartialEq)]
pub struct Planned {
    pub(crate) kind: SkillKind,
    /// The object (Pickup, Put, Slice, Toggle), or the fixture (Clean, Heat, Cool).
    pub(crate) object: Name,
    /// For Put, the receptacle.
    pub(crate) receptacle: Option<Name>,
    pub(crate) cleaned: Option<Name>,
    /// The object's first place to the millimetre.
    pub(crate) object_at: Option<(Class, Point)>,
    /// Where the receptacle stands: the one put into, or the one that the object was in.
    pub(crate) receptacle_at: Option<(Class, Point)>,
    /// The pose that was walked to.
    pub(crate) walked_to: Option<Pose>,
}

/// A recorded trajectory.
#[derive(Clone, Debug, PartialEq)]
pub struct Recording {
    /// `task/trial`.
    pub id: String,
    /// `train`, ...
    pub split: String,
    /// Where it starts.
    pub setting: RecordedStart,
    /// ALFRED's goal.
    pub(crate) goal: Goal,
    /// The merged skills.
    pub skills: Vec<Planned>,
    /// The actions, skill after skill.
    pub steps: Vec<RecordedStep>,
    /// What people wrote, merged.
    pub annotations: Vec<Annotation>,
}

impl Recording {
    /// Checks and merges a file's content.
    ///
    /// # Errors
    /// The field that makes no sense, and why.
    pub(crate) fn new(id: String, split: String, data: TrajData) -> Result<Recording, String> {
        let numbers = data.plan.high_pddl.iter().map(|high| high.high_idx);
        if let Some(number) = numbers.chain(data.plan.low_actions.iter().map(|low| low.high_idx)).find(|&n| n > 10_000)
        {
            return Err(format!("high_idx: {number} is out of range"));
        }
        let gotos = data.plan.high_pddl.iter().filter(|high| high.discrete_action.action == "GotoLocation");
        let merge = GotoMerge::new(gotos.map(|high| high.high_idx).collect());
        let skills = skills(&data.plan.high_pddl, &merge)?;
        let mut steps = Vec::with_capacity(data.plan.low_actions.len());
        for (index, low) in data.plan.low_actions.iter().enumerate() {
            let step = step(low, &merge).map_err(|error| format!("plan.low_actions[{index}].{error}"))?;
            let last = steps.last().map_or(0, |step: &RecordedStep| step.skill);
            if step.skill < last || step.skill >= skills.len() {
                return Err(format!("plan.low_actions[{index}].high_idx: {} fits no skill in order", low.high_idx));
            }
            steps.push(step);
        }
        for (i, ann) in data.turk_annotations.anns.iter().enumerate() {
            let longest = ann.high_descs.iter().chain([&ann.task_desc]).map(|text| text.chars().count()).max();
            if let Some(longest) = longest.filter(|&longest| longest > instruction::LONGEST) {
                let most = instruction::LONGEST;
                return Err(format!("turk_annotations.anns[{i}]: a text of {longest} characters, {most} are the most"));
            }
        }
        let annotations = data.turk_annotations.anns.iter().map(|ann| Annotation {
            goal: instruction::visible(&ann.task_desc),
            steps: merge.sentences(&ann.high_descs),
        });
        Ok(Recording {
            id,
            split,
            setting: RecordedStart::new(&data.scene)?,
            goal: goal(&data)?,
            skills,
            steps,
            annotations: annotations.collect(),
        })
    }
}

impl RecordedStart {
    /// Checks a file's scene.
    ///
    /// # Errors
    /// The field that makes no sense, and why.
    pub(crate) fn new(scene: &SceneData) -> Result<RecordedStart, String> {
        let room = Room::of_floor_plan(scene.scene_num)
            .filter(|_| scene.floor_plan == format!("FloorPlan{}", scene.scene_num))
            .ok_or_else(|| format!("scene.floor_plan: {:?} is no floor plan of ALFRED", scene.floor_plan))?;
        let init = &scene.init_action;
        let wrong = |field: &str, value: f64| format!("scene.init_action.{field}: {value} is out of range");
        let cell = cell_at(init.x, init.z).ok_or_else(|| wrong("x, z", init.x))?;
        let heading = heading_at(init.rotation).ok_or_else(|| wrong("rotation", init.rotation))?;
        let horizon = horizon(init.horizon).ok_or_else(|| wrong("horizon", init.horizon))?;
        let agent_y = millimetres(init.y).filter(|y| y.abs() < 5000).ok_or_else(|| wrong("y", init.y))?;
        let mut objects = Vec::with_capacity(scene.object_poses.len());
        for (index, pose) in scene.object_poses.iter().enumerate() {
            let kind = pose.object_name.split('_').next().unwrap_or_default();
            // Things of a class that House does not know cannot be acted on; they are left out.
            let Some(class) = class_named(kind).filter(|class| class.info().pickupable) else { continue };
            let wrong = |field: &str| format!("scene.object_poses[{index}].{field}: out of range");
            let p = pose.position;
            let (Some(x), Some(y), Some(z)) = (millimetres(p.x), millimetres(p.y), millimetres(p.z)) else {
                return Err(wrong("position"));
            };
            let tenths =
                |degrees: f64| degrees.is_finite().then(|| (degrees.rem_euclid(360.0) * 10.0).round() as i16 % 3600);
            let r = pose.rotation;
            let (Some(rx), Some(ry), Some(rz)) = (tenths(r.x), tenths(r.y), tenths(r.z)) else {
                return Err(wrong("rotation"));
            };
            let at = Point::new(x, y, z);
            objects.push(Placed { class, mesh: pose.object_name.clone(), at, turn: [rx, ry, rz] });
        }
        if objects.len() > 10_000 {
            return Err(format!("scene.object_poses: {} objects are too many", objects.len()));
        }
        Ok(RecordedStart {
            floor_plan: scene.floor_plan.clone(),
            room,
            agent_y,
            agent: Pose { cell, heading, horizon },
            objects,
            lit: scene.object_toggles.iter().filter(|t| t.is_on).filter_map(|t| class_named(&t.object_type)).collect(),
        })
    }
}

fn millimetres(metres: f64) -> Option<i32> {
    (metres.abs() <= FARTHEST).then(|| (metres * 1000.0).round() as i32)
}

fn horizon(degrees: f64) -> Option<i16> {
    let looks = degrees / f64::from(Pose::LOOK);
    let range = f64::from(Pose::UP)..=f64::from(Pose::DOWN);
    ((looks - looks.round()).abs() < 0.02 && range.contains(&degrees.round()))
        .then(|| looks.round() as i16 * Pose::LOOK)
}

/// The planned skills in order, GotoLocation and NoOp apart.
fn skills(plan: &[HighAction], merge: &GotoMerge) -> Result<Vec<Planned>, String> {
    let mut skills = Vec::new();
    let mut walked_to = None;
    for (index, high) in plan.iter().enumerate() {
        let wrong = |what: &str| format!("plan.high_pddl[{index}].{what}");
        let kind = match high.discrete_action.action.as_str() {
            "GotoLocation" => {
                walked_to = high.planner_action.location.as_deref().and_then(location);
                continue;
            }
            "NoOp" => continue,
            "PickupObject" => SkillKind::Pickup,
            "PutObject" => SkillKind::Put,
            "SliceObject" => SkillKind::Slice,
            "ToggleObject" => SkillKind::Toggle,
            "CleanObject" => SkillKind::Clean,
            "HeatObject" => SkillKind::Heat,
            "CoolObject" => SkillKind::Cool,
            other => return Err(wrong(&format!("discrete_action.action: {other:?} is no skill of ALFRED"))),
        };
        if merge.skill(high.high_idx) != skills.len() {
            return Err(wrong(&format!("high_idx: {} is out of order", high.high_idx)));
        }
        let planner = &high.planner_action;
        let name = |field: &str, id: &Option<String>| -> Result<Option<Name>, String> {
            let read = id.as_deref().map(Name::parse).transpose();
            read.map_err(|error| wrong(&format!("planner_action.{field}: {error}")))
        };
        let object = name("objectId", &planner.object_id)?.ok_or_else(|| wrong("planner_action: missing objectId"))?;
        let receptacle = name("receptacleObjectId", &planner.receptacle_object_id)?;
        if kind == SkillKind::Put && receptacle.is_none() {
            return Err(wrong("planner_action: missing receptacleObjectId"));
        }
        skills.push(Planned {
            kind,
            object,
            receptacle,
            cleaned: name("cleanObjectId", &planner.clean_object_id)?,
            object_at: planner.coordinate_object_id.as_ref().and_then(coordinate),
            receptacle_at: planner.coordinate_receptacle_object_id.as_ref().and_then(coordinate),
            walked_to: walked_to.take(),
        });
    }
    if skills.is_empty() {
        return Err("plan.high_pddl: holds no skill".into());
    }
    Ok(skills)
}

/// `loc|x|z|rotation|horizon`, in cells, quarter turns and degrees.
fn location(text: &str) -> Option<Pose> {
    let numbers: Vec<i16> = text.strip_prefix("loc|")?.split('|').filter_map(|field| field.parse().ok()).collect();
    let [x, z, rotation, degrees] = numbers[..] else { return None };
    let heading = crate::domain::Heading::from_quarters(rotation.into());
    Some(Pose { cell: crate::domain::Cell::new(x, z), heading, horizon: horizon(degrees.into())? })
}

/// A type and a point: `[x, x, z, z, y, y]` in quarter metres.
fn coordinate((kind, [x, _, z, _, y, _]): &Coordinate) -> Option<(Class, Point)> {
    let mm = |quarters: f64| millimetres(quarters / 4.0);
    Some((class_named(kind)?, Point::new(mm(*x)?, mm(*y)?, mm(*z)?)))
}

fn step(low: &LowAction, merge: &GotoMerge) -> Result<RecordedStep, String> {
    let kind = match low.api_action.action.as_str() {
        "MoveAhead" => ActionType::MoveAhead,
        "RotateLeft" => ActionType::RotateLeft,
        "RotateRight" => ActionType::RotateRight,
        "LookUp" => ActionType::LookUp,
        "LookDown" => ActionType::LookDown,
        "PickupObject" => ActionType::Pickup,
        "PutObject" => ActionType::Put,
        "OpenObject" => ActionType::Open,
        "CloseObject" => ActionType::Close,
        "ToggleObjectOn" => ActionType::ToggleOn,
        "ToggleObjectOff" => ActionType::ToggleOff,
        "SliceObject" => ActionType::Slice,
        other => return Err(format!("api_action.action: {other:?} is no action of ALFRED")),
    };
    let (field, id) = match kind {
        ActionType::Put => ("receptacleObjectId", &low.api_action.receptacle_object_id),
        _ => ("objectId", &low.api_action.object_id),
    };
    let target = match id {
        _ if !kind.is_interaction() => None,
        Some(id) => Some(Name::parse(id).map_err(|error| format!("api_action.{field}: {error}"))?),
        None => return Err(format!("api_action: missing {field}")),
    };
    let bounds = low.discrete_action.args.bbox.filter(|_| kind.is_interaction()).and_then(edges);
    Ok(RecordedStep { kind, target, skill: merge.skill(low.high_idx), bounds })
}

/// Pixel edges of a recorded box: its x are inclusive, its y are one too large.
fn edges([left, top, right, bottom]: [f64; 4]) -> Option<[u16; 4]> {
    let edge = |value: f64| (0.0..=300.0).contains(&value).then_some(value as u16);
    let edges = [edge(left)?, edge(top - 1.0)?, edge(right + 1.0)?, edge(bottom)?];
    (edges[0] < edges[2] && edges[1] < edges[3]).then_some(edges)
}

fn goal(data: &TrajData) -> Result<Goal, String> {
    let kind = match data.task_type.as_str() {
        "look_at_obj_in_light" => GoalKind::LookAtObjInLight,
        "pick_and_place_simple" => GoalKind::PickAndPlaceSimple,
        "pick_and_place_with_movable_recep" => GoalKind::PickAndPlaceWithMovableRecep,
        "pick_clean_then_place_in_recep" => GoalKind::PickCleanThenPlaceInRecep,
        "pick_cool_then_place_in_recep" => GoalKind::PickCoolThenPlaceInRecep,
        "pick_heat_then_place_in_recep" => GoalKind::PickHeatThenPlaceInRecep,
        "pick_two_obj_and_place" => GoalKind::PickTwoObjAndPlace,
        other => return Err(format!("task_type: {other:?} is no task type of ALFRED")),
    };
    let class = |field: &str, name: &str| -> Result<Option<Class>, String> {
        let class = (!name.is_empty()).then(|| class_named(name));
        let unknown = || format!("pddl_params.{field}: {name:?} is of no known object class");
        class.map(|class| class.ok_or_else(unknown)).transpose()
    };
    let params = &data.pddl_params;
    let object = class("object_target", &params.object_target)?;
    Ok(Goal {
        kind,
        object: object.ok_or_else(|| "pddl_params.object_target: is empty".to_owned())?,
        sliced: params.object_sliced,
        receptacle: class("parent_target", &params.parent_target)?,
        movable: class("mrecep_target", &params.mrecep_target)?,
        lamp: class("toggle_target", &params.toggle_target)?,
    })
}
