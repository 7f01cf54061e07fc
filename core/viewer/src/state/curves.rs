//! State of the curve editor: its visible range, hidden curves, and dragged keys.

use crate::state::keyed::{KeyRef, KeyedProperty};
use crate::state::selection::Selected;
use crate::state::span::Span;
use choreo_motion::Time;
use std::collections::BTreeSet;
use std::sync::Arc;

/// Largest number of samples of a curve.
const MAX_SAMPLES: usize = 4000;

pub struct Curves {
    /// Times at the left and the right edge, independent of the sequencer.
    pub time: Span,
    /// Values at the bottom and the top edge.
    pub values: Span,
    /// Hidden curves: object, property and component.
    pub hidden: BTreeSet<(Selected, String, usize)>,
    /// Whether rates of change per second are displayed in place of values.
    pub shows_speed: bool,
    /// Whether each property is scaled to the full height.
    pub normalized: bool,
    /// Whether times and values are fitted to the keys in the next frame.
    pub fits_to_keys: bool,
    /// Object whose curves were displayed last.
    last_shown: Option<Selected>,
    /// Whether the pointer was over the editor in the last frame, so that some shortcuts apply to it.
    pub hovered: bool,
    /// Whether the editor was drawn in the last frame.
    pub was_drawn: bool,
    pub drag: Option<KeyDrag>,
    cached: Option<CachedProperties>,
}

/// Properties of an object that can have keys, and those that do.
pub type KnownProperties = (Arc<Vec<KeyedProperty>>, Arc<Vec<KeyedProperty>>);

/// Cached properties of an object in one version of the scene.
struct CachedProperties {
    number: u64,
    what: Selected,
    all: Arc<Vec<KeyedProperty>>,
    /// Properties that have keys.
    keyed: Arc<Vec<KeyedProperty>>,
}

impl Default for Curves {
    fn default() -> Curves {
        Curves {
            time: Span::whole(1.0),
            values: Span { from: 0.0, to: 1.0 },
            hidden: BTreeSet::new(),
            shows_speed: false,
            normalized: false,
            fits_to_keys: false,
            last_shown: None,
            hovered: false,
            was_drawn: false,
            drag: None,
            cached: None,
        }
    }
}

/// Keys that are being dragged.
#[derive(Clone, Debug, PartialEq)]
pub struct KeyDrag {
    pub key: KeyRef,
    /// Component of the value that was grabbed.
    pub part: usize,
    /// Change of the time, seconds.
    pub by: f64,
    /// Change of the component, in the unit of the value.
    pub value: f64,
}

impl Curves {
    /// Properties of an object in a version of the scene that can have keys, and those that do. The result is cached between frames.
    pub fn properties(
        &mut self,
        number: u64,
        what: &Selected,
        find: impl FnOnce() -> Vec<KeyedProperty>,
    ) -> KnownProperties {
        let same = self.cached.as_ref().filter(|known| known.what == *what);
        if let Some(known) = same.filter(|known| known.number == number) {
            return (known.all.clone(), known.keyed.clone());
        }
        let all = Arc::new(find());
        let keyed = Arc::new(all.iter().filter(|p| p.has_keys()).cloned().collect::<Vec<_>>());
        self.cached =
            Some(CachedProperties { number, what: what.clone(), all: all.clone(), keyed: keyed.clone() });
        self.drag = None;
        (all, keyed)
    }

    /// Whether the object of the curves has changed since the last call.
    pub(crate) fn changes_object(&mut self, what: &Selected, keyed: &[KeyedProperty]) -> bool {
        let is_other = self.last_shown.as_ref() != Some(what);
        self.last_shown = Some(what.clone()).filter(|_| !keyed.is_empty());
        is_other && !keyed.is_empty()
    }

    pub(crate) fn is_shown(&self, property: &KeyedProperty, part: usize) -> bool {
        !self.hidden.contains(&(property.what.clone(), property.name.clone(), part))
    }

    /// Whether the curve editor is open and hides all curves of a property.
    pub(crate) fn hides(&self, property: &KeyedProperty) -> bool {
        self.was_drawn && !(0..property.width()).any(|part| self.is_shown(property, part))
    }

    /// Fits the value range to the curves, from the first to the last key or within `span`.
    pub(crate) fn fit_values(
        &mut self,
        properties: &[KeyedProperty],
        min_end: Time,
        span: Option<(Time, Time)>,
    ) {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for property in properties {
            let (Some(first), Some(last)) = (property.keys.first(), property.keys.last()) else { continue };
            let (from, to) = span.unwrap_or((*first, (*last).max(min_end)));
            let samples = self.samples(property, from, to, 200);
            for (_, numbers) in samples {
                let shown = numbers.iter().enumerate().filter(|(part, _)| self.is_shown(property, *part));
                for (_, number) in shown {
                    (low, high) = (low.min(*number), high.max(*number));
                }
            }
        }
        if low > high {
            (low, high) = (0.0, 1.0);
        }
        let margin = ((high - low) * 0.1).max(if high - low < 1e-6 { 0.5 } else { 0.0 });
        self.values = Span { from: low - margin, to: high + margin };
    }

    /// Offset to add to a value, and divisor to apply afterwards, to draw it on the common scale.
    pub fn scale(&self, property: &KeyedProperty) -> (f64, f64) {
        if !self.normalized || self.shows_speed {
            return (0.0, 1.0);
        }
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for key in &property.keys {
            for number in property.at(*key) {
                (low, high) = (low.min(number), high.max(number));
            }
        }
        if high - low < 1e-9 { (-low, 1.0) } else { (-low, high - low) }
    }

    /// Samples of a curve between two times: values on the common scale, or their change per second.
    pub fn samples(
        &self,
        property: &KeyedProperty,
        from: Time,
        to: Time,
        count: usize,
    ) -> Vec<(Time, Vec<f64>)> {
        let count = count.clamp(2, MAX_SAMPLES) as i64;
        let length = (to - from).0.max(1);
        let mut times: Vec<Time> = (0..=count)
            .map(|n| Time(from.0 + (i128::from(length) * i128::from(n) / i128::from(count)) as i64))
            .collect();
        // Keys and the ticks before them are sampled, too, so that bends and jumps are exact; the speed ends after the last key.
        let bends = property.keys.iter().flat_map(|key| [*key - Time(1), *key]);
        let bends = bends.chain(property.keys.last().map(|key| *key + Time(1)));
        times.extend(bends.filter(|time| from <= *time && *time <= to).take(2 * MAX_SAMPLES));
        times.sort_unstable();
        times.dedup();
        let scale = self.scale(property);
        times.into_iter().map(|time| (time, self.displayed_values(property, time, scale))).collect()
    }

    /// Components of a property at a time as drawn. The last argument is the result of [`Curves::scale`].
    pub fn displayed_values(
        &self,
        property: &KeyedProperty,
        time: Time,
        (add, divide): (f64, f64),
    ) -> Vec<f64> {
        match self.shows_speed {
            true => change_per_second(property, time),
            false => property.at(time).iter().map(|v| (v + add) / divide).collect(),
        }
    }
}

/// Change of a value per second, measured over at most a thousandth of a second before and after `time` and between the surrounding keys. At a key
/// it is that after the key; at the last key that before it.
fn change_per_second(property: &KeyedProperty, time: Time) -> Vec<f64> {
    let (step, keys) = (Time::from_secs(1e-3), &property.keys);
    let next = keys.partition_point(|key| *key <= time) - usize::from(keys.last() == Some(&time));
    let (mut from, mut to) = (time - step, time + step);
    let start = next.checked_sub(1).map_or(from, |before| from.max(keys[before]));
    // A stepped value changes exactly at its key.
    let end = keys.get(next).map_or(to, |key| to.min(*key - Time(1)));
    // Keys closer together are a jump.
    if (end - start).0 > step.0 / 4 {
        (from, to) = (start, end);
    }
    let length = (to - from).as_secs();
    property.at(from).iter().zip(property.at(to)).map(|(a, b)| (b - a) / length).collect()
}

impl Span {
    /// Zooms the values. A factor above 1 shows less; the value at the fraction `part` of the height stays in place.
    pub(crate) fn zoom_values(&mut self, factor: f64, part: f64) {
        let at = self.from + (self.to - self.from) * part;
        let size = ((self.to - self.from) / factor.max(1e-6)).clamp(1e-6, 1e9);
        *self = Span { from: at - size * part, to: at + size * (1.0 - part) };
    }

    pub(crate) fn pan_values(&mut self, part: f64) {
        let by = (self.to - self.from) * part;
        *self = Span { from: self.from + by, to: self.to + by };
    }
}
