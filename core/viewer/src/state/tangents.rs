//! Tangents of keys in the units of curves: those that the script states, and those that follow from the interpolation.

use crate::state::keyed::{KeyedProperty, ValueKind};
use choreo_motion::{Interpolation, Time};
use choreo_session::edit::{KeyShape, KeySide, WrittenKey, WrittenKeys};
use choreo_stage::{Property, Tangents};

/// Default length of a handle, as a fraction of the span.
pub const DEFAULT_HANDLE_LENGTH: f64 = 1.0 / 3.0;

/// A tangent handle on one side of a key.
#[derive(Clone, Debug, PartialEq)]
pub struct KeyHandle {
    /// Slope of each component, units per second.
    pub tangent: Vec<f64>,
    /// Length of the handle of each component, as a fraction of the span.
    pub weight: Vec<f64>,
    /// Length of the span, seconds.
    pub span: f64,
}

/// A choice for the tangents of a key.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TangentChoice {
    /// Tangents of the interpolation of all keys.
    Automatic,
    /// Tangents that keep the curve within the range of each span.
    Monotone,
    Flat,
    /// Straight lines to the neighboring keys.
    Linear,
    /// One direction for both sides, to be dragged.
    Aligned,
    /// A direction for each side.
    Broken,
}

impl TangentChoice {
    pub const ALL: [(TangentChoice, &'static str); 6] = [
        (TangentChoice::Automatic, "Automatic: like all keys"),
        (TangentChoice::Monotone, "Monotone: no overshoot"),
        (TangentChoice::Flat, "Flat"),
        (TangentChoice::Linear, "Linear: straight to its neighbors"),
        (TangentChoice::Aligned, "Free, both sides aligned"),
        (TangentChoice::Broken, "Free, broken"),
    ];
}

impl KeyedProperty {
    /// The script's keys, if they can have tangents.
    fn keys_with_tangents(&self) -> Option<&WrittenKeys> {
        let written = self.written.as_ref()?;
        let is_quaternion = |key: &WrittenKey| key.numbers.as_ref().is_some_and(|all| all.len() == 4);
        let can = match self.kind {
            ValueKind::Numbers(_) | ValueKind::Degrees | ValueKind::Scale | ValueKind::Color => true,
            ValueKind::Rotation => !written.keys.iter().any(is_quaternion),
            ValueKind::Direction | ValueKind::Kelvin | ValueKind::Flag => false,
        };
        (can && self.interpolation() != Some(Interpolation::Step)).then_some(written)
    }

    /// Easing and tangents of a key, as the script states them. `None` if the key cannot have tangents.
    pub fn shape(&self, key: usize) -> Option<KeyShape> {
        self.keys_with_tangents()?.keys.get(key)?.shape.clone()
    }

    /// Incoming and outgoing handle of a key. `None` for a side without a span, or whose span has an easing.
    pub fn handles(&self, key: usize) -> [Option<KeyHandle>; 2] {
        [self.handle(key, 0), self.handle(key, 1)]
    }

    fn handle(&self, key: usize, side: usize) -> Option<KeyHandle> {
        let written = self.keys_with_tangents()?;
        let next = if side == 0 { key } else { key + 1 };
        let before = next.checked_sub(1)?;
        let [from, to] = [written.keys.get(before)?, written.keys.get(next)?];
        let [leaving, reaching] = [from.shape.as_ref()?, to.shape.as_ref()?];
        let has_tangents = leaving.outgoing.is_given() || reaching.incoming.is_given();
        let interpolation = written.interpolation.as_deref().unwrap_or("\"linear\"");
        let eased_by_all = interpolation.starts_with('[')
            || interpolation.starts_with("\"in_")
            || interpolation.starts_with("\"out_");
        if reaching.ease.is_some() || eased_by_all && !has_tangents {
            return None;
        }
        let own = if side == 0 { &reaching.incoming } else { &leaving.outgoing };
        let span = (self.keys[next] - self.keys[before]).as_secs();
        let tangent = match &own.tangent {
            Some(own) => self.expand_to_components(own),
            None => self.automatic_tangent(interpolation, key, [before, next]),
        };
        let weight = own.weight.as_ref().map_or(vec![DEFAULT_HANDLE_LENGTH; self.width()], |own| {
            match own.as_slice() {
                [one] => vec![*one; self.width()],
                all => all.to_vec(),
            }
        });
        Some(KeyHandle { tangent, weight, span })
    }

    /// A stated tangent with as many components as the value.
    fn expand_to_components(&self, stated: &[f64]) -> Vec<f64> {
        let mut all = match (stated, self.kind) {
            ([y], ValueKind::Rotation) if self.width() == 3 => vec![0.0, *y, 0.0],
            // Only the angle about y is displayed.
            ([_, y, _], ValueKind::Rotation) if self.width() == 1 => vec![*y],
            ([one], _) => vec![*one; self.width()],
            (all, _) => all.to_vec(),
        };
        all.resize(self.width(), 0.0);
        all
    }

    /// Components at a time that have curves.
    fn components_at(&self, at: &Time) -> Vec<f64> {
        let mut numbers = self.at(*at);
        numbers.truncate(self.width());
        numbers
    }

    /// Tangent that the interpolation gives a key. `span`: the keys whose straight connection is used for linear keys.
    fn automatic_tangent(&self, interpolation: &str, key: usize, span: [usize; 2]) -> Vec<f64> {
        let tangents = match interpolation {
            "\"smooth\"" => Some(Tangents::Flat),
            "\"cubic\"" => Some(Tangents::Limited),
            "\"catmull_rom\"" => Some(Tangents::CatmullRom),
            _ => None,
        };
        match tangents {
            Some(tangents) => self.tangent_at_key(tangents, key),
            None => self.linear_tangent(span),
        }
    }

    fn tangent_at_key(&self, tangents: Tangents, key: usize) -> Vec<f64> {
        let vector = self.property() == Some(Property::Translation);
        // A tangent depends on the neighboring keys; at both ends it is flat.
        let near = key.checked_sub(1).and_then(|before| self.keys.get(before..before + 3));
        let Some(near) = near else { return vec![0.0; self.width()] };
        let values: Vec<Vec<f64>> = near.iter().map(|at| self.components_at(at)).collect();
        tangents.of(near, &values, vector).swap_remove(1)
    }

    fn linear_tangent(&self, [from, to]: [usize; 2]) -> Vec<f64> {
        let secs = (self.keys[to] - self.keys[from]).as_secs();
        let [a, b] = [from, to].map(|key| self.at(self.keys[key]));
        a.iter().zip(&b).take(self.width()).map(|(a, b)| (b - a) / secs).collect()
    }

    /// Tangents of a key after a choice. `None` if it cannot have tangents.
    pub fn shape_after_choice(&self, key: usize, choice: TangentChoice) -> Option<KeyShape> {
        let now = self.shape(key)?;
        let [before, after] = self.handles(key);
        let both = |tangent: Vec<f64>| {
            let side = |old: &KeySide| KeySide { tangent: Some(tangent.clone()), weight: old.weight.clone() };
            let (incoming, outgoing) = (side(&now.incoming), side(&now.outgoing));
            KeyShape { ease: now.ease.clone(), incoming, outgoing, broken: false }
        };
        let sides = [&before, &after].map(|handle| handle.as_ref().map(|handle| handle.tangent.clone()));
        let each = |sides: [Option<Vec<f64>>; 2], broken: bool| {
            let [first, second] = sides;
            let rest = || vec![0.0; self.width()];
            let incoming = first.clone().or(second.clone()).unwrap_or_else(rest);
            let outgoing = second.or(first).unwrap_or_else(rest);
            let mut shape = both(incoming);
            (shape.outgoing.tangent, shape.broken) = (Some(outgoing), broken);
            shape
        };
        let spans = [key.checked_sub(1).map(|before| [before, key]), Some([key, key + 1])];
        let spans = spans.map(|span| span.filter(|[_, to]| *to < self.keys.len()));
        Some(match choice {
            TangentChoice::Automatic => KeyShape { ease: now.ease.clone(), ..KeyShape::default() },
            TangentChoice::Monotone => both(self.tangent_at_key(Tangents::Limited, key)),
            TangentChoice::Flat => both(vec![0.0; self.width()]),
            TangentChoice::Linear => {
                each(spans.map(|span| span.map(|span| self.linear_tangent(span))), false)
            }
            TangentChoice::Broken => each(sides, true),
            TangentChoice::Aligned => {
                let KeyShape { incoming, outgoing, .. } = each(sides, false);
                let [a, b] = [incoming.tangent.unwrap_or_default(), outgoing.tangent.unwrap_or_default()];
                both(a.iter().zip(&b).map(|(a, b)| 0.5 * (a + b)).collect())
            }
        })
    }

    /// Tangents of a key after one of its handles was dragged. The other side is aligned unless the key is broken. `None` if it cannot have
    /// tangents.
    pub fn shape_after_drag(&self, key: usize, drag: &HandleDrag) -> Option<KeyShape> {
        let mut shape = self.shape(key)?;
        let handles = self.handles(key);
        shape.broken |= drag.breaks;
        for side in 0..2 {
            let of = if side == 0 { &mut shape.incoming } else { &mut shape.outgoing };
            if side != drag.side && shape.broken {
                continue;
            }
            let Some(handle) = handles[side].as_ref().or(handles[drag.side].as_ref()) else { continue };
            let mut tangent = handle.tangent.clone();
            *tangent.get_mut(drag.part)? = drag.tangent;
            of.tangent = Some(tangent);
            if let Some(length) = drag.weight.filter(|_| side == drag.side) {
                let mut weight = handle.weight.clone();
                *weight.get_mut(drag.part)? = length;
                let even = weight.iter().all(|w| *w == weight[0]);
                of.weight = Some(if even { vec![weight[0]] } else { weight });
            }
        }
        Some(shape)
    }
}

/// Tangents that keep the curves unchanged when a key is inserted.
#[derive(Clone, Debug, PartialEq)]
pub struct SplitSpan {
    /// Index of the key before the new one.
    pub before: usize,
    /// Tangents of the previous key, the new key and the next key.
    pub shapes: [KeyShape; 3],
}

impl KeyedProperty {
    /// Splits a span with tangents at a new key. `None` if there is no such span.
    pub fn split(&self, at: Time) -> Option<SplitSpan> {
        let next = self.keys.partition_point(|key| *key <= at);
        let before = next.checked_sub(1)?;
        let (mut first, mut last) = (self.shape(before)?, self.shape(next)?);
        if self.keys[before] == at || !(first.outgoing.is_given() || last.incoming.is_given()) {
            return None;
        }
        let [leaving, reaching] = [self.handle(before, 1)?, self.handle(next, 0)?];
        let share = (at - self.keys[before]).as_secs() / leaving.span;
        let [from, to] = [before, next].map(|key| self.at(self.keys[key]));
        let part = |n: usize| -> Option<SplitCurve> {
            let (w0, w1, span) = (*leaving.weight.get(n)?, *reaching.weight.get(n)?, leaving.span);
            let (m0, m1) = (leaving.tangent[n], reaching.tangent[n]);
            let values = [from[n], from[n] + w0 * span * m0, to[n] - w1 * span * m1, to[n]];
            Some(SplitCurve::of([0.0, w0, 1.0 - w1, 1.0], values, share, span))
        };
        let parts: Vec<SplitCurve> = (0..self.width()).map(part).collect::<Option<_>>()?;
        let side = |tangent: Vec<f64>, weight: usize| {
            let weight: Vec<f64> = parts.iter().map(|part| part.weights[weight]).collect();
            let even = weight.iter().all(|weight| (weight - DEFAULT_HANDLE_LENGTH).abs() < 1e-6);
            KeySide { tangent: Some(tangent), weight: (!even).then_some(weight) }
        };
        let tangent: Vec<f64> = parts.iter().map(|part| part.tangent).collect();
        first.outgoing = side(leaving.tangent, 0);
        last.incoming = side(reaching.tangent, 3);
        let (incoming, outgoing) = (side(tangent.clone(), 1), side(tangent, 2));
        let new = KeyShape { incoming, outgoing, ..KeyShape::default() };
        Some(SplitSpan { before, shapes: [first, new, last] })
    }
}

/// Two halves of a cubic Bézier curve over time, split by de Casteljau's algorithm.
struct SplitCurve {
    /// Slope at the split, units per second.
    tangent: f64,
    /// Lengths of the four handles, each as a fraction of its half.
    weights: [f64; 4],
}

impl SplitCurve {
    /// Splits a curve. `times`, `values`: its control points, times as fractions of the span; `share`: time of the split as a fraction; `span`:
    /// seconds.
    fn of(times: [f64; 4], values: [f64; 4], share: f64, span: f64) -> SplitCurve {
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..60 {
            let u = 0.5 * (low + high);
            if de_casteljau(times, u)[2] < share { low = u } else { high = u }
        }
        let u = 0.5 * (low + high);
        let [t0, ta, _, tb, t3] = de_casteljau(times, u);
        let [_, va, _, vb, _] = de_casteljau(values, u);
        let lengths = [t0 / share, (share - ta) / share, (tb - share) / (1.0 - share), t3 / (1.0 - share)];
        let rise = if tb > ta { (vb - va) / ((tb - ta) * span) } else { 0.0 };
        SplitCurve { tangent: rise, weights: lengths.map(|length| length.clamp(0.0, 1.0)) }
    }
}

/// De Casteljau's algorithm at the parameter `u`: length of the first handle, control point before the split, split point, control point after it,
/// and length of the last handle.
fn de_casteljau([a, b, c, d]: [f64; 4], u: f64) -> [f64; 5] {
    let mix = |a: f64, b: f64| a + (b - a) * u;
    let (ab, bc, cd) = (mix(a, b), mix(b, c), mix(c, d));
    let (abc, bcd) = (mix(ab, bc), mix(bc, cd));
    [ab - a, abc, mix(abc, bcd), bcd, d - cd]
}

/// Drag of a tangent handle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HandleDrag {
    /// 0: incoming side, 1: outgoing side.
    pub side: usize,
    /// Index of the component.
    pub part: usize,
    /// New slope of the component, units per second.
    pub tangent: f64,
    /// New length as a fraction of the span, if that changes, too.
    pub weight: Option<f64>,
    /// Whether the other side stays as it is.
    pub breaks: bool,
}
