//! Arrays of numbers that stay in native memory: a mesh goes from the file to the asset without a script value a number.

use crate::budget::{Budget, Refused, refuse};
use rhai::{Array, Dynamic, Engine};
use std::sync::Arc;

/// Cheap to copy; every operation makes a new one.
#[derive(Clone, Debug)]
pub struct Numbers {
    pub values: Arc<Vec<f64>>,
    pub(crate) budget: Budget,
}

impl Numbers {
    pub(crate) fn new(values: Vec<f64>, budget: &Budget) -> Numbers {
        Numbers { values: Arc::new(values), budget: budget.clone() }
    }

    fn map(&self, f: impl Fn(f64) -> f64) -> Result<Numbers, Refused> {
        self.budget.take(8 * self.values.len())?;
        Ok(Numbers::new(self.values.iter().map(|v| f(*v)).collect(), &self.budget))
    }

    fn zip(&self, other: &Numbers, what: &str, f: impl Fn(f64, f64) -> f64) -> Result<Numbers, Refused> {
        if self.values.len() != other.values.len() {
            return Err(refuse(format!(
                "{what}: one array has {} numbers, the other {}",
                self.values.len(),
                other.values.len()
            )));
        }
        self.budget.take(8 * self.values.len())?;
        let both = self.values.iter().zip(other.values.iter());
        Ok(Numbers::new(both.map(|(a, b)| f(*a, *b)).collect(), &self.budget))
    }

    fn at(&self, index: i64) -> Result<f64, Refused> {
        usize::try_from(index).ok().and_then(|i| self.values.get(i)).copied().ok_or_else(|| {
            refuse(format!("number {index} of an array of {}, counted from 0", self.values.len()))
        })
    }

    /// `count` numbers from `start` on.
    fn part(&self, start: i64, count: i64) -> Result<Numbers, Refused> {
        let range = usize::try_from(start).ok().zip(usize::try_from(count).ok());
        let part = range.and_then(|(s, c)| self.values.get(s..s.checked_add(c)?));
        let part = part.ok_or_else(|| {
            refuse(format!("part({start}, {count}) of an array of {} numbers", self.values.len()))
        })?;
        self.budget.take(8 * part.len())?;
        Ok(Numbers::new(part.to_vec(), &self.budget))
    }

    /// The given columns, in this order, of rows of `width` numbers: rows of x y z with `[0, 2, 1]` become x z y.
    fn columns(&self, width: i64, columns: &Array) -> Result<Numbers, Refused> {
        let width = usize::try_from(width).ok().filter(|w| (1..=4096).contains(w));
        let columns: Option<Vec<usize>> =
            columns.iter().map(|c| c.as_int().ok().and_then(|c| usize::try_from(c).ok())).collect();
        let (Some(width), Some(columns)) = (width, columns) else {
            return Err(refuse("columns(width, [numbers]): whole numbers, width from 1 to 4096"));
        };
        if let Some(bad) = columns.iter().find(|c| **c >= width) {
            return Err(refuse(format!("columns: column {bad} of rows of {width}, counted from 0")));
        }
        self.rows_of(width, "columns")?;
        let rows = self.values.len() / width;
        self.budget.take(8 * rows.saturating_mul(columns.len()))?;
        let rows = self.values.chunks_exact(width);
        let picked = rows.flat_map(|row| columns.iter().map(|c| row[*c])).collect();
        Ok(Numbers::new(picked, &self.budget))
    }

    /// The rows of `width` numbers with these numbers, in their order: vertices that faces share, one by one.
    fn rows(&self, width: i64, rows: &Numbers) -> Result<Numbers, Refused> {
        let width = usize::try_from(width).ok().filter(|w| (1..=4096).contains(w));
        let width = width.ok_or_else(|| refuse("rows(width, numbers): width is from 1 to 4096"))?;
        self.rows_of(width, "rows")?;
        let count = self.values.len() / width;
        self.budget.take(8 * rows.values.len().saturating_mul(width))?;
        let mut picked = Vec::with_capacity(rows.values.len() * width);
        for (i, row) in rows.values.iter().enumerate() {
            // A fraction or a negative number is no row.
            let at = *row as usize;
            if at as f64 != *row || at >= count {
                return Err(refuse(format!(
                    "rows: number {i} asks for row {row} of {count}, counted from 0"
                )));
            }
            picked.extend_from_slice(&self.values[at * width..(at + 1) * width]);
        }
        Ok(Numbers::new(picked, &self.budget))
    }

    fn rows_of(&self, width: usize, what: &str) -> Result<(), Refused> {
        if self.values.len().is_multiple_of(width) {
            return Ok(());
        }
        Err(refuse(format!("{what}: {} numbers are no whole rows of {width}", self.values.len())))
    }

    fn array(&self) -> Result<Array, Refused> {
        if self.values.len() > crate::engine::MOST_IN_ARRAY {
            return Err(refuse(format!(
                "array(): {} numbers, at most {} fit a script's array; work on the numbers as they are",
                self.values.len(),
                crate::engine::MOST_IN_ARRAY
            )));
        }
        Ok(self.values.iter().map(|v| Dynamic::from_float(*v)).collect())
    }
}

/// The numbers of an array, `Numbers` or script values.
pub fn read(value: &Dynamic) -> Option<Vec<f64>> {
    if let Some(numbers) = value.read_lock::<Numbers>() {
        return Some(numbers.values.to_vec());
    }
    let array = value.read_lock::<Array>()?;
    array.iter().map(|v| v.as_float().ok().or_else(|| v.as_int().ok().map(|i| i as f64))).collect()
}

/// Numbers in a text, apart by anything that is no part of a number: `1 2/3,4e-5`.
pub fn parse(text: &str, budget: &Budget) -> Result<Numbers, Refused> {
    let mut values = Vec::new();
    let is_part = |c: char| c.is_ascii_alphanumeric() || matches!(c, '+' | '-' | '.');
    for word in text.split(|c: char| !is_part(c)).filter(|w| !w.is_empty()) {
        let value: f64 = word.parse().map_err(|_| {
            let shown: String = word.chars().take(40).collect();
            refuse(format!("numbers: \"{shown}\" is no number"))
        })?;
        if values.len() % 4096 == 0 {
            budget.take(8 * 4096)?;
        }
        values.push(value);
    }
    Ok(Numbers::new(values, budget))
}

pub fn register(engine: &mut Engine, budget: &Budget) {
    engine.register_type_with_name::<Numbers>("Numbers");
    engine.register_fn("len", |n: &mut Numbers| n.values.len() as i64);
    engine.register_get("len", |n: &mut Numbers| n.values.len() as i64);
    engine.register_indexer_get(|n: &mut Numbers, i: i64| n.at(i));
    engine.register_fn("part", |n: &mut Numbers, start: i64, count: i64| n.part(start, count));
    engine.register_fn("columns", |n: &mut Numbers, width: i64, c: Array| n.columns(width, &c));
    engine.register_fn("rows", |n: &mut Numbers, width: i64, rows: Numbers| n.rows(width, &rows));
    engine.register_fn("array", |n: &mut Numbers| n.array());
    engine.register_fn("min", |n: &mut Numbers| n.values.iter().copied().fold(f64::INFINITY, f64::min));
    engine.register_fn("max", |n: &mut Numbers| n.values.iter().copied().fold(f64::NEG_INFINITY, f64::max));
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
    let given = budget.clone();
    engine.register_fn("numbers", move |array: Array| {
        given.take(8 * array.len())?;
        let values = read(&array.into()).ok_or_else(|| refuse("numbers: an array of numbers is needed"))?;
        Ok::<_, Refused>(Numbers::new(values, &given))
    });
    let given = budget.clone();
    engine.register_fn("numbers", move |text: &str| parse(text, &given));
}
