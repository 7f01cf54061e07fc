//! Handles: values of script variables that refer to objects of the stage being built.
//!
//! A handle returned by a failed call is dead: calls on it are skipped silently, so that one wrong name gives one message and the
//! script goes on to its next mistake.

use crate::api_error::{ApiError, Place};
use crate::load::Load;
use crate::test_data::{Claim, Expectation, Measure, PlanOptions, Value, When};
use choreo_asset::{AlphaMode, Asset, ContentHash, Image, ImageSource, Sampler};
use choreo_importer_kit::Problem;
use choreo_importer_kit::images::Encoded;
use choreo_motion::{Clip, Time};
use rhai::{Dynamic, Engine};
use std::any::TypeId;
use std::sync::Arc;

/// Index of a dead handle.
const DEAD: usize = usize::MAX;

/// Handle of an asset, which may still be imported.
#[derive(Clone, Debug)]
pub(crate) struct AssetRef {
    pub load: Arc<Load>,
    pub dead: bool,
}

#[derive(Clone, Debug)]
pub(crate) struct ClipRef {
    pub clip: Arc<Clip>,
    /// The asset for whose skeleton the clip is made.
    pub asset: Arc<Asset>,
    pub dead: bool,
}

#[derive(Clone, Debug)]
pub(crate) struct ActorRef {
    pub id: usize,
    pub asset: Arc<Asset>,
}

#[derive(Clone, Debug)]
pub(crate) struct JointRef {
    pub actor: usize,
    pub joint: u32,
    pub asset: Arc<Asset>,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct CueRef(pub usize);

#[derive(Clone, Copy, Debug)]
pub(crate) struct LookRef {
    pub actor: usize,
    pub index: usize,
}

/// Handle of a constraint: reach, aim, foot lock or mirroring.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ConstraintRef {
    pub actor: usize,
    pub index: usize,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct CameraRef(pub usize);

#[derive(Clone, Copy, Debug)]
pub(crate) struct LightRef(pub usize);

/// Handle of a 2D layer: text, image, panel or letterbox.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Layer2dRef(pub usize);

/// Handle of the sky, of which a stage has one.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SkyRef(pub usize);

#[derive(Clone, Debug)]
pub(crate) struct EffectRef {
    pub id: usize,
    /// Name of the plugin, because the list of effects has moved to the stage when callbacks run.
    pub plugin: Arc<str>,
}

/// Handle of a stage in a test: the section's own stage, or one that `stage_of` has made.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StageRef(pub usize);

/// Handle of the render plan of a frame, in a test.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PlanRef {
    pub options: PlanOptions,
    pub dead: bool,
}

/// Handle of the objects that another script, run by `scene`, has put on the stage of a test.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SceneRef(pub usize);

/// Image sequence. All images have the same size.
#[derive(Clone, Debug)]
pub(crate) struct ImageSequenceRef {
    pub images: Arc<dyn ImageSource>,
    pub hashes: Vec<ContentHash>,
    /// Alpha mode that is sufficient for all images.
    pub alpha: AlphaMode,
}

/// An image with its sampler.
#[derive(Clone, Debug)]
pub(crate) struct ImageRef {
    /// The image. If [`ImageRef::file`] contains its pixels, it is opaque and has no pixels itself.
    pub image: Arc<Image>,
    /// The encoded file, if the pixels are decoded on demand by [`ImageRef::decoded`].
    pub file: Option<Arc<Encoded<Vec<u8>>>>,
    pub sampler: Sampler,
    pub dead: bool,
    /// The image sequence, if there is one; `image` is its first image.
    pub sequence: Option<ImageSequenceRef>,
}

impl ImageRef {
    pub(crate) fn dead() -> ImageRef {
        ImageRef {
            image: Arc::new(Image::default()),
            file: None,
            sampler: Sampler::default(),
            dead: true,
            sequence: None,
        }
    }

    /// The image with its pixels, decoded if needed.
    pub(crate) fn decoded(&self) -> Result<Arc<Image>, ApiError> {
        let Some(file) = &self.file else { return Ok(self.image.clone()) };
        file.decode().map_err(|problem| decoding_error("image", &file.name, problem))
    }
}

/// The error that an image file cannot be decoded. `what`: the function or option for which it is decoded.
pub(crate) fn decoding_error(what: &str, name: &str, p: Problem) -> ApiError {
    let error = ApiError::new(format!("{what}: \"{name}\": {}", p.what)).focus(name);
    match p.hint {
        Some(hint) => error.hint(hint),
        None => error,
    }
}

/// Placeholder for a value that a failed statement would have made; see [`recover`](crate::recover).
#[derive(Clone, Debug)]
pub(crate) struct Poison;

/// Type name of [`Poison`], by which errors that it causes are recognized.
pub(crate) const POISON: &str = "value of a failed statement";

/// Handle of an `expect(…)` before its comparison.
#[derive(Clone, Debug)]
pub(crate) struct ExpectRef {
    /// Index into `TestState::pending_expects`.
    pub id: usize,
    pub stage: usize,
    pub measure: Measure,
    pub when: When,
    pub step: Option<Time>,
    pub negated: bool,
    pub sometime: bool,
}

impl ExpectRef {
    pub(crate) fn dead() -> ExpectRef {
        ExpectRef {
            id: DEAD,
            stage: 0,
            measure: Measure::Value(Value::Nothing),
            when: When::Always,
            step: None,
            negated: false,
            sometime: false,
        }
    }

    /// The expectation with its claim. `source`: the line of the script.
    pub(crate) fn expectation(&self, claim: Claim, place: Place, source: String) -> Expectation {
        Expectation {
            place,
            source,
            stage: self.stage,
            when: self.when,
            step: self.step,
            negated: self.negated,
            sometime: self.sometime,
            claim,
        }
    }
}

/// Declares the types of handles: name in scripts and messages, type, test for a dead handle, and a dead handle.
macro_rules! handles {
    ($($name:ident: $handle:ty, $is_dead:expr, $dead:expr;)*) => {
        /// The types of handles, by the names that scripts and messages use.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub(crate) enum HandleKind {
            /// No receiver: a function.
            None,
            $($name),*
        }

        impl HandleKind {
            const HANDLES: &[HandleKind] = &[$(HandleKind::$name),*];

            pub(crate) fn name(self) -> &'static str {
                match self {
                    HandleKind::None => "",
                    $(HandleKind::$name => stringify!($name)),*
                }
            }

            pub(crate) fn type_id(self) -> TypeId {
                match self {
                    HandleKind::None => TypeId::of::<Dynamic>(),
                    $(HandleKind::$name => TypeId::of::<$handle>()),*
                }
            }
        }

        pub(crate) fn register_types(engine: &mut Engine) {
            $(engine.register_type_with_name::<$handle>(stringify!($name));)*
            engine.register_type_with_name::<Poison>(POISON);
        }

        /// Whether a value is a handle made by a call that failed.
        pub(crate) fn is_dead(v: &Dynamic) -> bool {
            match kind_of(v) {
                HandleKind::None => v.is::<Poison>(),
                $(HandleKind::$name => v.read_lock::<$handle>().is_some_and(|h| {
                    let is_dead: fn(&$handle) -> bool = $is_dead;
                    is_dead(&h)
                })),*
            }
        }

        /// The result of a failed call: a dead handle of a kind.
        pub(crate) fn dead(kind: HandleKind) -> Dynamic {
            match kind {
                HandleKind::None => Dynamic::UNIT,
                $(HandleKind::$name => Dynamic::from($dead)),*
            }
        }
    };
}

handles! {
    Asset: AssetRef, |h| h.dead, AssetRef { load: Arc::new(Load::failed()), dead: true };
    Image: ImageRef, |h| h.dead, ImageRef::dead();
    Clip: ClipRef, |h| h.dead, ClipRef { clip: Arc::default(), asset: Arc::default(), dead: true };
    Actor: ActorRef, |h| h.id == DEAD, ActorRef { id: DEAD, asset: Arc::default() };
    Joint: JointRef, |h| h.actor == DEAD, JointRef { actor: DEAD, joint: 0, asset: Arc::default() };
    Cue: CueRef, |h| h.0 == DEAD, CueRef(DEAD);
    Look: LookRef, |h| h.actor == DEAD, LookRef { actor: DEAD, index: 0 };
    Constraint: ConstraintRef, |h| h.actor == DEAD, ConstraintRef { actor: DEAD, index: 0 };
    Camera: CameraRef, |h| h.0 == DEAD, CameraRef(DEAD);
    Light: LightRef, |h| h.0 == DEAD, LightRef(DEAD);
    Sky: SkyRef, |h| h.0 == DEAD, SkyRef(DEAD);
    Layer2d: Layer2dRef, |h| h.0 == DEAD, Layer2dRef(DEAD);
    Effect: EffectRef, |h| h.id == DEAD, EffectRef { id: DEAD, plugin: "".into() };
    Expect: ExpectRef, |h| h.id == DEAD, ExpectRef::dead();
    Stage: StageRef, |h| h.0 == DEAD, StageRef(DEAD);
    Plan: PlanRef, |h| h.dead, PlanRef { options: PlanOptions::default(), dead: true };
    Scene: SceneRef, |h| h.0 == DEAD, SceneRef(DEAD);
}

impl HandleKind {
    /// The handle type of a name, such as "Actor".
    pub(crate) fn from_name(name: &str) -> Option<HandleKind> {
        HandleKind::HANDLES.iter().copied().find(|k| k.name() == name)
    }
}

/// The handle type of a value; [`HandleKind::None`] for other values.
pub(crate) fn kind_of(v: &Dynamic) -> HandleKind {
    let id = v.type_id();
    HandleKind::HANDLES.iter().copied().find(|k| k.type_id() == id).unwrap_or(HandleKind::None)
}
