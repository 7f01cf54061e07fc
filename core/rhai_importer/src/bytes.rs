//! The bytes of a file as the script sees them: checked reads of single numbers and of whole arrays.

use crate::budget::{Budget, Refused, refuse};
use crate::engine::MOST_IN_ARRAY;
use crate::lines::{self, Lines};
use crate::numbers::{self, Numbers};
use choreo_plugin::suggest::{did_you_mean, list};
use rhai::{Array, Dynamic, Engine, ImmutableString, Map};
use std::ops::Range;
use std::sync::Arc;

/// A file or a part of one. Numbers are little-endian, or big-endian where [`Bytes::big`] was requested.
#[derive(Clone, Debug)]
pub struct Bytes {
    pub all: Arc<Vec<u8>>,
    pub range: Range<usize>,
    big: bool,
    pub budget: Budget,
}

/// Layout of a number type and its conversion to f64, which is exact except for 64-bit integers beyond 2^53.
#[derive(Clone, Copy)]
struct NumberType {
    name: &'static str,
    size: usize,
    read: fn([u8; 8]) -> f64,
    /// Integer that stands for 1.0 in normalized integers; 0 for floats.
    one: f64,
}

/// `read` receives eight bytes that begin with the number in little-endian order.
macro_rules! kind {
    ($name:literal, $type:ty, $one:expr) => {
        NumberType {
            name: $name,
            size: size_of::<$type>(),
            read: |b| {
                let mut bytes = [0; size_of::<$type>()];
                bytes.copy_from_slice(&b[..size_of::<$type>()]);
                <$type>::from_le_bytes(bytes) as f64
            },
            one: $one,
        }
    };
}

const NUMBER_TYPES: [NumberType; 10] = [
    kind!("u8", u8, 255.0),
    kind!("i8", i8, 127.0),
    kind!("u16", u16, 65535.0),
    kind!("i16", i16, 32767.0),
    kind!("u32", u32, 4_294_967_295.0),
    kind!("i32", i32, 2_147_483_647.0),
    kind!("u64", u64, 0.0),
    kind!("i64", i64, 0.0),
    kind!("f32", f32, 0.0),
    kind!("f64", f64, 0.0),
];

impl Bytes {
    pub fn new(all: Arc<Vec<u8>>, budget: &Budget) -> Bytes {
        Bytes { range: 0..all.len(), all, big: false, budget: budget.clone() }
    }

    pub fn slice(&self) -> &[u8] {
        &self.all[self.range.clone()]
    }

    /// The bytes `offset..offset + count` of this part. The error states offsets from the start of the file.
    fn take(&self, offset: i64, count: i64, what: &str) -> Result<&[u8], Refused> {
        let range = usize::try_from(offset).ok().zip(usize::try_from(count).ok());
        let range = range.and_then(|(o, c)| Some(o..o.checked_add(c)?));
        range.and_then(|r| self.slice().get(r)).ok_or_else(|| {
            let first = i128::from(offset) + self.range.start as i128;
            let end = first + i128::from(count);
            let part = match self.range == (0..self.all.len()) {
                true => format!("the file has {}", self.all.len()),
                false => format!("this part is {}..{}", self.range.start, self.range.end),
            };
            refuse(format!("{what}: needs the bytes {first}..{end}, {part}"))
        })
    }

    pub fn part(&self, offset: i64, count: i64) -> Result<Bytes, Refused> {
        self.take(offset, count, "part")?;
        // `take` has checked both numbers.
        let start = self.range.start + offset as usize;
        Ok(Bytes { range: start..start + count as usize, ..self.clone() })
    }

    fn number_at(&self, kind: NumberType, offset: i64) -> Result<f64, Refused> {
        let bytes = self.take(offset, kind.size as i64, kind.name)?;
        Ok((kind.read)(self.little_endian(bytes)))
    }

    fn little_endian(&self, bytes: &[u8]) -> [u8; 8] {
        let mut little = [0; 8];
        little[..bytes.len()].copy_from_slice(bytes);
        if self.big {
            little[..bytes.len()].reverse();
        }
        little
    }

    /// `count` rows of `width` numbers, a row starting every `stride` bytes.
    fn many(&self, kind: NumberType, offset: i64, count: i64, options: &Map) -> Result<Numbers, Refused> {
        let what = format!("{}s", kind.name);
        let known = ["width", "stride", "normalized"];
        if let Some(key) = options.keys().find(|k| !known.contains(&k.as_str())) {
            let hint = list(known, 3);
            return Err(refuse(format!(
                "{what}: unknown option \"{key}\"{}; options: {hint}",
                did_you_mean(key, known)
            )));
        }
        let whole = |name: &str, default: i64| match options.get(name) {
            None => Ok(default),
            Some(v) => v.as_int().ok().filter(|v| (1..=1 << 20).contains(v)).ok_or_else(|| {
                refuse(format!("{what}: {name} must be a whole number from 1 to 1048576, got {v}"))
            }),
        };
        let width = whole("width", 1)?;
        let packed = width * kind.size as i64;
        let stride = whole("stride", packed)?;
        if stride < packed {
            return Err(refuse(format!(
                "{what}: a stride of {stride} is less than the {packed} bytes of a row"
            )));
        }
        let scale = match options.get("normalized").map(Dynamic::as_bool) {
            None | Some(Ok(false)) => 1.0,
            Some(Ok(true)) if kind.one > 0.0 => 1.0 / kind.one,
            _ => {
                return Err(refuse(format!(
                    "{what}: normalized is true or false, and for integers up to 32 bits"
                )));
            }
        };
        // The last row may lack the padding up to the stride.
        let span = match count {
            1.. => (count - 1).checked_mul(stride).and_then(|b| b.checked_add(packed)),
            0 => Some(0),
            _ => None,
        };
        let span = span.ok_or_else(|| refuse(format!("{what}: {count} rows of {stride} bytes")))?;
        let bytes = self.take(offset, span, &what)?;
        let share = self.budget.share(8 * (count * width) as usize)?;
        let mut values = Vec::with_capacity((count * width) as usize);
        for row in bytes.chunks(stride as usize) {
            for number in row[..packed as usize].chunks_exact(kind.size) {
                let value = (kind.read)(self.little_endian(number));
                values.push(if scale == 1.0 { value } else { (value * scale).max(-1.0) });
            }
        }
        Ok(Numbers::new(values, share))
    }

    pub fn text(&self) -> Result<&str, Refused> {
        std::str::from_utf8(self.slice())
            .map_err(|e| refuse(format!("byte {} is no UTF-8 text", self.range.start + e.valid_up_to())))
    }

    /// Text of at most `count` bytes that ends at the first zero byte, such as a name in a field of fixed size.
    fn name(&self, offset: i64, count: i64) -> Result<String, Refused> {
        let bytes = self.take(offset, count, "text")?;
        let end = bytes.iter().position(|b| *b == 0).unwrap_or(bytes.len());
        self.budget.take(end)?;
        Ok(String::from_utf8_lossy(&bytes[..end]).into_owned())
    }

    fn whole_text(&self) -> Result<ImmutableString, Refused> {
        let text = self.text()?;
        self.budget.take(text.len())?;
        Ok(text.strip_prefix('\u{feff}').unwrap_or(text).into())
    }

    fn find(&self, wanted: &str, from: i64) -> i64 {
        let from = usize::try_from(from).unwrap_or(usize::MAX);
        let Some(rest) = self.slice().get(from..) else { return -1 };
        let wanted = wanted.as_bytes();
        match wanted.is_empty() {
            true => -1,
            false => rest.windows(wanted.len()).position(|w| w == wanted).map_or(-1, |i| (from + i) as i64),
        }
    }

    fn json(&self) -> Result<Dynamic, Refused> {
        self.budget.take(8 * self.slice().len())?;
        let bytes = self.slice();
        let bytes = bytes.strip_prefix("\u{feff}".as_bytes()).unwrap_or(bytes);
        let value: serde_json::Value =
            serde_json::from_slice(bytes).map_err(|e| refuse(format!("json: {e}")))?;
        script_value(value)
    }
}

/// Converts a JSON value to a script value. `serde_json` refuses more than 128 levels, so the recursion cannot run out of stack.
fn script_value(value: serde_json::Value) -> Result<Dynamic, Refused> {
    use serde_json::Value;
    Ok(match value {
        Value::Null => Dynamic::UNIT,
        Value::Bool(b) => b.into(),
        Value::Number(n) => match n.as_i64() {
            Some(i) => i.into(),
            None => n.as_f64().unwrap_or(f64::NAN).into(),
        },
        Value::String(s) => s.into(),
        Value::Array(a) if a.len() > MOST_IN_ARRAY => {
            return Err(refuse(format!(
                "json: an array has {} elements, at most {MOST_IN_ARRAY} are allowed",
                a.len()
            )));
        }
        Value::Array(a) => a.into_iter().map(script_value).collect::<Result<Array, _>>()?.into(),
        Value::Object(o) => {
            let entries = o.into_iter().map(|(k, v)| Ok((k.into(), script_value(v)?)));
            entries.collect::<Result<Map, Refused>>()?.into()
        }
    })
}

pub fn register(engine: &mut Engine) {
    engine.register_type_with_name::<Bytes>("Bytes");
    engine.register_fn("len", |b: &mut Bytes| b.slice().len() as i64);
    engine.register_get("len", |b: &mut Bytes| b.slice().len() as i64);
    engine.register_fn("part", |b: &mut Bytes, offset: i64, count: i64| b.part(offset, count));
    engine.register_fn("big", |b: &mut Bytes| Bytes { big: true, ..b.clone() });
    engine.register_fn("text", |b: &mut Bytes| b.whole_text());
    engine.register_fn("text", |b: &mut Bytes, offset: i64, count: i64| b.name(offset, count));
    engine.register_fn("lines", |b: &mut Bytes| Lines::of(b));
    engine.register_fn("json", |b: &mut Bytes| b.json());
    engine.register_fn("numbers", |b: &mut Bytes| numbers::parse(b.text()?, &b.budget));
    engine.register_fn("find", |b: &mut Bytes, wanted: &str, from: i64| b.find(wanted, from));
    engine.register_fn("find", |b: &mut Bytes, wanted: &str| b.find(wanted, 0));
    engine.register_fn("starts_with", |b: &mut Bytes, wanted: &str| b.slice().starts_with(wanted.as_bytes()));
    lines::register(engine);
    engine.register_fn("words", |text: &str| -> Array {
        text.split_whitespace().map(|w| Dynamic::from(ImmutableString::from(w))).collect()
    });
    for kind in NUMBER_TYPES {
        match kind.name {
            "f32" | "f64" => {
                engine.register_fn(kind.name, move |b: &mut Bytes, offset: i64| b.number_at(kind, offset));
            }
            _ => {
                engine.register_fn(kind.name, move |b: &mut Bytes, offset: i64| {
                    b.number_at(kind, offset).map(|v| v as i64)
                });
            }
        }
        let many = format!("{}s", kind.name);
        engine.register_fn(&many, move |b: &mut Bytes, offset: i64, count: i64| {
            b.many(kind, offset, count, &Map::new())
        });
        engine.register_fn(&many, move |b: &mut Bytes, offset: i64, count: i64, options: Map| {
            b.many(kind, offset, count, &options)
        });
    }
}
