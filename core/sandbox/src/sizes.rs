//! Limits on the sizes of texts, arrays and object maps. They replace Rhai's own limits, which count all elements of a value
//! after each call that may change it, so that `push` in a loop takes quadratic time.
//!
//! The length of a value is checked whenever its variable is read, which happens before each growth. Functions that take a length
//! check it before they allocate. Elements of nested values are counted only after the memory of the process has grown by
//! [`COUNT_EVERY`], so that counting takes a small share of the time in which the memory was filled.

use crate::memory;
use rhai::{Array, Blob, Dynamic, Engine, EvalAltResult, ImmutableString, Position, Scope};
use std::sync::atomic::{AtomicU64, Ordering};

/// Growth of the process's memory in bytes after which the elements of all visible variables are counted.
const COUNT_EVERY: u64 = 64 << 20;

/// Maximum nesting of a value, because the count is recursive. Deeper values are refused when they are counted.
const MAX_NESTING: usize = 256;

/// Rhai's names of the limits in [`EvalAltResult::ErrorDataTooLarge`].
const STRING: &str = "Length of string";
const ARRAY: &str = "Size of array/BLOB";
const MAP: &str = "Size of object map";

type CheckResult<T> = Result<T, Box<EvalAltResult>>;

/// The largest sizes of one value, its nested values included.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SizeLimits {
    /// Bytes of texts.
    pub string: usize,
    /// Elements of arrays, bytes of blobs.
    pub array: usize,
    /// Entries of object maps.
    pub map: usize,
}

/// The sizes of one value.
#[derive(Clone, Copy, Default)]
struct Sizes {
    string: usize,
    array: usize,
    map: usize,
}

impl SizeLimits {
    /// Makes `engine` refuse larger values with [`EvalAltResult::ErrorDataTooLarge`], which scripts cannot catch. Replaces the
    /// `on_var` callback of the engine.
    pub fn install(self, engine: &mut Engine) {
        engine.set_max_string_size(0);
        engine.set_max_array_size(0);
        engine.set_max_map_size(0);
        let counted = AtomicU64::new(0);
        #[allow(deprecated, reason = "volatile, not deprecated, says Rhai")]
        engine.on_var(move |name, _, context| {
            let scope = context.scope();
            if let Some(value) = scope.get(name) {
                self.check(own_size(value))?;
            }
            self.count_after_growth(scope, &counted)?;
            Ok(None)
        });
        self.register_growing(engine);
    }

    fn check(self, size: Sizes) -> CheckResult<()> {
        let name = match size {
            _ if size.string > self.string => STRING,
            _ if size.array > self.array => ARRAY,
            _ if size.map > self.map => MAP,
            _ => return Ok(()),
        };
        Err(Box::new(EvalAltResult::ErrorDataTooLarge(name.into(), Position::NONE)))
    }

    fn count_after_growth(self, scope: &Scope<'_>, counted: &AtomicU64) -> CheckResult<()> {
        let (now, before) = (memory::in_use(), counted.load(Ordering::Relaxed));
        if now < before.saturating_add(COUNT_EVERY) {
            // The memory has shrunk, so growth is measured from the lower level.
            if now + COUNT_EVERY < before {
                counted.store(now, Ordering::Relaxed);
            }
            return Ok(());
        }
        counted.store(now, Ordering::Relaxed);
        for (_, _, value) in scope.iter_raw() {
            let mut sizes = Sizes::default();
            self.count(value, &mut sizes, 0)?;
        }
        Ok(())
    }

    fn count(self, value: &Dynamic, sizes: &mut Sizes, depth: usize) -> CheckResult<()> {
        let own = own_size(value);
        sizes.string = sizes.string.saturating_add(own.string);
        sizes.array = sizes.array.saturating_add(own.array);
        sizes.map = sizes.map.saturating_add(own.map);
        let nested = if depth < MAX_NESTING { Sizes::default() } else { Sizes { array: usize::MAX, ..own } };
        self.check(nested)?;
        self.check(*sizes)?;
        if let Ok(array) = value.as_array_ref() {
            array.iter().try_for_each(|value| self.count(value, sizes, depth + 1))?;
        } else if let Ok(map) = value.as_map_ref() {
            map.values().try_for_each(|value| self.count(value, sizes, depth + 1))?;
        }
        Ok(())
    }

    /// Replaces the functions of Rhai whose result can be many times as large as their arguments.
    fn register_growing(self, engine: &mut Engine) {
        engine.register_fn("pad", move |array: &mut Array, len: i64, item: Dynamic| {
            let len = usize::try_from(len).unwrap_or(0);
            if len > array.len() {
                let mut one = Sizes::default();
                self.count(&item, &mut one, 0)?;
                let copies = len - array.len();
                self.check(Sizes {
                    string: one.string.saturating_mul(copies),
                    array: one.array.saturating_mul(copies).saturating_add(len),
                    map: one.map.saturating_mul(copies),
                })?;
                array.resize(len, item);
            }
            Ok::<_, Box<EvalAltResult>>(())
        });
        engine.register_fn("pad", move |blob: &mut Blob, len: i64, byte: i64| {
            let len = self.check_blob_length(len)?;
            blob.resize(len.max(blob.len()), byte as u8);
            Ok::<_, Box<EvalAltResult>>(())
        });
        engine.register_fn("blob", move |len: i64| {
            Ok::<_, Box<EvalAltResult>>(vec![0_u8; self.check_blob_length(len)?])
        });
        engine.register_fn("blob", move |len: i64, byte: i64| {
            Ok::<_, Box<EvalAltResult>>(vec![byte as u8; self.check_blob_length(len)?])
        });
        engine.register_fn("pad", move |text: &mut ImmutableString, len: i64, with: char| {
            self.pad(text, len, with.encode_utf8(&mut [0; 4]))
        });
        engine.register_fn("pad", move |text: &mut ImmutableString, len: i64, with: &str| {
            self.pad(text, len, with)
        });
        engine.register_fn("replace", move |text: &mut ImmutableString, find: &str, with: &str| {
            self.replace(text, find, with)
        });
        engine.register_fn("replace", move |text: &mut ImmutableString, find: char, with: &str| {
            self.replace(text, find.encode_utf8(&mut [0; 4]), with)
        });
    }

    /// Checks the length of a blob to be made.
    fn check_blob_length(self, len: i64) -> CheckResult<usize> {
        let array = usize::try_from(len).unwrap_or(0);
        self.check(Sizes { array, ..Sizes::default() })?;
        Ok(array)
    }

    /// Appends `with` until the text has `len` characters, as Rhai's `pad` does: a longer `with` is cut off.
    fn pad(self, text: &mut ImmutableString, len: i64, with: &str) -> CheckResult<()> {
        let missing = usize::try_from(len).unwrap_or(0).saturating_sub(text.chars().count());
        let string = text.len().saturating_add(missing);
        self.check(Sizes { string, ..Sizes::default() })?;
        if missing > 0 && !with.is_empty() {
            let padding: String = with.chars().cycle().take(missing).collect();
            *text += padding;
        }
        Ok(())
    }

    fn replace(self, text: &mut ImmutableString, find: &str, with: &str) -> CheckResult<()> {
        let longer = with.len().saturating_sub(find.len());
        if longer > 0 {
            let string = longer.saturating_mul(text.matches(find).count()).saturating_add(text.len());
            self.check(Sizes { string, ..Sizes::default() })?;
        }
        *text = text.replace(find, with).into();
        Ok(())
    }
}

/// Sizes of a value without its nested values. A locked value, which a call is changing right now, counts as empty, because
/// waiting for the lock would never end.
fn own_size(value: &Dynamic) -> Sizes {
    if value.is_shared() && value.is_locked() {
        Sizes::default()
    } else if let Ok(array) = value.as_array_ref() {
        Sizes { array: array.len(), ..Sizes::default() }
    } else if let Ok(text) = value.as_immutable_string_ref() {
        Sizes { string: text.len(), ..Sizes::default() }
    } else if let Ok(map) = value.as_map_ref() {
        Sizes { map: map.len(), ..Sizes::default() }
    } else if let Ok(blob) = value.as_blob_ref() {
        Sizes { array: blob.len(), ..Sizes::default() }
    } else {
        Sizes::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: SizeLimits = SizeLimits { string: 1000, array: 1000, map: 100 };

    fn run(script: &str) -> Result<(), Box<EvalAltResult>> {
        let mut engine = Engine::new();
        LIMITS.install(&mut engine);
        // A limit that fails must not fill the memory.
        engine.set_max_operations(1_000_000);
        engine.run(script)
    }

    fn refused(script: &str) -> String {
        match run(script).map_err(|e| *e) {
            Err(EvalAltResult::ErrorDataTooLarge(what, _)) => what,
            other => panic!("{script}: {other:?}"),
        }
    }

    #[test]
    fn values_larger_than_the_limit_are_refused() {
        run("let a = []; for i in 0..1000 { a.push(i); } if a.len != 1000 { throw a.len }").unwrap();
        assert_eq!(refused("let a = []; loop { a.push(1); }"), ARRAY);
        assert_eq!(refused("let a = [1]; loop { a += a; }"), ARRAY);
        assert_eq!(refused("let s = \"x\"; loop { s += s; }"), STRING);
        assert_eq!(refused("let s = \"x\"; loop { s = `${s}${s}`; }"), STRING);
        assert_eq!(refused("let m = #{}; let i = 0; loop { m[`k${i}`] = 1; i += 1; }"), MAP);
        assert_eq!(refused("let b = blob(10); loop { b += b; }"), ARRAY);
        assert_eq!(refused("let a = [1]; try { loop { a += a; } } catch {}"), ARRAY);
    }

    #[test]
    fn lengths_are_checked_before_allocation() {
        for (script, what) in [
            ("let a = []; a.pad(1000000000000, 0)", ARRAY),
            ("let a = []; a.pad(600, [1, 2])", ARRAY),
            ("let b = blob(1000000000000)", ARRAY),
            ("let b = blob(1000000000000, 7)", ARRAY),
            ("let b = blob(1); b.pad(1000000000000, 7)", ARRAY),
            ("let s = \"\"; s.pad(1000000000000, 'x')", STRING),
            ("let s = \"\"; s.pad(1000000000000, \"xy\")", STRING),
            (
                "let s = \"aaaa\"; s.replace(\"a\", \"bbbbbbbbbb\"); s.pad(900, 'b'); s.replace('b', \"aa\")",
                STRING,
            ),
        ] {
            assert_eq!(refused(script), what, "{script}");
        }
    }

    /// The replaced functions return the same results as those of Rhai.
    #[test]
    fn replaced_functions_return_the_results_of_rhai() {
        for script in [
            "let s = \"hä\"; s.pad(7, \"xyz\"); s",
            "let s = \"hä\"; s.pad(1, \"xyz\"); s",
            "let s = \"hä\"; s.pad(-1, 'x'); s",
            "let s = \"hä\"; s.pad(5, 'ö'); s",
            "let s = \"hä hä\"; s.replace(\"ä\", \"\"); s",
            "let s = \"hä hä\"; s.replace('h', \"--\"); s",
            "let s = \"hä hä\"; s.replace(\"\", \"-\"); s",
            "let a = [1]; a.pad(3, \"x\"); `${a}`",
            "let a = [1, 2]; a.pad(-3, 0); `${a}`",
            "`${blob(3)} ${blob(2, 300)} ${blob(-1)}`",
            "let b = blob(1); b.pad(3, 258); `${b}`",
        ] {
            let mut limited = Engine::new();
            LIMITS.install(&mut limited);
            let own: String = limited.eval(script).unwrap_or_else(|e| panic!("{script}: {e}"));
            let theirs: String = Engine::new().eval(script).unwrap_or_else(|e| panic!("{script}: {e}"));
            assert_eq!(own, theirs, "{script}");
        }
    }

    /// Values inside values are counted once the program has taken memory.
    #[test]
    fn nested_values_are_counted_when_memory_grows() {
        if memory::in_use() == 0 {
            println!("SKIP 1: this system does not report how much memory is in use");
            return;
        }
        assert_eq!(refused("let a = [1, 2, 3, 4]; loop { a = [a, a, a, a]; }"), ARRAY);
        assert_eq!(refused("let m = #{ a: 1 }; loop { m = #{ a: m, b: m, c: m }; }"), MAP);
    }
}
