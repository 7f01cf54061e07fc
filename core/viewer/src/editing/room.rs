//! Free places on the ground for new objects, found with bounding rectangles.

use super::placing::placement_at;
use crate::geometry::picking;
use choreo_motion::Time;
use choreo_stage::{Actor, ActorState, Stage};
use glam::{DAffine3, DVec2, DVec3};

/// Largest ratio of height to width of an object that counts as ground.
const MAX_GROUND_RATIO: f64 = 0.05;
/// Number of widths of the new object from which another object counts as a set that it may stand in, in both directions.
const MIN_SET_WIDTHS: f64 = 8.0;
/// Distance between bounds, as a fraction of the new object's width.
const GAP_FRACTION: f64 = 0.15;

/// Rectangle that an object covers on the ground: x and z in world space, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Footprint {
    pub low: DVec2,
    pub high: DVec2,
}

impl Footprint {
    fn of(low: DVec3, high: DVec3) -> Footprint {
        Footprint { low: DVec2::new(low.x, low.z), high: DVec2::new(high.x, high.z) }
    }

    /// A square around the origin for an object of which only the half width is known.
    pub(super) fn square(half_width: f64) -> Footprint {
        Footprint { low: DVec2::splat(-half_width), high: DVec2::splat(half_width) }
    }

    pub(super) fn moved(self, by: DVec3) -> Footprint {
        let by = DVec2::new(by.x, by.z);
        Footprint { low: self.low + by, high: self.high + by }
    }

    fn size(self) -> DVec2 {
        self.high - self.low
    }

    fn overlaps(self, other: Footprint, gap: f64) -> bool {
        (self.low - gap).cmplt(other.high).all() && (self.high + gap).cmpgt(other.low).all()
    }
}

/// Footprint of an actor as posed, else in its rest pose. `None` if it has no surface or is ground.
pub(super) fn footprint(actor: &Actor, state: Option<&ActorState>, time: Time) -> Option<Footprint> {
    let posed = state.filter(|state| state.visible).and_then(|state| picking::bounds(&actor.asset, state));
    let (low, high) = posed.or_else(|| {
        let rest = actor.asset.rest_bounds();
        let placed = placement_at(actor, time);
        let world_from_model =
            DAffine3::from_scale_rotation_translation(placed.scale, placed.rotation, placed.translation);
        let corners = rest.corners().map(|corner| world_from_model.transform_point3(corner.as_dvec3()));
        let low = corners.into_iter().reduce(DVec3::min).filter(|_| !rest.is_empty())?;
        Some((low, corners.into_iter().reduce(DVec3::max)?))
    })?;
    let size = high - low;
    (size.y > MAX_GROUND_RATIO * size.x.max(size.z)).then(|| Footprint::of(low, high))
}

/// Footprints of the actors of a stage at a time.
pub(super) fn footprints(stage: &Stage, time: Time) -> Vec<Footprint> {
    // If the stage cannot be evaluated, the rest poses are used.
    let snapshot = stage.at(time).ok();
    let state = |index: usize| snapshot.as_ref().and_then(|s| s.actors.get(index));
    let all = stage.actors.iter().enumerate();
    all.filter_map(|(index, actor)| footprint(actor, state(index), time)).collect()
}

/// Footprints that are in the way of an object; sets are not.
fn obstacles(occupied: &[Footprint], footprint: Footprint) -> impl Iterator<Item = Footprint> {
    let is_set = move |other: &Footprint| {
        (other.size() / footprint.size().max(DVec2::splat(1e-9))).min_element() > MIN_SET_WIDTHS
    };
    occupied.iter().copied().filter(move |other| !is_set(other))
}

/// Whether an object has room where it stands.
pub(super) fn is_free(occupied: &[Footprint], footprint: Footprint) -> bool {
    obstacles(occupied, footprint).all(|other| !footprint.overlaps(other, 0.0))
}

/// The free position nearest to a point along x. `footprint`: that of the object at the origin.
pub(super) fn nearest_free(occupied: &[Footprint], footprint: Footprint, point: DVec3) -> DVec3 {
    let gap = GAP_FRACTION * footprint.size().max_element();
    let others: Vec<Footprint> = obstacles(occupied, footprint).collect();
    let beside = others.iter().flat_map(|other| {
        [(other.high.x - footprint.low.x + gap, 1.0), (other.low.x - footprint.high.x - gap, -1.0)]
    });
    // Rounds outward to a tenth of a metre, or to a millimetre for small objects.
    let parts = if footprint.size().max_element() > 0.5 { 10.0 } else { 1000.0 };
    let beside = beside.map(|(x, side)| side * (x * side * parts).ceil() / parts);
    let at = |x: f64| DVec3::new(x, point.y, point.z);
    let mut places: Vec<f64> = std::iter::once(point.x).chain(beside).collect();
    places.sort_by(|a, b| (a - point.x).abs().total_cmp(&(b - point.x).abs()));
    let free = |x: &f64| others.iter().all(|other| !footprint.moved(at(*x)).overlaps(*other, gap * 0.5));
    places.iter().copied().find(free).map_or(point, at)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rectangle(x: [f64; 2], z: [f64; 2]) -> Footprint {
        Footprint { low: DVec2::new(x[0], z[0]), high: DVec2::new(x[1], z[1]) }
    }

    #[test]
    fn a_new_model_is_placed_beside_others_but_may_stand_inside_a_large_environment() {
        let footprint = rectangle([-0.5, 0.5], [-0.5, 0.5]);
        let mut occupied = vec![rectangle([-20.0, 20.0], [-20.0, 20.0])];
        assert_eq!(nearest_free(&occupied, footprint, DVec3::new(1.0, 0.0, 2.0)), DVec3::new(1.0, 0.0, 2.0));
        for _ in 0..5 {
            let at = nearest_free(&occupied, footprint, DVec3::ZERO);
            assert!(is_free(&occupied, footprint.moved(at)), "{at}");
            assert!(at.x.abs() <= 2.0 * 1.3 && at.z == 0.0, "{at}");
            occupied.push(footprint.moved(at));
        }
        // There is room behind them.
        let behind = DVec3::new(0.0, 0.0, -3.0);
        assert_eq!(nearest_free(&occupied, footprint, behind), behind);
    }
}
