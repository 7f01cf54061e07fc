//! The sandbox: a Rhai engine with the script API and all limits, without functions that wait or read the clock.

use crate::api;
use crate::api_error::{ApiError, Place};
use crate::build::ScriptContext;
use crate::call::{Call, Function};
use crate::compile::{FORBIDDEN_NAMES, PARSE_TIMEOUT, is_forbidden, scope_with_constants};
use crate::def::{Def, ResultType};
use crate::diagnostic::Severity;
use crate::errors::{Thrown, throw};
use crate::frame_callback;
use crate::limits::Limits;
use crate::modules::Modules;
use crate::synonyms::ALIASES;
use crate::value::{ExpectRef, HandleKind, dead, is_dead, register_types};
use choreo_sandbox::{SizeLimits, memory};
use rhai::packages::{BasicBlobPackage, Package};
use rhai::{Dynamic, Engine, EvalAltResult, LexError, NativeCallContext, Token};
use std::any::TypeId;
use std::collections::BTreeSet;
use std::sync::Arc;
use std::sync::atomic::{AtomicU8, AtomicU32, Ordering};

/// Makes the engine of one run, with the script API and the limits of `context`.
pub(crate) fn make_engine(context: &Arc<ScriptContext>) -> Engine {
    let mut engine = choreo_sandbox::engine();
    engine.register_global_module(BasicBlobPackage::new().as_shared_module());
    let mut globals = rhai::Module::new();
    for (name, _, value) in scope_with_constants().iter() {
        globals.set_var(name, value);
    }
    engine.register_global_module(globals.into());
    set_limits(&mut engine, context);
    capture_output(&mut engine, context);
    adapt_tokens(&mut engine, context);
    engine.set_module_resolver(Modules::new(context.clone()));
    register_types(&mut engine);
    api::maths::register(&mut engine);
    for function in api::functions() {
        register(&mut engine, context, function.def.name, function);
        for (alias, _) in ALIASES.iter().filter(|(_, name)| *name == function.def.full_name()) {
            register(&mut engine, context, alias, function);
        }
    }
    engine
}

/// Disables forbidden functions and sets all limits.
fn set_limits(engine: &mut Engine, context: &Arc<ScriptContext>) {
    let limits = &context.limits;
    for (name, _) in FORBIDDEN_NAMES {
        engine.disable_symbol(*name);
    }
    // Function pointers can call functions whose names are disabled, as in `Fn("sleep").call(9e9)`.
    let refuse = |name: &str| throw(crate::errors::forbidden_name_error(name), Place::default());
    engine.register_fn("sleep", move |_: i64| -> Result<(), Box<EvalAltResult>> { Err(refuse("sleep")) });
    engine.register_fn("sleep", move |_: f64| -> Result<(), Box<EvalAltResult>> { Err(refuse("sleep")) });
    engine.set_strict_variables(true);
    engine.set_allow_shadowing(true);
    let size = |n: u64| usize::try_from(n).unwrap_or(usize::MAX);
    // Steps are counted by `on_progress`, which distinguishes callbacks of a frame from the script itself.
    engine.set_max_operations(0);
    engine.set_max_call_levels(size(limits.call_levels.min(Limits::MAX_CALL_LEVELS)));
    SizeLimits { string: size(limits.string), array: size(limits.array), map: size(limits.map) }
        .install(engine);
    engine.set_max_variables(size(limits.variables));
    engine.set_max_functions(size(limits.functions));
    engine.set_max_modules(size(limits.modules));
    let watched = Arc::downgrade(context);
    let (operations, memory) = (limits.operations, limits.memory);
    engine.on_progress(move |steps| {
        if memory::in_use() > memory {
            return Some("memory".into());
        }
        if frame_callback::in_frame() {
            return frame_callback::exceeded_limit(steps).map(Into::into);
        }
        if steps > operations {
            return Some("operations".into());
        }
        // A single step may copy a large array, so the clock is read often.
        if steps & 0x3f != 0 {
            return None;
        }
        watched.upgrade().and_then(|context| context.exceeded_time_limit()).map(Into::into)
    });
}

/// Collects the lines of `print` and `debug` in the stage draft.
fn capture_output(engine: &mut Engine, context: &Arc<ScriptContext>) {
    // Lines beyond the limit are only counted, so that a loop that prints cannot fill the memory.
    let keep = |context: &std::sync::Weak<ScriptContext>, line: String| {
        if let Some(context) = context.upgrade() {
            let mut stage_draft =
                context.stage_draft.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
            stage_draft.print(&line, context.limits.printed);
        }
    };
    let weak = Arc::downgrade(context);
    engine.on_print(move |text| keep(&weak, text.to_string()));
    let weak = Arc::downgrade(context);
    engine.on_debug(move |text, file, at| {
        let line = at.line().unwrap_or(0);
        keep(&weak, format!("{}:{line}: {text}", file.unwrap_or("")));
    });
}

/// Adapts the tokenizer: keywords of Rhai after a dot are method names (`.loop()`, `.until(3.0)`), and `until` can be a key of an
/// object map. Past the time limit every token is an error, because Rhai takes quadratic time to parse a file with many
/// variables.
fn adapt_tokens(engine: &mut Engine, context: &Arc<ScriptContext>) {
    // The kinds of the previous token.
    const OTHER: u8 = 0;
    const DOT: u8 = 1;
    // A comma, or the start of an object map.
    const LIST: u8 = 2;
    // A keyword that became a name. Rhai reads a minus after it as a sign, as after keywords.
    const RENAMED: u8 = 3;
    let previous = AtomicU8::new(OTHER);
    let watched = Arc::downgrade(context);
    let count = AtomicU32::new(0);
    #[allow(deprecated, reason = "volatile, not deprecated, says Rhai")]
    engine.on_parse_token(move |token, at, _| {
        if let Some(context) = watched.upgrade() {
            let here = (at.line().unwrap_or(0), at.position().unwrap_or(0));
            *context.last_token.lock().unwrap_or_else(std::sync::PoisonError::into_inner) = here;
        }
        if count.fetch_add(1, Ordering::Relaxed) & 0x3f == 0x3f
            && watched.upgrade().is_some_and(|context| context.exceeded_time_limit().is_some())
        {
            return Token::LexError(Box::new(rhai::LexError::Runtime(PARSE_TIMEOUT.into())));
        }
        let current = match token {
            Token::Period | Token::Elvis => DOT,
            Token::MapStart | Token::Comma => LIST,
            _ => OTHER,
        };
        let before = previous.swap(current, Ordering::Relaxed);
        let as_name = |word: &str| {
            previous.store(RENAMED, Ordering::Relaxed);
            Token::Identifier(Box::new(word.into()))
        };
        if before == RENAMED {
            return match token {
                Token::UnaryMinus => Token::Minus,
                Token::UnaryPlus => Token::Plus,
                Token::IntegerConstant(number) if number < 0 => missing_space_error(),
                Token::FloatConstant(number) if number.0.is_sign_negative() => missing_space_error(),
                token => token,
            };
        }
        // The keyword `until` only ends a `do { … }`, so after a comma the word is a key: `#{ fade: 0.4, until: 3.0 }`.
        if before == LIST && token == Token::Until {
            return as_name("until");
        }
        if before != DOT {
            return token;
        }
        let word = match &token {
            Token::Reserved(word) => word.to_string(),
            Token::LexError(error) => match &**error {
                LexError::ImproperSymbol(word, _) => word.clone(),
                _ => return token,
            },
            // Only standard keywords are renamed: `call` and other keyword functions keep their meaning.
            token if token.is_standard_keyword() => token.literal_syntax().to_string(),
            _ => return token,
        };
        let is_method = api::defs().iter().any(|def| def.on != HandleKind::None && def.name == word);
        // Forbidden functions count as names, too; otherwise the parser would report the dot.
        let is_name = is_method || is_forbidden(&word);
        if is_name { as_name(&word) } else { token }
    });
}

/// The error about a minus and a number that the tokenizer has read as one negative number, which cannot be split here.
fn missing_space_error() -> Token {
    let text = "write a space between the minus and the number: after this name, a keyword of Rhai, they are read as one number";
    Token::LexError(Box::new(LexError::Runtime(text.into())))
}

/// Registers a function of the API under a name, once for each number of arguments.
fn register(engine: &mut Engine, context: &Arc<ScriptContext>, name: &str, function: &'static Function) {
    let def = &function.def;
    let counts: BTreeSet<usize> = def.forms().iter().map(Vec::len).collect();
    for count in counts {
        let mut types = Vec::new();
        if def.on != HandleKind::None {
            types.push(def.on.type_id());
        }
        types.extend(std::iter::repeat_n(TypeId::of::<Dynamic>(), count));
        // A weak reference, because callbacks on the stage keep both the engine and `context` alive.
        let context = Arc::downgrade(context);
        engine.register_raw_fn(name, types, move |native_context, args| match context.upgrade() {
            Some(context) => call_function(&context, function, &native_context, args),
            None => Ok(Dynamic::UNIT),
        });
    }
}

/// Runs a function of the API. While the stage is built, an error is reported and replaced by a placeholder, so that the script
/// goes on; other errors are thrown.
fn call_function(
    context: &Arc<ScriptContext>,
    Function { def, run }: &'static Function,
    native_context: &NativeCallContext,
    args: &mut [&mut Dynamic],
) -> Result<Dynamic, Box<EvalAltResult>> {
    let at = native_context.call_position();
    let place = Place {
        file: native_context.call_source().unwrap_or_default().to_string(),
        line: at.line().unwrap_or(0),
        column: at.position().unwrap_or(0),
    };
    let in_frame = frame_callback::in_frame();
    if in_frame && !def.is_for_frames {
        return Err(throw(error_in_frame(def), place));
    }
    let placeholder = match def.returns {
        ResultType::Nothing => Some(Dynamic::UNIT),
        ResultType::Receiver => Some(args[0].flatten_clone()),
        ResultType::Handle(kind) => Some(dead(kind)),
        ResultType::Value(_) => None,
    };
    if !in_frame && args.iter().any(|a| is_dead(a)) {
        return placeholder.ok_or_else(|| throw(ApiError::silent(), place));
    }
    if def.is_for_tests && !in_frame && !context.test().is_running {
        let error = ApiError::new(format!("{} can be used in test sections only", def.name))
            .hint("a section is test(\"name\", || { … }); choreo test runs it");
        return match placeholder {
            Some(value) => {
                context.add_diagnostic(Severity::Error, &place, &error);
                Ok(value)
            }
            None => Err(throw(error, place)),
        };
    }
    let mut call = Call { context, def, args, place: place.clone(), in_frame, native_context };
    match run(&mut call) {
        Ok(value) => Ok(value),
        Err(error) => match placeholder {
            Some(value) if !in_frame && !error.fatal => {
                context.add_diagnostic(Severity::Error, &place, &error);
                if let Some(expect) = args.first().and_then(|of| of.read_lock::<ExpectRef>()) {
                    context.test().count_comparison(expect.id);
                }
                Ok(value)
            }
            // The script cannot catch an error that ends it.
            _ if error.fatal => {
                Err(Box::new(EvalAltResult::ErrorTerminated(Dynamic::from(Thrown { error, place }), at)))
            }
            _ => Err(Box::new(EvalAltResult::ErrorRuntime(Dynamic::from(Thrown { error, place }), at))),
        },
    }
}

/// The error that a function cannot be used inside `on_frame`.
fn error_in_frame(def: &Def) -> ApiError {
    let error = ApiError::new(format!("{} cannot be used inside on_frame", def.full_name()));
    if def.is_for_tests {
        return error.hint("it is for test sections: test(\"name\", || { … })");
    }
    let allowed =
        api::defs().iter().filter(|d| d.on == def.on && d.is_for_frames && d.on != HandleKind::None);
    let allowed: Vec<&str> = allowed.map(|d| d.name).collect();
    error.hint(match allowed.as_slice() {
        [] => "it builds the stage and is called once; call it before on_frame".to_string(),
        names => format!(
            "it builds the stage and is called once; in on_frame, {} has: {}",
            def.on.name(),
            names.join(", ")
        ),
    })
}
