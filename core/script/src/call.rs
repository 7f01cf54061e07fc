//! One call of a script function: its definition as data, its arguments with checks, its errors.

use crate::build::{Build, Shared};
use crate::color;
use crate::suggest::{did_you_mean, list};
use crate::testing::ExpectRef;
use crate::value::*;
use choreo_motion::Time;
use choreo_stage::Target;
use glam::{DVec3, Vec3, Vec4};
use rhai::{Dynamic, Map};
use std::any::TypeId;
use std::sync::{Arc, MutexGuard, PoisonError};

/// A function or method of the script API. The tables of these are the API: registration, messages and API.md
/// are made from them.
pub struct Def {
    pub on: Kind,
    pub name: &'static str,
    /// Ways to call it, separated by `|`; arguments ending in `?` may be left out: `x, y, z | point`.
    pub args: &'static str,
    pub gives: Gives,
    /// One line.
    pub about: &'static str,
    /// Also inside `on_frame`.
    pub frame: bool,
    /// Only inside a test section.
    pub tests: bool,
    pub run: fn(&mut Call) -> Reply,
}

/// What a call returns: also what stands in for the result of one that failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Gives {
    Nothing,
    /// The receiver, for chaining.
    Itself,
    A(Kind),
    /// A number, text or list: nothing can stand in for it, so an error ends the script.
    Value(&'static str),
}

pub type Reply = Result<Dynamic, ApiError>;

impl Def {
    pub const fn new(
        on: Kind,
        name: &'static str,
        args: &'static str,
        gives: Gives,
        about: &'static str,
        run: fn(&mut Call) -> Reply,
    ) -> Def {
        Def { on, name, args, gives, about, frame: false, tests: false, run }
    }

    pub const fn in_frames(mut self) -> Def {
        self.frame = true;
        self
    }

    pub const fn in_tests(mut self) -> Def {
        self.tests = true;
        self
    }

    /// The ways to call it, as lists of argument names; optional ones are given in both forms.
    pub fn forms(&self) -> Vec<Vec<&'static str>> {
        let mut forms = Vec::new();
        for form in self.args.split('|') {
            let names: Vec<&str> = form.split(',').map(str::trim).filter(|n| !n.is_empty()).collect();
            let needed = names.iter().take_while(|n| !n.ends_with('?')).count();
            for count in needed..=names.len() {
                forms.push(names[..count].iter().map(|n| n.trim_end_matches('?')).collect());
            }
        }
        forms
    }

    /// `turn(degrees)`, `at(x, y, z) or at(point)`.
    pub fn usage(&self) -> String {
        let forms: Vec<String> =
            self.args.split('|').map(|form| format!("{}({})", self.name, form.trim())).collect();
        forms.join(" or ")
    }
}

/// Where in which script file.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Place {
    pub file: String,
    pub line: usize,
    pub column: usize,
}

/// An error in a call, before its place is known. Travels through the interpreter as a value.
#[derive(Clone, Debug, PartialEq)]
pub struct ApiError {
    pub message: String,
    pub hint: Option<String>,
    /// The string literal to point at, where one argument is to blame.
    pub focus: Option<String>,
    /// Follows from an error already noted: not shown.
    pub silent: bool,
    /// Ends the script at once, where going on would only repeat it.
    pub fatal: bool,
}

impl ApiError {
    pub fn new(message: impl Into<String>) -> ApiError {
        ApiError { message: message.into(), hint: None, focus: None, silent: false, fatal: false }
    }
    pub fn hint(mut self, hint: impl Into<String>) -> ApiError {
        self.hint = Some(hint.into());
        self
    }
    pub fn focus(mut self, literal: impl Into<String>) -> ApiError {
        self.focus = Some(literal.into());
        self
    }
}

impl From<String> for ApiError {
    fn from(message: String) -> ApiError {
        ApiError::new(message)
    }
}

/// `unknown WHAT "NAME"PLACE; did you mean "…"?`, with the known names as a hint.
pub fn unknown<'a>(
    what: &str,
    name: &str,
    place: &str,
    known: impl IntoIterator<Item = &'a str> + Clone,
) -> ApiError {
    let shown: String = name.chars().take(80).collect();
    let mut error =
        ApiError::new(format!("unknown {what} \"{shown}\"{place}{}", did_you_mean(name, known.clone())))
            .focus(name);
    let names = list(known, 24);
    error.hint =
        Some(if names.is_empty() { format!("there are no {what}s") } else { format!("known: {names}") });
    error
}

pub struct Call<'a, 'b> {
    pub shared: &'a Arc<Shared>,
    pub def: &'static Def,
    pub args: &'a mut [&'b mut Dynamic],
    pub place: Place,
    pub in_frame: bool,
    pub context: &'a rhai::NativeCallContext<'a>,
}

impl Call<'_, '_> {
    fn offset(&self) -> usize {
        usize::from(self.def.on != Kind::None)
    }

    /// Arguments without the receiver.
    pub fn len(&self) -> usize {
        self.args.len() - self.offset()
    }

    pub fn build(&self) -> MutexGuard<'_, Build> {
        self.shared.build.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub fn this<T: rhai::Variant + Clone>(&self) -> Result<T, ApiError> {
        self.args[0]
            .flatten_clone()
            .try_cast::<T>()
            .ok_or_else(|| ApiError::new(format!("{} is a method of {}", self.def.name, self.def.on.name())))
    }

    /// The receiver, to return for chaining.
    pub fn itself(&self) -> Reply {
        Ok(self.args[0].flatten_clone())
    }

    pub fn value(&self, i: usize) -> Dynamic {
        self.args[i + self.offset()].flatten_clone()
    }

    /// `turn: degrees`.
    pub fn label(&self, i: usize) -> String {
        let len = self.len();
        let name = self.def.forms().into_iter().find(|f| f.len() == len).and_then(|f| f.get(i).copied());
        format!("{}: {}", self.def.name, name.unwrap_or("argument"))
    }

    /// `turn: degrees must be ALLOWED, got …`.
    pub fn wrong(&self, i: usize, allowed: &str) -> ApiError {
        wrong(&self.value(i), &self.label(i), allowed)
    }

    pub fn number(&self, i: usize) -> Result<f64, ApiError> {
        number(&self.value(i), &self.label(i))
    }
    pub fn number_in(&self, i: usize, min: f64, max: f64) -> Result<f64, ApiError> {
        number_in(&self.value(i), &self.label(i), min, max)
    }
    /// On stage: inside `perform` times count from where it begins.
    pub fn time(&self, i: usize) -> Result<Time, ApiError> {
        self.stage_time(&self.value(i), &self.label(i))
    }
    pub fn stage_time(&self, value: &Dynamic, label: &str) -> Result<Time, ApiError> {
        Ok(time(value, label)? + self.build().offset)
    }
    pub fn duration(&self, i: usize) -> Result<Time, ApiError> {
        duration(&self.value(i), &self.label(i))
    }
    pub fn text(&self, i: usize) -> Result<String, ApiError> {
        text(&self.value(i), &self.label(i))
    }
    /// Of something on stage: of a length that messages and tables can show.
    pub fn name(&self, i: usize) -> Result<String, ApiError> {
        const MOST: usize = 200;
        let name = self.text(i)?;
        match name.chars().count() {
            count if count > MOST => Err(ApiError::new(format!(
                "{} must have at most {MOST} letters, this has {count}",
                self.label(i)
            ))),
            _ => Ok(name),
        }
    }
    pub fn color(&self, i: usize) -> Result<Vec4, ApiError> {
        color(&self.value(i), &self.label(i))
    }
    pub fn target(&self, i: usize) -> Result<Target, ApiError> {
        target(&self.value(i), &self.label(i))
    }

    /// A point from one array or three numbers, from argument `i` on.
    pub fn point(&self, i: usize) -> Result<DVec3, ApiError> {
        if self.len() >= i + 3 {
            let p = DVec3::new(self.number(i)?, self.number(i + 1)?, self.number(i + 2)?);
            return near(p, self.def.name);
        }
        point(&self.value(i), &self.label(i))
    }

    /// The option map at `i`, or an empty one where it was left out; unknown keys are an error.
    pub fn options(&self, i: usize, known: &[&str]) -> Result<Options, ApiError> {
        if i >= self.len() {
            return Ok(Options { function: self.def.name.to_string(), map: Map::new() });
        }
        let Some(map) = self.value(i).try_cast::<Map>() else {
            return Err(self.wrong(i, "an object map like #{ name: value }"));
        };
        let options = Options { function: self.def.name.to_string(), map };
        options.check(known)?;
        Ok(options)
    }
}

/// An object map of options whose keys have been checked.
pub struct Options {
    pub function: String,
    pub map: Map,
}

impl Options {
    pub fn check(&self, known: &[&str]) -> Result<(), ApiError> {
        match self.map.keys().find(|k| !known.contains(&k.as_str())) {
            None => Ok(()),
            Some(key) => Err(ApiError::new(format!(
                "{}: unknown option \"{key}\"{}",
                self.function,
                did_you_mean(key, known.iter().copied())
            ))
            .focus(key.to_string())
            .hint(format!("options: {}", list(known.iter().copied(), 30)))),
        }
    }
    pub fn get(&self, name: &str) -> Option<Dynamic> {
        self.map.get(name).map(Dynamic::flatten_clone)
    }
    pub fn label(&self, name: &str) -> String {
        format!("{}: {name}", self.function)
    }
    fn read<T>(
        &self,
        name: &str,
        reader: impl Fn(&Dynamic, &str) -> Result<T, ApiError>,
    ) -> Result<Option<T>, ApiError> {
        self.get(name).map(|v| reader(&v, &self.label(name))).transpose()
    }
    pub fn number(&self, name: &str) -> Result<Option<f64>, ApiError> {
        self.read(name, number)
    }
    pub fn number_in(&self, name: &str, min: f64, max: f64) -> Result<Option<f64>, ApiError> {
        self.read(name, |v, label| number_in(v, label, min, max))
    }
    pub fn duration(&self, name: &str) -> Result<Option<Time>, ApiError> {
        self.read(name, duration)
    }
    pub fn text(&self, name: &str) -> Result<Option<String>, ApiError> {
        self.read(name, text)
    }
    pub fn flag(&self, name: &str) -> Result<Option<bool>, ApiError> {
        self.read(name, |v, label| v.as_bool().map_err(|_| wrong(v, label, "true or false")))
    }
    pub fn color(&self, name: &str) -> Result<Option<Vec4>, ApiError> {
        self.read(name, color)
    }
    pub fn point(&self, name: &str) -> Result<Option<DVec3>, ApiError> {
        self.read(name, point)
    }
    pub fn target(&self, name: &str) -> Result<Option<Target>, ApiError> {
        self.read(name, target)
    }
    pub fn one_of(&self, name: &str, allowed: &[&'static str]) -> Result<Option<&'static str>, ApiError> {
        self.read(name, |v, label| one_of(v, label, allowed))
    }
}

pub fn one_of(v: &Dynamic, label: &str, allowed: &[&'static str]) -> Result<&'static str, ApiError> {
    let given = text(v, label)?;
    allowed.iter().find(|a| **a == given).copied().ok_or_else(|| {
        ApiError::new(format!(
            "{label} must be {}, got \"{given}\"{}",
            list(allowed.iter().copied(), 20),
            did_you_mean(&given, allowed.iter().copied())
        ))
        .focus(given)
    })
}

/// `LABEL must be ALLOWED, got …`.
pub fn wrong(v: &Dynamic, label: &str, allowed: &str) -> ApiError {
    let mut error = ApiError::new(format!("{label} must be {allowed}, got {}", describe(v)));
    error.focus = v.clone().into_string().ok();
    error
}

/// A value in a message.
pub fn describe(v: &Dynamic) -> String {
    let v = v.flatten_clone();
    if v.is_unit() {
        return "nothing, ()".into();
    }
    if let Ok(b) = v.as_bool() {
        return b.to_string();
    }
    if let Ok(n) = v.as_int() {
        return n.to_string();
    }
    if let Ok(n) = v.as_float() {
        return format!("{n:?}");
    }
    if v.is_string() {
        let s = v.into_string().unwrap_or_default();
        let shown: String = s.chars().take(40).collect();
        return format!("the text \"{shown}{}\"", if s.chars().count() > 40 { "…" } else { "" });
    }
    if let Some(a) = v.read_lock::<rhai::Array>() {
        let short = (1..=4).contains(&a.len()) && a.iter().all(|n| n.is_int() || n.is_float());
        let numbers = || a.iter().map(describe).collect::<Vec<_>>().join(", ");
        return if short { format!("[{}]", numbers()) } else { format!("an array of {}", a.len()) };
    }
    if v.is_map() {
        return "an object map".into();
    }
    if v.is_fnptr() {
        return "a function".into();
    }
    match kind_of(&v) {
        Kind::None => format!("a value of type {}", v.type_name()),
        k @ (Kind::Asset | Kind::Actor | Kind::Effect | Kind::Expect) => format!("an {}", k.name()),
        k => format!("a {}", k.name()),
    }
}

pub fn number(v: &Dynamic, label: &str) -> Result<f64, ApiError> {
    let n = match (v.as_int(), v.as_float()) {
        (Ok(n), _) => n as f64,
        (_, Ok(n)) => n,
        _ => return Err(wrong(v, label, "a number")),
    };
    if n.is_finite() {
        Ok(n)
    } else {
        Err(ApiError::new(format!("{label} must be a finite number, got {n}")))
    }
}

pub fn number_in(v: &Dynamic, label: &str, min: f64, max: f64) -> Result<f64, ApiError> {
    let n = number(v, label)?;
    if (min..=max).contains(&n) {
        return Ok(n);
    }
    Err(ApiError::new(format!("{label} must be from {min} to {max}, got {}", describe(v))))
}

/// ±1 000 000 s, 11 days: far from where integer time or f64 seconds lose anything.
const LONGEST_SECS: f64 = 1e6;

pub fn time(v: &Dynamic, label: &str) -> Result<Time, ApiError> {
    let secs = number(v, label).map_err(|e| match v.as_int().is_err() && v.as_float().is_err() {
        true => wrong(v, label, "a time: seconds, or f(frame)"),
        false => e,
    })?;
    if secs.abs() > LONGEST_SECS {
        return Err(ApiError::new(format!(
            "{label} must be a time within ±{LONGEST_SECS} s, got {}",
            describe(v)
        )));
    }
    Ok(Time::from_secs(secs))
}

pub fn duration(v: &Dynamic, label: &str) -> Result<Time, ApiError> {
    let t = time(v, label)?;
    if t < Time::ZERO {
        return Err(ApiError::new(format!("{label} must not be negative, got {}", describe(v))));
    }
    Ok(t)
}

pub fn text(v: &Dynamic, label: &str) -> Result<String, ApiError> {
    v.clone().into_string().map_err(|_| wrong(v, label, "text"))
}

pub fn numbers(v: &Dynamic) -> Option<Vec<f64>> {
    let array = v.read_lock::<rhai::Array>()?;
    array.iter().map(|n| number(n, "").ok()).collect()
}

/// Metres: as far as the middle of the galaxy would lose all sense, so a slip is refused.
const FARTHEST: f64 = 1e15;

pub fn point(v: &Dynamic, label: &str) -> Result<DVec3, ApiError> {
    match numbers(v).as_deref() {
        Some([x, y, z]) => near(DVec3::new(*x, *y, *z), label),
        _ => Err(wrong(v, label, "a point, [x, y, z]")),
    }
}

fn near(p: DVec3, label: &str) -> Result<DVec3, ApiError> {
    if p.abs().max_element() <= FARTHEST {
        return Ok(p);
    }
    Err(ApiError::new(format!("{label} must be within ±{FARTHEST:e} m")))
}

pub fn target(v: &Dynamic, label: &str) -> Result<Target, ApiError> {
    if let Some(actor) = v.read_lock::<ActorRef>() {
        return Ok(Target::Actor(actor.id));
    }
    if let Some(joint) = v.read_lock::<JointRef>() {
        return Ok(Target::Joint { actor: joint.actor, joint: joint.joint });
    }
    if !v.is_array() {
        return Err(wrong(v, label, "an Actor, a Joint or a point, [x, y, z]"));
    }
    point(v, label).map(Target::Point)
}

/// Linear RGBA from a name, `#rgb`, `#rrggbb`, `#rrggbbaa`, `[r, g, b]` or `[r, g, b, a]` in sRGB.
pub fn color(v: &Dynamic, label: &str) -> Result<Vec4, ApiError> {
    if v.is_string() {
        let name = text(v, label)?;
        return color::parse(&name).map_err(|what| {
            ApiError::new(format!("{label}: {what}"))
                .focus(name)
                .hint("a color is a CSS name, \"#rrggbb\" or [r, g, b] with numbers from 0 to 1")
        });
    }
    match numbers(v).as_deref() {
        Some(c @ ([_, _, _] | [_, _, _, _])) if c.iter().all(|c| (0.0..=1.0).contains(c)) => Ok(Vec4::new(
            color::linear(c[0]),
            color::linear(c[1]),
            color::linear(c[2]),
            c.get(3).map_or(1.0, |a| *a as f32),
        )),
        Some([_, _, _] | [_, _, _, _]) => {
            Err(ApiError::new(format!("{label}: the numbers of a color must be from 0 to 1")))
        }
        _ => Err(wrong(v, label, "a color: a name, \"#rrggbb\" or [r, g, b]")),
    }
}

pub fn rgb(c: Vec4) -> Vec3 {
    c.truncate()
}

pub fn kind_of(v: &Dynamic) -> Kind {
    let id = v.type_id();
    Kind::HANDLES.into_iter().find(|k| type_id(*k) == id).unwrap_or(Kind::None)
}

pub fn type_id(kind: Kind) -> TypeId {
    match kind {
        Kind::None => TypeId::of::<Dynamic>(),
        Kind::Asset => TypeId::of::<AssetRef>(),
        Kind::Clip => TypeId::of::<ClipRef>(),
        Kind::Actor => TypeId::of::<ActorRef>(),
        Kind::Joint => TypeId::of::<JointRef>(),
        Kind::Cue => TypeId::of::<CueRef>(),
        Kind::Look => TypeId::of::<LookRef>(),
        Kind::Goal => TypeId::of::<GoalRef>(),
        Kind::Camera => TypeId::of::<CameraRef>(),
        Kind::Light => TypeId::of::<LightRef>(),
        Kind::Effect => TypeId::of::<EffectRef>(),
        Kind::Expect => TypeId::of::<ExpectRef>(),
        Kind::Stage => TypeId::of::<StageRef>(),
        Kind::Plan => TypeId::of::<PlanRef>(),
        Kind::Scene => TypeId::of::<SceneRef>(),
    }
}

/// A handle made by a call that failed.
pub fn is_dead(v: &Dynamic) -> bool {
    match kind_of(v) {
        Kind::None => false,
        Kind::Asset => v.read_lock::<AssetRef>().is_some_and(|h| h.dead),
        Kind::Clip => v.read_lock::<ClipRef>().is_some_and(|h| h.dead),
        Kind::Actor => v.read_lock::<ActorRef>().is_some_and(|h| h.id == DEAD),
        Kind::Joint => v.read_lock::<JointRef>().is_some_and(|h| h.actor == DEAD),
        Kind::Cue => v.read_lock::<CueRef>().is_some_and(|h| h.0 == DEAD),
        Kind::Look => v.read_lock::<LookRef>().is_some_and(|h| h.actor == DEAD),
        Kind::Goal => v.read_lock::<GoalRef>().is_some_and(|h| h.actor == DEAD),
        Kind::Camera => v.read_lock::<CameraRef>().is_some_and(|h| h.0 == DEAD),
        Kind::Light => v.read_lock::<LightRef>().is_some_and(|h| h.0 == DEAD),
        Kind::Effect => v.read_lock::<EffectRef>().is_some_and(|h| h.0 == DEAD),
        Kind::Expect => v.read_lock::<ExpectRef>().is_some_and(|h| h.id == DEAD),
        Kind::Stage => v.read_lock::<StageRef>().is_some_and(|h| h.0 == DEAD),
        Kind::Plan => v.read_lock::<PlanRef>().is_some_and(|h| h.dead),
        Kind::Scene => v.read_lock::<SceneRef>().is_some_and(|h| h.0 == DEAD),
    }
}

/// Stands in for the result of a call that failed.
pub fn dead(kind: Kind) -> Dynamic {
    let asset = || Arc::new(choreo_stage::Asset::default());
    match kind {
        Kind::None => Dynamic::UNIT,
        Kind::Asset => Dynamic::from(AssetRef { asset: asset(), dead: true }),
        Kind::Clip => match choreo_motion::Clip::new(String::new(), 0, Vec::new()) {
            Ok(clip) => Dynamic::from(ClipRef { clip: Arc::new(clip), asset: asset(), dead: true }),
            Err(_) => Dynamic::UNIT,
        },
        Kind::Actor => Dynamic::from(ActorRef { id: DEAD, asset: asset() }),
        Kind::Joint => Dynamic::from(JointRef { actor: DEAD, joint: 0, asset: asset() }),
        Kind::Cue => Dynamic::from(CueRef(DEAD)),
        Kind::Look => Dynamic::from(LookRef { actor: DEAD, index: 0 }),
        Kind::Goal => Dynamic::from(GoalRef { actor: DEAD, index: 0 }),
        Kind::Camera => Dynamic::from(CameraRef(DEAD)),
        Kind::Light => Dynamic::from(LightRef(DEAD)),
        Kind::Effect => Dynamic::from(EffectRef(DEAD)),
        Kind::Expect => Dynamic::from(ExpectRef::dead()),
        Kind::Stage => Dynamic::from(StageRef(DEAD)),
        Kind::Plan => Dynamic::from(PlanRef { options: Default::default(), dead: true }),
        Kind::Scene => Dynamic::from(SceneRef(DEAD)),
    }
}
