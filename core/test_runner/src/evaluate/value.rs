//! Judges values that a script has computed itself.

use super::Judgment;
use super::text_format::{self, matches_pattern, tolerance_ratio};
use choreo_script::testing::{Expectation, Value, ValueTest};

pub(super) fn judge(e: &Expectation, got: &Value, test: &ValueTest) -> Judgment {
    let number = as_number(got);
    let (holds, expected, by) = match test {
        ValueTest::Equals(wanted) => {
            (equal_values(got, wanted), value_text(wanted), difference_text(got, wanted))
        }
        ValueTest::Near { goal, tolerance } => {
            let off = distance(got, goal);
            let by =
                off.map(|off| format!("{}{}", text_format::number(off), tolerance_ratio(off, *tolerance)));
            let holds = off.is_some_and(|off| off <= *tolerance);
            (
                holds,
                format!("{} ± {}", value_text(goal), text_format::number(*tolerance)),
                by.unwrap_or_default(),
            )
        }
        ValueTest::Below(limit) => (
            number.is_some_and(|n| n <= *limit),
            format!("at most {}", text_format::number(*limit)),
            number.map(|n| text_format::number(n - limit)).unwrap_or_default(),
        ),
        ValueTest::Above(limit) => (
            number.is_some_and(|n| n >= *limit),
            format!("at least {}", text_format::number(*limit)),
            number.map(|n| text_format::number(limit - n)).unwrap_or_default(),
        ),
        ValueTest::Between(low, high) => (
            number.is_some_and(|n| (*low..=*high).contains(&n)),
            format!("{} to {}", text_format::number(*low), text_format::number(*high)),
            number.map(|n| text_format::number((low - n).max(n - high))).unwrap_or_default(),
        ),
        ValueTest::Contains(part) => {
            let holds = match (got, part) {
                (Value::Text(text), Value::Text(part)) => text.contains(part.as_str()),
                (Value::List(list), part) => list.iter().any(|element| equal_values(element, part)),
                _ => false,
            };
            (holds, format!("containing {}", value_text(part)), String::new())
        }
        ValueTest::Matches(pattern) => {
            let holds = matches!(got, Value::Text(text) if matches_pattern(text, pattern));
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
    Judgment::new(holds != e.negated, expected, value_text(got)).with_error(by)
}

fn as_number(v: &Value) -> Option<f64> {
    match v {
        Value::Int(n) => Some(*n as f64),
        Value::Number(n) => Some(*n),
        _ => None,
    }
}

/// Whether values are equal. Integers and floats are compared by value; NaN is not equal to anything.
fn equal_values(a: &Value, b: &Value) -> bool {
    match (a, b) {
        (Value::Int(a), Value::Int(b)) => a == b,
        (Value::List(a), Value::List(b)) => {
            a.len() == b.len() && a.iter().zip(b).all(|(a, b)| equal_values(a, b))
        }
        (Value::Map(a), Value::Map(b)) => {
            a.len() == b.len() && a.iter().zip(b).all(|((k, a), (l, b))| k == l && equal_values(a, b))
        }
        (a, b) => match (as_number(a), as_number(b)) {
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
        _ => Some((as_number(a)? - as_number(b)?).abs()),
    }
}

fn difference_text(a: &Value, b: &Value) -> String {
    distance(a, b).filter(|d| *d > 0.0).map(text_format::number).unwrap_or_default()
}

fn value_text(v: &Value) -> String {
    const MAX_SHOWN: usize = 12;
    match v {
        Value::Nothing => "()".into(),
        Value::Bool(b) => b.to_string(),
        Value::Int(n) => n.to_string(),
        Value::Number(n) => text_format::number(*n),
        Value::Text(text) => {
            let cut: String = text.chars().take(120).collect();
            format!("\"{cut}{}\"", if cut.len() < text.len() { "…" } else { "" })
        }
        Value::List(list) => {
            let more = if list.len() > MAX_SHOWN { ", …" } else { "" };
            let texts: Vec<String> = list.iter().take(MAX_SHOWN).map(value_text).collect();
            format!("[{}{more}]", texts.join(", "))
        }
        Value::Map(map) => {
            let more = if map.len() > MAX_SHOWN { ", …" } else { "" };
            let texts: Vec<String> =
                map.iter().take(MAX_SHOWN).map(|(k, v)| format!("{k}: {}", value_text(v))).collect();
            format!("#{{ {}{more} }}", texts.join(", "))
        }
    }
}
