//! The expectations of a section, as data: recorded by the script with their place, judged once the stage is finished.
//!
//! `expect(anna.joint("Head")).at(1.5).near([0.0, 1.6, 0.0], 0.01)` is an [`Expectation`] with the claim
//! `Vector { quantity: Position of the joint, test: Near a point }`.

use crate::api_error::Place;
use crate::diagnostic::Diagnostic;
use choreo_image_diff::METRICS;
use choreo_motion::Time;
use choreo_stage::{Attachment, Target};
use glam::{DQuat, DVec3};
use std::sync::Arc;

#[derive(Clone, Debug)]
pub struct Expectation {
    /// Place of the call that compares.
    pub place: Place,
    /// The text: the line of the script, without indentation.
    pub source: String,
    /// 0: the section's own stage; n: the n-th made with `stage_of`. Index into `SectionRun::stages`.
    pub stage: usize,
    pub when: When,
    /// Time between two looks in a span, and the step of differences for speeds; `None`: a frame of the stage.
    pub step: Option<Time>,
    /// The claim must fail: at every time looked at.
    pub negated: bool,
    /// One look at which it holds, or, negated, fails, is enough.
    pub sometime: bool,
    pub claim: Claim,
}

/// The times at which a claim must hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum When {
    /// Every frame of the stage.
    Always,
    At(Time),
    /// A span from one time to another, both included.
    During(Time, Time),
}

/// Something on the stage, by its index there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Subject {
    Actor(usize),
    Joint { actor: usize, joint: u32 },
    Camera(usize),
    Light(usize),
}

#[derive(Clone, Debug)]
pub enum Claim {
    /// A number that may change over time.
    Number { quantity: Quantity, test: NumberTest },
    /// A point or a color that may change over time.
    Vector { quantity: VectorQuantity, test: VectorTest },
    /// A rotation that may change over time; the same rotation may be written as q and as −q.
    Rotation { quantity: RotationQuantity, goal: RotationGoal, tolerance_deg: f64 },
    /// Something that is so or not.
    Flag(Flag),
    /// All of an actor is inside the image of the camera that is on (or the one given).
    InFrame(InFrame),
    /// The same bits.
    Same { what: SameWhat, other: SameOther },
    /// Cues, cuts, looks and effects, in order.
    Events { of: Option<Subject>, test: EventsTest },
    /// Lines of text: warnings, names.
    Texts { texts: TextsQuantity, test: TextsTest },
    /// A value that the script has worked out itself.
    Value { got: Value, test: ValueTest },
    /// Evaluating this stage at all its frames takes at most `factor` times as long as the other.
    Cost { other: usize, factor: f64 },
    /// The image at a time is like the stored one.
    Picture(ImageExpectation),
}

/// Numbers of a stage, each a function of the time. Lengths in metres, angles in degrees, times in seconds.
#[derive(Clone, Debug)]
pub enum Quantity {
    /// x, y or z of a vector: 0, 1, 2.
    Component(VectorQuantity, usize),
    Length(VectorQuantity),
    /// Distance to a point that may move.
    Distance(Subject, Target),
    /// Angle between the subject's direction (+z; for cameras and lights, where they point) and a point that may move.
    AngleTo(Subject, Target),
    /// How far the subject is turned against another rotation.
    Angle(RotationQuantity, RotationQuantity),
    /// Metres a second since the look before.
    Speed(VectorQuantity),
    /// Metres a second², from the looks before and after.
    Acceleration(VectorQuantity),
    /// Metres a second³, from four looks.
    Jerk(VectorQuantity),
    /// Degrees a second since the look before.
    TurnSpeed(RotationQuantity),
    /// Metres that a joint has gone along the floor since it touched down; 0 while it is up.
    Slide(Contact),
    /// Share of a clip in its own layer of an actor, or in the pose of one joint, all layers counted; 0..=1.
    ClipWeight {
        actor: usize,
        joint: Option<u32>,
        clip: String,
    },
    /// Seconds of the clip, of the cue with the largest share; NaN where it is not active.
    ClipTime {
        actor: usize,
        clip: String,
    },
    /// Morph target's weight, the largest over the actor's meshes.
    Morph {
        actor: usize,
        targets: Vec<(u32, u32)>,
    },
    /// Lowest and highest point of an actor as posed, metres.
    Lowest(usize),
    Highest(usize),
    /// Height of an actor's outline in the image, as a share of the image's.
    PictureHeight {
        actor: usize,
        camera: Option<usize>,
    },
    /// Share of an actor's vertices that are inside the image, 0..=1, whatever stands before them.
    PictureShare {
        actor: usize,
        camera: Option<usize>,
    },
    /// Angle in the image between up and the subject's own up, degrees, 0..=180.
    Tilt {
        subject: Subject,
        camera: Option<usize>,
    },
    /// Vertical angle of view, degrees.
    FieldOfView(usize),
    /// Intensity of a light.
    Intensity(usize),
    /// Counted in the stage, whatever the time.
    Count(Count),
    /// Counted in the plan of the frame.
    PlanCount(PlanOptions, PlanCount),
}

#[derive(Clone, Debug, PartialEq)]
pub enum VectorQuantity {
    /// Position in the world, or in the space of an actor or joint.
    Position(Subject, Option<Attachment>),
    Scale(Subject),
    /// Direction of the subject as a unit vector (the front of actors, +z of joints; where cameras and lights point).
    Direction(Subject),
    /// Red, green, blue, linear.
    Tint(usize),
    LightColor(usize),
    /// Extent of an actor as posed, along the world's axes.
    Size(usize),
    /// Position in the image: x from 0 (left) to 1 (right), y from 0 (top) to 1 (bottom), z in metres before the camera.
    InPicture(Subject, Option<usize>),
}

#[derive(Clone, Debug, PartialEq)]
pub enum RotationQuantity {
    /// Rotation in the world, or in the space of an actor or joint.
    Of(Subject, Option<Attachment>),
}

/// A joint on the floor: at most `height` above it, and rising or sinking at most at `speed`.
#[derive(Clone, Debug, PartialEq)]
pub struct Contact {
    pub actor: usize,
    pub joint: u32,
    /// Metres above `ground`.
    pub height: f64,
    /// Metres a second, up or down.
    pub speed: f64,
    /// Metres a second along the floor.
    pub swing: f64,
    /// y of the floor.
    pub ground: f64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Count {
    Actors,
    Cameras,
    Cuts,
    Lights,
    Effects,
    Layers,
    Cues,
    Callbacks,
    Assets,
    Joints,
    Triangles,
    Vertices,
    Frames,
}

/// Size and samples of a plan; `None`: those of the stage, and 4 samples if the stage has none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PlanOptions {
    pub size: Option<[u32; 2]>,
    pub samples: Option<u32>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlanCount {
    /// Render passes, full-screen ones included.
    Passes,
    PostPasses,
    Pipelines,
    Draws,
    Copies,
    Triangles,
    Lights,
    JointMatrices,
    Morphs,
    /// Depths seen from lights that cast shadows.
    ShadowMaps,
    /// Geometry that effects draw: two triangles a line or point.
    OverlayTriangles,
}

#[derive(Clone, Debug)]
pub enum NumberTest {
    /// Within the tolerance of a number or a function of the time.
    Near {
        goal: NumberGoal,
        tolerance: f64,
    },
    Below(f64),
    Above(f64),
    Between(f64, f64),
}

#[derive(Clone, Debug)]
pub enum NumberGoal {
    Number(f64),
    Formula(Formula),
}

#[derive(Clone, Debug)]
pub enum VectorTest {
    Near {
        goal: VectorGoal,
        tolerance: f64,
    },
    /// The point lies in a box.
    Within {
        min: DVec3,
        max: DVec3,
    },
}

#[derive(Clone, Debug)]
pub enum VectorGoal {
    Point(DVec3),
    /// The position of a target at the same time.
    Target(Target),
    /// The same property of another subject.
    Subject(Subject),
    Formula(Formula),
}

#[derive(Clone, Debug)]
pub enum RotationGoal {
    Rotation(DQuat),
    /// The rotation of another subject at the same time.
    Subject(Subject),
    /// Gives degrees about y, or [x, y, z] as for `.rotate`.
    Formula(Formula),
}

#[derive(Clone, Debug, PartialEq)]
pub enum Flag {
    Visible(usize),
    OnFloor(Contact),
    /// This camera is the one that is on.
    On(usize),
    /// The effect of this name is on.
    Effect(String),
}

#[derive(Clone, Debug, PartialEq)]
pub struct InFrame {
    pub actor: usize,
    /// `None`: the camera that is on.
    pub camera: Option<usize>,
    /// Share of the image's sides that must stay free, 0 up to 0.5.
    pub margin: f64,
    /// Height of the actor as a share of the image's.
    pub height: Option<(f64, f64)>,
    /// Most degrees between the actor's up and the image's.
    pub upright: Option<f64>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SameWhat {
    /// The whole stage; at a time: the whole snapshot.
    Stage,
    /// Its pose in the space of the actor, and its morph weights.
    Pose(usize),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SameOther {
    /// The same at another time.
    Time(Time),
    /// Index into `SectionRun::stages`.
    Stage(usize),
    Actor(usize),
}

/// An event that is expected: a text like `anna: Walk starts`, and when.
#[derive(Clone, Debug, PartialEq)]
pub struct EventPattern {
    /// `None`: at any time.
    pub at: Option<Time>,
    /// `*` stands for anything.
    pub text: String,
}

#[derive(Clone, Debug, PartialEq)]
pub enum EventsTest {
    /// These and no others, in this order.
    Exactly(Vec<EventPattern>, Time),
    /// These in this order, others between.
    InOrder(Vec<EventPattern>, Time),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TextsQuantity {
    /// Warnings about the script and the assets on stage.
    Warnings,
    Printed,
    /// A feature or object that the plan leaves out: `skinning: no mesh has a skin`.
    LeftOut(PlanOptions),
    /// Names of the effects that are on.
    Effects,
}

#[derive(Clone, Debug, PartialEq)]
pub enum TextsTest {
    Empty,
    /// Some line holds this text.
    Contains(String),
    /// Some line begins with this text, up to its colon.
    Names(String),
    Count(usize),
}

/// A value of the script.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    Nothing,
    Bool(bool),
    Int(i64),
    Number(f64),
    Text(String),
    List(Vec<Value>),
    /// Entries sorted by key.
    Map(Vec<(String, Value)>),
}

#[derive(Clone, Debug, PartialEq)]
pub enum ValueTest {
    Equals(Value),
    Near {
        goal: Value,
        tolerance: f64,
    },
    Below(f64),
    Above(f64),
    Between(f64, f64),
    /// A text or list that holds this.
    Contains(Value),
    /// `*` stands for anything, `?` for one character.
    Matches(String),
    Empty,
}

/// The image of the stage at a time, against a stored one.
#[derive(Clone, Debug, PartialEq)]
pub struct ImageExpectation {
    /// Unlike every other of its file; letters, digits, `_`, `-`.
    pub name: String,
    pub at: Time,
    /// Pixels; `None`: as the stage states.
    pub size: Option<[u32; 2]>,
    /// 1 or 4; `None`: as the stage states.
    pub samples: Option<u32>,
    /// "cpu" or "vulkan"; `None`: the CPU renderer, which is the same everywhere.
    pub device: Option<String>,
    /// Steps of 255 that a channel may be off without counting as different.
    pub tolerance: u8,
    /// Limits in the order of `choreo_image_diff::METRICS`.
    pub limits: [f64; METRICS.len()],
    /// May take more than 40 KiB.
    pub large: bool,
}

impl ImageExpectation {
    /// The image at time zero, with the limits that hold where a test states none.
    pub fn new(name: &str) -> ImageExpectation {
        ImageExpectation {
            name: name.to_string(),
            at: Time::ZERO,
            size: None,
            samples: None,
            device: None,
            tolerance: 4,
            limits: METRICS.map(|metric| metric.limit),
            large: false,
        }
    }
}

/// A function of the time in a script, `|t| …`, called when the expectation is judged.
#[derive(Clone)]
pub struct Formula(pub(crate) Arc<dyn Fn(Time) -> Result<Vec<f64>, Diagnostic> + Send + Sync>);

impl Formula {
    /// One number or three, at a time of the stage. The error has file and line.
    pub fn at(&self, time: Time) -> Result<Vec<f64>, Diagnostic> {
        (self.0)(time)
    }
}

impl std::fmt::Debug for Formula {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "|t| …")
    }
}

/// The measured property of an expectation.
#[derive(Clone, Debug)]
pub enum Measure {
    Number(Quantity),
    Vector(VectorQuantity),
    Rotation(RotationQuantity),
    Events(Option<Subject>),
    Texts(TextsQuantity),
    Value(Value),
    Whole(SameWhat),
    Plan(PlanOptions),
}

impl Measure {
    /// The word used in messages.
    pub fn word(&self) -> &'static str {
        match self {
            Measure::Number(_) => "a number",
            Measure::Vector(VectorQuantity::Tint(_) | VectorQuantity::LightColor(_)) => "a color",
            Measure::Vector(_) => "a point",
            Measure::Rotation(_) => "a rotation",
            Measure::Events(_) => "events",
            Measure::Texts(_) => "lines of text",
            Measure::Value(Value::Text(_)) => "a text",
            Measure::Value(Value::List(_)) => "an array",
            Measure::Value(Value::Bool(_)) => "true or false",
            Measure::Value(_) => "a value",
            Measure::Whole(SameWhat::Stage) => "a stage",
            Measure::Whole(SameWhat::Pose(_)) => "a pose",
            Measure::Plan(_) => "a plan",
        }
    }
}

impl Claim {
    /// Judged look by look.
    pub(crate) fn graded(&self) -> bool {
        matches!(
            self,
            Claim::Number { .. }
                | Claim::Vector { .. }
                | Claim::Rotation { .. }
                | Claim::Flag(_)
                | Claim::InFrame(_)
        )
    }

    /// Whether the time plays no part in it.
    pub fn timeless(&self) -> bool {
        match self {
            Claim::Events { .. } | Claim::Value { .. } | Claim::Cost { .. } | Claim::Picture(_) => true,
            Claim::Texts { texts, .. } => matches!(texts, TextsQuantity::Warnings | TextsQuantity::Printed),
            Claim::Number { quantity, .. } => matches!(quantity, Quantity::Count(_)),
            _ => false,
        }
    }
}
