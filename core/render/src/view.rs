//! Camera matrices: reversed Z, Vulkan clip space, the camera at the origin of camera-relative space.

use choreo_asset::Projection;
use choreo_stage::CameraState;
use glam::{DMat4, DVec3, DVec4, Mat4, Vec3, Vec4};

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Vulkan clip space: x right, y DOWN, depth 1 at the near plane and 0 at infinity or the far plane (reversed Z).
    pub clip_from_view: Mat4,
    /// Rotation into view space. Camera-relative space has its origin at the camera, so that there is no translation.
    pub view_from_relative: Mat4,
    pub clip_from_relative: Mat4,
    /// World position of the camera.
    pub position: DVec3,
    /// Perspective: xyz 0 (the camera's position), `w` 1. Orthographic: xyz = direction to the viewer, `w` 0.
    pub eye: Vec4,
}

impl View {
    /// View of a camera. `size` in pixels gives the aspect ratio.
    pub fn new(camera: &CameraState, size: [u32; 2]) -> View {
        let aspect = f64::from(size[0].max(1)) / f64::from(size[1].max(1));
        let clip_from_view = clip_from_view(camera.projection, aspect);
        // A rotation: its inverse is its transpose.
        let rotation = camera.world_from_view.matrix3.transpose();
        let view_from_relative = DMat4::from_mat3(rotation);
        let eye = match camera.projection {
            Projection::Perspective { .. } => Vec4::new(0.0, 0.0, 0.0, 1.0),
            Projection::Orthographic { .. } => camera.world_from_view.matrix3.z_axis.as_vec3().extend(0.0),
        };
        View {
            clip_from_view: clip_from_view.as_mat4(),
            view_from_relative: view_from_relative.as_mat4(),
            clip_from_relative: (clip_from_view * view_from_relative).as_mat4(),
            position: camera.world_from_view.translation,
            eye,
        }
    }

    /// Depth of a camera-relative point in metres in front of the camera.
    pub fn depth(&self, relative: Vec3) -> f32 {
        -self.view_from_relative.transform_point3(relative).z
    }

    /// Pixels that a metre covers at a depth; infinite at the camera and behind it.
    pub(crate) fn pixels_per_meter(&self, depth: f32, size: [u32; 2]) -> f32 {
        let pixels_per_unit = self.clip_from_view.y_axis.y.abs() * 0.5 * size[1] as f32;
        match self.eye.w == 0.0 {
            true => pixels_per_unit,
            false if depth > 0.0 => pixels_per_unit / depth,
            false => f32::INFINITY,
        }
    }
}

/// Projection matrix of glTF 2.0 §3.10.3, with y down, and z from 1 (near) to 0 (far or infinity).
fn clip_from_view(projection: Projection, aspect: f64) -> DMat4 {
    let rows = match projection {
        Projection::Perspective { yfov, near, far } => {
            let f = 1.0 / libm::tan(f64::from(yfov) * 0.5);
            let near = f64::from(near);
            // z_clip = a·z + b, w = −z: 1 at z = −near and 0 at −far; a = 0 with the far plane at infinity.
            let (a, b) = match far.map(f64::from) {
                Some(far) => (near / (far - near), near * far / (far - near)),
                None => (0.0, near),
            };
            [
                DVec4::new(f / aspect, 0.0, 0.0, 0.0),
                DVec4::new(0.0, -f, 0.0, 0.0),
                DVec4::new(0.0, 0.0, a, b),
                DVec4::new(0.0, 0.0, -1.0, 0.0),
            ]
        }
        Projection::Orthographic { height, near, far } => {
            let (height, near, far) = (f64::from(height), f64::from(near), f64::from(far));
            [
                DVec4::new(2.0 / (height * aspect), 0.0, 0.0, 0.0),
                DVec4::new(0.0, -2.0 / height, 0.0, 0.0),
                DVec4::new(0.0, 0.0, 1.0 / (far - near), far / (far - near)),
                DVec4::new(0.0, 0.0, 0.0, 1.0),
            ]
        }
    };
    DMat4::from_cols_array_2d(&rows.map(|r| r.to_array())).transpose()
}

/// Camera-relative position of a world position: subtracted in f64, then rounded once.
pub fn camera_relative(world: DVec3, view: &View) -> Vec3 {
    (world - view.position).as_vec3()
}

/// Ray basis (right, down, ahead): a pixel's ray has the direction x · right + y · down + ahead, with x and y from −1 to 1. In
/// orthographic views only ahead is not zero.
pub(crate) fn ray_basis(view: &View) -> [Vec3; 3] {
    let relative_from_view = view.view_from_relative.transpose();
    let to_relative = |v: Vec3| (relative_from_view * v.extend(0.0)).truncate();
    let m = view.clip_from_view;
    match view.eye.w > 0.5 {
        true => {
            // The center of a tile lies off the view axis.
            let forward = Vec3::new(m.z_axis.x / m.x_axis.x, m.z_axis.y / m.y_axis.y, -1.0);
            [to_relative(Vec3::X / m.x_axis.x), to_relative(Vec3::Y / m.y_axis.y), to_relative(forward)]
        }
        false => [Vec3::ZERO, Vec3::ZERO, to_relative(Vec3::NEG_Z)],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DAffine3, DQuat, Vec3};

    fn camera(projection: Projection) -> CameraState {
        CameraState { camera: None, world_from_view: DAffine3::IDENTITY, projection }
    }

    #[test]
    fn depth_is_one_at_the_near_plane_and_zero_at_the_far_plane() {
        for far in [None, Some(20.0)] {
            let v = View::new(&camera(Projection::Perspective { yfov: 1.0, near: 0.5, far }), [200, 100]);
            let near = v.clip_from_relative * Vec4::new(0.0, 0.0, -0.5, 1.0);
            assert!((near.z / near.w - 1.0).abs() < 1e-6);
            let at = v.clip_from_relative * Vec4::new(0.0, 0.0, -20.0, 1.0);
            let expected = if far.is_some() { 0.0 } else { 0.5 / 20.0 };
            assert!((at.z / at.w - expected).abs() < 1e-6, "{far:?}: {}", at.z / at.w);
        }
        let v = View::new(&camera(Projection::Orthographic { height: 2.0, near: 1.0, far: 3.0 }), [200, 100]);
        let p = |z: f32| v.clip_from_relative * Vec4::new(2.0, 1.0, z, 1.0);
        assert!(p(-1.0).abs_diff_eq(Vec4::new(1.0, -1.0, 1.0, 1.0), 1e-6));
        assert!(p(-3.0).abs_diff_eq(Vec4::new(1.0, -1.0, 0.0, 1.0), 1e-6));
    }

    #[test]
    fn field_of_view_ends_at_the_image_border() {
        let yfov = 0.9f32;
        let mut c = camera(Projection::Perspective { yfov, near: 0.1, far: None });
        // The camera looks along +X.
        c.world_from_view = DAffine3::from_rotation_translation(
            DQuat::from_rotation_y(-std::f64::consts::FRAC_PI_2),
            DVec3::new(5e6, 1.0, 2.0),
        );
        let v = View::new(&c, [300, 200]);
        let up = libm::tanf(yfov / 2.0) * 7.0;
        let p = v.clip_from_relative
            * camera_relative(DVec3::new(5e6 + 7.0, 1.0 + f64::from(up), 2.0), &v).extend(1.0);
        assert!((p.y / p.w + 1.0).abs() < 1e-5, "top of the image, y down: {}", p.y / p.w);
        let right = v.clip_from_relative * Vec3::new(7.0, 0.0, up * 1.5).extend(1.0);
        assert!((right.x / right.w - 1.0).abs() < 1e-5, "+Z is to the right of +X: {}", right.x / right.w);
        assert!((v.depth(Vec3::new(7.0, 0.0, 0.0)) - 7.0).abs() < 1e-5);
    }
}
