//! The sandbox of an importer: no files, no clock, no modules; limits on steps, seconds and memory.

use crate::budget::{Budget, NativeError, native_error};
use crate::{bytes, numbers, quaternions};
use choreo_sandbox::SizeLimits;
use rhai::{Engine, OptimizationLevel};
use std::time::{Duration, Instant};

/// Maximum elements of a script's own array or map, nested ones included. Native `Numbers` are not script values and do not
/// count.
pub(crate) const MAX_ARRAY_LEN: usize = 1_000_000;

/// Maximum depth of nested calls.
pub(crate) const MAX_CALL_DEPTH: usize = 48;
/// Maximum bytes of a text.
pub(crate) const MAX_TEXT_BYTES: usize = 64 << 20;

/// Interpreter steps for one file, which take some seconds.
const MAX_STEPS: u64 = 50_000_000;
/// Steps that `manifest` may take.
const MAX_MANIFEST_STEPS: u64 = 10_000;
/// Time limit in seconds for a run that is still within its steps: generous, because a busy machine takes many times as long for
/// them.
const MAX_SECONDS: u64 = 60;

/// Makes the engine of one import or export. `steps`: step limit, `None` for the default.
pub(crate) fn build_engine(budget: &Budget, steps: Option<u64>) -> Engine {
    let mut engine = choreo_sandbox::engine();
    for name in ["eval", "sleep", "timestamp", "import", "export", "**"] {
        engine.disable_symbol(name);
    }
    // Function pointers can call functions whose names are disabled, so `sleep` is replaced, too.
    engine.register_fn("sleep", |_: i64| {});
    engine.register_fn("sleep", |_: f64| {});
    engine.set_optimization_level(OptimizationLevel::Simple);
    engine.set_fail_on_invalid_map_property(true);
    engine.set_max_call_levels(MAX_CALL_DEPTH);
    SizeLimits { string: MAX_TEXT_BYTES, array: MAX_ARRAY_LEN, map: MAX_ARRAY_LEN }.install(&mut engine);
    engine.set_max_variables(256);
    engine.set_max_functions(256);
    engine.set_max_modules(0);
    engine.on_print(|_| {});
    engine.on_debug(|_, _, _| {});
    let max_steps = steps.unwrap_or(MAX_STEPS);
    let end = Instant::now() + Duration::from_secs(MAX_SECONDS);
    engine.on_progress(move |steps| match steps {
        _ if steps > max_steps => {
            Some(format!("more than {max_steps} steps, which is the limit: is there an endless loop?").into())
        }
        // A single step may copy a large array, so the clock is read often.
        _ if steps & 0xff == 0 && Instant::now() > end => {
            Some(format!("longer than {MAX_SECONDS} seconds, which is the limit").into())
        }
        _ => None,
    });
    register_math(&mut engine);
    bytes::register_bytes(&mut engine);
    numbers::register_numbers(&mut engine, budget);
    quaternions::register_quaternions(&mut engine, budget);
    engine
}

/// The engine for `fn manifest()`, which runs for every listed file: fewer steps, small texts and arrays.
pub(crate) fn build_manifest_engine() -> Engine {
    let mut engine = build_engine(&Budget::for_file(0), Some(MAX_MANIFEST_STEPS));
    SizeLimits { string: 64 << 10, array: 1000, map: 1000 }.install(&mut engine);
    engine
}

/// Parses a whole text as one number. Spaces around it are allowed.
fn parse_number<T: std::str::FromStr>(name: &str, kind: &str, text: &str) -> Result<T, NativeError> {
    text.trim().parse().map_err(|_| parse_error(kind, name, text))
}

/// Parses a whole number in a radix of 2 to 36.
fn parse_radix(text: &str, radix: i64) -> Result<i64, NativeError> {
    let radix = u32::try_from(radix).ok().filter(|radix| (2..=36).contains(radix));
    let number = radix.and_then(|radix| i64::from_str_radix(text.trim(), radix).ok());
    number.ok_or_else(|| parse_error("whole number in this radix", "parse_int", text))
}

fn parse_error(kind: &str, name: &str, text: &str) -> NativeError {
    let shown: String = text.chars().take(40).collect();
    native_error(format!("{name}: \"{shown}\" is no {kind}"))
}

/// Registers mathematics from `libm`, so that an import gives the same bits on every machine.
fn register_math(engine: &mut Engine) {
    type UnaryFunction = (&'static str, fn(f64) -> f64);
    let unary: [UnaryFunction; 11] = [
        ("sin", libm::sin),
        ("cos", libm::cos),
        ("tan", libm::tan),
        ("asin", libm::asin),
        ("acos", libm::acos),
        ("atan", libm::atan),
        ("sqrt", libm::sqrt),
        ("floor", libm::floor),
        ("ceil", libm::ceil),
        ("round", libm::round),
        ("abs", libm::fabs),
    ];
    for (name, f) in unary {
        engine.register_fn(name, move |x: f64| f(x));
        if name != "abs" {
            engine.register_fn(name, move |x: i64| f(x as f64));
        }
    }
    engine.register_fn("atan2", libm::atan2);
    engine.register_fn("pow", libm::pow);
    engine.register_fn("to_float", |x: i64| x as f64);
    engine.register_fn("to_float", |x: f64| x);
    engine.register_fn("to_int", |x: f64| x as i64);
    engine.register_fn("parse_float", |text: &str| parse_number::<f64>("parse_float", "number", text));
    engine.register_fn("parse_int", |text: &str| parse_number::<i64>("parse_int", "whole number", text));
    engine.register_fn("parse_int", parse_radix);
    engine.register_fn("radians", |x: f64| x * (std::f64::consts::PI / 180.0));
    engine.register_fn("radians", |x: i64| x as f64 * (std::f64::consts::PI / 180.0));
}
