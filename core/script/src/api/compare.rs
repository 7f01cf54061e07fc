//! The comparisons that end an `expect(…)`. Each is recorded with its place and judged when the stage is complete.

use super::expect::{camera_subject, contact, subject};
use super::expected_values::{events, formula, rotation_goal, tolerance};
use super::test::record_expectation;
use super::values::plain_value;
use crate::call::{ApiError, Call, Reply, api, numbers, point};
use crate::test_data::{
    Claim, ComparedObject, ComparedWith, EventPattern, EventsTest, Flag, InFrame, Measure, NumberGoal,
    NumberTest, RotationGoal, Subject, TextsQuantity, TextsTest, Value, ValueTest, VectorGoal,
    VectorQuantity, VectorTest, When,
};
use crate::value::{ActorRef, CameraRef, ExpectRef, StageRef};
use choreo_motion::Time;
use rhai::Dynamic;

api! {
    /// Tests that a value is within a tolerance of a number, a point, a color, the same property of another object,
    /// or a function of time, |t| …. Rotations are given as [x, y, z] as in Actor.rotate, as degrees about y, or as
    /// a quaternion [x, y, z, w]. Default tolerance: 0.001 (metres or the unit of the number), 0.1 degrees for
    /// rotations, 1e-9 for plain values.
    Expect.near("goal, tolerance?") -> Expect = near, in_tests;
    /// Tests that a number is at most this limit.
    Expect.below("limit") -> Expect = below, in_tests;
    /// Tests that a number is at least this limit.
    Expect.above("limit") -> Expect = above, in_tests;
    /// Tests that a number lies between two others, both included.
    Expect.between("low, high") -> Expect = between, in_tests;
    /// Tests that a point lies in a box, given by its minimum and maximum.
    Expect.within("min, max") -> Expect = within, in_tests;
    /// Tests that a plain value or a count is the same. An int and a float of the same value are equal.
    Expect.equals("value") -> Expect = equals, in_tests;
    /// Tests that a text contains this part, an array this element, or one of several lines this part.
    Expect.contains("part") -> Expect = contains, in_tests;
    /// Tests that a text matches a pattern: `*` stands for any characters, `?` for one.
    Expect.matches("pattern") -> Expect = matches, in_tests;
    /// Tests that there are no lines, or that a text or array is empty.
    Expect.empty("") -> Expect = empty, in_tests;
    /// Tests that there are these events and no others: an array of [time, text], or of texts where the time does
    /// not matter. `*` in a text stands for any characters. The tolerance is in seconds (default 0.000001).
    Expect.exactly("events, tolerance?") -> Expect = exactly, in_tests;
    /// Tests that these events come in this order, with others between; arguments as in Expect.exactly.
    Expect.in_order("events, tolerance?") -> Expect = in_order, in_tests;
    /// Tests that an actor is visible, by .hide, .show and keyframes.
    Expect.visible("") -> Expect = visible, in_tests;
    /// Tests that a camera is the active one.
    Expect.on("") -> Expect = on, in_tests;
    /// Tests that an effect is active on the stage.
    Expect.has_effect("name") -> Expect = has_effect, in_tests;
    /// Tests that a joint is on the floor. Options as in Expect.slide.
    Expect.on_floor("options?") -> Expect = on_floor, in_tests;
    /// Tests that an actor is completely inside the image. Options: camera (default the active one), margin (free
    /// fraction at the sides of the image, 0 to 0.49, default 0), height ([low, high], as fractions of the image
    /// height), upright (largest tilt in degrees).
    Expect.in_frame("options?") -> Expect = in_frame, in_tests;
    /// Tests for the same bits: of a stage and another stage, or the same stage at another time; of the pose of an
    /// actor and another actor, or the same actor at another time.
    Expect.same_as("other") -> Expect = same_as, in_tests;
    /// Tests that a plan does without a feature, by its name in `choreo explain`: "skinning", "morph targets",
    /// "blending and sorting back to front" and others.
    Expect.leaves_out("what") -> Expect = leaves_out, in_tests;
    /// Tests that evaluating all frames of this stage takes at most factor times as long as those of another stage.
    /// The stages run in turns, and the smallest of three medians counts, so that a busy machine does not fail the
    /// test.
    Expect.costs_at_most("factor, stage") -> Expect = costs_at_most, in_tests;
}

fn add_claim(c: &Call, mut expect: ExpectRef, claim: Claim) -> Reply {
    if claim.is_time_independent() && (expect.when != When::Always || expect.step.is_some()) {
        return Err(ApiError::new(format!(
            "{}: {} does not change over time",
            c.def.name,
            match claim {
                Claim::Number { .. } => "this count",
                Claim::Events { .. } => "the list of events",
                Claim::Texts { .. } => "this list",
                _ => "a value",
            }
        ))
        .hint("leave out .at, .during and .every"));
    }
    if expect.sometime && !claim.is_judged_at_each_time() {
        return Err(ApiError::new(format!(
            "{}: sometime is for numbers, points, rotations, flags and frames",
            c.def.name
        )));
    }
    record_expectation(c, &expect, claim)?;
    expect.negated = false;
    expect.sometime = false;
    Ok(Dynamic::from(expect))
}

fn near(c: &mut Call) -> Reply {
    let expect: ExpectRef = c.this()?;
    let claim = match &expect.measure {
        Measure::Number(quantity) => {
            let goal = match formula(c, 0, &[1])? {
                Some(formula) => NumberGoal::Formula(formula),
                None => NumberGoal::Number(c.number(0)?),
            };
            let test = NumberTest::Near { goal, tolerance: tolerance(c, 0.001)? };
            Claim::Number { quantity: quantity.clone(), test }
        }
        Measure::Vector(quantity) => {
            let color = matches!(quantity, VectorQuantity::Tint(_) | VectorQuantity::LightColor(_));
            let given = c.value(0);
            let goal = match formula(c, 0, &[3])? {
                Some(formula) => VectorGoal::Formula(formula),
                None if color => VectorGoal::Point(crate::call::rgb(c.color(0)?).as_dvec3()),
                None => match subject(&given) {
                    Some(subject) => VectorGoal::Subject(subject),
                    None => VectorGoal::Point(point(&given, &c.label(0))?),
                },
            };
            let test = VectorTest::Near { goal, tolerance: tolerance(c, 0.001)? };
            Claim::Vector { quantity: quantity.clone(), test }
        }
        Measure::Rotation(quantity) => {
            let goal = match formula(c, 0, &[1, 3])? {
                Some(formula) => RotationGoal::Formula(formula),
                None => rotation_goal(c)?,
            };
            let tolerance_deg = tolerance(c, 0.1)?;
            Claim::Rotation { quantity: quantity.clone(), goal, tolerance_deg }
        }
        Measure::Value(got) => {
            let goal = plain_value(&c.value(0), 0).filter(is_numeric);
            let goal = goal.ok_or_else(|| c.wrong(0, "a number or an array of numbers"))?;
            if !is_numeric(got) {
                return Err(c.not_for("a number or an array of numbers", &expect.measure));
            }
            let test = ValueTest::Near { goal, tolerance: tolerance(c, 1e-9)? };
            Claim::Value { got: got.clone(), test }
        }
        other => return Err(c.not_for("a number, a point, a color or a rotation", other)),
    };
    add_claim(c, expect, claim)
}

fn is_numeric(v: &Value) -> bool {
    match v {
        Value::Int(_) | Value::Number(_) => true,
        Value::List(list) => list.iter().all(is_numeric),
        _ => false,
    }
}

/// Records a comparison of a number that changes over time, or of a plain number.
fn compare_number(c: &Call, of_number: NumberTest, of_value: ValueTest) -> Reply {
    let expect: ExpectRef = c.this()?;
    let claim = match &expect.measure {
        Measure::Number(quantity) => Claim::Number { quantity: quantity.clone(), test: of_number },
        Measure::Value(got @ (Value::Int(_) | Value::Number(_))) => {
            Claim::Value { got: got.clone(), test: of_value }
        }
        Measure::Vector(_) => {
            let error = c.not_for("a number", &expect.measure);
            return Err(error.hint("choose one, as with .y(), .speed() or .distance(target)"));
        }
        other => return Err(c.not_for("a number", other)),
    };
    add_claim(c, expect, claim)
}

fn below(c: &mut Call) -> Reply {
    let limit = c.number(0)?;
    compare_number(c, NumberTest::Below(limit), ValueTest::Below(limit))
}

fn above(c: &mut Call) -> Reply {
    let limit = c.number(0)?;
    compare_number(c, NumberTest::Above(limit), ValueTest::Above(limit))
}

fn between(c: &mut Call) -> Reply {
    let (low, high) = (c.number(0)?, c.number(1)?);
    if low > high {
        return Err(ApiError::new(format!("between: low must not be above high, got {low} and {high}")));
    }
    compare_number(c, NumberTest::Between(low, high), ValueTest::Between(low, high))
}

fn within(c: &mut Call) -> Reply {
    let (min, max) = (point(&c.value(0), &c.label(0))?, point(&c.value(1), &c.label(1))?);
    if !min.cmple(max).all() {
        return Err(ApiError::new(format!("within: min must not be above max, got {min} and {max}")));
    }
    let expect: ExpectRef = c.this()?;
    let claim = match &expect.measure {
        Measure::Vector(quantity) => {
            Claim::Vector { quantity: quantity.clone(), test: VectorTest::Within { min, max } }
        }
        other => return Err(c.not_for("a point", other)),
    };
    add_claim(c, expect, claim)
}

fn equals(c: &mut Call) -> Reply {
    let expect: ExpectRef = c.this()?;
    let claim = match &expect.measure {
        Measure::Number(quantity) => {
            let wanted = c.number(0)?;
            Claim::Number { quantity: quantity.clone(), test: NumberTest::Between(wanted, wanted) }
        }
        Measure::Value(got) => {
            let wanted = plain_value(&c.value(0), 0).ok_or_else(|| c.wrong(0, "a plain value"))?;
            Claim::Value { got: got.clone(), test: ValueTest::Equals(wanted) }
        }
        Measure::Events(_) => return exactly(c),
        Measure::Vector(_) | Measure::Rotation(_) => {
            let error = c.not_for("a value or a number", &expect.measure);
            return Err(error.hint("points and rotations are compared with .near(goal, tolerance)"));
        }
        other => return Err(c.not_for("a value or a number", other)),
    };
    add_claim(c, expect, claim)
}

fn contains(c: &mut Call) -> Reply {
    let expect: ExpectRef = c.this()?;
    let claim = match &expect.measure {
        Measure::Texts(texts) => Claim::Texts { texts: *texts, test: TextsTest::Contains(c.text(0)?) },
        Measure::Value(got @ (Value::Text(_) | Value::List(_))) => {
            let part = plain_value(&c.value(0), 0).ok_or_else(|| c.wrong(0, "a plain value"))?;
            if let (Value::Text(_), false) = (got, matches!(part, Value::Text(_))) {
                return Err(c.wrong(0, "text"));
            }
            Claim::Value { got: got.clone(), test: ValueTest::Contains(part) }
        }
        Measure::Events(_) => return in_order(c),
        other => return Err(c.not_for("a text, an array or lines of text", other)),
    };
    add_claim(c, expect, claim)
}

fn matches(c: &mut Call) -> Reply {
    let pattern = c.text(0)?;
    let expect: ExpectRef = c.this()?;
    let claim = match &expect.measure {
        Measure::Value(got @ Value::Text(_)) => {
            Claim::Value { got: got.clone(), test: ValueTest::Matches(pattern) }
        }
        other => return Err(c.not_for("a text", other)),
    };
    add_claim(c, expect, claim)
}

fn empty(c: &mut Call) -> Reply {
    let expect: ExpectRef = c.this()?;
    let claim = match &expect.measure {
        Measure::Texts(texts) => Claim::Texts { texts: *texts, test: TextsTest::Empty },
        Measure::Events(of) => Claim::Events { of: *of, test: EventsTest::Exactly(Vec::new(), Time::ZERO) },
        Measure::Value(got @ (Value::Text(_) | Value::List(_) | Value::Map(_))) => {
            Claim::Value { got: got.clone(), test: ValueTest::Empty }
        }
        other => return Err(c.not_for("a text, an array or lines of text", other)),
    };
    add_claim(c, expect, claim)
}

fn compare_events(c: &Call, test: impl FnOnce(Vec<EventPattern>, Time) -> EventsTest) -> Reply {
    let expect: ExpectRef = c.this()?;
    let Measure::Events(of) = expect.measure else {
        let error = c.not_for("events", &expect.measure);
        return Err(error.hint("write expect(stage()).events() or expect(actor).events()"));
    };
    let (patterns, tolerance) = events(c)?;
    add_claim(c, expect, Claim::Events { of, test: test(patterns, tolerance) })
}

fn exactly(c: &mut Call) -> Reply {
    compare_events(c, EventsTest::Exactly)
}

fn in_order(c: &mut Call) -> Reply {
    compare_events(c, EventsTest::InOrder)
}

/// The actor that is tested.
fn tested_actor(c: &Call) -> Result<usize, ApiError> {
    let expect: ExpectRef = c.this()?;
    match &expect.measure {
        Measure::Vector(VectorQuantity::Position(Subject::Actor(actor), None)) => Ok(*actor),
        other => Err(c.not_for("an Actor", other)),
    }
}

fn visible(c: &mut Call) -> Reply {
    let (expect, actor): (ExpectRef, usize) = (c.this()?, tested_actor(c)?);
    add_claim(c, expect, Claim::Flag(Flag::Visible(actor)))
}

fn on(c: &mut Call) -> Reply {
    let (expect, camera): (ExpectRef, usize) = (c.this()?, camera_subject(c)?);
    add_claim(c, expect, Claim::Flag(Flag::CameraActive(camera)))
}

fn has_effect(c: &mut Call) -> Reply {
    let expect: ExpectRef = c.this()?;
    let name = c.text(0)?;
    match &expect.measure {
        Measure::Object(ComparedObject::Stage) => add_claim(c, expect, Claim::Flag(Flag::Effect(name))),
        other => Err(c.not_for("stage()", other)),
    }
}

fn on_floor(c: &mut Call) -> Reply {
    let expect: ExpectRef = c.this()?;
    let contact = contact(c, 0)?;
    add_claim(c, expect, Claim::Flag(Flag::OnFloor(contact)))
}

fn in_frame(c: &mut Call) -> Reply {
    let (expect, actor): (ExpectRef, usize) = (c.this()?, tested_actor(c)?);
    let o = c.options(0, &["camera", "margin", "height", "upright"])?;
    let camera = match o.get("camera") {
        None => None,
        Some(given) => match given.read_lock::<CameraRef>() {
            Some(camera) => Some(camera.0),
            None => return Err(crate::call::wrong(&given, "in_frame: camera", "a Camera")),
        },
    };
    let height = match o.get("height") {
        None => None,
        Some(given) => match numbers(&given).as_deref() {
            Some([low, high]) if low <= high => Some((*low, *high)),
            _ => {
                return Err(crate::call::wrong(
                    &given,
                    "in_frame: height",
                    "[low, high], shares of the image",
                ));
            }
        },
    };
    let claim = InFrame {
        actor,
        camera,
        margin: o.number_in("margin", 0.0, 0.49)?.unwrap_or(0.0),
        height,
        upright: o.number_in("upright", 0.0, 180.0)?,
    };
    add_claim(c, expect, Claim::InFrame(claim))
}

fn same_as(c: &mut Call) -> Reply {
    let expect: ExpectRef = c.this()?;
    let given = c.value(0);
    let what = match &expect.measure {
        Measure::Object(what) => *what,
        Measure::Vector(VectorQuantity::Position(Subject::Actor(actor), None)) => {
            ComparedObject::Pose(*actor)
        }
        other => return Err(c.not_for("stage() or an Actor", other)),
    };
    let other = if let Some(stage) = given.read_lock::<StageRef>().filter(|_| what == ComparedObject::Stage) {
        ComparedWith::Stage(stage.0)
    } else if let Some(actor) = given.read_lock::<ActorRef>().filter(|_| what != ComparedObject::Stage) {
        ComparedWith::Actor(actor.id)
    } else if given.is_int() || given.is_float() {
        if !matches!(expect.when, When::At(_)) {
            return Err(ApiError::new("same_as: comparing two times needs .at with the first one")
                .hint("write .at(1.0).same_as(2.0)"));
        }
        ComparedWith::Time(c.time(0)?)
    } else {
        let allowed = match what {
            ComparedObject::Stage => "another stage, as from stage_of, or a time",
            ComparedObject::Pose(_) => "another Actor, or a time",
        };
        return Err(c.wrong(0, allowed));
    };
    add_claim(c, expect, Claim::Same { what, other })
}

fn leaves_out(c: &mut Call) -> Reply {
    let expect: ExpectRef = c.this()?;
    let what = c.text(0)?;
    match &expect.measure {
        Measure::Plan(options) => {
            let texts = TextsQuantity::LeftOut(*options);
            add_claim(c, expect, Claim::Texts { texts, test: TextsTest::Names(what) })
        }
        other => {
            let error = c.not_for("plan()", other);
            Err(error)
        }
    }
}

fn costs_at_most(c: &mut Call) -> Reply {
    let expect: ExpectRef = c.this()?;
    let factor = c.number_in(0, 1e-3, 1e6)?;
    let given = c.value(1);
    let Some(other) = given.read_lock::<StageRef>().map(|stage| stage.0) else {
        return Err(c.wrong(1, "a stage, as from stage_of"));
    };
    match &expect.measure {
        Measure::Object(ComparedObject::Stage) => add_claim(c, expect, Claim::Cost { other, factor }),
        other => Err(c.not_for("a stage", other)),
    }
}
