//! Mathematics with the same bits on every machine: libm, not the system's library. Angles are radians.

use choreo_stage::noise::{noise, splitmix64, unit_interval};
use glam::DQuat;
use rhai::{Dynamic, Engine, EvalAltResult, ImmutableString, Position};

/// Name, arguments and description of each function.
pub(crate) const FUNCTIONS: &[(&str, &str, &str)] = &[
    ("sin", "x", "Returns the sine of an angle in radians."),
    ("cos", "x", "Returns the cosine of an angle in radians."),
    ("tan", "x", "Returns the tangent of an angle in radians."),
    ("asin", "x", "Returns the arc sine in radians."),
    ("acos", "x", "Returns the arc cosine in radians."),
    ("atan", "x", "Returns the arc tangent in radians; atan(y, x) returns the angle of the point (x, y)."),
    ("sinh", "x", "Returns the hyperbolic sine."),
    ("cosh", "x", "Returns the hyperbolic cosine."),
    ("tanh", "x", "Returns the hyperbolic tangent."),
    ("exp", "x", "Returns e to the power of x."),
    ("ln", "x", "Returns the natural logarithm."),
    ("log", "x", "Returns the logarithm to base 10; log(x, base) to another base."),
    ("sqrt", "x", "Returns the square root."),
    ("cbrt", "x", "Returns the cube root."),
    ("pow", "x, y", "Returns x to the power of y."),
    ("hypot", "x, y", "Returns the length of the vector (x, y)."),
    ("floor", "x", "Returns the largest whole number that is not above x."),
    ("ceiling", "x", "Returns the smallest whole number that is not below x."),
    ("round", "x", "Returns the nearest whole number; halves are rounded away from zero."),
    ("trunc", "x", "Returns x without its fraction."),
    ("fract", "x", "Returns the fraction of x."),
    ("to_int", "x", "Converts to an int; the fraction is cut off."),
    ("to_float", "x", "Converts to a float."),
    ("to_radians", "x", "Converts degrees to radians."),
    ("to_degrees", "x", "Converts radians to degrees."),
    ("cm", "x", "Converts centimetres to metres."),
    ("mm", "x", "Converts millimetres to metres."),
    ("min", "a, b", "Returns the smaller number."),
    ("max", "a, b", "Returns the larger number."),
    ("clamp", "x, low, high", "Limits x to the range from low to high."),
    ("lerp", "a, b, w", "Interpolates linearly: a where w is 0, b where w is 1."),
    ("smoothstep", "a, b, x", "Returns 0 below a, 1 above b, and a smooth transition between them."),
    ("is_nan", "x", "Returns whether x is not a number (NaN)."),
    ("parse_int", "text", "Reads a whole number from a text: digits, perhaps with a sign."),
    (
        "parse_int",
        "text, radix",
        "Reads a whole number with a radix of 2 to 36: parse_int(\"ff\", 16) is 255.",
    ),
    ("parse_float", "text", "Reads a number from a text."),
    (
        "rand",
        "seed",
        "Returns a pseudorandom number from 0 to 1 that depends only on the seed; rand(seed, low, high) one from low to high.",
    ),
    (
        "quaternion",
        "axis, degrees",
        "Returns the quaternion [x, y, z, w] of a rotation about an axis, counter-clockwise seen from its tip.",
    ),
    ("product", "a, b", "Returns the product of two quaternions: the rotation by b, then by a."),
    (
        "slerp",
        "a, b, w",
        "Interpolates two quaternions on the shortest arc (spherical linear interpolation): a where w is 0, b where w is 1.",
    ),
    (
        "noise",
        "x",
        "Returns smooth noise from -1 to 1, for example for camera shake; noise(seed, x) different noise for each seed.",
    ),
];

/// Registers a function for every combination of int and float arguments.
macro_rules! numbers {
    ($engine:expr, $name:literal, |$a:ident| $f:expr) => {
        $engine.register_fn($name, |$a: f64| $f);
        $engine.register_fn($name, |$a: i64| {
            let $a = $a as f64;
            $f
        });
    };
    ($engine:expr, $name:literal, |$a:ident, $b:ident| $f:expr) => {
        $engine.register_fn($name, |$a: f64, $b: f64| $f);
        $engine.register_fn($name, |$a: i64, $b: f64| {
            let $a = $a as f64;
            $f
        });
        $engine.register_fn($name, |$a: f64, $b: i64| {
            let $b = $b as f64;
            $f
        });
        $engine.register_fn($name, |$a: i64, $b: i64| {
            let ($a, $b) = ($a as f64, $b as f64);
            $f
        });
    };
}

fn number(v: &Dynamic, name: &str) -> Result<f64, Box<EvalAltResult>> {
    crate::call::number(v, name).map_err(|e| crate::errors::throw(e, crate::call::Place::default()))
}

type QuaternionArray = Result<rhai::Array, Box<EvalAltResult>>;

fn quaternion_array(q: DQuat) -> QuaternionArray {
    Ok(q.to_array().into_iter().map(Dynamic::from_float).collect())
}

fn quaternion(v: &Dynamic, name: &str) -> Result<DQuat, Box<EvalAltResult>> {
    super::keys::quaternion(v, name).map_err(|e| crate::errors::throw(e, crate::call::Place::default()))
}

fn register_quaternions(engine: &mut Engine) {
    engine.register_fn("quaternion", |axis: Dynamic, degrees: Dynamic| -> QuaternionArray {
        let axis = crate::call::Call::direction(&axis, "quaternion: axis");
        let axis = axis.map_err(|e| crate::errors::throw(e, crate::call::Place::default()))?;
        let half = crate::call::radians(number(&degrees, "quaternion: degrees")?) * 0.5;
        quaternion_array(
            DQuat::from_xyzw(0.0, 0.0, 0.0, libm::cos(half))
                + DQuat::from_vec4((axis * libm::sin(half)).extend(0.0)),
        )
    });
    engine.register_fn("product", |a: Dynamic, b: Dynamic| -> QuaternionArray {
        quaternion_array(quaternion(&a, "product: a")? * quaternion(&b, "product: b")?)
    });
    engine.register_fn("slerp", |a: Dynamic, b: Dynamic, w: Dynamic| -> QuaternionArray {
        let (a, b) = (quaternion(&a, "slerp: a")?, quaternion(&b, "slerp: b")?);
        quaternion_array(choreo_motion::slerp(a, b, number(&w, "slerp: w")?))
    });
}

pub(crate) fn register(engine: &mut Engine) {
    register_quaternions(engine);
    numbers!(engine, "sin", |x| libm::sin(x));
    numbers!(engine, "cos", |x| libm::cos(x));
    numbers!(engine, "tan", |x| libm::tan(x));
    numbers!(engine, "asin", |x| libm::asin(x));
    numbers!(engine, "acos", |x| libm::acos(x));
    numbers!(engine, "atan", |x| libm::atan(x));
    numbers!(engine, "atan", |y, x| libm::atan2(y, x));
    numbers!(engine, "sinh", |x| libm::sinh(x));
    numbers!(engine, "cosh", |x| libm::cosh(x));
    numbers!(engine, "tanh", |x| libm::tanh(x));
    numbers!(engine, "exp", |x| libm::exp(x));
    numbers!(engine, "ln", |x| libm::log(x));
    numbers!(engine, "log", |x| libm::log10(x));
    numbers!(engine, "log", |x, base| libm::log(x) / libm::log(base));
    numbers!(engine, "sqrt", |x| libm::sqrt(x));
    numbers!(engine, "cbrt", |x| libm::cbrt(x));
    numbers!(engine, "pow", |x, y| libm::pow(x, y));
    numbers!(engine, "hypot", |x, y| libm::hypot(x, y));
    numbers!(engine, "floor", |x| libm::floor(x));
    numbers!(engine, "ceiling", |x| libm::ceil(x));
    numbers!(engine, "round", |x| libm::round(x));
    numbers!(engine, "trunc", |x| libm::trunc(x));
    numbers!(engine, "fract", |x| x - libm::trunc(x));
    numbers!(engine, "to_float", |x| x);
    numbers!(engine, "to_radians", |x| x * (std::f64::consts::PI / 180.0));
    numbers!(engine, "to_degrees", |x| x * (180.0 / std::f64::consts::PI));
    numbers!(engine, "cm", |x| x / 100.0);
    numbers!(engine, "mm", |x| x / 1000.0);
    numbers!(engine, "is_nan", |x| x.is_nan());
    engine.register_fn("to_int", |x: i64| x);
    engine.register_fn("to_int", |x: f64| -> Result<i64, Box<EvalAltResult>> {
        // About ±2^63, the range of an int.
        if x > -9.3e18 && x < 9.2e18 {
            return Ok(x as i64);
        }
        Err(Box::new(EvalAltResult::ErrorArithmetic(
            format!("to_int: {x:?} does not fit an int"),
            Position::NONE,
        )))
    });
    engine.register_fn("min", |a: i64, b: i64| a.min(b));
    engine.register_fn("max", |a: i64, b: i64| a.max(b));
    engine.register_fn("min", |a: f64, b: f64| a.min(b));
    engine.register_fn("max", |a: f64, b: f64| a.max(b));
    engine.register_fn("min", |a: i64, b: f64| (a as f64).min(b));
    engine.register_fn("max", |a: i64, b: f64| (a as f64).max(b));
    engine.register_fn("min", |a: f64, b: i64| a.min(b as f64));
    engine.register_fn("max", |a: f64, b: i64| a.max(b as f64));
    engine.register_fn(
        "clamp",
        |x: Dynamic, low: Dynamic, high: Dynamic| -> Result<f64, Box<EvalAltResult>> {
            let (x, low, high) =
                (number(&x, "clamp: x")?, number(&low, "clamp: low")?, number(&high, "clamp: high")?);
            Ok(x.min(high).max(low))
        },
    );
    engine.register_fn("lerp", |a: Dynamic, b: Dynamic, w: Dynamic| -> Result<f64, Box<EvalAltResult>> {
        let (a, b, w) = (number(&a, "lerp: a")?, number(&b, "lerp: b")?, number(&w, "lerp: w")?);
        Ok(a + (b - a) * w)
    });
    engine.register_fn(
        "smoothstep",
        |a: Dynamic, b: Dynamic, x: Dynamic| -> Result<f64, Box<EvalAltResult>> {
            let (a, b, x) =
                (number(&a, "smoothstep: a")?, number(&b, "smoothstep: b")?, number(&x, "smoothstep: x")?);
            let w = if a == b { f64::from(u8::from(x >= a)) } else { ((x - a) / (b - a)).clamp(0.0, 1.0) };
            Ok(w * w * (3.0 - 2.0 * w))
        },
    );
    register_parsers(engine);
    register_random(engine);
}

fn register_parsers(engine: &mut Engine) {
    let not_a_number = |what: &str, text: &str| -> Box<EvalAltResult> {
        let shown: String = text.chars().take(40).collect();
        Box::new(EvalAltResult::ErrorArithmetic(
            format!("{what}: \"{shown}\" is not a number"),
            Position::NONE,
        ))
    };
    engine.register_fn("parse_int", move |text: ImmutableString| {
        text.trim().parse::<i64>().map_err(|_| not_a_number("parse_int", &text))
    });
    engine.register_fn("parse_int", move |text: ImmutableString, radix: i64| {
        let radix = u32::try_from(radix).ok().filter(|radix| (2..=36).contains(radix));
        let digits = text.trim();
        radix
            .and_then(|radix| i64::from_str_radix(digits, radix).ok())
            .ok_or_else(|| not_a_number("parse_int", &text))
    });
    engine.register_fn("parse_float", move |text: ImmutableString| {
        text.trim().parse::<f64>().map_err(|_| not_a_number("parse_float", &text))
    });
}

fn register_random(engine: &mut Engine) {
    engine.register_fn("rand", |seed: Dynamic| -> Result<f64, Box<EvalAltResult>> {
        Ok(unit_interval(splitmix64(seed_of(&seed)?)))
    });
    engine.register_fn(
        "rand",
        |seed: Dynamic, low: Dynamic, high: Dynamic| -> Result<f64, Box<EvalAltResult>> {
            let (low, high) = (number(&low, "rand: low")?, number(&high, "rand: high")?);
            Ok(low + (high - low) * unit_interval(splitmix64(seed_of(&seed)?)))
        },
    );
    engine.register_fn("noise", |x: Dynamic| -> Result<f64, Box<EvalAltResult>> {
        Ok(noise(0, number(&x, "noise: x")?))
    });
    engine.register_fn("noise", |seed: Dynamic, x: Dynamic| -> Result<f64, Box<EvalAltResult>> {
        Ok(noise(seed_of(&seed)?, number(&x, "noise: x")?))
    });
}

/// The seed of an int, a float or a text.
fn seed_of(v: &Dynamic) -> Result<u64, Box<EvalAltResult>> {
    if let Ok(n) = v.as_int() {
        return Ok(n as u64);
    }
    if let Ok(n) = v.as_float() {
        return Ok(n.to_bits());
    }
    match v.clone().into_string() {
        // FNV-1a, 64 bits.
        Ok(text) => Ok(text
            .bytes()
            .fold(0xcbf2_9ce4_8422_2325, |h, b| (h ^ u64::from(b)).wrapping_mul(0x100_0000_01b3))),
        Err(_) => {
            let error = crate::call::wrong(v, "rand: seed", "a number or text");
            Err(crate::errors::throw(error, crate::call::Place::default()))
        }
    }
}
