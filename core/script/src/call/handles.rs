//! Handles among the values of a script: which kind one is, whether it is dead, and what stands in for a result.

use crate::load::Load;
use crate::testing::ExpectRef;
use crate::value::*;
use rhai::Dynamic;
use std::any::TypeId;
use std::sync::Arc;

pub fn kind_of(v: &Dynamic) -> Kind {
    let id = v.type_id();
    Kind::HANDLES.into_iter().find(|k| type_id(*k) == id).unwrap_or(Kind::None)
}

pub fn type_id(kind: Kind) -> TypeId {
    match kind {
        Kind::None => TypeId::of::<Dynamic>(),
        Kind::Asset => TypeId::of::<AssetRef>(),
        Kind::Image => TypeId::of::<ImageRef>(),
        Kind::Clip => TypeId::of::<ClipRef>(),
        Kind::Actor => TypeId::of::<ActorRef>(),
        Kind::Joint => TypeId::of::<JointRef>(),
        Kind::Cue => TypeId::of::<CueRef>(),
        Kind::Look => TypeId::of::<LookRef>(),
        Kind::Camera => TypeId::of::<CameraRef>(),
        Kind::Light => TypeId::of::<LightRef>(),
        Kind::Sky => TypeId::of::<SkyRef>(),
        Kind::Flat => TypeId::of::<FlatRef>(),
        Kind::Goal => TypeId::of::<GoalRef>(),
        Kind::Effect => TypeId::of::<EffectRef>(),
        Kind::Expect => TypeId::of::<ExpectRef>(),
        Kind::Stage => TypeId::of::<StageRef>(),
        Kind::Plan => TypeId::of::<PlanRef>(),
        Kind::Scene => TypeId::of::<SceneRef>(),
    }
}

/// A handle made by a call that failed.
pub fn is_dead(v: &Dynamic) -> bool {
    match kind_of(v) {
        Kind::None => false,
        Kind::Asset => v.read_lock::<AssetRef>().is_some_and(|h| h.dead),
        Kind::Image => v.read_lock::<ImageRef>().is_some_and(|h| h.dead),
        Kind::Clip => v.read_lock::<ClipRef>().is_some_and(|h| h.dead),
        Kind::Actor => v.read_lock::<ActorRef>().is_some_and(|h| h.id == DEAD),
        Kind::Joint => v.read_lock::<JointRef>().is_some_and(|h| h.actor == DEAD),
        Kind::Cue => v.read_lock::<CueRef>().is_some_and(|h| h.0 == DEAD),
        Kind::Look => v.read_lock::<LookRef>().is_some_and(|h| h.actor == DEAD),
        Kind::Camera => v.read_lock::<CameraRef>().is_some_and(|h| h.0 == DEAD),
        Kind::Light => v.read_lock::<LightRef>().is_some_and(|h| h.0 == DEAD),
        Kind::Sky => v.read_lock::<SkyRef>().is_some_and(|h| h.0 == DEAD),
        Kind::Flat => v.read_lock::<FlatRef>().is_some_and(|h| h.0 == DEAD),
        Kind::Goal => v.read_lock::<GoalRef>().is_some_and(|h| h.actor == DEAD),
        Kind::Effect => v.read_lock::<EffectRef>().is_some_and(|h| h.id == DEAD),
        Kind::Expect => v.read_lock::<ExpectRef>().is_some_and(|h| h.id == DEAD),
        Kind::Stage => v.read_lock::<StageRef>().is_some_and(|h| h.0 == DEAD),
        Kind::Plan => v.read_lock::<PlanRef>().is_some_and(|h| h.dead),
        Kind::Scene => v.read_lock::<SceneRef>().is_some_and(|h| h.0 == DEAD),
    }
}

/// Stands in for the result of a call that failed.
pub fn dead(kind: Kind) -> Dynamic {
    let asset = || Arc::new(choreo_asset::Asset::default());
    match kind {
        Kind::None => Dynamic::UNIT,
        Kind::Asset => Dynamic::from(AssetRef { from: Arc::new(Load::dead()), dead: true }),
        Kind::Image => Dynamic::from(ImageRef::dead()),
        Kind::Clip => match choreo_motion::Clip::new(String::new(), 0, Vec::new()) {
            Ok(clip) => Dynamic::from(ClipRef { clip: Arc::new(clip), asset: asset(), dead: true }),
            Err(_) => Dynamic::UNIT,
        },
        Kind::Actor => Dynamic::from(ActorRef { id: DEAD, asset: asset() }),
        Kind::Joint => Dynamic::from(JointRef { actor: DEAD, joint: 0, asset: asset() }),
        Kind::Cue => Dynamic::from(CueRef(DEAD)),
        Kind::Look => Dynamic::from(LookRef { actor: DEAD, index: 0 }),
        Kind::Camera => Dynamic::from(CameraRef(DEAD)),
        Kind::Light => Dynamic::from(LightRef(DEAD)),
        Kind::Sky => Dynamic::from(SkyRef(DEAD)),
        Kind::Flat => Dynamic::from(FlatRef(DEAD)),
        Kind::Goal => Dynamic::from(GoalRef { actor: DEAD, index: 0 }),
        Kind::Effect => Dynamic::from(EffectRef { id: DEAD, plugin: "".into() }),
        Kind::Expect => Dynamic::from(ExpectRef::dead()),
        Kind::Stage => Dynamic::from(StageRef(DEAD)),
        Kind::Plan => Dynamic::from(PlanRef { options: Default::default(), dead: true }),
        Kind::Scene => Dynamic::from(SceneRef(DEAD)),
    }
}
