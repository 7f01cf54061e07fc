//! Arrays of numbers that stay in native memory: a mesh goes from the file to the asset without a script value per number.

use crate::budget::{Budget, BudgetShare, NativeError, native_error};
use rhai::{Array, Dynamic, Engine};
use std::ops::Deref;
use std::sync::Arc;

/// Values and their share of the import's budget.
#[derive(Debug)]
struct SharedValues {
    values: Vec<f64>,
    share: BudgetShare,
}

/// An array of f64. Copies share the values. Only `append` changes values; it copies them first if they are shared.
#[derive(Clone, Debug)]
pub(crate) struct Numbers(Arc<SharedValues>);

impl Deref for Numbers {
    type Target = [f64];

    fn deref(&self) -> &[f64] {
        &self.0.values
    }
}

impl Numbers {
    /// `share` counts at least 8 bytes of each value.
    pub(crate) fn new(values: Vec<f64>, share: BudgetShare) -> Numbers {
        Numbers(Arc::new(SharedValues { values, share }))
    }

    fn budget(&self) -> &Budget {
        &self.0.share.budget
    }

    fn map(&self, f: impl Fn(f64) -> f64) -> Result<Numbers, NativeError> {
        let share = self.budget().reserve(8 * self.len())?;
        Ok(Numbers::new(self.iter().map(|v| f(*v)).collect(), share))
    }

    fn zip(&self, other: &Numbers, what: &str, f: impl Fn(f64, f64) -> f64) -> Result<Numbers, NativeError> {
        if self.len() != other.len() {
            return Err(native_error(format!(
                "{what}: one array has {} numbers, the other {}",
                self.len(),
                other.len()
            )));
        }
        let share = self.budget().reserve(8 * self.len())?;
        Ok(Numbers::new(self.iter().zip(other.iter()).map(|(a, b)| f(*a, *b)).collect(), share))
    }

    /// Applies an operation to each row and a short array that has one number per column: `* [1, 1, -1]` mirrors rows of x y z.
    fn with_row(&self, row: Array, what: &str, f: impl Fn(f64, f64) -> f64) -> Result<Numbers, NativeError> {
        let row = read_numbers(&row.into()).filter(|row| !row.is_empty());
        let row = row.ok_or_else(|| native_error(format!("{what}: an array of numbers is needed")))?;
        self.require_whole_rows(row.len(), what)?;
        let share = self.budget().reserve(8 * self.len())?;
        Ok(Numbers::new(self.iter().zip(row.iter().cycle()).map(|(a, b)| f(*a, *b)).collect(), share))
    }

    /// Adds numbers at the end, in time proportional to their count.
    pub(crate) fn append(&mut self, more: &[f64]) -> Result<(), NativeError> {
        if Arc::get_mut(&mut self.0).is_none() {
            let share = self.budget().reserve(8 * self.len())?;
            *self = Numbers::new(self.to_vec(), share);
        }
        // The values are not shared any more.
        let Some(own) = Arc::get_mut(&mut self.0) else { return Ok(()) };
        own.share.grow(8 * more.len())?;
        own.values.extend_from_slice(more);
        Ok(())
    }

    fn number_at(&self, index: i64) -> Result<f64, NativeError> {
        usize::try_from(index).ok().and_then(|i| self.get(i)).copied().ok_or_else(|| {
            native_error(format!("there is no number {index} in an array of {}, counted from 0", self.len()))
        })
    }

    /// A copy of `count` numbers from index `start` on.
    fn part(&self, start: i64, count: i64) -> Result<Numbers, NativeError> {
        let range = usize::try_from(start).ok().zip(usize::try_from(count).ok());
        let part = range.and_then(|(s, c)| self.get(s..s.checked_add(c)?));
        let part = part.ok_or_else(|| {
            native_error(format!("part({start}, {count}) is outside of an array of {} numbers", self.len()))
        })?;
        let share = self.budget().reserve(8 * part.len())?;
        Ok(Numbers::new(part.to_vec(), share))
    }

    /// The given columns, in this order, of rows of `width` numbers: rows of x y z with `[0, 2, 1]` become x z y.
    fn columns(&self, width: i64, columns: &Array) -> Result<Numbers, NativeError> {
        let width = usize::try_from(width).ok().filter(|w| (1..=4096).contains(w));
        let columns: Option<Vec<usize>> =
            columns.iter().map(|c| c.as_int().ok().and_then(|c| usize::try_from(c).ok())).collect();
        let (Some(width), Some(columns)) = (width, columns) else {
            return Err(native_error(
                "columns: the width must be a whole number from 1 to 4096, the columns whole numbers from 0",
            ));
        };
        if let Some(bad) = columns.iter().find(|c| **c >= width) {
            return Err(native_error(format!(
                "columns: there is no column {bad} in rows of {width}, counted from 0"
            )));
        }
        self.require_whole_rows(width, "columns")?;
        let rows = self.len() / width;
        let share = self.budget().reserve(8 * rows.saturating_mul(columns.len()))?;
        let rows = self.chunks_exact(width);
        let picked = rows.flat_map(|row| columns.iter().map(|c| row[*c])).collect();
        Ok(Numbers::new(picked, share))
    }

    /// Gathers rows of `width` numbers by index: expands shared vertices to one per index.
    fn rows(&self, width: i64, rows: &Numbers) -> Result<Numbers, NativeError> {
        let width = usize::try_from(width).ok().filter(|w| (1..=4096).contains(w));
        let width =
            width.ok_or_else(|| native_error("rows: the width must be a whole number from 1 to 4096"))?;
        self.require_whole_rows(width, "rows")?;
        let count = self.len() / width;
        let share = self.budget().reserve(8 * rows.len().saturating_mul(width))?;
        let mut picked = Vec::with_capacity(rows.len() * width);
        for (i, row) in rows.iter().enumerate() {
            // A fraction or a negative number is not an index.
            let at = *row as usize;
            if at as f64 != *row || at >= count {
                return Err(native_error(format!(
                    "rows: number {i} is row {row}, which is not one of the {count} rows, counted from 0"
                )));
            }
            picked.extend_from_slice(&self[at * width..(at + 1) * width]);
        }
        Ok(Numbers::new(picked, share))
    }

    fn require_whole_rows(&self, width: usize, what: &str) -> Result<(), NativeError> {
        if self.len().is_multiple_of(width) {
            return Ok(());
        }
        Err(native_error(format!("{what}: {} numbers do not fill whole rows of {width}", self.len())))
    }

    fn array(&self) -> Result<Array, NativeError> {
        if self.len() > crate::engine::MAX_ARRAY_LEN {
            return Err(native_error(format!(
                "array(): {} numbers, at most {} fit a script's array; use the numbers without array()",
                self.len(),
                crate::engine::MAX_ARRAY_LEN
            )));
        }
        Ok(self.iter().map(|v| Dynamic::from_float(*v)).collect())
    }
}

/// Columns side by side: the first number of each, then the second of each, and so on.
fn interleave_columns(columns: &Array, budget: &Budget) -> Result<Numbers, NativeError> {
    let wrong = || native_error("interleaved: an array of columns is needed, each an array of numbers");
    let column = |value: &Dynamic| -> Result<Numbers, NativeError> {
        if let Some(numbers) = value.read_lock::<Numbers>() {
            return Ok(numbers.clone());
        }
        let values = read_numbers(value).ok_or_else(wrong)?;
        let share = budget.reserve(8 * values.len())?;
        Ok(Numbers::new(values, share))
    };
    let columns: Vec<Numbers> = columns.iter().map(column).collect::<Result<_, _>>()?;
    let count = columns.first().ok_or_else(wrong)?.len();
    if let Some((at, other)) = columns.iter().enumerate().find(|(_, column)| column.len() != count) {
        let other = other.len();
        return Err(native_error(format!(
            "interleaved: column {at} has {other} numbers, the first one {count}"
        )));
    }
    let share = budget.reserve(8 * count.saturating_mul(columns.len()))?;
    let columns = &columns;
    let rows = (0..count).flat_map(|row| columns.iter().map(move |column| column[row]));
    Ok(Numbers::new(rows.collect(), share))
}

/// The numbers of an array, `Numbers` or script values.
pub(crate) fn read_numbers(value: &Dynamic) -> Option<Vec<f64>> {
    if let Some(numbers) = value.read_lock::<Numbers>() {
        return Some(numbers.to_vec());
    }
    let array = value.read_lock::<Array>()?;
    array.iter().map(|v| v.as_float().ok().or_else(|| v.as_int().ok().map(|i| i as f64))).collect()
}

/// Parses the numbers of a text. Any character that cannot be part of a number separates: `1 2/3,4e-5`.
pub(crate) fn parse_numbers(text: &str, budget: &Budget) -> Result<Numbers, NativeError> {
    let mut share = budget.reserve(0)?;
    let mut values = Vec::new();
    let is_part = |byte: &u8| byte.is_ascii_alphanumeric() || matches!(byte, b'+' | b'-' | b'.');
    let mut rest = text;
    while let Some(start) = rest.as_bytes().iter().position(is_part) {
        rest = &rest[start..];
        let end = rest.as_bytes().iter().position(|byte| !is_part(byte)).unwrap_or(rest.len());
        let word = &rest[..end];
        let value: f64 = word.parse().map_err(|_| {
            let shown: String = word.chars().take(40).collect();
            native_error(format!("numbers: \"{shown}\" is no number"))
        })?;
        if values.len() == values.capacity() {
            // The vector doubles its capacity.
            let more = values.len().max(64);
            share.grow(8 * more)?;
            values.reserve_exact(more);
        }
        values.push(value);
        rest = &rest[end..];
    }
    Ok(Numbers::new(values, share))
}

/// Triangulates polygons, each written as a count and that many vertices as in PLY and OFF, into fans around the first vertex.
fn triangulate_fans(polygons: &Numbers) -> Result<Numbers, NativeError> {
    let mut triangles = Vec::new();
    let mut share = polygons.budget().reserve(0)?;
    let mut rest: &[f64] = polygons;
    while let Some((count, after)) = rest.split_first() {
        let whole = Some(*count as usize).filter(|n| *n as f64 == *count && *n <= after.len());
        let (polygon, next) = after.split_at(whole.ok_or_else(|| {
            let at = polygons.len() - rest.len();
            native_error(format!("fans: number {at} is {count}, must be the number of vertices that follow"))
        })?);
        share.grow(24 * polygon.len().saturating_sub(2))?;
        if let Some((first, others)) = polygon.split_first() {
            triangles.extend(others.windows(2).flat_map(|pair| [*first, pair[0], pair[1]]));
        }
        rest = next;
    }
    Ok(Numbers::new(triangles, share))
}

impl IntoIterator for Numbers {
    type Item = f64;
    type IntoIter = NumbersIter;

    fn into_iter(self) -> NumbersIter {
        NumbersIter { numbers: self, next: 0 }
    }
}

/// Iterator over the values, which are not copied.
pub(crate) struct NumbersIter {
    numbers: Numbers,
    next: usize,
}

impl Iterator for NumbersIter {
    type Item = f64;

    fn next(&mut self) -> Option<f64> {
        let value = self.numbers.get(self.next).copied();
        self.next += 1;
        value
    }
}

pub(crate) fn register_numbers(engine: &mut Engine, budget: &Budget) {
    engine.register_type_with_name::<Numbers>("Numbers");
    engine.register_fn("len", |n: &mut Numbers| n.len() as i64);
    engine.register_get("len", |n: &mut Numbers| n.len() as i64);
    engine.register_indexer_get(|n: &mut Numbers, i: i64| n.number_at(i));
    engine.register_fn("part", |n: &mut Numbers, start: i64, count: i64| n.part(start, count));
    engine.register_fn("columns", |n: &mut Numbers, width: i64, c: Array| n.columns(width, &c));
    engine.register_fn("rows", |n: &mut Numbers, width: i64, rows: Numbers| n.rows(width, &rows));
    engine.register_fn("array", |n: &mut Numbers| n.array());
    engine.register_fn("fans", |n: &mut Numbers| triangulate_fans(n));
    engine.register_iterator::<Numbers>();
    engine.register_fn("append", |n: &mut Numbers, more: Numbers| n.append(&more));
    engine.register_fn("append", |n: &mut Numbers, more: Array| {
        let more = read_numbers(&more.into())
            .ok_or_else(|| native_error("append: an array of numbers is needed"))?;
        n.append(&more)
    });
    engine.register_fn("push", |n: &mut Numbers, value: f64| n.append(&[value]));
    engine.register_fn("push", |n: &mut Numbers, value: i64| n.append(&[value as f64]));
    engine.register_fn("min", |n: &mut Numbers| n.iter().copied().fold(f64::INFINITY, f64::min));
    engine.register_fn("max", |n: &mut Numbers| n.iter().copied().fold(f64::NEG_INFINITY, f64::max));
    engine.register_fn("*", |n: Numbers, by: f64| n.map(|v| v * by));
    engine.register_fn("*", |n: Numbers, by: i64| n.map(|v| v * by as f64));
    engine.register_fn("/", |n: Numbers, by: f64| n.map(|v| v / by));
    engine.register_fn("/", |n: Numbers, by: i64| n.map(|v| v / by as f64));
    engine.register_fn("+", |n: Numbers, by: f64| n.map(|v| v + by));
    engine.register_fn("+", |n: Numbers, by: i64| n.map(|v| v + by as f64));
    engine.register_fn("-", |n: Numbers, by: f64| n.map(|v| v - by));
    engine.register_fn("-", |n: Numbers, by: i64| n.map(|v| v - by as f64));
    engine.register_fn("-", |n: Numbers| n.map(|v| -v));
    engine.register_fn("+", |a: Numbers, b: Numbers| a.zip(&b, "+", |a, b| a + b));
    engine.register_fn("-", |a: Numbers, b: Numbers| a.zip(&b, "-", |a, b| a - b));
    engine.register_fn("*", |a: Numbers, b: Numbers| a.zip(&b, "*", |a, b| a * b));
    engine.register_fn("+", |a: Numbers, row: Array| a.with_row(row, "+", |a, b| a + b));
    engine.register_fn("*", |a: Numbers, row: Array| a.with_row(row, "*", |a, b| a * b));
    let own_budget = budget.clone();
    engine.register_fn("numbers", move || {
        Ok::<_, NativeError>(Numbers::new(Vec::new(), own_budget.reserve(0)?))
    });
    let own_budget = budget.clone();
    engine.register_fn("numbers", move |array: Array| {
        let share = own_budget.reserve(8 * array.len())?;
        let values = read_numbers(&array.into())
            .ok_or_else(|| native_error("numbers: an array of numbers is needed"))?;
        Ok::<_, NativeError>(Numbers::new(values, share))
    });
    let own_budget = budget.clone();
    engine.register_fn("numbers", move |text: &str| parse_numbers(text, &own_budget));
    let own_budget = budget.clone();
    engine.register_fn("interleaved", move |columns: Array| interleave_columns(&columns, &own_budget));
}
