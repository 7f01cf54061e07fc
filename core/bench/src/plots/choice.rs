//! A numerical choice between methods: the cost and the error of each, and the one that was chosen.

use super::number::{bytes, duration, quantity};
use super::table::{Cell, Table};
use crate::timing::Nanos;
use serde_json::{Value, json};

/// One method.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    pub name: String,
    /// Worst error in the choice's unit; 0 is exact.
    pub worst: f64,
    /// Mean error over all cases in the same unit; NaN if it was not measured.
    pub mean: f64,
    /// Place and time of the worst error.
    pub at: String,
    /// Time of one item; `None` if the cost is not a time.
    pub nanos: Option<Nanos>,
    pub bytes: Option<f64>,
    /// A remark about the row.
    pub note: String,
}

impl Row {
    pub fn new(name: impl Into<String>) -> Row {
        Row {
            name: name.into(),
            worst: f64::NAN,
            mean: f64::NAN,
            at: String::new(),
            nanos: None,
            bytes: None,
            note: String::new(),
        }
    }
    pub fn error(mut self, worst: f64, mean: f64) -> Row {
        (self.worst, self.mean) = (worst, mean);
        self
    }
    pub fn at(mut self, at: impl Into<String>) -> Row {
        self.at = at.into();
        self
    }
    pub fn nanos(mut self, nanos: impl Into<Nanos>) -> Row {
        self.nanos = Some(nanos.into());
        self
    }
    pub fn bytes(mut self, bytes: f64) -> Row {
        self.bytes = Some(bytes);
        self
    }
    pub fn note(mut self, note: impl Into<String>) -> Row {
        self.note = note.into();
        self
    }

    /// The cost on the plot's axis: the time, or else the size in bytes.
    pub fn cost(&self) -> Option<f64> {
        self.nanos.map(|nanos| nanos.median).or(self.bytes)
    }
}

/// Methods for one task, compared.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Choice {
    /// One word for file names and programs: `bake`.
    pub key: String,
    pub question: String,
    /// The reference that the error is measured against, and its extent.
    pub reference: String,
    pub error_unit: &'static str,
    /// The mean error decides, not the worst: for images, whose worst error is that of one pixel.
    pub by_mean: bool,
    /// One item, in words: "sample of 41 joints".
    pub per: String,
    pub rows: Vec<Row>,
    pub chosen: Option<usize>,
    pub why: String,
}

impl Choice {
    pub fn new(key: &str, question: impl Into<String>) -> Choice {
        Choice { key: key.into(), question: question.into(), ..Choice::default() }
    }

    /// Marks the row with this name as chosen.
    pub fn choose(&mut self, name: &str, why: impl Into<String>) {
        self.chosen = self.rows.iter().position(|r| r.name == name);
        self.why = why.into();
    }

    /// The error that decides.
    pub fn error_of(&self, row: &Row) -> f64 {
        if self.by_mean { row.mean } else { row.worst }
    }

    /// The Pareto front: rows that no other row beats in both error and cost, in the order of the rows. Of rows with the same error and
    /// cost, all are on the front. Times that differ only by chance count as equal (`Nanos::is_less`).
    pub fn front(&self) -> Vec<usize> {
        let on_front = |i: &usize| {
            let row = &self.rows[*i];
            let Some(cost) = row.cost() else { return false };
            !self.rows.iter().enumerate().any(|(j, other)| {
                let Some(other_cost) = other.cost() else { return false };
                let cheaper = match (&other.nanos, &row.nanos) {
                    (Some(other), Some(row)) => other.is_less(row),
                    _ => other_cost < cost,
                };
                let (error, other_error) = (self.error_of(row), self.error_of(other));
                let better = other_error < error;
                j != *i && (cheaper && other_error <= error || better && other_cost <= cost)
            })
        };
        (0..self.rows.len()).filter(on_front).collect()
    }

    pub fn chosen_is_on_front(&self) -> bool {
        self.chosen.is_some_and(|chosen| self.front().contains(&chosen))
    }

    pub fn table(&self) -> Table {
        let unit = if self.error_unit.is_empty() { String::new() } else { format!(", {}", self.error_unit) };
        let worst = format!(">worst{unit}");
        let mean = format!(">mean{unit}");
        let columns = [
            ("", "chosen"),
            ("way", "way"),
            (worst.as_str(), "worst"),
            (mean.as_str(), "mean"),
            (">time", "nanos"),
            (">size", "bytes"),
            ("worst at", "at"),
            ("", "note"),
        ];
        let mut table = Table::new(self.question.clone(), &columns);
        let optional = |value: Option<f64>, text: fn(f64) -> String| match value {
            Some(value) => Cell::number(text(value), value),
            None => Cell::empty(),
        };
        for (i, row) in self.rows.iter().enumerate() {
            let chosen = self.chosen == Some(i);
            let mean =
                if row.mean.is_nan() { Cell::empty() } else { Cell::number(quantity(row.mean), row.mean) };
            let worst =
                if row.worst.is_nan() { Cell::empty() } else { Cell::number(quantity(row.worst), row.worst) };
            table.rows.push(vec![
                Cell { text: if chosen { "→".into() } else { String::new() }, value: json!(chosen) },
                Cell::text(&row.name),
                worst,
                mean,
                row.nanos.map_or_else(Cell::empty, time),
                optional(row.bytes, bytes),
                Cell::text(&row.at),
                Cell::text(&row.note),
            ]);
        }
        let mut notes = Vec::new();
        if !self.per.is_empty() {
            notes.push(format!("time: of one {}; median (quartiles)", self.per));
        }
        if !self.reference.is_empty() {
            notes.push(format!("error: {}", self.reference));
        }
        if let Some(chosen) = self.chosen {
            notes.push(format!("chosen: {}, {}", self.rows[chosen].name, self.why));
        }
        table.notes = notes;
        table.without_empty_columns()
    }

    pub fn json(&self) -> Value {
        let front = self.front();
        let finite = |v: f64| if v.is_finite() { json!(v) } else { Value::Null };
        let rows: Vec<Value> = self
            .rows
            .iter()
            .enumerate()
            .map(|(i, r)| {
                json!({
                    "way": r.name, "worst": finite(r.worst), "mean": finite(r.mean), "worst_at": r.at,
                    "nanos": r.nanos.map(|n| n.median), "quartiles": r.nanos.map(|n| n.quartiles), "bytes": r.bytes, "note": r.note,
                    "chosen": self.chosen == Some(i), "on_front": front.contains(&i),
                })
            })
            .collect();
        json!({
            "choice": self.key, "question": self.question, "error": { "unit": self.error_unit, "against": self.reference },
            "per": self.per, "rows": rows, "chosen": self.chosen.map(|c| self.rows[c].name.clone()), "why": self.why,
        })
    }
}

/// A median time with the quartiles of its rounds.
pub fn time(nanos: Nanos) -> Cell {
    let Nanos { median, quartiles: [low, high] } = nanos;
    let text = duration(median);
    let spread =
        if low < high { format!(" ({}–{})", duration(low), duration(high)) } else { String::new() };
    Cell::number(text + &spread, median)
}

/// Text in place of a difference that may be chance.
const WITHIN_NOISE: &str = "within the noise";

/// Time of `method` divided by that of `of`; a text if the difference may be chance.
pub fn ratio(of: &Nanos, method: &Nanos) -> Cell {
    let times = method.median / of.median;
    if of.differs(method) { Cell::number(format!("{times:.2}"), times) } else { Cell::text(WITHIN_NOISE) }
}

/// The time that `beyond` takes more than `of`, unless they may differ by chance.
pub fn difference(of: &Nanos, beyond: &Nanos) -> Cell {
    if !of.differs(beyond) {
        return Cell::text(WITHIN_NOISE);
    }
    let more = beyond.median - of.median;
    let sign = if more < 0.0 { "−" } else { "+" };
    Cell::number(format!("{sign}{}", duration(more.abs())), more)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_by_chance_are_reported_as_noise() {
        let [short, long] =
            [100.0, 150.0].map(|median| Nanos { median, quartiles: [median - 1.0, median + 1.0] });
        let noisy = Nanos { median: 120.0, quartiles: [90.0, 140.0] };
        let text = |of, beyond| difference(of, beyond).text;
        assert_eq!([text(&short, &long), text(&long, &short)], ["+50.0 ns", "−50.0 ns"]);
        assert_eq!([text(&short, &noisy), text(&noisy, &short)], ["within the noise"; 2]);
        assert_eq!(
            [ratio(&short, &long), ratio(&short, &noisy)].map(|c| c.text),
            ["1.50", "within the noise"]
        );
    }

    #[test]
    fn the_pareto_front_holds_undominated_rows() {
        let mut c = Choice::new("c", "?");
        c.error_unit = "mm";
        for (name, worst, nanos) in [
            ("slow, exact", 0.0, 100.0),
            ("fast, rough", 5.0, 10.0),
            ("slow, rough", 5.0, 50.0),
            ("middle", 1.0, 40.0),
        ] {
            c.rows.push(Row::new(name).error(worst, worst / 2.0).nanos(nanos));
        }
        assert_eq!(c.front(), [0, 1, 3]);
        c.choose("slow, rough", "on purpose");
        assert!(!c.chosen_is_on_front());
        c.choose("middle", "it is enough");
        assert!(c.chosen_is_on_front());
        let text = c.table().text();
        assert!(
            text.contains("  →  middle") && text.contains("worst, mm") && !text.contains("size"),
            "{text}"
        );
        assert_eq!(c.json()["rows"][3]["chosen"], true);
        assert_eq!(c.json()["rows"][2]["on_front"], false);
    }
}
