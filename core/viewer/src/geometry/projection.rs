//! Projection between world space and points of the window, in f64.

use choreo_asset::Projection;
use choreo_stage::CameraState;
use glam::{DAffine3, DVec2, DVec3};

/// Distance in front of the camera at which lines are clipped, metres. Nearer points are not projected.
const NEAR_PLANE: f64 = 1e-3;

/// Projection of a camera to an image in the window.
#[derive(Clone, Copy, Debug)]
pub struct ViewProjection {
    view_from_world: DAffine3,
    /// Top left corner of the image, in points of the window.
    top_left: DVec2,
    size: DVec2,
    /// Height of the visible area at a distance of 1 m, or at any distance in parallel projection, metres.
    height: f64,
    perspective: bool,
}

impl ViewProjection {
    /// `top_left`, `size`: position and size of the image in the window, points.
    pub fn new(camera: &CameraState, top_left: DVec2, size: DVec2) -> ViewProjection {
        let (height, perspective) = match camera.projection {
            Projection::Perspective { yfov, .. } => (2.0 * libm::tan(f64::from(yfov) / 2.0), true),
            Projection::Orthographic { height, .. } => (f64::from(height), false),
        };
        ViewProjection {
            view_from_world: camera.world_from_view.inverse(),
            top_left,
            size,
            height,
            perspective,
        }
    }

    fn window_from_view(&self, view: DVec3) -> DVec2 {
        let depth = if self.perspective { -view.z } else { 1.0 };
        let scale = self.size.y / (self.height * depth);
        self.top_left + self.size / 2.0 + DVec2::new(view.x, -view.y) * scale
    }

    /// Projects a point from world space to the window. `None` if it is behind the camera.
    pub fn project_point(&self, world: DVec3) -> Option<DVec2> {
        let view = self.view_from_world.transform_point3(world);
        (!self.perspective || -view.z >= NEAR_PLANE).then(|| self.window_from_view(view))
    }

    /// Projects the part of a line in front of the camera.
    pub fn project_line(&self, a: DVec3, b: DVec3) -> Option<[DVec2; 2]> {
        let [mut a, mut b] = [a, b].map(|p| self.view_from_world.transform_point3(p));
        if self.perspective {
            if -a.z < NEAR_PLANE && -b.z < NEAR_PLANE {
                return None;
            }
            let cut = |inside: DVec3, outside: DVec3| {
                let part = (-inside.z - NEAR_PLANE) / (outside.z - inside.z);
                inside + (outside - inside) * part
            };
            if -a.z < NEAR_PLANE {
                a = cut(b, a);
            } else if -b.z < NEAR_PLANE {
                b = cut(a, b);
            }
        }
        Some([self.window_from_view(a), self.window_from_view(b)])
    }

    /// Origin and unit direction in world space of the ray through a point of the window.
    pub fn ray_through(&self, at: DVec2) -> (DVec3, DVec3) {
        let from_middle = (at - self.top_left - self.size / 2.0) / self.size.y * self.height;
        let world_from_view = self.view_from_world.inverse();
        let across = DVec3::new(from_middle.x, -from_middle.y, 0.0);
        let (origin, direction) = match self.perspective {
            true => (DVec3::ZERO, across - DVec3::Z),
            false => (across, -DVec3::Z),
        };
        (world_from_view.transform_point3(origin), world_from_view.transform_vector3(direction).normalize())
    }

    /// Size in metres that a point of the window covers at a world position.
    pub(crate) fn metres_per_point(&self, at: DVec3) -> f64 {
        let depth = if self.perspective { -self.view_from_world.transform_point3(at).z } else { 1.0 };
        depth.max(NEAR_PLANE) * self.height / self.size.y.max(1.0)
    }

    pub(crate) fn is_perspective(&self) -> bool {
        self.perspective
    }

    /// Viewing direction, unit vector in world space.
    pub(crate) fn forward(&self) -> DVec3 {
        -self.view_from_world.inverse().matrix3.z_axis.normalize_or(DVec3::Z)
    }

    /// Unit vector from a world position to the camera.
    pub fn direction_to_camera(&self, from: DVec3) -> DVec3 {
        let world_from_view = self.view_from_world.inverse();
        match self.perspective {
            true => (world_from_view.translation - from).normalize_or(DVec3::Z),
            false => world_from_view.matrix3.z_axis,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use choreo_render::plan::View;
    use glam::DQuat;

    fn cameras() -> [CameraState; 2] {
        let world_from_view = DAffine3::from_rotation_translation(
            DQuat::from_xyzw(0.1, 0.6, -0.1, 0.8).normalize(),
            DVec3::new(1.0, 2.0, 3.0),
        );
        let projections =
            [Projection::default(), Projection::Orthographic { height: 3.0, near: 0.1, far: 50.0 }];
        projections.map(|projection| CameraState { camera: None, world_from_view, projection })
    }

    #[test]
    fn projection_agrees_with_the_matrices_of_the_renderer() {
        for camera in cameras() {
            let size = [640, 360];
            let projection = ViewProjection::new(&camera, DVec2::new(10.0, 20.0), DVec2::new(640.0, 360.0));
            let view = View::new(&camera, size);
            for at in [DVec3::new(0.4, 0.2, -3.0), DVec3::new(-0.7, 0.1, -8.0)] {
                let world = camera.world_from_view.transform_point3(at);
                let clip = view.clip_from_relative * (world - view.position).as_vec3().extend(1.0);
                let expected = DVec2::new(
                    10.0 + f64::from(clip.x / clip.w + 1.0) * 320.0,
                    20.0 + f64::from(clip.y / clip.w + 1.0) * 180.0,
                );
                let got = projection.project_point(world).unwrap();
                assert!((got - expected).length() < 0.01, "{got} {expected}");
                // The ray through the projected point passes through the original one.
                let (origin, direction) = projection.ray_through(got);
                assert!((world - origin).cross(direction).length() < 1e-6);
                let moved = projection.project_point(
                    world + camera.world_from_view.matrix3.x_axis * projection.metres_per_point(world),
                );
                assert!((moved.unwrap() - got - DVec2::X).length() < 1e-6);
            }
        }
    }

    #[test]
    fn lines_are_clipped_at_the_near_plane() {
        let projection = ViewProjection::new(&cameras()[0], DVec2::ZERO, DVec2::new(640.0, 360.0));
        let at = |z: f64| cameras()[0].world_from_view.transform_point3(DVec3::new(0.1, 0.1, z));
        assert!(
            projection.project_point(at(1.0)).is_none()
                && projection.project_line(at(1.0), at(2.0)).is_none()
        );
        let [a, b] = projection.project_line(at(-2.0), at(5.0)).unwrap();
        assert!((a - projection.project_point(at(-2.0)).unwrap()).length() < 1e-9);
        assert!(b.is_finite() && (b - DVec2::new(320.0, 180.0)).length() > 100.0);
    }
}
