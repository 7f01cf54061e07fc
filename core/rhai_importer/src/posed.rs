//! `pose(seconds)` of exporter scripts: the actors of a scene at one time, with the transforms of their joints in world space.

use crate::budget::{Refused, refuse};
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
    of: PosedActor,
    joint: usize,
    world_from_joint: DAffine3,
}

/// Makes an object map from fields.
pub fn map<const N: usize>(fields: [(&str, Dynamic); N]) -> Map {
    fields.into_iter().map(|(name, value)| (name.into(), value)).collect()
}

fn numbers(values: impl IntoIterator<Item = f64>) -> Dynamic {
    values.into_iter().map(Dynamic::from_float).collect::<Array>().into()
}

/// The property `position`, `rotation` or `matrix` of an object with a transform in world space.
fn place(name: &str, world_from_it: DAffine3) -> Dynamic {
    match name {
        "position" => numbers(world_from_it.translation.to_array()),
        "rotation" => numbers(world_from_it.to_scale_rotation_translation().1.to_array()),
        _ => numbers(DMat4::from(world_from_it).to_cols_array()),
    }
}

const PLACES: [&str; 3] = ["position", "rotation", "matrix"];

pub fn register(engine: &mut Engine, scene: &ExportedScene) {
    let evaluator = Mutex::new(scene.evaluator());
    let stage = scene.stage.clone();
    let pose = move |seconds: f64| -> Result<Pose, Refused> {
        if !seconds.is_finite() {
            return Err(refuse(format!("pose: a time in seconds must be finite, got {seconds}")));
        }
        let mut evaluator = evaluator.lock().unwrap_or_else(PoisonError::into_inner);
        let snapshot = evaluator.at(Time::from_secs(seconds)).map_err(|e| refuse(format!("pose: {e}")))?;
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
    engine.register_get("camera", |pose: &mut Pose| camera(pose));
    actors(engine);
    joints(engine);
}

fn camera(pose: &Pose) -> Map {
    let camera = &pose.snapshot.camera;
    let name = camera.camera.and_then(|c| pose.stage.cameras.get(c)).map_or("", |c| c.name.as_str());
    let (fov, height) = match camera.projection {
        Projection::Perspective { yfov, .. } => {
            (Dynamic::from_float(f64::from(yfov).to_degrees()), Dynamic::UNIT)
        }
        Projection::Orthographic { height, .. } => (Dynamic::UNIT, Dynamic::from_float(f64::from(height))),
    };
    let [position, rotation, matrix] = PLACES.map(|name| place(name, camera.world_from_view));
    map([
        ("name", name.into()),
        ("fov", fov),
        ("height", height),
        ("position", position),
        ("rotation", rotation),
        ("matrix", matrix),
    ])
}

fn actors(engine: &mut Engine) {
    engine.register_type_with_name::<PosedActor>("PosedActor");
    engine.register_get("name", |a: &mut PosedActor| a.pose.stage.actors[a.actor].name.clone());
    engine.register_get("asset", |a: &mut PosedActor| a.pose.stage.actors[a.actor].asset.name.clone());
    engine.register_get("visible", |a: &mut PosedActor| a.pose.snapshot.actors[a.actor].visible);
    for name in PLACES {
        engine.register_get(name, move |a: &mut PosedActor| {
            place(name, a.pose.snapshot.actors[a.actor].world_from_model)
        });
    }
    engine.register_get("joints", |a: &mut PosedActor| -> Array {
        let state = &a.pose.snapshot.actors[a.actor];
        let joint = |joint| {
            let world_from_joint = state.world_from_joint(joint)?;
            Some(Dynamic::from(PosedJoint { of: a.clone(), joint, world_from_joint }))
        };
        (0..state.model_from_joint.len()).filter_map(joint).collect()
    });
    // One array for each mesh instance of the asset.
    engine.register_get("morphs", |a: &mut PosedActor| -> Array {
        let weights = &a.pose.snapshot.actors[a.actor].morph_weights;
        weights.iter().map(|of| numbers(of.iter().map(|w| f64::from(*w)))).collect()
    });
}

fn joints(engine: &mut Engine) {
    engine.register_type_with_name::<PosedJoint>("PosedJoint");
    engine.register_get("name", |j: &mut PosedJoint| {
        j.of.pose.stage.actors[j.of.actor].asset.skeleton.names()[j.joint].clone()
    });
    engine.register_get("parent", |j: &mut PosedJoint| {
        let parent = j.of.pose.stage.actors[j.of.actor].asset.skeleton.parents()[j.joint];
        parent.map_or(-1, i64::from)
    });
    engine.register_get("x", |j: &mut PosedJoint| j.world_from_joint.translation.x);
    engine.register_get("y", |j: &mut PosedJoint| j.world_from_joint.translation.y);
    engine.register_get("z", |j: &mut PosedJoint| j.world_from_joint.translation.z);
    for name in PLACES {
        engine.register_get(name, move |j: &mut PosedJoint| place(name, j.world_from_joint));
    }
}
