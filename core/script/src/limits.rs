//! What a script may use up. Every limit has a name, and the message that it is reached says how to raise it.

use crate::suggest::{did_you_mean, list};

#[derive(Clone, Debug, PartialEq)]
pub struct Limits {
    /// Steps of the interpreter while the stage is built.
    pub operations: u64,
    /// Steps of the interpreter in one call of an `on_frame` callback.
    pub frame_operations: u64,
    /// Functions inside functions.
    pub call_levels: u64,
    /// Bytes of one string.
    pub string: u64,
    /// Elements of one array, those of arrays inside included.
    pub array: u64,
    /// Entries of one object map, those of maps inside included.
    pub map: u64,
    /// Variables in scope at once.
    pub variables: u64,
    /// Functions that one script file may define.
    pub functions: u64,
    /// Files imported with `import`.
    pub modules: u64,
    /// Seconds that the script itself may take, files being loaded not counted.
    pub seconds: f64,
    /// Actors, cameras, lights, cues, cuts, effects and callbacks, each.
    pub things: u64,
    /// Keys of all `.key(…)` calls together.
    pub keys: u64,
    /// Bytes of one file.
    pub file: u64,
    /// Bytes of the memory that the program may have in use while the script runs (where the system tells).
    pub memory: u64,
}

impl Default for Limits {
    fn default() -> Self {
        Limits {
            operations: 20_000_000,
            frame_operations: 1_000_000,
            call_levels: 48,
            string: 1 << 20,
            array: 100_000,
            map: 10_000,
            variables: 1_000,
            functions: 1_000,
            modules: 64,
            seconds: 20.0,
            things: 10_000,
            keys: 1_000_000,
            file: 1 << 30,
            memory: 4 << 30,
        }
    }
}

impl Limits {
    /// Most call levels: callbacks run on threads with 2 MiB of stack, which 48 levels of deeply nested expressions fit with room.
    pub const DEEPEST: u64 = 64;

    /// The names that [`Limits::set`] knows.
    pub const NAMES: &[&str] = &[
        "operations",
        "frame_operations",
        "call_levels",
        "string",
        "array",
        "map",
        "variables",
        "functions",
        "modules",
        "seconds",
        "things",
        "keys",
        "file",
        "memory",
    ];

    /// Sets a limit from the command line, `operations=50000000`. The error says what is allowed.
    pub fn set(&mut self, text: &str) -> Result<(), String> {
        let Some((name, value)) = text.split_once('=') else {
            return Err(format!("a limit is written NAME=NUMBER, not \"{text}\""));
        };
        if name == "seconds" {
            self.seconds = value
                .parse()
                .ok()
                .filter(|v: &f64| *v > 0.0 && v.is_finite())
                .ok_or_else(|| format!("limit seconds takes a number above 0, not \"{value}\""))?;
            return Ok(());
        }
        let Some(slot) = self.slot(name) else {
            return Err(format!(
                "unknown limit \"{name}\"{}; known limits: {}",
                did_you_mean(name, Self::NAMES.iter().copied()),
                list(Self::NAMES.iter().copied(), 20)
            ));
        };
        // Rhai reads 0 as "no limit", so it is not offered.
        *slot = value
            .parse()
            .ok()
            .filter(|v| *v > 0)
            .ok_or_else(|| format!("limit {name} takes a whole number above 0, not \"{value}\""))?;
        if self.call_levels > Self::DEEPEST {
            self.call_levels = Self::DEEPEST;
            return Err(format!("limit call_levels can be raised to {} at most", Self::DEEPEST));
        }
        Ok(())
    }

    fn slot(&mut self, name: &str) -> Option<&mut u64> {
        Some(match name {
            "operations" => &mut self.operations,
            "frame_operations" => &mut self.frame_operations,
            "call_levels" => &mut self.call_levels,
            "string" => &mut self.string,
            "array" => &mut self.array,
            "map" => &mut self.map,
            "variables" => &mut self.variables,
            "functions" => &mut self.functions,
            "modules" => &mut self.modules,
            "things" => &mut self.things,
            "keys" => &mut self.keys,
            "file" => &mut self.file,
            "memory" => &mut self.memory,
            _ => return None,
        })
    }
}

/// What to do when a limit is reached.
pub fn raise_hint(name: &str, now: impl std::fmt::Display) -> String {
    format!("the limit is {now}; raise it with --limit {name}=NUMBER if the script means it")
}
