//! Instancing of characters: one pose, many placements.

use crate::asset::{Asset, MeshInstance};
use crate::bounds::{Aabb, AffineRange};
use crate::skinning::widen;
use glam::{Affine3A, DAffine3, Vec3, Vec3A};

/// Up to this number of placements, boxes are joined one by one; more are bounded by the range of their transforms.
const MAX_SEPARATE_BOXES: usize = 64;

impl Asset {
    /// model-from-model of the character's first `count` placements (`None`: all); the identity if it has none.
    pub fn first_placements(&self, count: Option<u32>) -> impl Iterator<Item = Affine3A> + '_ {
        let identity = if self.placements.is_empty() { Some(Affine3A::IDENTITY) } else { None };
        let limit = count.filter(|_| !self.placements.is_empty()).map_or(usize::MAX, |n| n as usize);
        identity.into_iter().chain(self.placements.iter().copied().take(limit))
    }

    /// Every drawn copy of an instance: model-from-model of the character's placement, and joint-from-mesh of the copy. `count`
    /// limits the placements, or the copies if there are no placements.
    pub fn drawn_copies<'a>(
        &'a self,
        instance: &'a MeshInstance,
        count: Option<u32>,
    ) -> impl Iterator<Item = (Affine3A, Affine3A)> + 'a {
        let copies = if self.placements.is_empty() { count } else { None };
        self.first_placements(count)
            .flat_map(move |place| instance.joint_from_first(copies).map(move |copy| (place, copy)))
    }

    /// Number of times that an instance is drawn: placements times copies, each at least 1.
    pub fn times(&self, instance: &MeshInstance) -> usize {
        self.placements.len().max(1).saturating_mul(instance.copies.len().max(1))
    }

    /// Whether there are placements or copies, so that an actor's number of copies has an effect.
    pub fn has_copies(&self) -> bool {
        !self.placements.is_empty() || self.instances.iter().any(|i| !i.copies.is_empty())
    }

    /// Box around the box `of_one` at all placements, model space.
    pub fn spread(&self, of_one: &Aabb) -> Aabb {
        match self.placements.len() {
            _ if of_one.is_empty() => Aabb::EMPTY,
            0 => *of_one,
            1..=MAX_SEPARATE_BOXES => {
                let boxes = self.placements.iter().map(|place| of_one.transformed(place));
                boxes.fold(Aabb::EMPTY, Aabb::union)
            }
            _ => self.range_of_placements().map_or(*of_one, |range| range.transformed_bounds(of_one)),
        }
    }

    fn range_of_placements(&self) -> Option<AffineRange> {
        *self.derived.range_of_placements.get_or_init(|| AffineRange::of(&self.placements))
    }

    /// Calls `each` with boxes around all drawn copies of an instance in a pose, each with its transform into model space.
    pub fn posed_boxes(
        &self,
        instance: usize,
        model_from_joint: &[Affine3A],
        weights: &[f32],
        mut each: impl FnMut(&DAffine3, &Aabb),
    ) {
        let bounds = &self.instance_bounds()[instance];
        if self.placements.len() > MAX_SEPARATE_BOXES {
            each(&DAffine3::IDENTITY, &self.spread(&bounds.posed(model_from_joint, weights)));
            return;
        }
        for place in self.first_placements(None) {
            let place = (!self.placements.is_empty()).then(|| widen(&place));
            for part in &bounds.parts {
                let Some(joint) = model_from_joint.get(part.joint as usize) else { continue };
                let model_from_part = place.map_or(widen(joint), |place| place * widen(joint));
                each(&model_from_part, &part.morphed(weights));
            }
        }
    }

    /// Bounding radius around the model's origin, metres, of all placements of a character whose own bounding radius is `radius`;
    /// and an upper bound of the placements' scale, at least 1.
    pub fn farthest(&self, radius: f64) -> (f64, f64) {
        if self.placements.is_empty() {
            return (radius, 1.0);
        }
        let stretch = |place: &Affine3A| {
            // The Frobenius norm is at least the largest singular value.
            let m = place.matrix3;
            let square = |v: Vec3A| f64::from(Vec3::from(v).length_squared());
            (square(m.x_axis) + square(m.y_axis) + square(m.z_axis)).sqrt()
        };
        self.placements.iter().fold((0.0, 1.0), |(far, large): (f64, f64), place| {
            let stretch = stretch(place);
            let distance = f64::from(place.translation.length());
            (far.max(distance + stretch * radius), large.max(stretch))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Quat;

    /// Points on a lattice, each turned and scaled in its own way.
    fn placements(count: u32, turned: bool) -> Vec<Affine3A> {
        let place = |i: u32| {
            let at = Vec3::new(i as f32 % 7.0, i as f32 * 0.3 - 4.0, (i * i % 11) as f32);
            let turn = if turned { Quat::from_rotation_y(i as f32) } else { Quat::IDENTITY };
            let scale = if turned { Vec3::new(1.0, -0.5, 1.0 + i as f32 * 0.01) } else { Vec3::ONE };
            Affine3A::from_scale_rotation_translation(scale, turn, at)
        };
        (0..count).map(place).collect()
    }

    #[test]
    fn bounds_of_all_placements_contain_every_placed_corner_and_are_tight_for_translations() {
        let one = Aabb { min: Vec3::new(-0.5, 0.0, -2.0), max: Vec3::new(0.25, 1.75, -1.0) };
        for (count, turned) in [(1, true), (64, true), (65, true), (300, true), (300, false), (12, false)] {
            let asset = Asset { placements: placements(count, turned).into(), ..Asset::default() };
            let all = asset.spread(&one);
            let mut truth = Aabb::EMPTY;
            for place in asset.placements.iter() {
                one.corners().iter().for_each(|c| truth.add(place.transform_point3(*c)));
            }
            let holds = all.min.cmple(truth.min).all() && all.max.cmpge(truth.max).all();
            assert!(holds, "{count}: {all:?} {truth:?}");
            let loose = (all.max - all.min - (truth.max - truth.min)).max_element();
            assert!(loose < if turned { 3.0 } else { 1e-3 }, "{count}: {loose}");
        }
        assert!(Asset::default().spread(&Aabb::EMPTY).is_empty());
    }

    #[test]
    fn a_limit_counts_placements_or_copies_if_there_are_no_placements() {
        let moved = |x: f32| Affine3A::from_translation(Vec3::X * x);
        let instance = MeshInstance { copies: [moved(0.1), moved(0.2)].into(), ..MeshInstance::default() };
        let mut asset = Asset { placements: [moved(1.0), moved(2.0), moved(3.0)].into(), ..Asset::default() };
        asset.instances.push(instance.clone());
        let all = |asset: &Asset, count| -> Vec<f32> {
            let both = asset.drawn_copies(&instance, count);
            both.map(|(place, copy)| (place * copy).translation.x).collect()
        };
        assert_eq!(all(&asset, Some(2)), [1.1, 1.2, 2.1, 2.2]);
        assert_eq!((all(&asset, None).len(), asset.times(&instance), asset.has_copies()), (6, 6, true));
        assert_eq!(all(&asset, Some(0)), [0.0; 0]);
        asset.placements = Default::default();
        assert_eq!(all(&asset, Some(1)), [0.1]);
        assert_eq!(asset.times(&instance), 2);
    }
}
