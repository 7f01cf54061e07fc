//! Resource limits of a script. Every limit has a name, and its error message states how to raise it.

use crate::suggest::{did_you_mean, list};

/// A mutable reference to a limit's value of either type.
enum LimitMut<'a> {
    Whole(&'a mut u64),
    Secs(&'a mut f64),
}

impl<'a> From<&'a mut u64> for LimitMut<'a> {
    fn from(value: &'a mut u64) -> LimitMut<'a> {
        LimitMut::Whole(value)
    }
}

impl<'a> From<&'a mut f64> for LimitMut<'a> {
    fn from(value: &'a mut f64) -> LimitMut<'a> {
        LimitMut::Secs(value)
    }
}

/// Declares the struct, its defaults and the table of names from one list.
macro_rules! limits {
    ($($name:ident: $kind:ty = $default:expr, $about:literal;)*) => {
        #[derive(Clone, Debug, PartialEq)]
        pub struct Limits {
            $(#[doc = $about] pub $name: $kind,)*
        }

        impl Default for Limits {
            fn default() -> Self {
                Limits { $($name: $default,)* }
            }
        }

        impl Limits {
            /// Name, default and description of every limit.
            pub const ALL: &[(&str, f64, &str)] = &[$((
                stringify!($name),
                {
                    // The number has the limit's own type: as an i32, 4 << 30 would be 0.
                    let default: $kind = $default;
                    default as f64
                },
                $about,
            ),)*];

            fn limit_mut(&mut self, name: &str) -> Option<LimitMut<'_>> {
                match name {
                    $(stringify!($name) => Some((&mut self.$name).into()),)*
                    _ => None,
                }
            }
        }
    };
}

limits! {
    operations: u64 = 20_000_000, "steps of the interpreter while the stage is built";
    frame_operations: u64 = 1_000_000, "steps of the interpreter in the on_frame callbacks of one frame, shared among them";
    call_levels: u64 = 48, "nested function calls; 64 at most";
    string: u64 = 1 << 20, "bytes of one text";
    array: u64 = 100_000, "elements of one array, with those of nested arrays";
    map: u64 = 10_000, "entries of one object map, with those of nested maps";
    variables: u64 = 1_000, "variables in scope at once";
    functions: u64 = 1_000, "functions that one script file defines";
    modules: u64 = 64, "files imported with import";
    seconds: f64 = 20.0, "seconds that the script itself takes, without the loading of files";
    frame_seconds: f64 = 5.0, "seconds that the on_frame callbacks of one frame take, shared among them";
    check_seconds: f64 = 120.0, "seconds that choreo check takes for all frames";
    render_seconds: f64 = 86_400.0, "seconds that a render takes";
    actors: u64 = 10_000, "actors";
    cameras: u64 = 1_000, "cameras";
    lights: u64 = 1_000, "lights";
    cues: u64 = 100_000, "cues, layers included";
    effects: u64 = 64, "effects over the image";
    callbacks: u64 = 100, "on_frame callbacks";
    things: u64 = 10_000, "cuts, parameters, shapes, and look_at targets of one actor, each";
    keys: u64 = 1_000_000, "keys of all .key(…) calls together";
    clip_keys: u64 = 20_000_000, "keys of all clips that the script makes from others, retargeted ones included";
    joints: u64 = 2_000_000, "joints of all actors together";
    instances: u64 = 1_000_000, "meshes of all actors together";
    vertices: u64 = 50_000_000, "vertices of all actors together";
    texels: u64 = 256 << 20, "pixels of all textures together, each image counted once";
    files: u64 = 1_000, "files loaded";
    file: u64 = 1 << 30, "bytes of one file";
    memory: u64 = 4 << 30, "bytes of memory that the program has in use (where the system reports it)";
    printed: u64 = 256 << 10, "bytes that print and debug write";
    frames: u64 = 1_000_000, "frames of the stage, and of each render";
    pixels: u64 = 64 << 20, "pixels of one image";
    output: u64 = 64 << 30, "bytes that a render writes";
}

impl Limits {
    /// Largest value of `call_levels`. Callbacks run on threads with 2 MiB of stack, which is ample for 48 levels of deeply
    /// nested expressions.
    pub const MAX_CALL_LEVELS: u64 = 64;

    /// The names that [`Limits::set`] knows.
    pub fn names() -> impl Iterator<Item = &'static str> + Clone {
        Limits::ALL.iter().map(|(name, ..)| *name)
    }

    /// Sets a limit from the command line, `operations=50000000`.
    pub fn set(&mut self, text: &str) -> Result<(), LimitError> {
        let (name, value) = text.split_once('=').ok_or_else(|| LimitError::Form(text.to_string()))?;
        let limit = self.limit_mut(name).ok_or_else(|| LimitError::Unknown { name: name.to_string() })?;
        let value_error = |kind| LimitError::Value { name: name.to_string(), kind, value: value.to_string() };
        match limit {
            LimitMut::Secs(limit) => {
                let parsed = value.parse().ok().filter(|v: &f64| *v > 0.0 && v.is_finite());
                *limit = parsed.ok_or_else(|| value_error("number"))?;
            }
            // Rhai reads 0 as "no limit", so 0 is not allowed.
            LimitMut::Whole(limit) => {
                let parsed = value.parse().ok().filter(|v| *v > 0);
                *limit = parsed.ok_or_else(|| value_error("whole number"))?;
            }
        }
        if self.call_levels > Self::MAX_CALL_LEVELS {
            self.call_levels = Self::MAX_CALL_LEVELS;
            return Err(LimitError::TooDeep);
        }
        Ok(())
    }

    /// All limits with their defaults, one per line, for `--help` and API.md.
    pub fn table() -> String {
        let width = Limits::names().map(str::len).max().unwrap_or(0);
        let row = |(name, default, about): &(&str, f64, &str)| {
            format!("  {name:width$}  {:>20}  {about}\n", Limits::shown(*default, about))
        };
        Limits::ALL.iter().map(row).collect()
    }

    /// A default as text: the number, after the same value in GiB, MiB or KiB if it is a whole number of bytes in that unit.
    pub fn shown(default: f64, about: &str) -> String {
        let units = [(30, "GiB"), (20, "MiB"), (10, "KiB")].map(|(bits, unit)| ((1u64 << bits) as f64, unit));
        match units.iter().find(|(size, _)| about.starts_with("bytes") && default % size == 0.0) {
            Some((size, unit)) => format!("{} {unit} = {default}", default / size),
            None => default.to_string(),
        }
    }
}

/// The error that a limit of the command line cannot be set.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LimitError {
    #[error("a limit is written NAME=NUMBER, not \"{0}\"")]
    Form(String),
    #[error(
        "unknown limit \"{name}\"{}; known limits: {}",
        did_you_mean(name, Limits::names()),
        list(Limits::names(), 100)
    )]
    Unknown { name: String },
    #[error("limit {name} takes a {kind} above 0, not \"{value}\"")]
    Value { name: String, kind: &'static str, value: String },
    #[error("limit call_levels can be raised to {} at most", Limits::MAX_CALL_LEVELS)]
    TooDeep,
}

/// Hint of the error that a limit was reached. `now`: the limit with its unit.
pub fn raise_hint(name: &str, now: impl std::fmt::Display) -> String {
    format!("the limit is {now}; raise it with --limit {name}=NUMBER if the script needs more")
}
