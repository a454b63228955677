//! ALFRED's `traj_data.json` as published: the fields that are read. All others (masks, images, votes) are passed over.

use serde::{Deserialize, Deserializer};

/// A recorded trajectory.
#[derive(Clone, Debug, Deserialize)]
pub struct TrajData {
    /// `pick_and_place_simple`, ...
    pub task_type: String,
    /// What the task is about.
    pub pddl_params: PddlParams,
    /// Where and how it starts.
    pub scene: SceneData,
    /// What the expert did.
    pub plan: PlanData,
    /// What people wrote.
    pub turk_annotations: TurkAnnotations,
}

/// A test split's file: only the scene is read of it.
#[derive(Clone, Debug, Deserialize)]
pub struct SceneOnly {
    /// Where and how it starts.
    pub scene: SceneData,
}

/// The task's parameters; empty texts where one does not apply.
#[derive(Clone, Debug, Deserialize)]
pub struct PddlParams {
    /// Class of the object.
    pub object_target: String,
    /// Class of the receptacle where it ends up.
    pub parent_target: String,
    /// Class of the movable receptacle.
    pub mrecep_target: String,
    /// Class of the lamp.
    pub toggle_target: String,
    /// Slices of the object are meant.
    pub object_sliced: bool,
}

/// Where and how a trajectory starts.
#[derive(Clone, Debug, Deserialize)]
pub struct SceneData {
    /// `FloorPlan7`.
    pub floor_plan: String,
    /// Its number.
    pub scene_num: u32,
    /// The agent's first pose.
    pub init_action: InitAction,
    /// Every movable object.
    pub object_poses: Vec<ObjectPose>,
    /// Which switches are on.
    #[serde(default)]
    pub object_toggles: Vec<ObjectToggle>,
}

/// Whether things of a type are switched on at first.
#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
#[allow(missing_docs)]
pub struct ObjectToggle {
    pub object_type: String,
    pub is_on: bool,
}

/// The agent's first pose: metres and degrees.
#[derive(Clone, Debug, Deserialize)]
#[allow(missing_docs)]
pub struct InitAction {
    pub x: f64,
    pub y: f64,
    pub z: f64,
    pub rotation: f64,
    pub horizon: f64,
}

/// A movable object's first pose.
#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct ObjectPose {
    /// `Class_mesh`.
    pub object_name: String,
    /// The pivot in metres.
    pub position: Triple,
    /// Euler angles in degrees.
    pub rotation: Triple,
}

/// Three numbers by the names of the axes.
#[derive(Clone, Copy, Debug, Deserialize)]
#[allow(missing_docs)]
pub struct Triple {
    pub x: f64,
    pub y: f64,
    pub z: f64,
}

/// What the expert planned and did.
#[derive(Clone, Debug, Deserialize)]
pub struct PlanData {
    /// The skills, GotoLocation apart.
    pub high_pddl: Vec<HighAction>,
    /// The actions.
    pub low_actions: Vec<LowAction>,
}

/// One step of the plan.
#[derive(Clone, Debug, Deserialize)]
pub struct HighAction {
    /// Its number.
    #[serde(deserialize_with = "number_or_text")]
    pub high_idx: usize,
    /// Its kind.
    pub discrete_action: DiscreteAction,
    /// What it is about.
    pub planner_action: PlannerAction,
}

/// The kind of a plan's step.
#[derive(Clone, Debug, Deserialize)]
pub struct DiscreteAction {
    /// `GotoLocation`, `PickupObject`, ...
    pub action: String,
}

/// A type name and a point: `[x, x, z, z, y, y]` in quarter metres.
pub type Coordinate = (String, [f64; 6]);

/// What a plan's step is about.
#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct PlannerAction {
    /// The target; for Clean, Heat and Cool the fixture.
    pub object_id: Option<String>,
    /// For Put, the receptacle.
    pub receptacle_object_id: Option<String>,
    /// For Clean, what is cleaned.
    pub clean_object_id: Option<String>,
    /// Where the object stood at first.
    pub coordinate_object_id: Option<Coordinate>,
    /// Where the receptacle stands.
    pub coordinate_receptacle_object_id: Option<Coordinate>,
    /// For GotoLocation, `loc|x|z|rotation|horizon`.
    pub location: Option<String>,
}

/// One action of the expert.
#[derive(Clone, Debug, Deserialize)]
pub struct LowAction {
    /// Which step of the plan it belongs to.
    #[serde(deserialize_with = "number_or_text")]
    pub high_idx: usize,
    /// What was sent to the simulator.
    pub api_action: ApiAction,
    /// What was recorded with it.
    pub discrete_action: RecordedAction,
}

/// What was sent to the simulator.
#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct ApiAction {
    /// `MoveAhead`, `PickupObject`, ...
    pub action: String,
    /// The target; for Put, the held object.
    pub object_id: Option<String>,
    /// For Put, the target.
    pub receptacle_object_id: Option<String>,
}

/// What was recorded with an action.
#[derive(Clone, Debug, Deserialize)]
pub struct RecordedAction {
    /// Its arguments; absent in some files.
    #[serde(default)]
    pub args: RecordedArgs,
}

/// What was recorded with an interaction.
#[derive(Clone, Debug, Default, Deserialize)]
pub struct RecordedArgs {
    /// The target's bounds in the frame before it: smallest x, smallest y + 1, largest x, largest y + 1 of its pixels.
    pub bbox: Option<[f64; 4]>,
}

/// What people wrote.
#[derive(Clone, Debug, Deserialize)]
pub struct TurkAnnotations {
    /// One a person.
    pub anns: Vec<TurkAnnotation>,
}

/// What one person wrote.
#[derive(Clone, Debug, Deserialize)]
pub struct TurkAnnotation {
    /// The whole task.
    pub task_desc: String,
    /// One sentence for each step of the plan, NoOp apart.
    pub high_descs: Vec<String>,
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
