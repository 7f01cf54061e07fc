//! When a foot is on the ground, from where it goes.

use glam::DVec3;

/// What counts as standing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactRule {
    /// A point at most this far above the ground may stand, metres.
    pub height: f64,
    /// A point slower than this may stand, metres a second.
    pub speed: f64,
    /// A contact that has begun ends only beyond both limits times this, ≥ 1: it does not flicker.
    pub hold: f64,
    /// Seconds; what is shorter is no contact, and a shorter gap between two is none.
    pub least: f64,
}

impl Default for ContactRule {
    /// For a person's feet at walking and running pace.
    fn default() -> Self {
        ContactRule { height: 0.035, speed: 0.6, hold: 1.5, least: 0.05 }
    }
}

/// A stay on the ground: samples `first..=last`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Contact {
    pub first: usize,
    pub last: usize,
}

/// The contacts of a point with the ground. `positions`: in the world, +Y up, one every `step` seconds; `heights`: above the ground.
pub fn contacts(positions: &[DVec3], heights: &[f64], step: f64, rule: &ContactRule) -> Vec<Contact> {
    let mut found: Vec<Contact> = Vec::new();
    let mut open: Option<Contact> = None;
    let count = positions.len().min(heights.len());
    for (at, height) in heights.iter().enumerate().take(count) {
        // Over the neighbours, so that a touch-down is fast before it and slow after it alike.
        let (before, after) = (at.saturating_sub(1), (at + 1).min(count - 1));
        let speed = (positions[after] - positions[before]).length() / (step * (after - before).max(1) as f64);
        let factor = if open.is_some() { rule.hold } else { 1.0 };
        if *height <= rule.height * factor && speed <= rule.speed * factor {
            open.get_or_insert(Contact { first: at, last: at }).last = at;
        } else {
            found.extend(open.take());
        }
    }
    found.extend(open);
    let least = (rule.least / step).max(0.0);
    let mut joined: Vec<Contact> = Vec::new();
    for contact in found {
        match joined.last_mut() {
            Some(before) if ((contact.first - before.last) as f64) < least => before.last = contact.last,
            _ => joined.push(contact),
        }
    }
    joined.retain(|c| (c.last - c.first) as f64 >= least || c.first == 0 || c.last + 1 == count);
    joined
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A foot that stands for half of each second and is carried forward in an arc for the other half.
    fn walk(step: f64) -> (Vec<DVec3>, Vec<f64>) {
        let at = |i: usize| {
            let t = i as f64 * step;
            let (round, phase) = (t.floor(), t - t.floor());
            let swing = ((phase - 0.5) * 2.0).max(0.0);
            let eased = swing * swing * (3.0 - 2.0 * swing);
            DVec3::new(0.0, 0.08 + 0.12 * libm::sin(swing * std::f64::consts::PI), round + eased)
        };
        let positions: Vec<DVec3> = (0..(3.0 / step) as usize).map(at).collect();
        let heights = positions.iter().map(|p| p.y - 0.08).collect();
        (positions, heights)
    }

    #[test]
    fn each_step_is_found_where_it_is() {
        let (positions, heights) = walk(0.01);
        let found = contacts(&positions, &heights, 0.01, &ContactRule::default());
        assert_eq!(found.len(), 3, "{found:?}");
        for (index, contact) in found.iter().enumerate() {
            let (from, to) =
                (contact.first as f64 * 0.01 - index as f64, contact.last as f64 * 0.01 - index as f64);
            // A foot that leaves slowly still stands for a moment, and lands a moment early.
            assert!((-0.08..=0.01).contains(&from) && (0.48..=0.58).contains(&to), "{contact:?}");
        }
    }

    #[test]
    fn what_never_rests_has_no_contact_and_no_samples_are_fine() {
        let slide: Vec<DVec3> = (0..100).map(|i| DVec3::Z * f64::from(i) * 0.02).collect();
        assert!(contacts(&slide, &[0.0; 100], 0.01, &ContactRule::default()).is_empty());
        let rest = contacts(&[DVec3::ZERO; 10], &[0.0; 10], 0.01, &ContactRule::default());
        assert_eq!(rest, [Contact { first: 0, last: 9 }]);
        assert!(contacts(&[], &[], 0.01, &ContactRule::default()).is_empty());
    }
}
