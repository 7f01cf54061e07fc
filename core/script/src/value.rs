//! The values of a script's variables: handles onto the stage being built.
//!
//! A handle made by a call that failed is dead: whatever is done with it is skipped without a word, so that one
//! wrong name is one message and the script goes on to its next mistake.

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

#[derive(Clone, Debug)]
pub(crate) struct AssetRef {
    pub from: Arc<Load>,
    pub dead: bool,
}

#[derive(Clone, Debug)]
pub(crate) struct ClipRef {
    pub clip: Arc<Clip>,
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

/// A reach, an aim or planted feet.
#[derive(Clone, Copy, Debug)]
pub(crate) struct GoalRef {
    pub actor: usize,
    pub index: usize,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct CameraRef(pub usize);

#[derive(Clone, Copy, Debug)]
pub(crate) struct LightRef(pub usize);

/// A text, image, panel or letterbox.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FlatRef(pub usize);

/// Handle of the one sky of a stage.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SkyRef(pub usize);

#[derive(Clone, Debug)]
pub(crate) struct EffectRef {
    pub id: usize,
    /// Callbacks run when the list of effects has left the script.
    pub plugin: Arc<str>,
}

/// A stage in a test: the section's own or one of `stage_of`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StageRef(pub usize);

/// The plan of a frame, in a test.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PlanRef {
    pub options: PlanOptions,
    pub dead: bool,
}

/// Everything that another script has put on the stage of a test.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SceneRef(pub usize);

/// Images of one size that follow each other.
#[derive(Clone, Debug)]
pub struct Following {
    pub pictures: Arc<dyn ImageSource>,
    pub hashes: Vec<ContentHash>,
    /// The alpha mode that covers all of them.
    pub alpha: AlphaMode,
}

/// An image and how it is looked up.
#[derive(Clone, Debug)]
pub(crate) struct ImageRef {
    /// Opaque and without pixels where [`ImageRef::file`] holds them.
    pub image: Arc<Image>,
    /// The file, where its pixels are decoded only for who calls [`ImageRef::decoded`].
    pub file: Option<Arc<Encoded<Vec<u8>>>>,
    pub sampler: Sampler,
    pub dead: bool,
    /// All of them, where several follow each other; `image` is the first.
    pub files: Option<Following>,
}

impl ImageRef {
    pub fn dead() -> ImageRef {
        ImageRef {
            image: Arc::new(Image::default()),
            file: None,
            sampler: Sampler::default(),
            dead: true,
            files: None,
        }
    }

    /// The image with its pixels.
    pub fn decoded(&self) -> Result<Arc<Image>, ApiError> {
        let Some(file) = &self.file else { return Ok(self.image.clone()) };
        file.decode().map_err(|problem| undecodable("image", &file.name, problem))
    }
}

/// `what`: the word before the error.
pub(crate) fn undecodable(what: &str, name: &str, p: Problem) -> ApiError {
    let error = ApiError::new(format!("{what}: \"{name}\": {}", p.what)).focus(name);
    match p.hint {
        Some(hint) => error.hint(hint),
        None => error,
    }
}

/// Stands for a value that a statement failed to make; see [`recover`](crate::recover).
#[derive(Clone, Debug)]
pub(crate) struct Poison;

/// Name of [`Poison`] as a type, by which errors that it causes are known.
pub(crate) const POISON: &str = "value of a failed statement";

/// An `expect(…)` on its way to a comparison.
#[derive(Clone, Debug)]
pub(crate) struct ExpectRef {
    /// Index into `TestState::asked`.
    pub id: usize,
    pub stage: usize,
    pub measure: Measure,
    pub when: When,
    pub step: Option<Time>,
    pub negated: bool,
    pub sometime: bool,
}

impl ExpectRef {
    pub fn dead() -> ExpectRef {
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

    /// The expectation as recorded; `source` is the line of the script.
    pub fn expectation(&self, claim: Claim, place: Place, source: String) -> Expectation {
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

/// Declares the types of handles: the name that scripts and messages use, the type, when one is dead, and a dead one.
macro_rules! handles {
    ($($name:ident: $handle:ty, $is_dead:expr, $dead:expr;)*) => {
        /// The types of handles, by the names that scripts and messages use.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum HandleKind {
            /// No receiver: a function.
            None,
            $($name),*
        }

        impl HandleKind {
            const HANDLES: &[HandleKind] = &[$(HandleKind::$name),*];

            pub fn name(self) -> &'static str {
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

        /// A value that stands for the result of a call that failed.
        pub fn dead(kind: HandleKind) -> Dynamic {
            match kind {
                HandleKind::None => Dynamic::UNIT,
                $(HandleKind::$name => Dynamic::from($dead)),*
            }
        }
    };
}

handles! {
    Asset: AssetRef, |h| h.dead, AssetRef { from: Arc::new(Load::dead()), dead: true };
    Image: ImageRef, |h| h.dead, ImageRef::dead();
    Clip: ClipRef, |h| h.dead, ClipRef { clip: Arc::default(), asset: Arc::default(), dead: true };
    Actor: ActorRef, |h| h.id == DEAD, ActorRef { id: DEAD, asset: Arc::default() };
    Joint: JointRef, |h| h.actor == DEAD, JointRef { actor: DEAD, joint: 0, asset: Arc::default() };
    Cue: CueRef, |h| h.0 == DEAD, CueRef(DEAD);
    Look: LookRef, |h| h.actor == DEAD, LookRef { actor: DEAD, index: 0 };
    Goal: GoalRef, |h| h.actor == DEAD, GoalRef { actor: DEAD, index: 0 };
    Camera: CameraRef, |h| h.0 == DEAD, CameraRef(DEAD);
    Light: LightRef, |h| h.0 == DEAD, LightRef(DEAD);
    Sky: SkyRef, |h| h.0 == DEAD, SkyRef(DEAD);
    Flat: FlatRef, |h| h.0 == DEAD, FlatRef(DEAD);
    Effect: EffectRef, |h| h.id == DEAD, EffectRef { id: DEAD, plugin: "".into() };
    Expect: ExpectRef, |h| h.id == DEAD, ExpectRef::dead();
    Stage: StageRef, |h| h.0 == DEAD, StageRef(DEAD);
    Plan: PlanRef, |h| h.dead, PlanRef { options: PlanOptions::default(), dead: true };
    Scene: SceneRef, |h| h.0 == DEAD, SceneRef(DEAD);
}

impl HandleKind {
    pub fn from_name(name: &str) -> Option<HandleKind> {
        HandleKind::HANDLES.iter().copied().find(|k| k.name() == name)
    }
}

/// The type of handle that a value is; [`HandleKind::None`] for any other value.
pub fn kind_of(v: &Dynamic) -> HandleKind {
    let id = v.type_id();
    HandleKind::HANDLES.iter().copied().find(|k| k.type_id() == id).unwrap_or(HandleKind::None)
}
