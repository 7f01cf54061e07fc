//! `<sampler>`: animation keys and their interpolation.

use crate::source::{doubles, inputs, names};
use crate::xml::Node;
use crate::xml::Xml;
use choreo_importer_kit::Result;
use choreo_motion::Time;

/// Limit of key times, the same in all importers: about 115 days, seconds.
const MAX_SECS: f64 = 1e7;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Interpolation {
    Step,
    Linear,
    Bezier,
    Hermite,
}

/// Keys at increasing times, with `width` values each.
pub(crate) struct Sampler {
    pub times: Vec<Time>,
    pub values: Vec<f64>,
    pub width: usize,
    pub interpolation: Vec<Interpolation>,
    /// Tangents for each key: `width` pairs of time (s) and value, or `width` values.
    tangents_in: Vec<f64>,
    tangents_out: Vec<f64>,
}

impl Sampler {
    pub(crate) fn read(xml: &Xml<'_>, node: Node<'_>) -> Result<Sampler> {
        let mut sampler = Sampler {
            times: Vec::new(),
            values: Vec::new(),
            width: 1,
            interpolation: Vec::new(),
            tangents_in: Vec::new(),
            tangents_out: Vec::new(),
        };
        let mut secs = Vec::new();
        let mut words = Vec::new();
        let mut output = None;
        for input in inputs(xml, node)? {
            match input.semantic {
                "INPUT" => secs = doubles(xml, input.source, 1)?.0,
                "OUTPUT" => {
                    let (values, stride) = doubles(xml, input.source, 1)?;
                    (sampler.values, sampler.width) = (values, stride);
                    output = Some(input.source);
                }
                "INTERPOLATION" => words = names(xml, input.source)?.0,
                "IN_TANGENT" => sampler.tangents_in = doubles(xml, input.source, 2)?.0,
                "OUT_TANGENT" => sampler.tangents_out = doubles(xml, input.source, 2)?.0,
                _ => {}
            }
        }
        if output.is_none() || secs.is_empty() {
            return Err(xml.problem(node, "needs an INPUT with at least one time and an OUTPUT"));
        }
        // Some exporters omit the stride; then there are several values for each time.
        if sampler.width == 1
            && sampler.values.len() > secs.len()
            && sampler.values.len().is_multiple_of(secs.len())
        {
            sampler.width = sampler.values.len() / secs.len();
        }
        if sampler.values.len() != secs.len() * sampler.width {
            let what = format!(
                "{} times need {} values ({} each), but there are {}",
                secs.len(),
                secs.len() * sampler.width,
                sampler.width,
                sampler.values.len()
            );
            return Err(xml.problem(node, what));
        }
        if let Some(far) = secs.iter().find(|t| t.abs() > MAX_SECS) {
            return Err(xml.problem(node, format!("a key is at {far} s; the limit is {MAX_SECS} s")));
        }
        sampler.times = secs.iter().map(|t| Time::from_secs(*t)).collect();
        let keys = secs.len();
        let mut unknown = None;
        sampler.interpolation = (0..keys)
            .map(|i| match words.get(i).copied().unwrap_or("LINEAR") {
                "STEP" => Interpolation::Step,
                "LINEAR" => Interpolation::Linear,
                "BEZIER" => Interpolation::Bezier,
                "HERMITE" => Interpolation::Hermite,
                other => {
                    unknown = Some(other);
                    Interpolation::Linear
                }
            })
            .collect();
        if let Some(other) = unknown {
            xml.warn(node, format!("interpolation {other} is not supported; LINEAR is used"));
        }
        sampler.check_tangents(xml, node);
        sampler.drop_repeated(xml, node);
        Ok(sampler)
    }

    fn check_tangents(&mut self, xml: &Xml<'_>, node: Node<'_>) {
        let curved =
            self.interpolation.iter().any(|i| matches!(i, Interpolation::Bezier | Interpolation::Hermite));
        let (one, two) = (self.values.len(), self.values.len() * 2);
        let fits = |t: &Vec<f64>| t.len() == one || t.len() == two;
        let same = self.tangents_in.len() == self.tangents_out.len();
        if curved && !(fits(&self.tangents_in) && fits(&self.tangents_out) && same) {
            xml.warn(node, "curved keys without tangents, or with too few; LINEAR is used");
            for i in &mut self.interpolation {
                if matches!(i, Interpolation::Bezier | Interpolation::Hermite) {
                    *i = Interpolation::Linear;
                }
            }
        }
    }

    /// Drops keys that are not later than the key before.
    fn drop_repeated(&mut self, xml: &Xml<'_>, node: Node<'_>) {
        let mut kept: Vec<usize> = Vec::with_capacity(self.times.len());
        for i in 0..self.times.len() {
            if kept.last().is_none_or(|last| self.times[i] > self.times[*last]) {
                kept.push(i);
            }
        }
        let dropped = self.times.len() - kept.len();
        if dropped == 0 {
            return;
        }
        xml.warn(
            node,
            format!("{dropped} of {} keys are not after the one before; they are left out", self.times.len()),
        );
        let tangent_width = self.tangents_in.len() / self.times.len().max(1);
        let pick = |list: &[f64], width: usize| -> Vec<f64> {
            kept.iter()
                .flat_map(|i| list.get(i * width..(i + 1) * width).unwrap_or_default())
                .copied()
                .collect()
        };
        self.values = pick(&self.values, self.width);
        self.tangents_in = pick(&self.tangents_in, tangent_width);
        self.tangents_out = pick(&self.tangents_out, tangent_width);
        self.interpolation = kept.iter().map(|i| self.interpolation[*i]).collect();
        self.times = kept.iter().map(|i| self.times[*i]).collect();
    }

    /// Whether any interpolation is STEP, and whether all are.
    pub(crate) fn steps(&self) -> (bool, bool) {
        let step = |i: &Interpolation| *i == Interpolation::Step;
        (self.interpolation.iter().any(step), self.interpolation.iter().all(step))
    }

    /// Whether all interpolations are STEP or LINEAR.
    pub(crate) fn is_plain(&self) -> bool {
        self.interpolation.iter().all(|i| matches!(i, Interpolation::Step | Interpolation::Linear))
    }

    /// The key at or before a time, and the fraction of the way to the next key.
    pub(crate) fn locate(&self, time: Time) -> (usize, f64) {
        let after = self.times.partition_point(|t| *t <= time);
        if after == 0 {
            return (0, 0.0);
        }
        let key = after - 1;
        let Some(next) = self.times.get(after) else { return (key, 0.0) };
        if self.interpolation[key] == Interpolation::Step {
            return (key, 0.0);
        }
        let span = (next.0 - self.times[key].0) as f64;
        (key, (time.0 - self.times[key].0) as f64 / span)
    }

    /// One value at a time; constant before the first and after the last key.
    pub(crate) fn value(&self, time: Time, component: usize) -> f64 {
        self.value_at(self.locate(time), component)
    }

    /// All values at a time, as many as fit into `out`.
    pub(crate) fn row(&self, time: Time, out: &mut [f64]) {
        let at = self.locate(time);
        out.iter_mut().enumerate().for_each(|(component, v)| *v = self.value_at(at, component));
    }

    fn value_at(&self, (key, part): (usize, f64), component: usize) -> f64 {
        let at = |key: usize| self.values[key * self.width + component];
        if part == 0.0 {
            return at(key);
        }
        let (a, b) = (at(key), at(key + 1));
        match self.interpolation[key] {
            Interpolation::Step | Interpolation::Linear => a + (b - a) * part,
            kind => self.curve(key, component, part, kind == Interpolation::Hermite),
        }
    }

    /// A cubic Bézier in (time, value). A Hermite curve is a Bézier whose handles are a third of the tangents long.
    fn curve(&self, key: usize, component: usize, part: f64, hermite: bool) -> f64 {
        let (a, b) =
            (self.values[key * self.width + component], self.values[(key + 1) * self.width + component]);
        let (t0, t1) = (self.times[key].as_secs(), self.times[key + 1].as_secs());
        let span = t1 - t0;
        let pairs = self.tangents_out.len() == self.values.len() * 2;
        let handle = |list: &[f64], key: usize, time: f64, value: f64, sign: f64| -> (f64, f64) {
            let at = key * self.width + component;
            let (x, y) = if pairs { (list[at * 2], list[at * 2 + 1]) } else { (f64::NAN, list[at]) };
            match (hermite, pairs) {
                (true, true) => (time + sign * x / 3.0, value + sign * y / 3.0),
                (true, false) => (time + sign * span / 3.0, value + sign * y / 3.0),
                (false, true) => (x, y),
                (false, false) => (time + sign * span / 3.0, y),
            }
        };
        let (x1, y1) = handle(&self.tangents_out, key, t0, a, 1.0);
        let (x2, y2) = handle(&self.tangents_in, key + 1, t1, b, -1.0);
        // Handle times as fractions of the interval, limited so that time does not decrease.
        let (x1, x2) = (((x1 - t0) / span).clamp(0.0, 1.0), ((x2 - t0) / span).clamp(0.0, 1.0));
        let cubic = |s: f64, p1: f64, p2: f64, p3: f64| {
            let r = 1.0 - s;
            3.0 * r * r * s * p1 + 3.0 * r * s * s * p2 + s * s * s * p3
        };
        // Time increases with s, so bisection always finds it.
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..52 {
            let middle = (low + high) * 0.5;
            if cubic(middle, x1, x2, 1.0) < part { low = middle } else { high = middle }
        }
        let s = (low + high) * 0.5;
        a + cubic(s, y1 - a, y2 - a, b - a)
    }
}
