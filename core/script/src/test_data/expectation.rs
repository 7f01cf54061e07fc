//! Expectations of a test section as data. The script records them with their places; they are judged when the stage is complete.
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

/// A comparison of a test with its place and times.
#[derive(Clone, Debug)]
pub struct Expectation {
    /// Place of the call that compares.
    pub place: Place,
    /// The source line, without indentation.
    pub source: String,
    /// Index into `SectionRun::stages`. 0: the section's own stage; n: the n-th stage made with `stage_of`.
    pub stage: usize,
    pub when: When,
    /// Interval between tested times, also for the differences that give speeds; `None`: one frame of the stage.
    pub step: Option<Time>,
    /// The claim must fail at every tested time.
    pub negated: bool,
    /// It is enough that the claim holds (negated: fails) at one tested time.
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

/// An object of the stage, by its index.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Subject {
    Actor(usize),
    Joint { actor: usize, joint: u32 },
    Camera(usize),
    Light(usize),
}

/// Claim of an expectation: the measured property and the test.
#[derive(Clone, Debug)]
pub enum Claim {
    /// A number that may change over time.
    Number { quantity: Quantity, test: NumberTest },
    /// A point or a color that may change over time.
    Vector { quantity: VectorQuantity, test: VectorTest },
    /// A rotation that may change over time; the same rotation may be written as q and as −q.
    Rotation { quantity: RotationQuantity, goal: RotationGoal, tolerance_deg: f64 },
    /// A property that is true or false.
    Flag(Flag),
    /// The whole actor is inside the image of the active camera, or of the given one.
    InFrame(InFrame),
    /// Two stages or poses have the same bits.
    Same { what: ComparedObject, other: ComparedWith },
    /// Events of cues, cuts, look-at constraints and effects, in order.
    Events { of: Option<Subject>, test: EventsTest },
    /// Lines of text: warnings, names.
    Texts { texts: TextsQuantity, test: TextsTest },
    /// A value that the script has computed.
    Value { got: Value, test: ValueTest },
    /// Evaluating this stage at all its frames takes at most `factor` times as long as the other.
    Cost { other: usize, factor: f64 },
    /// The image at a time matches the golden image.
    Image(ImageExpectation),
}

/// Numbers of a stage, each a function of time. Lengths are in metres, angles in degrees, times in seconds.
#[derive(Clone, Debug)]
pub enum Quantity {
    /// x, y or z of a vector: 0, 1, 2.
    Component(VectorQuantity, usize),
    Length(VectorQuantity),
    /// Distance to a point that may move.
    Distance(Subject, Target),
    /// Angle between the subject's direction (+z; for cameras and lights, where they point) and a point that may move.
    AngleTo(Subject, Target),
    /// Angle between two rotations.
    Angle(RotationQuantity, RotationQuantity),
    /// Mean speed since the previous tested time, metres per second.
    Speed(VectorQuantity),
    /// Metres per second², from the tested times before and after.
    Acceleration(VectorQuantity),
    /// Metres per second³, from four tested times.
    Jerk(VectorQuantity),
    /// Degrees per second since the tested time before.
    TurnSpeed(RotationQuantity),
    /// Foot sliding: metres that a joint has moved along the floor since it touched down; 0 while it is in the air.
    Slide(Contact),
    /// Weight of a clip, 0..=1: in its layer of the actor, or in the pose of one joint with all layers.
    ClipWeight {
        actor: usize,
        joint: Option<u32>,
        clip: String,
    },
    /// Time in seconds of the clip, for the cue with the largest weight; NaN while it is not active.
    ClipTime {
        actor: usize,
        clip: String,
    },
    /// Weight of a morph target, the largest of the actor's meshes.
    Morph {
        actor: usize,
        targets: Vec<(u32, u32)>,
    },
    /// y of the lowest point of a posed actor, metres.
    Lowest(usize),
    /// y of the highest point of a posed actor, metres.
    Highest(usize),
    /// Height of an actor in the image, as a fraction of the image height.
    ImageHeight {
        actor: usize,
        camera: Option<usize>,
    },
    /// Fraction of an actor's vertices that are inside the image, 0..=1. Occlusion is ignored.
    ShareInImage {
        actor: usize,
        camera: Option<usize>,
    },
    /// Angle in the image between up and the subject's +y axis, degrees, 0..=180.
    Tilt {
        subject: Subject,
        camera: Option<usize>,
    },
    /// Vertical field of view, degrees.
    FieldOfView(usize),
    /// Intensity of a light.
    Intensity(usize),
    /// A count in the stage, independent of time.
    Count(Count),
    /// A count in the render plan of the frame.
    PlanCount(PlanOptions, PlanCount),
}

/// Points, vectors and colors of a stage, each a function of time.
#[derive(Clone, Debug, PartialEq)]
pub enum VectorQuantity {
    /// Position in the world, or in the space of an actor or joint.
    Position(Subject, Option<Attachment>),
    Scale(Subject),
    /// Direction of the subject as a unit vector (the front of actors, +z of joints; where cameras and lights point).
    Direction(Subject),
    /// Tint of an actor: linear red, green and blue.
    Tint(usize),
    LightColor(usize),
    /// Extent of a posed actor along the world axes, metres.
    Size(usize),
    /// Position in the image: x from 0 (left) to 1 (right), y from 0 (top) to 1 (bottom), z in metres in front of the camera.
    InImage(Subject, Option<usize>),
}

/// Rotations of a stage, each a function of time.
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
    /// Metres per second, up or down.
    pub speed: f64,
    /// Speed along the floor in metres per second above which a sinking joint passes over the floor instead of standing on it.
    pub swing: f64,
    /// y of the floor.
    pub ground: f64,
}

/// Things that are counted in a stage.
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

/// Things that are counted in the render plan of a frame.
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
    /// Shadow maps of lights.
    ShadowMaps,
    /// Triangles that effects draw, two per line or point.
    OverlayTriangles,
}

/// Comparison of a number.
#[derive(Clone, Debug)]
pub enum NumberTest {
    /// The number is within the tolerance of a number or of a function of time.
    Near {
        goal: NumberGoal,
        tolerance: f64,
    },
    Below(f64),
    Above(f64),
    Between(f64, f64),
}

/// Expected number.
#[derive(Clone, Debug)]
pub enum NumberGoal {
    Number(f64),
    Formula(Formula),
}

/// Comparison of a point, vector or color.
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

/// Expected point, vector or color.
#[derive(Clone, Debug)]
pub enum VectorGoal {
    Point(DVec3),
    /// The position of a target at the same time.
    Target(Target),
    /// The same property of another subject.
    Subject(Subject),
    Formula(Formula),
}

/// Expected rotation.
#[derive(Clone, Debug)]
pub enum RotationGoal {
    Rotation(DQuat),
    /// The rotation of another subject at the same time.
    Subject(Subject),
    /// A function of time that returns degrees about y, or [x, y, z] as in `.rotate`.
    Formula(Formula),
}

/// Property that is true or false.
#[derive(Clone, Debug, PartialEq)]
pub enum Flag {
    /// The actor is visible.
    Visible(usize),
    /// The joint is on the floor.
    OnFloor(Contact),
    /// The camera is active.
    CameraActive(usize),
    /// The effect with this name is active.
    Effect(String),
}

/// Requirements on an actor that must be inside the image.
#[derive(Clone, Debug, PartialEq)]
pub struct InFrame {
    pub actor: usize,
    /// `None`: the active camera.
    pub camera: Option<usize>,
    /// Fraction of the image that must stay free at each side, 0 to 0.49.
    pub margin: f64,
    /// Range of the actor's height, as fractions of the image height.
    pub height: Option<(f64, f64)>,
    /// Largest angle in degrees between the actor's +y axis and up in the image.
    pub upright: Option<f64>,
}

/// Object whose bits are compared with those of another.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ComparedObject {
    /// The whole stage, or its snapshot at a time.
    Stage,
    /// The pose of an actor in the actor's space, and its morph weights.
    Pose(usize),
}

/// Object with which it is compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ComparedWith {
    /// The same object at another time.
    Time(Time),
    /// Index into `SectionRun::stages`.
    Stage(usize),
    Actor(usize),
}

/// An expected event: a text such as `anna: Walk starts`, and its time.
#[derive(Clone, Debug, PartialEq)]
pub struct EventPattern {
    /// Expected time; `None`: any time.
    pub at: Option<Time>,
    /// `*` stands for anything.
    pub text: String,
}

/// Comparison of the events of a stage.
#[derive(Clone, Debug, PartialEq)]
pub enum EventsTest {
    /// The given events and no others, in this order. The time is the tolerance.
    Exactly(Vec<EventPattern>, Time),
    /// The given events in this order; other events may occur between them. The time is the tolerance.
    InOrder(Vec<EventPattern>, Time),
}

/// Lists of texts of a stage or plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TextsQuantity {
    /// Warnings about the script and the assets on stage.
    Warnings,
    Printed,
    /// Features that the plan leaves out, with the reason: `skinning: no mesh has a skin`.
    LeftOut(PlanOptions),
    /// Names of the active effects.
    Effects,
}

/// Comparison of a list of texts.
#[derive(Clone, Debug, PartialEq)]
pub enum TextsTest {
    Empty,
    /// A line contains this text.
    Contains(String),
    /// The text before `: ` of one line is this name.
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

/// Comparison of a plain value.
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
    /// A text or list that contains this value.
    Contains(Value),
    /// `*` stands for anything, `?` for one character.
    Matches(String),
    Empty,
}

/// Comparison of a frame of the stage with its golden image.
#[derive(Clone, Debug, PartialEq)]
pub struct ImageExpectation {
    /// Name of the golden image, unique in its file: letters, digits, `_`, `-`.
    pub name: String,
    pub at: Time,
    /// Size in pixels; `None`: the size of the stage.
    pub size: Option<[u32; 2]>,
    /// Samples per pixel, 1 or 4; `None`: those of the stage.
    pub samples: Option<u32>,
    /// "cpu" or "vulkan"; `None`: the CPU renderer, which is the same everywhere.
    pub device: Option<String>,
    /// Difference per channel, in steps of 1/255, up to which pixels count as equal.
    pub tolerance: u8,
    /// Limits in the order of `choreo_image_diff::METRICS`.
    pub limits: [f64; METRICS.len()],
    /// The golden image may be larger than 40 KiB.
    pub large: bool,
}

impl ImageExpectation {
    /// The comparison at time 0 with default limits.
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

/// A function of time in a script, `|t| …`, called when the expectation is judged.
#[derive(Clone)]
pub struct Formula(pub(crate) Arc<dyn Fn(Time) -> Result<Vec<f64>, Diagnostic> + Send + Sync>);

impl Formula {
    /// Calls the function at a stage time. Returns one or three numbers. The error has file and line.
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
pub(crate) enum Measure {
    Number(Quantity),
    Vector(VectorQuantity),
    Rotation(RotationQuantity),
    Events(Option<Subject>),
    Texts(TextsQuantity),
    Value(Value),
    Object(ComparedObject),
    Plan(PlanOptions),
}

impl Measure {
    /// The word used in messages.
    pub(crate) fn word(&self) -> &'static str {
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
            Measure::Object(ComparedObject::Stage) => "a stage",
            Measure::Object(ComparedObject::Pose(_)) => "a pose",
            Measure::Plan(_) => "a plan",
        }
    }
}

impl Claim {
    /// Whether the claim is judged at each tested time.
    pub(crate) fn is_judged_at_each_time(&self) -> bool {
        matches!(
            self,
            Claim::Number { .. }
                | Claim::Vector { .. }
                | Claim::Rotation { .. }
                | Claim::Flag(_)
                | Claim::InFrame(_)
        )
    }

    /// Whether the claim does not depend on time.
    pub fn is_time_independent(&self) -> bool {
        match self {
            Claim::Events { .. } | Claim::Value { .. } | Claim::Cost { .. } | Claim::Image(_) => true,
            Claim::Texts { texts, .. } => matches!(texts, TextsQuantity::Warnings | TextsQuantity::Printed),
            Claim::Number { quantity, .. } => matches!(quantity, Quantity::Count(_)),
            _ => false,
        }
    }
}
