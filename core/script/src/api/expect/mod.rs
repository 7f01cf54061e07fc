//! `expect(…)`: the measured property, and the times at which it is measured.

mod places;

use super::actor::morph_targets;
use super::values::{COUNTS, PLAN_COUNTS, plain_value};
use crate::call::{ApiError, Call, Options, Reply, api};
use crate::suggest::did_you_mean;
use crate::test_data::{
    ComparedObject, Contact, Measure, PendingExpect, Quantity, Subject, TextsQuantity, VectorQuantity, When,
};
use crate::value::{ActorRef, CameraRef, ClipRef, ExpectRef, JointRef, LightRef, PlanRef, StageRef};
use choreo_motion::Time;
use places::{
    acceleration, angle_to, component, direction, distance, in_picture, jerk, length, position, relative_to,
    rotation, scale, size, speed, turn_speed,
};
use rhai::Dynamic;

api! {
    /// Chooses what is tested: an Actor, Joint, Camera or Light (its position, unless another property is chosen),
    /// `stage()`, `plan()`, or a value.
    expect("what") -> Expect = expect, in_tests;
    /// Tests at one time only. Without at and during, every frame of the stage is tested.
    Expect.at("time") -> Expect = at, in_tests;
    /// Tests every frame from one time to another, both included.
    Expect.during("from, until") -> Expect = during, in_tests;
    /// Tests at this interval in seconds in place of once per frame. Speeds are then measured over this interval.
    Expect.every("seconds") -> Expect = every, in_tests;
    /// Negates the next comparison: it must fail at every tested time.
    Expect.not("") -> Expect = not, in_tests;
    /// Requires the next comparison to hold at one tested time in place of all. After .not() it must fail at one.
    Expect.sometime("") -> Expect = sometime, in_tests;
    /// Selects the position in metres.
    Expect.position("") -> Expect = position, in_tests;
    /// Selects the rotation.
    Expect.rotation("") -> Expect = rotation, in_tests;
    /// Selects the direction, a unit vector: the front of actors (`choreo info` shows it), +z of joints, the viewing
    /// direction of cameras, the direction in which lights shine.
    Expect.direction("") -> Expect = direction, in_tests;
    /// Selects the scale relative to the file, along the own axes.
    Expect.scale("") -> Expect = scale, in_tests;
    /// Selects the extent of an actor in its pose, along x, y and z, in metres.
    Expect.size("") -> Expect = size, in_tests;
    /// Transforms a position or rotation into the space of an actor or joint.
    Expect.relative_to("actor_or_joint") -> Expect = relative_to, in_tests;
    /// Selects the position in the image: x from 0 (left) to 1 (right), y from 0 (top) to 1 (bottom), z in metres
    /// in front of the camera. The camera is the active one unless another is given.
    Expect.in_picture("camera?") -> Expect = in_picture, in_tests;
    /// Selects the first number of a point.
    Expect.x("") -> Expect = |c| component(c, 0), in_tests;
    /// Selects the second number of a point.
    Expect.y("") -> Expect = |c| component(c, 1), in_tests;
    /// Selects the third number of a point.
    Expect.z("") -> Expect = |c| component(c, 2), in_tests;
    /// Selects the distance of a point from the origin of its space.
    Expect.length("") -> Expect = length, in_tests;
    /// Selects the distance to an actor, joint or point in metres.
    Expect.distance("target") -> Expect = distance, in_tests;
    /// Selects the angle in degrees between the direction of the subject and an actor, joint or point.
    Expect.angle_to("target") -> Expect = angle_to, in_tests;
    /// Selects the speed in metres per second, since the frame before.
    Expect.speed("") -> Expect = speed, in_tests;
    /// Selects the acceleration in metres per second², from the frames before and after.
    Expect.acceleration("") -> Expect = acceleration, in_tests;
    /// Selects the jerk in metres per second³, from four frames. It is large where the motion pops.
    Expect.jerk("") -> Expect = jerk, in_tests;
    /// Selects the angular speed in degrees per second, since the frame before.
    Expect.turn_speed("") -> Expect = turn_speed, in_tests;
    /// Selects the weight of a clip, 0 to 1: of an actor, in the layer that plays it; of a joint, in its pose, with
    /// all layers.
    Expect.weight("clip") -> Expect = weight, in_tests;
    /// Selects the time of the clip that an actor is at, in seconds of the clip.
    Expect.clip_time("clip") -> Expect = clip_time, in_tests;
    /// Selects the weight of a morph target.
    Expect.morph("name") -> Expect = morph, in_tests;
    /// Selects the color by which an actor is multiplied, linear.
    Expect.tint("") -> Expect = tint, in_tests;
    /// Selects the color of a light, linear.
    Expect.color("") -> Expect = color, in_tests;
    /// Selects the intensity of a light.
    Expect.intensity("") -> Expect = intensity, in_tests;
    /// Selects the vertical field of view of a camera in degrees.
    Expect.fov("") -> Expect = fov, in_tests;
    /// Selects y of the lowest point of an actor in its pose, in metres.
    Expect.lowest("") -> Expect = lowest, in_tests;
    /// Selects y of the highest point of an actor in its pose, in metres.
    Expect.highest("") -> Expect = highest, in_tests;
    /// Selects the foot sliding of a joint: metres along the floor since it touched down, 0 while it is in the air.
    /// Options: height (a joint this low is on the floor, metres, default 0.03), speed (a joint that rises or sinks
    /// faster is not on the floor, metres per second, default 0.5), swing (metres per second along the floor: a joint
    /// that moves faster while it comes down, or is 5 mm above where it stood, swings above the floor and is not on it,
    /// default 2), ground (y of the floor, default 0). A joint that never touches the floor is an error.
    Expect.slide("options?") -> Expect = slide, in_tests;
    /// Selects the height of an actor in the image, as a fraction of the image height.
    Expect.picture_height("camera?") -> Expect = picture_height, in_tests;
    /// Selects the fraction of an actor's vertices that are inside the image. Occlusion is ignored.
    Expect.picture_share("camera?") -> Expect = picture_share, in_tests;
    /// Selects the angle in the image between up and the +y axis of an actor or joint, in degrees.
    Expect.tilt("camera?") -> Expect = tilt, in_tests;
    /// Selects a number. Of a stage: "actors", "cameras", "cuts", "lights", "effects", "layers", "cues",
    /// "callbacks", "assets", "joints", "triangles", "vertices", "frames".
    /// - Of a plan: "passes", "post_passes", "pipelines", "draws", "copies" (instances), "triangles", "lights",
    ///   "joint_matrices", "morphs", "shadow_maps", "overlay_triangles" (those that effects draw; two per line or
    ///   point).
    Expect.count("what") -> Expect = count, in_tests;
    /// Selects the events: starts and ends of cues ("anna: Walk starts"), look-at constraints ("anna: look ends"),
    /// cuts ("cut to wide") and effects ("vignette starts"). Of an actor, only its own.
    Expect.events("") -> Expect = events, in_tests;
    /// Selects the warnings about the script and the assets on stage, as lines.
    Expect.warnings("") -> Expect = warnings, in_tests;
    /// Selects the lines that the script printed.
    Expect.printed("") -> Expect = printed, in_tests;
    /// Selects the names of the active effects.
    Expect.effects("") -> Expect = effects, in_tests;
}

fn expect(c: &mut Call) -> Reply {
    let given = c.value(0);
    let subject = subject(&given);
    let measure = if let Some(subject) = subject {
        Measure::Vector(VectorQuantity::Position(subject, None))
    } else if let Some(plan) = given.read_lock::<PlanRef>() {
        Measure::Plan(plan.options)
    } else if given.read_lock::<StageRef>().is_some() {
        Measure::Object(ComparedObject::Stage)
    } else {
        Measure::Value(plain_value(&given, 0).ok_or_else(|| {
            c.wrong(0, "an Actor, Joint, Camera or Light, stage(), plan(), a number, a text, true or false, or an array of these")
        })?)
    };
    let mut test = c.context.test();
    crate::build::check_limit(test.pending_expects.len(), "expectations", &c.context.limits)?;
    let stage = given.read_lock::<StageRef>().map_or(test.current_stage, |s| s.0);
    test.pending_expects.push(PendingExpect {
        place: c.place.clone(),
        comparisons: 0,
        unused_modifier: None,
    });
    let id = test.pending_expects.len() - 1;
    Ok(Dynamic::from(ExpectRef {
        id,
        stage,
        measure,
        when: When::Always,
        step: None,
        negated: false,
        sometime: false,
    }))
}

/// The subject that a handle refers to; `None` for values other than actors, joints, cameras and lights.
pub(crate) fn subject(v: &Dynamic) -> Option<Subject> {
    if let Some(actor) = v.read_lock::<ActorRef>() {
        Some(Subject::Actor(actor.id))
    } else if let Some(joint) = v.read_lock::<JointRef>() {
        Some(Subject::Joint { actor: joint.actor, joint: joint.joint })
    } else if let Some(camera) = v.read_lock::<CameraRef>() {
        Some(Subject::Camera(camera.0))
    } else {
        v.read_lock::<LightRef>().map(|light| Subject::Light(light.0))
    }
}

/// Returns a changed copy of the receiver.
fn with_change(c: &Call, change: impl FnOnce(&mut ExpectRef)) -> Reply {
    let mut expect: ExpectRef = c.this()?;
    change(&mut expect);
    Ok(Dynamic::from(expect))
}

/// Returns a changed copy of the receiver, and records the called method as a modifier of the next comparison.
fn with_modifier(c: &Call, change: impl FnOnce(&mut ExpectRef)) -> Reply {
    let expect = c.expect()?;
    if let Some(pending) = c.context.test().pending_expects.get_mut(expect.id) {
        pending.unused_modifier = Some((c.def.name, c.place.clone()));
    }
    with_change(c, change)
}

fn select_measure(c: &Call, measure: Measure) -> Reply {
    with_change(c, |expect| expect.measure = measure)
}

fn at(c: &mut Call) -> Reply {
    let time = c.time(0)?;
    with_modifier(c, |expect| expect.when = When::At(time))
}

fn during(c: &mut Call) -> Reply {
    let (from, until) = (c.time(0)?, c.time(1)?);
    if from >= until {
        return Err(ApiError::new(format!(
            "during: from must be before until, got {} and {}",
            from.as_secs(),
            until.as_secs()
        )));
    }
    with_modifier(c, |expect| expect.when = When::During(from, until))
}

fn every(c: &mut Call) -> Reply {
    let step = Time::from_secs(c.number_in(0, 1e-6, 1e6)?);
    with_modifier(c, |expect| expect.step = Some(step))
}

fn not(c: &mut Call) -> Reply {
    with_modifier(c, |expect| expect.negated = !expect.negated)
}

fn sometime(c: &mut Call) -> Reply {
    with_modifier(c, |expect| expect.sometime = true)
}

impl Call<'_, '_> {
    fn expect(&self) -> Result<ExpectRef, ApiError> {
        self.this()
    }

    /// The error that a method does not apply to the tested value: `speed: the argument of expect must be …, not …`.
    pub(crate) fn not_for(&self, allowed: &str, measure: &Measure) -> ApiError {
        ApiError::new(format!(
            "{}: the argument of expect must be {allowed}, not {}",
            self.def.name,
            measure.word()
        ))
    }

    /// The tested object, if no property of it has been selected yet.
    fn subject(&self, allowed: &str) -> Result<Subject, ApiError> {
        let expect = self.expect()?;
        match expect.measure {
            Measure::Vector(VectorQuantity::Position(subject, None)) => Ok(subject),
            other => Err(self.not_for(allowed, &other)),
        }
    }

    fn actor_subject(&self) -> Result<usize, ApiError> {
        match self.subject("an Actor")? {
            Subject::Actor(actor) => Ok(actor),
            other => Err(ApiError::new(format!(
                "{}: the argument of expect must be an Actor, not {}",
                self.def.name,
                subject_word(other)
            ))),
        }
    }

    fn vector(&self) -> Result<VectorQuantity, ApiError> {
        match self.expect()?.measure {
            Measure::Vector(vector) => Ok(vector),
            other => Err(self.not_for("an Actor, Joint, Camera, Light or a point", &other)),
        }
    }

    /// The camera of an optional argument; `None`: the active camera.
    fn optional_camera(&self, i: usize) -> Result<Option<usize>, ApiError> {
        if i >= self.len() {
            return Ok(None);
        }
        let given = self.value(i);
        let camera = given.read_lock::<CameraRef>().map(|camera| camera.0);
        camera.map(Some).ok_or_else(|| self.wrong(i, "a Camera"))
    }
}

fn subject_word(subject: Subject) -> &'static str {
    match subject {
        Subject::Actor(_) => "an Actor",
        Subject::Joint { .. } => "a Joint",
        Subject::Camera(_) => "a Camera",
        Subject::Light(_) => "a Light",
    }
}

/// The clip name in the first argument, a text or a Clip.
///
/// # Errors
/// Returns an error if the actor plays no clip of that name.
fn clip_name(c: &Call, actor: usize) -> Result<String, ApiError> {
    let given = c.value(0);
    let name = match given.read_lock::<ClipRef>() {
        Some(clip) => clip.clip.name.clone(),
        None => c.text(0)?,
    };
    let stage_draft = c.stage_draft();
    let of_actor = |chain: usize| stage_draft.chains.get(chain).is_some_and(|chain| chain.actor == actor);
    let played: Vec<&str> = stage_draft
        .cues
        .iter()
        .filter(|cue| of_actor(cue.chain))
        .map(|cue| cue.cue.clip.name.as_str())
        .collect();
    if played.contains(&name.as_str()) {
        return Ok(name);
    }
    let actor_name = stage_draft.actors.get(actor).map_or("", |d| d.actor.name.as_str());
    let error = ApiError::new(format!(
        "{}: actor \"{actor_name}\" does not play \"{name}\"{}",
        c.def.name,
        did_you_mean(&name, played.iter().copied())
    ));
    Err(error.focus(name))
}

fn weight(c: &mut Call) -> Reply {
    let (actor, joint) = match c.subject("an Actor or Joint")? {
        Subject::Actor(actor) => (actor, None),
        Subject::Joint { actor, joint } => (actor, Some(joint)),
        other => return Err(ApiError::new(format!("weight: {} plays no clips", subject_word(other)))),
    };
    let clip = clip_name(c, actor)?;
    select_measure(c, Measure::Number(Quantity::ClipWeight { actor, joint, clip }))
}

fn clip_time(c: &mut Call) -> Reply {
    let actor = c.actor_subject()?;
    let clip = clip_name(c, actor)?;
    select_measure(c, Measure::Number(Quantity::ClipTime { actor, clip }))
}

fn morph(c: &mut Call) -> Reply {
    let actor = c.actor_subject()?;
    let asset = c.stage_draft().actor(actor)?.actor.asset.clone();
    let targets = morph_targets(&asset, &c.value(0), &c.label(0))?;
    select_measure(c, Measure::Number(Quantity::Morph { actor, targets }))
}

fn tint(c: &mut Call) -> Reply {
    let actor = c.actor_subject()?;
    select_measure(c, Measure::Vector(VectorQuantity::Tint(actor)))
}

fn light_subject(c: &Call) -> Result<usize, ApiError> {
    match c.subject("a Light")? {
        Subject::Light(light) => Ok(light),
        other => Err(ApiError::new(format!(
            "{}: the argument of expect must be a Light, not {}",
            c.def.name,
            subject_word(other)
        ))),
    }
}

fn color(c: &mut Call) -> Reply {
    let light = light_subject(c)?;
    select_measure(c, Measure::Vector(VectorQuantity::LightColor(light)))
}

fn intensity(c: &mut Call) -> Reply {
    let light = light_subject(c)?;
    select_measure(c, Measure::Number(Quantity::Intensity(light)))
}

pub(crate) fn camera_subject(c: &Call) -> Result<usize, ApiError> {
    match c.subject("a Camera")? {
        Subject::Camera(camera) => Ok(camera),
        other => Err(ApiError::new(format!(
            "{}: the argument of expect must be a Camera, not {}",
            c.def.name,
            subject_word(other)
        ))),
    }
}

fn fov(c: &mut Call) -> Reply {
    let camera = camera_subject(c)?;
    select_measure(c, Measure::Number(Quantity::FieldOfView(camera)))
}

fn lowest(c: &mut Call) -> Reply {
    let actor = c.actor_subject()?;
    select_measure(c, Measure::Number(Quantity::Lowest(actor)))
}

fn highest(c: &mut Call) -> Reply {
    let actor = c.actor_subject()?;
    select_measure(c, Measure::Number(Quantity::Highest(actor)))
}

/// The tested joint, and the thresholds for being on the floor.
pub(crate) fn contact(c: &Call, i: usize) -> Result<Contact, ApiError> {
    let Subject::Joint { actor, joint } = c.subject("a Joint")? else {
        return Err(ApiError::new(format!(
            "{}: the argument of expect must be a Joint of a foot",
            c.def.name
        )));
    };
    let o: Options = c.options(i, &["height", "speed", "swing", "ground"])?;
    Ok(Contact {
        actor,
        joint,
        height: o.number_in("height", 0.0, 1e6)?.unwrap_or(0.03),
        speed: o.number_in("speed", 0.0, 1e6)?.unwrap_or(0.5),
        swing: o.number_in("swing", 0.0, 1e6)?.unwrap_or(2.0),
        ground: o.number("ground")?.unwrap_or(0.0),
    })
}

fn slide(c: &mut Call) -> Reply {
    let contact = contact(c, 0)?;
    select_measure(c, Measure::Number(Quantity::Slide(contact)))
}

fn picture_height(c: &mut Call) -> Reply {
    let (actor, camera) = (c.actor_subject()?, c.optional_camera(0)?);
    select_measure(c, Measure::Number(Quantity::ImageHeight { actor, camera }))
}

fn picture_share(c: &mut Call) -> Reply {
    let (actor, camera) = (c.actor_subject()?, c.optional_camera(0)?);
    select_measure(c, Measure::Number(Quantity::ShareInImage { actor, camera }))
}

fn tilt(c: &mut Call) -> Reply {
    let camera = c.optional_camera(0)?;
    let subject = match c.subject("an Actor or Joint")? {
        subject @ (Subject::Actor(_) | Subject::Joint { .. }) => subject,
        other => return Err(ApiError::new(format!("tilt: {} has no up direction", subject_word(other)))),
    };
    select_measure(c, Measure::Number(Quantity::Tilt { subject, camera }))
}

fn count(c: &mut Call) -> Reply {
    fn find<T: Copy>(c: &Call, known: &[(&'static str, T)]) -> Result<T, ApiError> {
        let names: Vec<&'static str> = known.iter().map(|(name, _)| *name).collect();
        let name = crate::call::one_of(&c.value(0), &c.label(0), &names)?;
        let found = known.iter().find(|(n, _)| *n == name).map(|(_, what)| *what);
        found.ok_or_else(|| c.wrong(0, "a known word"))
    }
    let quantity = match c.expect()?.measure {
        Measure::Object(ComparedObject::Stage) => Quantity::Count(find(c, COUNTS)?),
        Measure::Plan(options) => Quantity::PlanCount(options, find(c, PLAN_COUNTS)?),
        other => return Err(c.not_for("stage() or plan()", &other)),
    };
    select_measure(c, Measure::Number(quantity))
}

fn events(c: &mut Call) -> Reply {
    let of = match c.expect()?.measure {
        Measure::Object(ComparedObject::Stage) => None,
        Measure::Vector(VectorQuantity::Position(subject @ Subject::Actor(_), None)) => Some(subject),
        other => return Err(c.not_for("stage() or an Actor", &other)),
    };
    select_measure(c, Measure::Events(of))
}

fn select_texts_of_stage(c: &Call, texts: TextsQuantity) -> Reply {
    match c.expect()?.measure {
        Measure::Object(ComparedObject::Stage) => select_measure(c, Measure::Texts(texts)),
        other => Err(c.not_for("stage()", &other)),
    }
}

fn warnings(c: &mut Call) -> Reply {
    select_texts_of_stage(c, TextsQuantity::Warnings)
}

fn printed(c: &mut Call) -> Reply {
    select_texts_of_stage(c, TextsQuantity::Printed)
}

fn effects(c: &mut Call) -> Reply {
    select_texts_of_stage(c, TextsQuantity::Effects)
}
