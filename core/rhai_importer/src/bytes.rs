//! The bytes of a file as the script sees them: checked reads of single numbers and of whole arrays.

use crate::budget::{Budget, NativeError, native_error};
use crate::engine::MAX_ARRAY_LEN;
use crate::lines::{self, Lines};
use crate::numbers::{self, Numbers};
use choreo_plugin::suggest::{did_you_mean, list};
use rhai::{Array, Dynamic, Engine, ImmutableString, Map};
use std::ops::Range;
use std::sync::Arc;

/// A file or a part of one. Numbers are little-endian, or big-endian where [`Bytes::big`] was requested.
#[derive(Clone, Debug)]
pub(crate) struct Bytes {
    pub file: Arc<Vec<u8>>,
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
    unit_value: f64,
}

/// `read` receives eight bytes that begin with the number in little-endian order.
macro_rules! number_type {
    ($name:literal, $type:ty, $unit_value:expr) => {
        NumberType {
            name: $name,
            size: size_of::<$type>(),
            read: |b| {
                let mut bytes = [0; size_of::<$type>()];
                bytes.copy_from_slice(&b[..size_of::<$type>()]);
                <$type>::from_le_bytes(bytes) as f64
            },
            unit_value: $unit_value,
        }
    };
}

const NUMBER_TYPES: [NumberType; 10] = [
    number_type!("u8", u8, 255.0),
    number_type!("i8", i8, 127.0),
    number_type!("u16", u16, 65535.0),
    number_type!("i16", i16, 32767.0),
    number_type!("u32", u32, 4_294_967_295.0),
    number_type!("i32", i32, 2_147_483_647.0),
    number_type!("u64", u64, 0.0),
    number_type!("i64", i64, 0.0),
    number_type!("f32", f32, 0.0),
    number_type!("f64", f64, 0.0),
];

impl Bytes {
    pub(crate) fn new(file: Arc<Vec<u8>>, budget: &Budget) -> Bytes {
        Bytes { range: 0..file.len(), file, big: false, budget: budget.clone() }
    }

    pub(crate) fn slice(&self) -> &[u8] {
        &self.file[self.range.clone()]
    }

    /// The bytes `offset..offset + count` of this part. The error states offsets from the start of the file.
    fn checked_slice(&self, offset: i64, count: i64, what: &str) -> Result<&[u8], NativeError> {
        let range = usize::try_from(offset).ok().zip(usize::try_from(count).ok());
        let range = range.and_then(|(o, c)| Some(o..o.checked_add(c)?));
        range.and_then(|r| self.slice().get(r)).ok_or_else(|| {
            let first = i128::from(offset) + self.range.start as i128;
            let end = first + i128::from(count);
            let part = match self.range == (0..self.file.len()) {
                true => format!("the file has {}", self.file.len()),
                false => format!("this part is {}..{}", self.range.start, self.range.end),
            };
            native_error(format!("{what}: needs the bytes {first}..{end}, {part}"))
        })
    }

    pub(crate) fn part(&self, offset: i64, count: i64) -> Result<Bytes, NativeError> {
        self.checked_slice(offset, count, "part")?;
        // `checked_slice` has checked both numbers.
        let start = self.range.start + offset as usize;
        Ok(Bytes { range: start..start + count as usize, ..self.clone() })
    }

    fn read_number(&self, number_type: NumberType, offset: i64) -> Result<f64, NativeError> {
        let bytes = self.checked_slice(offset, number_type.size as i64, number_type.name)?;
        Ok((number_type.read)(self.to_little_endian(bytes)))
    }

    fn to_little_endian(&self, bytes: &[u8]) -> [u8; 8] {
        let mut little = [0; 8];
        little[..bytes.len()].copy_from_slice(bytes);
        if self.big {
            little[..bytes.len()].reverse();
        }
        little
    }

    /// `count` rows of `width` numbers, a row starting every `stride` bytes.
    fn read_rows(
        &self,
        number_type: NumberType,
        offset: i64,
        count: i64,
        options: &Map,
    ) -> Result<Numbers, NativeError> {
        let what = format!("{}s", number_type.name);
        let known = ["width", "stride", "normalized"];
        if let Some(key) = options.keys().find(|k| !known.contains(&k.as_str())) {
            let hint = list(known, 3);
            return Err(native_error(format!(
                "{what}: unknown option \"{key}\"{}; options: {hint}",
                did_you_mean(key, known)
            )));
        }
        let whole = |name: &str, default: i64| match options.get(name) {
            None => Ok(default),
            Some(v) => v.as_int().ok().filter(|v| (1..=1 << 20).contains(v)).ok_or_else(|| {
                native_error(format!("{what}: {name} must be a whole number from 1 to 1048576, got {v}"))
            }),
        };
        let width = whole("width", 1)?;
        let packed = width * number_type.size as i64;
        let stride = whole("stride", packed)?;
        if stride < packed {
            return Err(native_error(format!(
                "{what}: a stride of {stride} is less than the {packed} bytes of a row"
            )));
        }
        let scale = match options.get("normalized").map(Dynamic::as_bool) {
            None | Some(Ok(false)) => 1.0,
            Some(Ok(true)) if number_type.unit_value > 0.0 => 1.0 / number_type.unit_value,
            _ => {
                return Err(native_error(format!(
                    "{what}: normalized must be true or false; true needs an integer type of at most 32 bits"
                )));
            }
        };
        // The last row may lack the padding up to the stride.
        let span = match count {
            1.. => (count - 1).checked_mul(stride).and_then(|b| b.checked_add(packed)),
            0 => Some(0),
            _ => None,
        };
        let span =
            span.ok_or_else(|| native_error(format!("{what}: cannot read {count} rows of {stride} bytes")))?;
        let bytes = self.checked_slice(offset, span, &what)?;
        let share = self.budget.reserve(8 * (count * width) as usize)?;
        let mut values = Vec::with_capacity((count * width) as usize);
        for row in bytes.chunks(stride as usize) {
            for number in row[..packed as usize].chunks_exact(number_type.size) {
                let value = (number_type.read)(self.to_little_endian(number));
                values.push(if scale == 1.0 { value } else { (value * scale).max(-1.0) });
            }
        }
        Ok(Numbers::new(values, share))
    }

    pub(crate) fn text(&self) -> Result<&str, NativeError> {
        std::str::from_utf8(self.slice()).map_err(|e| {
            native_error(format!("byte {} is not UTF-8 text", self.range.start + e.valid_up_to()))
        })
    }

    /// Text of at most `count` bytes that ends at the first zero byte, such as a name in a field of fixed size.
    fn fixed_size_text(&self, offset: i64, count: i64) -> Result<String, NativeError> {
        let bytes = self.checked_slice(offset, count, "text")?;
        let end = bytes.iter().position(|b| *b == 0).unwrap_or(bytes.len());
        self.budget.charge(end)?;
        Ok(String::from_utf8_lossy(&bytes[..end]).into_owned())
    }

    fn whole_text(&self) -> Result<ImmutableString, NativeError> {
        let text = self.text()?;
        self.budget.charge(text.len())?;
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

    fn parse_json(&self) -> Result<Dynamic, NativeError> {
        self.budget.charge(8 * self.slice().len())?;
        let bytes = self.slice();
        let bytes = bytes.strip_prefix("\u{feff}".as_bytes()).unwrap_or(bytes);
        let value: serde_json::Value =
            serde_json::from_slice(bytes).map_err(|e| native_error(format!("json: {e}")))?;
        json_to_script_value(value)
    }
}

/// Converts a JSON value to a script value. `serde_json` refuses more than 128 levels, so the recursion cannot run out of stack.
fn json_to_script_value(value: serde_json::Value) -> Result<Dynamic, NativeError> {
    use serde_json::Value;
    Ok(match value {
        Value::Null => Dynamic::UNIT,
        Value::Bool(b) => b.into(),
        Value::Number(n) => match n.as_i64() {
            Some(i) => i.into(),
            None => n.as_f64().unwrap_or(f64::NAN).into(),
        },
        Value::String(s) => s.into(),
        Value::Array(a) if a.len() > MAX_ARRAY_LEN => {
            return Err(native_error(format!(
                "json: an array has {} elements, at most {MAX_ARRAY_LEN} are allowed",
                a.len()
            )));
        }
        Value::Array(a) => a.into_iter().map(json_to_script_value).collect::<Result<Array, _>>()?.into(),
        Value::Object(o) => {
            let entries = o.into_iter().map(|(k, v)| Ok((k.into(), json_to_script_value(v)?)));
            entries.collect::<Result<Map, NativeError>>()?.into()
        }
    })
}

pub(crate) fn register_bytes(engine: &mut Engine) {
    engine.register_type_with_name::<Bytes>("Bytes");
    engine.register_fn("len", |b: &mut Bytes| b.slice().len() as i64);
    engine.register_get("len", |b: &mut Bytes| b.slice().len() as i64);
    engine.register_fn("part", |b: &mut Bytes, offset: i64, count: i64| b.part(offset, count));
    engine.register_fn("big", |b: &mut Bytes| Bytes { big: true, ..b.clone() });
    engine.register_fn("text", |b: &mut Bytes| b.whole_text());
    engine.register_fn("text", |b: &mut Bytes, offset: i64, count: i64| b.fixed_size_text(offset, count));
    engine.register_fn("lines", |b: &mut Bytes| Lines::of(b));
    engine.register_fn("json", |b: &mut Bytes| b.parse_json());
    engine.register_fn("numbers", |b: &mut Bytes| numbers::parse_numbers(b.text()?, &b.budget));
    engine.register_fn("find", |b: &mut Bytes, wanted: &str, from: i64| b.find(wanted, from));
    engine.register_fn("find", |b: &mut Bytes, wanted: &str| b.find(wanted, 0));
    engine.register_fn("starts_with", |b: &mut Bytes, wanted: &str| b.slice().starts_with(wanted.as_bytes()));
    lines::register_lines(engine);
    engine.register_fn("words", |text: &str| -> Array {
        text.split_whitespace().map(|w| Dynamic::from(ImmutableString::from(w))).collect()
    });
    for number_type in NUMBER_TYPES {
        match number_type.name {
            "f32" | "f64" => {
                engine.register_fn(number_type.name, move |b: &mut Bytes, offset: i64| {
                    b.read_number(number_type, offset)
                });
            }
            _ => {
                engine.register_fn(number_type.name, move |b: &mut Bytes, offset: i64| {
                    b.read_number(number_type, offset).map(|v| v as i64)
                });
            }
        }
        let plural_name = format!("{}s", number_type.name);
        engine.register_fn(&plural_name, move |b: &mut Bytes, offset: i64, count: i64| {
            b.read_rows(number_type, offset, count, &Map::new())
        });
        engine.register_fn(&plural_name, move |b: &mut Bytes, offset: i64, count: i64, options: Map| {
            b.read_rows(number_type, offset, count, &options)
        });
    }
}
