//! Tests whether a box is in a camera's image, and how large it appears.

use crate::snapshot::{ActorState, CameraState};
use choreo_asset::{Aabb, Asset, DAabb, Projection};
use glam::DAffine3;

/// Reason why an actor is not in the image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum OutOfView {
    Behind,
    TooNear,
    TooFar,
    Left,
    Right,
    Above,
    Below,
}

impl OutOfView {
    pub(super) fn description(self) -> &'static str {
        match self {
            OutOfView::Behind => "behind the camera",
            OutOfView::TooNear => "nearer than the camera's near plane",
            OutOfView::TooFar => "beyond the camera's far plane",
            OutOfView::Left => "left of the image",
            OutOfView::Right => "right of the image",
            OutOfView::Above => "above the image",
            OutOfView::Below => "below the image",
        }
    }
}

pub(crate) struct CameraView {
    pub view_from_world: DAffine3,
    projection: Projection,
    /// Size of the image, pixels.
    size: [f64; 2],
}

impl CameraView {
    pub(super) fn new(camera: &CameraState, size: [u32; 2]) -> CameraView {
        let view_from_world = camera.world_from_view.inverse();
        let size = size.map(|n| f64::from(n.max(1)));
        CameraView { view_from_world, projection: camera.projection, size }
    }

    /// Bounds of a posed actor in view axes (right, up, back); empty if it has no meshes or is not posed.
    pub(super) fn actor_bounds(&self, asset: &Asset, state: &ActorState) -> DAabb {
        let mut bounds = DAabb::EMPTY;
        let view_from_model = self.view_from_world * state.world_from_model;
        for index in 0..asset.instances.len() {
            let weights = state.morph_weights.get(index).map_or(&[][..], Vec::as_slice);
            let add = |model_from_part: &DAffine3, part: &Aabb| {
                bounds.add_box(&(view_from_model * *model_from_part), part);
            };
            asset.posed_boxes(index, &state.model_from_joint, weights, add);
        }
        bounds
    }

    /// Longer side, in pixels, of the area that a box in view axes covers, or the reason why the box is not in the image. The test is exact
    /// for such boxes: the view is widest at their greatest depth.
    pub(super) fn covered_pixels(&self, bounds: &DAabb) -> Result<f64, OutOfView> {
        let (nearest, farthest) = (-bounds.max.z, -bounds.min.z);
        let aspect = self.size[0] / self.size[1];
        // Half of the image's width and height at a depth.
        let half = |depth: f64| match self.projection {
            Projection::Perspective { yfov, .. } => {
                let up = libm::tan(f64::from(yfov) / 2.0) * depth;
                (up * aspect, up)
            }
            Projection::Orthographic { height, .. } => {
                let up = f64::from(height) / 2.0;
                (up * aspect, up)
            }
        };
        let (near, far) = match self.projection {
            Projection::Perspective { near, far, .. } => {
                (f64::from(near), far.map_or(f64::INFINITY, f64::from))
            }
            Projection::Orthographic { near, far, .. } => (f64::from(near), f64::from(far)),
        };
        if farthest < near {
            return Err(if farthest < 0.0 { OutOfView::Behind } else { OutOfView::TooNear });
        }
        if nearest > far {
            return Err(OutOfView::TooFar);
        }
        let (wide, high) = half(farthest.min(far));
        let misses = [
            (bounds.max.x < -wide, OutOfView::Left),
            (bounds.min.x > wide, OutOfView::Right),
            (bounds.min.y > high, OutOfView::Above),
            (bounds.max.y < -high, OutOfView::Below),
        ];
        if let Some((_, miss)) = misses.iter().find(|(outside, _)| *outside) {
            return Err(*miss);
        }
        let (wide, high) = half(nearest.max(near));
        let size = bounds.max - bounds.min;
        Ok((size.x / (2.0 * wide) * self.size[0]).max(size.y / (2.0 * high) * self.size[1]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    fn camera_view(projection: Projection) -> CameraView {
        CameraView::new(&CameraState { projection, ..CameraState::default() }, [200, 100])
    }

    #[test]
    fn boxes_outside_the_image_report_their_side() {
        // A field of view of 90°: at depth d the image is 2d high and 4d wide.
        let yfov = std::f32::consts::FRAC_PI_2;
        let s = camera_view(Projection::Perspective { yfov, near: 0.5, far: Some(100.0) });
        let at = |x: f64, y: f64, z: f64| {
            let p = DVec3::new(x, y, z);
            s.covered_pixels(&DAabb { min: p - 0.5, max: p + 0.5 })
        };
        // The box's front, 1 m high, is 9.5 m away, where the image is 19 m high: 100 / 19 pixels.
        assert!((at(0.0, 0.0, -10.0).unwrap() - 100.0 / 19.0).abs() < 1e-4);
        assert_eq!(at(0.0, 0.0, 10.0), Err(OutOfView::Behind));
        assert_eq!(at(0.0, 0.0, 0.2), Err(OutOfView::TooNear));
        assert_eq!(at(0.0, 0.0, -101.0), Err(OutOfView::TooFar));
        // The far side of the box, at 10.5 m, is in while |x| − 0.5 ≤ 21.
        assert!(at(21.4, 0.0, -10.0).is_ok() && at(-21.4, 10.9, -10.0).is_ok());
        assert_eq!(at(21.6, 0.0, -10.0), Err(OutOfView::Right));
        assert_eq!(at(-21.6, 0.0, -10.0), Err(OutOfView::Left));
        assert_eq!(at(0.0, 11.1, -10.0), Err(OutOfView::Above));
        assert_eq!(at(0.0, -11.1, -10.0), Err(OutOfView::Below));
        // The camera is inside the box.
        assert!(at(0.0, 0.0, 0.0).is_ok_and(|pixels| pixels > 90.0));
        let s = camera_view(Projection::Orthographic { height: 2.0, near: -5.0, far: 5.0 });
        let cube = |x: f64| {
            s.covered_pixels(&DAabb { min: DVec3::new(x, 0.0, 0.0), max: DVec3::new(x + 1.0, 1.0, 1.0) })
        };
        assert!((cube(0.0).unwrap() - 50.0).abs() < 1e-9);
        assert_eq!(cube(2.1), Err(OutOfView::Right));
    }
}
