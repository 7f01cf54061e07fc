//! One call of a script function: reads and checks its arguments, and makes its errors.

pub(crate) mod fields;
mod read;

use read::check_coordinates;
pub(crate) use read::{
    color, describe, duration, euler, int_or_float, number, number_in, numbers, one_of, point, radians, rgb,
    target, text, texts, time, wrong,
};

pub(crate) use crate::api_error::{ApiError, Place};
use crate::build::{ScriptContext, StageDraft};
use crate::def::Def;
use crate::suggest::{closest, did_you_mean, list};
use crate::synonyms;
use crate::value::{AssetRef, HandleKind};
use choreo_asset::Asset;
use choreo_motion::Time;
use choreo_stage::Target;
use glam::{DVec3, Vec4};
use rhai::{Dynamic, Map};
use std::sync::{Arc, MutexGuard, PoisonError};

/// Declares the functions and methods of a module as `DEFS`:
///
/// ```text
/// /// Sets the position in metres.
/// Camera.at("x, y, z | point") = at, in_frames;
/// /// Makes a camera.
/// camera("name") -> Camera = camera;
/// /// Returns the start time.
/// Cue.start("") -> "float" = start;
/// ```
/// A method without an arrow returns its receiver; `-> ()` returns nothing, and a text is the type of a plain value. The
/// documentation begins with what the function does; each paragraph that begins with `- ` describes a group of options or one
/// aspect.
macro_rules! api {
    ($($(#[doc = $doc:literal])+ $on:ident $(. $name:ident)? ($args:literal) $(-> $returns:tt)? = $run:expr $(, $mark:ident $(($mark_arg:expr))?)*;)*) => {
        pub(crate) const DEFS: &[$crate::call::Function] = &[$($crate::call::Function {
            def: $crate::call::api!(@def $on $($name)?, $crate::def::Def {
                on: $crate::value::HandleKind::None,
                name: "",
                args: $args,
                returns: $crate::call::api!(@returns $($returns)?),
                doc: &[$($doc),+],
                is_for_frames: false,
                is_for_tests: false,
                options: None,
            })$(.$mark($($mark_arg)?))*,
            run: $run,
        }),*];
    };
    (@def $name:ident, $def:expr) => { $crate::def::Def { name: stringify!($name), ..$def } };
    (@def $on:ident $name:ident, $def:expr) => {
        $crate::def::Def { on: $crate::value::HandleKind::$on, name: stringify!($name), ..$def }
    };
    (@returns) => { $crate::def::ResultType::Receiver };
    (@returns ()) => { $crate::def::ResultType::Nothing };
    (@returns $value:literal) => { $crate::def::ResultType::Value($value) };
    (@returns $kind:ident) => { $crate::def::ResultType::Handle($crate::value::HandleKind::$kind) };
}
pub(crate) use api;

/// A function or method of scripts: its description and its implementation.
pub(crate) struct Function {
    pub def: Def,
    pub run: fn(&mut Call) -> Reply,
}

pub(crate) type Reply = Result<Dynamic, ApiError>;

/// The text `; did you mean "bloom"?` for the synonym `glow` and the misspelling `blom`; empty without a suggestion.
fn did_you_mean_text<'a>(name: &str, known: impl IntoIterator<Item = &'a str> + Clone) -> String {
    match synonyms::suggest_value(name, known.clone()) {
        Some(known) => format!("; did you mean \"{known}\"?"),
        None => did_you_mean(name, known),
    }
}

/// The error `unknown WHAT "NAME"PLACE; did you mean "…"?`, with the known names as a hint.
pub(crate) fn unknown<'a>(
    what: &str,
    name: &str,
    place: &str,
    known: impl IntoIterator<Item = &'a str> + Clone,
) -> ApiError {
    unknown_of(what, name, place, known.clone(), known)
}

/// [`unknown`] that suggests any accepted name of `taken`; the hint lists `known`.
pub(crate) fn unknown_of<'a>(
    what: &str,
    name: &str,
    place: &str,
    known: impl IntoIterator<Item = &'a str>,
    taken: impl IntoIterator<Item = &'a str> + Clone,
) -> ApiError {
    let shown: String = name.chars().take(80).collect();
    let meant = did_you_mean_text(name, taken);
    let mut error = ApiError::new(format!("unknown {what} \"{shown}\"{place}{meant}")).focus(name);
    let names = list(known, 24);
    error.hint =
        Some(if names.is_empty() { format!("there are no {what}s") } else { format!("known: {names}") });
    error
}

/// A call in progress: the called function, its arguments (the receiver first), and its place in the script.
pub(crate) struct Call<'a, 'b> {
    pub context: &'a Arc<ScriptContext>,
    pub def: &'static Def,
    pub args: &'a mut [&'b mut Dynamic],
    pub place: Place,
    pub in_frame: bool,
    pub native_context: &'a rhai::NativeCallContext<'a>,
}

impl Call<'_, '_> {
    fn offset(&self) -> usize {
        usize::from(self.def.on != HandleKind::None)
    }

    /// Number of arguments without the receiver.
    pub(crate) fn len(&self) -> usize {
        self.args.len() - self.offset()
    }

    /// Locks the stage draft. Drop the guard before calling anything that locks it, too.
    pub(crate) fn stage_draft(&self) -> MutexGuard<'_, StageDraft> {
        self.context.stage_draft.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The receiver. Error: it has another type than `T`.
    pub(crate) fn this<T: rhai::Variant + Clone>(&self) -> Result<T, ApiError> {
        self.args[0]
            .flatten_clone()
            .try_cast::<T>()
            .ok_or_else(|| ApiError::new(format!("{} is a method of {}", self.def.name, self.def.on.name())))
    }

    /// The asset of the receiver. Waits while it is still being imported.
    pub(crate) fn this_asset(&self) -> Result<Arc<Asset>, ApiError> {
        self.context.asset(&self.this::<AssetRef>()?.load)
    }

    /// The receiver, to return for chaining.
    pub(crate) fn receiver(&self) -> Reply {
        Ok(self.args[0].flatten_clone())
    }

    /// Argument `i`, the receiver not counted.
    pub(crate) fn value(&self, i: usize) -> Dynamic {
        self.args[i + self.offset()].flatten_clone()
    }

    /// The label of an argument in messages, such as `turn: degrees`.
    pub(crate) fn label(&self, i: usize) -> String {
        let len = self.len();
        let name = self.def.forms().into_iter().find(|f| f.len() == len).and_then(|f| f.get(i).copied());
        format!("{}: {}", self.def.name, name.unwrap_or("argument"))
    }

    /// The error `turn: degrees must be ALLOWED, got …` about argument `i`.
    pub(crate) fn wrong(&self, i: usize, allowed: &str) -> ApiError {
        wrong(&self.value(i), &self.label(i), allowed)
    }

    pub(crate) fn number(&self, i: usize) -> Result<f64, ApiError> {
        number(&self.value(i), &self.label(i))
    }
    pub(crate) fn number_in(&self, i: usize, min: f64, max: f64) -> Result<f64, ApiError> {
        number_in(&self.value(i), &self.label(i), min, max)
    }
    /// The argument as a stage time: inside `perform`, times count from its start.
    pub(crate) fn time(&self, i: usize) -> Result<Time, ApiError> {
        self.stage_time(&self.value(i), &self.label(i))
    }
    pub(crate) fn stage_time(&self, value: &Dynamic, label: &str) -> Result<Time, ApiError> {
        Ok(time(value, label)? + self.stage_draft().sequence_start)
    }
    pub(crate) fn duration(&self, i: usize) -> Result<Time, ApiError> {
        duration(&self.value(i), &self.label(i))
    }
    pub(crate) fn text(&self, i: usize) -> Result<String, ApiError> {
        text(&self.value(i), &self.label(i))
    }
    /// The argument as a name of something on stage, short enough for messages and tables.
    pub(crate) fn name(&self, i: usize) -> Result<String, ApiError> {
        const MOST: usize = 200;
        let name = self.text(i)?;
        match name.chars().count() {
            count if count > MOST => Err(ApiError::new(format!(
                "{} must have at most {MOST} characters, this has {count}",
                self.label(i)
            ))),
            _ => Ok(name),
        }
    }
    pub(crate) fn color(&self, i: usize) -> Result<Vec4, ApiError> {
        color(&self.value(i), &self.label(i))
    }
    pub(crate) fn target(&self, i: usize) -> Result<Target, ApiError> {
        target(&self.value(i), &self.label(i))
    }

    /// A point from one array or three numbers, from argument `i` on.
    pub(crate) fn point(&self, i: usize) -> Result<DVec3, ApiError> {
        if self.len() >= i + 3 {
            let p = DVec3::new(self.number(i)?, self.number(i + 1)?, self.number(i + 2)?);
            return check_coordinates(p, self.def.name);
        }
        point(&self.value(i), &self.label(i))
    }

    /// The option map in argument `i`, empty if left out. Unknown keys are an error.
    pub(crate) fn options(&self, i: usize, known: &[&str]) -> Result<Options, ApiError> {
        if i >= self.len() {
            return Ok(Options { function: self.def.name.to_string(), map: Map::new() });
        }
        let Some(map) = self.value(i).try_cast::<Map>() else {
            return Err(self.wrong(i, "an object map like #{ name: value }"));
        };
        let mut options = Options { function: self.def.name.to_string(), map };
        options.rename_aliases()?;
        options.check(self, known)?;
        Ok(options)
    }
}

/// An object map of options whose keys have been checked.
pub(crate) struct Options {
    pub function: String,
    pub map: Map,
}

impl Options {
    /// Renames options that are written by an alias.
    fn rename_aliases(&mut self) -> Result<(), ApiError> {
        let option = |text: &'static str| text.strip_prefix(&*self.function)?.strip_prefix(": ");
        let aliases =
            synonyms::ALIASES.iter().filter_map(|(alias, name)| Some((option(alias)?, option(name)?)));
        for (alias, name) in aliases {
            let Some(value) = self.map.remove(alias) else { continue };
            if self.map.insert(name.into(), value).is_some() {
                let what = format!("{}: {alias} is another name of {name}: give one of them", self.function);
                return Err(ApiError::new(what).focus(alias));
            }
        }
        Ok(())
    }
    /// Error: the map has a key that is not in `known`.
    pub(crate) fn check(&self, c: &Call, known: &[&str]) -> Result<(), ApiError> {
        let Some(key) = self.map.keys().find(|k| !known.contains(&k.as_str())) else { return Ok(()) };
        let options = format!("options: {}", list(known.iter().copied(), 30));
        let near = closest(key, known.iter().copied());
        let synonym = synonyms::suggest_option(c.context.defs, key, &self.function, known);
        let (meant, hint) = match (near, synonym) {
            (_, Some(synonym)) if known.contains(&&*synonym.name) || near.is_none() => {
                (Some(synonym.name), format!("{}\n{options}", synonym.hint).trim_start().to_string())
            }
            (near, _) => (near.map(str::to_string), options),
        };
        let meant = meant.map(|name| format!("; did you mean \"{name}\"?")).unwrap_or_default();
        let what = format!("{}: unknown option \"{key}\"{meant}", self.function);
        Err(ApiError::new(what).focus(key.to_string()).hint(hint))
    }
    /// Value of an option, if it is given.
    pub(crate) fn get(&self, name: &str) -> Option<Dynamic> {
        self.map.get(name).map(Dynamic::flatten_clone)
    }
    /// Label of an option in messages, such as `sun: color`.
    pub(crate) fn label(&self, name: &str) -> String {
        format!("{}: {name}", self.function)
    }
    /// Converts the value of an option by `reader`, which gets value and label; `None` if it is not given.
    pub(crate) fn read<T>(
        &self,
        name: &str,
        reader: impl Fn(&Dynamic, &str) -> Result<T, ApiError>,
    ) -> Result<Option<T>, ApiError> {
        self.get(name).map(|v| reader(&v, &self.label(name))).transpose()
    }
    pub(crate) fn number(&self, name: &str) -> Result<Option<f64>, ApiError> {
        self.read(name, number)
    }
    pub(crate) fn number_in(&self, name: &str, min: f64, max: f64) -> Result<Option<f64>, ApiError> {
        self.read(name, |v, label| number_in(v, label, min, max))
    }
    pub(crate) fn duration(&self, name: &str) -> Result<Option<Time>, ApiError> {
        self.read(name, duration)
    }
    pub(crate) fn text(&self, name: &str) -> Result<Option<String>, ApiError> {
        self.read(name, text)
    }
    pub(crate) fn flag(&self, name: &str) -> Result<Option<bool>, ApiError> {
        self.read(name, |v, label| v.as_bool().map_err(|_| wrong(v, label, "true or false")))
    }
    pub(crate) fn color(&self, name: &str) -> Result<Option<Vec4>, ApiError> {
        self.read(name, color)
    }
    pub(crate) fn point(&self, name: &str) -> Result<Option<DVec3>, ApiError> {
        self.read(name, point)
    }
    pub(crate) fn target(&self, name: &str) -> Result<Option<Target>, ApiError> {
        self.read(name, target)
    }
    pub(crate) fn one_of(
        &self,
        name: &str,
        allowed: &[&'static str],
    ) -> Result<Option<&'static str>, ApiError> {
        self.read(name, |v, label| one_of(v, label, allowed))
    }
}
