//! Camera moved by the mouse: orbit, pan, zoom, and walk.

use choreo_asset::Projection;
use choreo_stage::CameraState;
use glam::{DAffine3, DMat3, DQuat, DVec2, DVec3};

/// Largest elevation, radians. Straight up and down are excluded, where "sideways" is undefined.
const MAX_ELEVATION: f64 = 1.55;
const MIN_DISTANCE: f64 = 0.01;
const MAX_DISTANCE: f64 = 1e7;

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Orbit {
    /// Center of the orbit, world space, metres.
    pub center: DVec3,
    pub distance: f64,
    /// Angle about the y axis, radians; at 0 the camera looks along −Z.
    pub azimuth: f64,
    /// Angle above the horizon, radians.
    pub elevation: f64,
    /// Rotation about the viewing axis, radians.
    pub roll: f64,
    /// Projection. `height` of an orthographic one is per metre of `distance`.
    pub projection: Projection,
}

/// Height of the orthographic image per metre of distance, metres.
pub(crate) const ORTHOGRAPHIC_HEIGHT_PER_METRE: f32 = 0.7;

impl Orbit {
    /// An orbit with the position and direction of a camera. Its center is the point in front of the camera that is nearest to `near`.
    pub(crate) fn from_camera(camera: &CameraState, near: DVec3) -> Orbit {
        let axes = camera.world_from_view.matrix3;
        let back = axes.z_axis.normalize_or(DVec3::Z);
        let position = camera.world_from_view.translation;
        let distance = (position - near).dot(back).clamp(0.5, 1e4);
        let projection = match camera.projection {
            Projection::Orthographic { height, near, far } => {
                Projection::Orthographic { height: height / distance as f32, near, far }
            }
            perspective => perspective,
        };
        // The right vector of a camera that looks straight up or down determines its azimuth.
        let level = DVec2::new(back.x, back.z).length() > 1e-6;
        let azimuth = match level {
            true => libm::atan2(back.x, back.z),
            false => libm::atan2(-axes.x_axis.z, axes.x_axis.x),
        };
        let elevation = libm::asin(back.y.clamp(-1.0, 1.0));
        let center = position - back * distance;
        let mut orbit = Orbit { center, distance, azimuth, elevation, roll: 0.0, projection };
        let right = orbit.rotation().inverse() * axes.x_axis.normalize_or(DVec3::X);
        let roll = libm::atan2(right.y, right.x);
        // Rounding errors must not become a roll.
        orbit.roll = if roll.abs() < 1e-9 { 0.0 } else { roll };
        orbit
    }

    fn rotation(&self) -> DQuat {
        let about = |axis: DVec3, angle: f64| {
            let (sin, cos) = libm::sincos(angle / 2.0);
            DQuat::from_xyzw(axis.x * sin, axis.y * sin, axis.z * sin, cos)
        };
        about(DVec3::Y, self.azimuth) * about(DVec3::X, -self.elevation) * about(DVec3::Z, self.roll)
    }

    pub fn camera(&self) -> CameraState {
        let rotation = self.rotation();
        let position = self.center + rotation * DVec3::new(0.0, 0.0, self.distance);
        let world_from_view = DAffine3 { matrix3: DMat3::from_quat(rotation), translation: position };
        // The near plane moves closer for near objects, so that they are not clipped.
        let near_limit = (self.distance * 0.01) as f32;
        let projection = match self.projection {
            Projection::Perspective { yfov, near, far } => {
                Projection::Perspective { yfov, near: near.min(near_limit.max(1e-4)), far }
            }
            // A shorter distance shows a smaller area in parallel projection.
            Projection::Orthographic { height, near, .. } => {
                let height = (self.distance * f64::from(height)) as f32;
                Projection::Orthographic { height, near, far: 10_000.0 }
            }
        };
        CameraState { camera: None, world_from_view, projection }
    }

    /// Rotates the camera about the center. `by`: drag in heights of the view, right and down positive.
    pub fn turn(&mut self, by: DVec2) {
        const RADIANS_PER_HEIGHT: f64 = core::f64::consts::PI;
        self.azimuth = (self.azimuth - by.x * RADIANS_PER_HEIGHT) % (2.0 * core::f64::consts::PI);
        self.elevation = (self.elevation + by.y * RADIANS_PER_HEIGHT).clamp(-MAX_ELEVATION, MAX_ELEVATION);
    }

    /// Pans the camera, so that points at the distance of the center follow the mouse. `by`: drag in heights of the view.
    pub fn pan(&mut self, by: DVec2) {
        let height = match self.projection {
            Projection::Perspective { yfov, .. } => 2.0 * libm::tan(f64::from(yfov) / 2.0) * self.distance,
            Projection::Orthographic { height, .. } => self.distance * f64::from(height),
        };
        self.center += self.rotation() * DVec3::new(-by.x * height, by.y * height, 0.0);
    }

    /// Zooms by notches of the mouse wheel; positive is closer.
    pub fn zoom(&mut self, notches: f64) {
        self.distance = (self.distance * libm::pow(0.85, notches)).clamp(MIN_DISTANCE, MAX_DISTANCE);
    }

    /// Rotates the camera in place. `by`: drag in heights of the view.
    pub fn look_around(&mut self, by: DVec2) {
        let eye = self.center + self.rotation() * DVec3::new(0.0, 0.0, self.distance);
        self.turn(DVec2::new(by.x, by.y));
        self.center = eye - self.rotation() * DVec3::new(0.0, 0.0, self.distance);
    }

    /// Moves the camera right, up and forward, metres.
    pub fn walk(&mut self, by: DVec3) {
        self.center += self.rotation() * DVec3::new(by.x, by.y, -by.z);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::projection::ViewProjection;

    fn close(a: DVec3, b: DVec3) -> bool {
        (a - b).length() < 1e-9
    }

    fn orbit() -> Orbit {
        Orbit {
            center: DVec3::new(1.0, 1.0, 0.0),
            distance: 5.0,
            azimuth: 0.6,
            elevation: 0.3,
            roll: 0.0,
            projection: Projection::default(),
        }
    }

    #[test]
    fn an_orbit_starts_at_the_position_of_a_camera() {
        let first = orbit().camera();
        let again = Orbit::from_camera(&first, DVec3::new(1.0, 1.0, 0.0));
        assert!(close(again.center, orbit().center), "{again:?}");
        assert!(
            (again.camera().world_from_view.translation - first.world_from_view.translation).length() < 1e-9
        );
        let (a, b) = (again.camera().world_from_view.matrix3, first.world_from_view.matrix3);
        assert!(close(a.z_axis, b.z_axis) && close(a.x_axis, b.x_axis));
    }

    /// Works for any camera, including rolled ones, ones that look straight down, and orthographic ones.
    #[test]
    fn an_orbit_made_from_a_camera_keeps_the_image() {
        let rotations = [
            DQuat::from_xyzw(0.1, 0.6, -0.1, 0.8).normalize(),
            DQuat::from_rotation_y(0.4) * DQuat::from_rotation_x(-core::f64::consts::FRAC_PI_2),
            DQuat::from_rotation_y(-2.0) * DQuat::from_rotation_x(0.2) * DQuat::from_rotation_z(0.5),
        ];
        let projections = [
            Projection::Perspective { yfov: 0.4, near: 0.1, far: None },
            Projection::Orthographic { height: 3.0, near: 0.1, far: 50.0 },
        ];
        for (rotation, projection) in rotations.into_iter().flat_map(|r| projections.map(|p| (r, p))) {
            let world_from_view = DAffine3::from_rotation_translation(rotation, DVec3::new(1.0, 2.0, 3.0));
            let before = CameraState { camera: None, world_from_view, projection };
            let after = Orbit::from_camera(&before, DVec3::new(0.3, 0.9, -1.0)).camera();
            let size = DVec2::new(640.0, 360.0);
            let [a, b] = [before, after].map(|camera| ViewProjection::new(&camera, DVec2::ZERO, size));
            for point in [DVec3::new(0.4, 0.2, -3.0), DVec3::new(-0.7, 0.1, -8.0)] {
                let world = world_from_view.transform_point3(point);
                let [a, b] = [a.project_point(world), b.project_point(world)].map(Option::unwrap);
                assert!((a - b).length() < 1e-3, "{rotation} {projection:?}: {a} {b}");
            }
        }
    }

    #[test]
    fn turning_keeps_center_and_distance_and_never_goes_over_the_top() {
        let mut o = orbit();
        for _ in 0..100 {
            o.turn(DVec2::new(0.13, 0.4));
            let position = o.camera().world_from_view.translation;
            assert!(((position - o.center).length() - 5.0).abs() < 1e-9);
            assert!(o.camera().world_from_view.matrix3.y_axis.y > 0.0, "never upside down");
        }
    }

    #[test]
    fn panning_moves_the_point_under_the_pointer_along() {
        let mut o = orbit();
        let view_from_world = |o: &Orbit| o.camera().world_from_view.inverse();
        let before = view_from_world(&o).transform_point3(o.center);
        let point = o.center;
        o.pan(DVec2::new(0.25, -0.5));
        let after = view_from_world(&o).transform_point3(point);
        let height = 2.0 * libm::tan(f64::from(0.7f32) / 2.0) * 5.0;
        assert!(close(after - before, DVec3::new(0.25 * height, 0.5 * height, 0.0)), "{before} {after}");
    }

    #[test]
    fn looking_around_leaves_the_eye_where_it_is() {
        let mut o = orbit();
        let before = o.camera().world_from_view.translation;
        o.look_around(DVec2::new(0.3, -0.2));
        assert!(close(o.camera().world_from_view.translation, before));
        assert!(!close(o.center, orbit().center));
    }

    #[test]
    fn zooming_in_and_out_restores_the_view() {
        let mut o = orbit();
        o.zoom(3.0);
        assert!(o.distance < 5.0);
        o.zoom(-3.0);
        assert!((o.distance - 5.0).abs() < 1e-9);
        o.zoom(1e9);
        assert_eq!(o.distance, MIN_DISTANCE);
    }

    #[test]
    fn walking_forward_moves_along_the_view_direction() {
        let mut o = orbit();
        let before = o.camera();
        o.walk(DVec3::new(0.0, 0.0, 2.0));
        let gone = o.camera().world_from_view.translation - before.world_from_view.translation;
        assert!(close(gone, before.world_from_view.matrix3.z_axis * -2.0));
    }
}
