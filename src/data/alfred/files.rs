//! ALFRED's `traj_data.json` as published: the fields that are read. All others (masks, images, votes) are passed over.

use serde::{Deserialize, Deserializer};

/// A recorded trajectory.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct TrajData {
    /// `pick_and_place_simple`, ...
    pub(crate) task_type: String,
    /// What the task is about.
    pub(crate) pddl_params: PddlParams,
    /// Where and how it starts.
    pub(crate) scene: SceneData,
    /// What the expert did.
    pub(crate) plan: PlanData,
    /// What people wrote.
    pub(crate) turk_annotations: TurkAnnotations,
}

/// A test split's file: only the scene is read of it.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct SceneOnly {
    /// Where and how it starts.
    pub(crate) scene: SceneData,
}

/// The task's parameters; empty texts where one does not apply.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct PddlParams {
    /// Class of the object.
    pub(crate) object_target: String,
    /// Class of the receptacle where it ends up.
    pub(crate) parent_target: String,
    /// Class of the movable receptacle.
    pub(crate) mrecep_target: String,
    /// Class of the lamp.
    pub(crate) toggle_target: String,
    /// Slices of the object are meant.
    pub(crate) object_sliced: bool,
}

/// Where and how a trajectory starts.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct SceneData {
    /// `FloorPlan7`.
    pub(crate) floor_plan: String,
    /// Its number.
    pub(crate) scene_num: u32,
    /// The agent's first pose.
    pub(crate) init_action: InitAction,
    /// Every movable object.
    pub(crate) object_poses: Vec<ObjectPose>,
    /// Which switches are on.
    #[serde(default)]
    pub(crate) object_toggles: Vec<ObjectToggle>,
}

/// Whether things of a type are switched on at first.
#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
#[allow(missing_docs)]
pub(crate) struct ObjectToggle {
    pub(crate) object_type: String,
    pub(crate) is_on: bool,
}

/// The agent's first pose: metres and degrees.
#[derive(Clone, Debug, Deserialize)]
#[allow(missing_docs)]
pub(crate) struct InitAction {
    pub(crate) x: f64,
    pub(crate) y: f64,
    pub(crate) z: f64,
    pub(crate) rotation: f64,
    pub(crate) horizon: f64,
}

/// A movable object's first pose.
#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct ObjectPose {
    /// `Class_mesh`.
    pub(crate) object_name: String,
    /// The pivot in metres.
    pub(crate) position: Triple,
    /// Euler angles in degrees.
    pub(crate) rotation: Triple,
}

/// Three numbers by the names of the axes.
#[derive(Clone, Copy, Debug, Deserialize)]
#[allow(missing_docs)]
pub(crate) struct Triple {
    pub(crate) x: f64,
    pub(crate) y: f64,
    pub(crate) z: f64,
}

/// What the expert planned and did.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct PlanData {
    /// The skills, GotoLocation apart.
    pub(crate) high_pddl: Vec<HighAction>,
    /// The actions.
    pub(crate) low_actions: Vec<LowAction>,
}

/// One step of the plan.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct HighAction {
    /// Its number.
    #[serde(deserialize_with = "number_or_text")]
    pub(crate) high_idx: usize,
    /// Its kind.
    pub(crate) discrete_action: DiscreteAction,
    /// What it is about.
    pub(crate) planner_action: PlannerAction,
}

/// The kind of a plan's step.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct DiscreteAction {
    /// `GotoLocation`, `PickupObject`, ...
    pub(crate) action: String,
}

/// A type name and a point: `[x, x, z, z, y, y]` in quarter metres.
pub(crate) type Coordinate = (String, [f64; 6]);

/// What a plan's step is about.
#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct PlannerAction {
    /// The target; for Clean, Heat and Cool the fixture.
    pub(crate) object_id: Option<String>,
    /// For Put, the receptacle.
    pub(crate) receptacle_object_id: Option<String>,
    /// For Clean, what is cleaned.
    pub(crate) clean_object_id: Option<String>,
    /// Where the object stood at first.
    pub(crate) coordinate_object_id: Option<Coordinate>,
    /// Where the receptacle stands.
    pub(crate) coordinate_receptacle_object_id: Option<Coordinate>,
    /// For GotoLocation, `loc|x|z|rotation|horizon`.
    pub(crate) location: Option<String>,
}

/// One action of the expert.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct LowAction {
    /// Which step of the plan it belongs to.
    #[serde(deserialize_with = "number_or_text")]
    pub(crate) high_idx: usize,
    /// What was sent to the simulator.
    pub(crate) api_action: ApiAction,
    /// What was recorded with it.
    pub(crate) discrete_action: RecordedAction,
}

/// What was sent to the simulator.
#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct ApiAction {
    /// `MoveAhead`, `PickupObject`, ...
    pub(crate) action: String,
    /// The target; for Put, the held object.
    pub(crate) object_id: Option<String>,
    /// For Put, the target.
    pub(crate) receptacle_object_id: Option<String>,
}

/// What was recorded with an action.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct RecordedAction {
    /// Its arguments; absent in some files.
    #[serde(default)]
    pub(crate) args: RecordedArgs,
}

/// What was recorded with an interaction.
#[derive(Clone, Debug, Default, Deserialize)]
pub(crate) struct RecordedArgs {
    /// The target's bounds in the frame before it: smallest x, smallest y + 1, largest x, largest y + 1 of its pixels.
    pub(crate) bbox: Option<[f64; 4]>,
}

/// What people wrote.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct TurkAnnotations {
    /// One a person.
    pub(crate) anns: Vec<TurkAnnotation>,
}

/// What one person wrote.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct TurkAnnotation {
    /// The whole task.
    pub(crate) task_desc: String,
    /// One sentence for each step of the plan, NoOp apart.
    pub(crate) high_descs: Vec<String>,
}

/// Some tools write these numbers as texts.
fn number_or_text<'de, D: Deserializer<'de>>(deserializer: D) -> Result<usize, D::Error> {
    #[derive(Deserialize)]
    #[serde(untagged)]
    enum Either {
        Number(usize),
        Text(String),
    }
    match Either::deserialize(deserializer)? {
        Either::Number(number) => Ok(number),
        Either::Text(text) => text.parse().map_err(|_| serde::de::Error::custom(format!("high_idx: {text:?}"))),
    }
}
