//! Judges values that a script has computed itself.

use super::Judged;
use super::words::{self, like, times_tolerance};
use choreo_script::testing::{Expectation, Value, ValueTest};

pub fn judge(e: &Expectation, got: &Value, test: &ValueTest) -> Judged {
    let number = number(got);
    let (holds, expected, by) = match test {
        ValueTest::Equals(wanted) => (same(got, wanted), shown(wanted), difference(got, wanted)),
        ValueTest::Near { goal, tolerance } => {
            let off = distance(got, goal);
            let by = off.map(|off| format!("{}{}", words::number(off), times_tolerance(off, *tolerance)));
            let holds = off.is_some_and(|off| off <= *tolerance);
            (holds, format!("{} ± {}", shown(goal), words::number(*tolerance)), by.unwrap_or_default())
        }
        ValueTest::Below(limit) => (
            number.is_some_and(|n| n <= *limit),
            format!("at most {}", words::number(*limit)),
            number.map(|n| words::number(n - limit)).unwrap_or_default(),
        ),
        ValueTest::Above(limit) => (
            number.is_some_and(|n| n >= *limit),
            format!("at least {}", words::number(*limit)),
            number.map(|n| words::number(limit - n)).unwrap_or_default(),
        ),
        ValueTest::Between(low, high) => (
            number.is_some_and(|n| (*low..=*high).contains(&n)),
            format!("{} to {}", words::number(*low), words::number(*high)),
            number.map(|n| words::number((low - n).max(n - high))).unwrap_or_default(),
        ),
        ValueTest::Contains(part) => {
            let holds = match (got, part) {
                (Value::Text(text), Value::Text(part)) => text.contains(part.as_str()),
                (Value::List(list), part) => list.iter().any(|element| same(element, part)),
                _ => false,
            };
            (holds, format!("containing {}", shown(part)), String::new())
        }
        ValueTest::Matches(pattern) => {
            let holds = matches!(got, Value::Text(text) if like(text, pattern));
            (holds, format!("like \"{pattern}\""), String::new())
        }
        ValueTest::Empty => {
            let holds = match got {
                Value::Text(text) => text.is_empty(),
                Value::List(list) => list.is_empty(),
                Value::Map(map) => map.is_empty(),
                _ => false,
            };
            (holds, "empty".to_string(), String::new())
        }
    };
    let expected = if e.negated { format!("not {expected}") } else { expected };
    let by = if e.negated { String::new() } else { by };
    Judged::new(holds != e.negated, expected, shown(got)).by(by)
}

fn number(v: &Value) -> Option<f64> {
    match v {
        Value::Int(n) => Some(*n as f64),
        Value::Number(n) => Some(*n),
        _ => None,
    }
}

/// Whether values are equal. Integers and floats are compared by value; NaN is not equal to anything.
fn same(a: &Value, b: &Value) -> bool {
    match (a, b) {
        (Value::Int(a), Value::Int(b)) => a == b,
        (Value::List(a), Value::List(b)) => a.len() == b.len() && a.iter().zip(b).all(|(a, b)| same(a, b)),
        (Value::Map(a), Value::Map(b)) => {
            a.len() == b.len() && a.iter().zip(b).all(|((k, a), (l, b))| k == l && same(a, b))
        }
        (a, b) => match (number(a), number(b)) {
            (Some(a), Some(b)) => a == b,
            _ => a == b,
        },
    }
}

/// Largest absolute difference of two numbers, or of the elements of two lists.
fn distance(a: &Value, b: &Value) -> Option<f64> {
    match (a, b) {
        (Value::List(a), Value::List(b)) if a.len() == b.len() => {
            let each: Option<Vec<f64>> = a.iter().zip(b).map(|(a, b)| distance(a, b)).collect();
            each.map(|each| {
                each.into_iter().fold(0.0, |most: f64, d| if d.is_nan() { d } else { most.max(d) })
            })
        }
        _ => Some((number(a)? - number(b)?).abs()),
    }
}

fn difference(a: &Value, b: &Value) -> String {
    distance(a, b).filter(|d| *d > 0.0).map(words::number).unwrap_or_default()
}

fn shown(v: &Value) -> String {
    const MOST: usize = 12;
    match v {
        Value::Nothing => "()".into(),
        Value::Bool(b) => b.to_string(),
        Value::Int(n) => n.to_string(),
        Value::Number(n) => words::number(*n),
        Value::Text(text) => {
            let cut: String = text.chars().take(120).collect();
            format!("\"{cut}{}\"", if cut.len() < text.len() { "…" } else { "" })
        }
        Value::List(list) => {
            let more = if list.len() > MOST { ", …" } else { "" };
            let texts: Vec<String> = list.iter().take(MOST).map(shown).collect();
            format!("[{}{more}]", texts.join(", "))
        }
        Value::Map(map) => {
            let more = if map.len() > MOST { ", …" } else { "" };
            let texts: Vec<String> =
                map.iter().take(MOST).map(|(k, v)| format!("{k}: {}", shown(v))).collect();
            format!("#{{ {}{more} }}", texts.join(", "))
        }
    }
}
