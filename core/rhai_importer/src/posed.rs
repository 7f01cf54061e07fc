//! `pose(seconds)` of exporter scripts: the actors of a scene at one time, with the transforms of their joints in world space.

use crate::budget::{NativeError, native_error};
use choreo_plugin::ExportedScene;
use choreo_plugin::asset::Projection;
use choreo_plugin::motion::Time;
use choreo_plugin::stage::{Snapshot, Stage};
use glam::{DAffine3, DMat4};
use rhai::{Array, Dynamic, Engine, Map};
use std::sync::{Arc, Mutex, PoisonError};

/// The evaluated stage at one time.
#[derive(Clone)]
struct Pose {
    stage: Arc<Stage>,
    snapshot: Arc<Snapshot>,
}

/// One actor of a pose.
#[derive(Clone)]
struct PosedActor {
    pose: Pose,
    actor: usize,
}

/// One joint of a posed actor, with its transform in world space.
#[derive(Clone)]
struct PosedJoint {
    owner: PosedActor,
    joint: usize,
    world_from_joint: DAffine3,
}

/// Makes an object map from fields.
pub(crate) fn object_map<const N: usize>(fields: [(&str, Dynamic); N]) -> Map {
    fields.into_iter().map(|(name, value)| (name.into(), value)).collect()
}

fn number_array(values: impl IntoIterator<Item = f64>) -> Dynamic {
    values.into_iter().map(Dynamic::from_float).collect::<Array>().into()
}

/// The property `position`, `rotation` or `matrix` of an object with a transform in world space.
fn transform_property(name: &str, world_from_it: DAffine3) -> Dynamic {
    match name {
        "position" => number_array(world_from_it.translation.to_array()),
        "rotation" => number_array(world_from_it.to_scale_rotation_translation().1.to_array()),
        _ => number_array(DMat4::from(world_from_it).to_cols_array()),
    }
}

const TRANSFORM_PROPERTIES: [&str; 3] = ["position", "rotation", "matrix"];

pub(crate) fn register_pose(engine: &mut Engine, scene: &ExportedScene) {
    let evaluator = Mutex::new(scene.evaluator());
    let stage = scene.stage.clone();
    let pose = move |seconds: f64| -> Result<Pose, NativeError> {
        if !seconds.is_finite() {
            return Err(native_error(format!("pose: a time in seconds must be finite, got {seconds}")));
        }
        let mut evaluator = evaluator.lock().unwrap_or_else(PoisonError::into_inner);
        let snapshot =
            evaluator.at(Time::from_secs(seconds)).map_err(|e| native_error(format!("pose: {e}")))?;
        Ok(Pose { stage: stage.clone(), snapshot: Arc::new(snapshot) })
    };
    let pose = Arc::new(pose);
    let of_int = pose.clone();
    engine.register_fn("pose", move |seconds: f64| pose(seconds));
    engine.register_fn("pose", move |seconds: i64| of_int(seconds as f64));
    engine.register_type_with_name::<Pose>("Pose");
    engine.register_get("actors", |pose: &mut Pose| -> Array {
        let actor = |actor| Dynamic::from(PosedActor { pose: pose.clone(), actor });
        (0..pose.snapshot.actors.len()).map(actor).collect()
    });
    engine.register_get("camera", |pose: &mut Pose| camera_map(pose));
    register_actor_properties(engine);
    register_joint_properties(engine);
}

fn camera_map(pose: &Pose) -> Map {
    let camera = &pose.snapshot.camera;
    let name = camera.camera.and_then(|c| pose.stage.cameras.get(c)).map_or("", |c| c.name.as_str());
    let (fov, height) = match camera.projection {
        Projection::Perspective { yfov, .. } => {
            (Dynamic::from_float(f64::from(yfov).to_degrees()), Dynamic::UNIT)
        }
        Projection::Orthographic { height, .. } => (Dynamic::UNIT, Dynamic::from_float(f64::from(height))),
    };
    let [position, rotation, matrix] =
        TRANSFORM_PROPERTIES.map(|name| transform_property(name, camera.world_from_view));
    object_map([
        ("name", name.into()),
        ("fov", fov),
        ("height", height),
        ("position", position),
        ("rotation", rotation),
        ("matrix", matrix),
    ])
}

fn register_actor_properties(engine: &mut Engine) {
    engine.register_type_with_name::<PosedActor>("PosedActor");
    engine.register_get("name", |a: &mut PosedActor| a.pose.stage.actors[a.actor].name.clone());
    engine.register_get("asset", |a: &mut PosedActor| a.pose.stage.actors[a.actor].asset.name.clone());
    engine.register_get("visible", |a: &mut PosedActor| a.pose.snapshot.actors[a.actor].visible);
    for name in TRANSFORM_PROPERTIES {
        engine.register_get(name, move |a: &mut PosedActor| {
            transform_property(name, a.pose.snapshot.actors[a.actor].world_from_model)
        });
    }
    engine.register_get("joints", |a: &mut PosedActor| -> Array {
        let state = &a.pose.snapshot.actors[a.actor];
        let joint = |joint| {
            let world_from_joint = state.world_from_joint(joint)?;
            Some(Dynamic::from(PosedJoint { owner: a.clone(), joint, world_from_joint }))
        };
        (0..state.model_from_joint.len()).filter_map(joint).collect()
    });
    // One array for each mesh instance of the asset.
    engine.register_get("morphs", |a: &mut PosedActor| -> Array {
        let weights = &a.pose.snapshot.actors[a.actor].morph_weights;
        weights.iter().map(|of| number_array(of.iter().map(|w| f64::from(*w)))).collect()
    });
}

fn register_joint_properties(engine: &mut Engine) {
    engine.register_type_with_name::<PosedJoint>("PosedJoint");
    engine.register_get("name", |j: &mut PosedJoint| {
        j.owner.pose.stage.actors[j.owner.actor].asset.skeleton.names()[j.joint].clone()
    });
    engine.register_get("parent", |j: &mut PosedJoint| {
        let parent = j.owner.pose.stage.actors[j.owner.actor].asset.skeleton.parents()[j.joint];
        parent.map_or(-1, i64::from)
    });
    engine.register_get("x", |j: &mut PosedJoint| j.world_from_joint.translation.x);
    engine.register_get("y", |j: &mut PosedJoint| j.world_from_joint.translation.y);
    engine.register_get("z", |j: &mut PosedJoint| j.world_from_joint.translation.z);
    for name in TRANSFORM_PROPERTIES {
        engine.register_get(name, move |j: &mut PosedJoint| transform_property(name, j.world_from_joint));
    }
}
