//! Inputs of effects on images from the scene: depth, normals, motion and actors of each pixel, time, camera and sun.

use crate::{BACKGROUND_DISTANCE, EffectImage};
use glam::{Mat4, Vec3, Vec4};

/// The parts of the scene that a [`crate::Hook::Image`] function reads; the others are neither drawn nor computed.
///
/// ```
/// use choreo_plugin::SceneInputs;
/// let (depth, clock) = (SceneInputs { surface: true, ..Default::default() }, SceneInputs { time: true, ..Default::default() });
/// assert!(depth.union(clock).time && depth.is_drawn() && !clock.is_drawn());
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SceneInputs {
    /// [`SceneImages::surface`]: depth and normals of the scene.
    pub surface: bool,
    /// [`SceneImages::motion`]: motion vectors and actors.
    pub motion: bool,
    /// [`EffectFrame::time`], [`EffectFrame::frame`] and [`EffectFrame::delta`].
    pub time: bool,
    /// [`EffectFrame::view_from_world`] and [`EffectFrame::clip_from_view`].
    pub camera: bool,
    /// [`EffectFrame::sun`].
    pub sun: bool,
}

impl SceneInputs {
    /// The inputs that either of both reads.
    pub fn union(self, other: SceneInputs) -> SceneInputs {
        SceneInputs {
            surface: self.surface || other.surface,
            motion: self.motion || other.motion,
            time: self.time || other.time,
            camera: self.camera || other.camera,
            sun: self.sun || other.sun,
        }
    }

    /// Whether the inputs need an additional pass over the scene.
    pub fn is_drawn(self) -> bool {
        self.surface || self.motion
    }
}

/// Numbers of a frame that [`crate::Hook::Image`] functions read; each is zero unless [`SceneInputs`] names it.
///
/// ```
/// use choreo_plugin::EffectFrame;
/// let frame = EffectFrame { frame: 70_000, ..EffectFrame::default() };
/// assert_eq!((frame.rows()[1].x, frame.rows()[1].y), (4464.0, 1.0));
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EffectFrame {
    /// Seconds since the start.
    pub time: f32,
    /// Number of the frame, from 0: the last one that begins at or before the time.
    pub frame: u32,
    /// Seconds from frame to frame.
    pub delta: f32,
    /// View space from the world: the camera looks along −Z. f32, so accurate near the origin.
    pub view_from_world: Mat4,
    /// Clip space from view space: y down, depth 1 at the near plane and 0 far away.
    pub clip_from_view: Mat4,
    /// Unit direction in the world to the brightest sun; `None` if none shines.
    pub sun: Option<Vec3>,
}

impl EffectFrame {
    /// Number of [`EffectFrame::rows`].
    pub const ROWS: usize = 19;

    /// Number of [`EffectFrame::numbers`].
    pub const NUMBERS: usize = 8;

    /// The numbers that follow the parameters of an effect with [`EffectShader::reads_frame`](crate::EffectShader::reads_frame), in the
    /// order in which the shaders read them: time, delta, the frame number in two halves of 16 bits; width and height of the image in
    /// pixels; two zeros.
    ///
    /// ```
    /// use choreo_plugin::EffectFrame;
    /// let frame = EffectFrame { time: 2.0, frame: 60, delta: 0.033, ..EffectFrame::default() };
    /// assert_eq!(frame.numbers([640, 360]), [2.0, 0.033, 60.0, 0.0, 640.0, 360.0, 0.0, 0.0]);
    /// ```
    pub fn numbers(&self, size: [u32; 2]) -> [f32; EffectFrame::NUMBERS] {
        let [low, high] = self.frame_halves();
        let [width, height] = size.map(|side| side as f32);
        [self.time, self.delta, low, high, width, height, 0.0, 0.0]
    }

    fn frame_halves(&self) -> [f32; 2] {
        [(self.frame & 0xffff) as f32, (self.frame >> 16) as f32]
    }

    /// The frame as rows, in the order in which the shaders read them: time and delta; the frame number in two halves of 16 bits; the
    /// direction of the sun, with 1 in w if one shines; then the columns of view-from-world, world-from-view, clip-from-view and
    /// view-from-clip.
    pub fn rows(&self) -> [Vec4; EffectFrame::ROWS] {
        let mut rows = [Vec4::ZERO; EffectFrame::ROWS];
        rows[0] = Vec4::new(self.time, self.delta, 0.0, 0.0);
        let [low, high] = self.frame_halves();
        rows[1] = Vec4::new(low, high, 0.0, 0.0);
        rows[2] = self.sun.map_or(Vec4::ZERO, |sun| sun.extend(1.0));
        let inverse = |m: Mat4| match m == Mat4::ZERO {
            true => m,
            // The inverse is computed in f64, because f32 would lose most digits if the far plane is near.
            false => m.as_dmat4().inverse().as_mat4(),
        };
        let (view, clip) = (self.view_from_world, self.clip_from_view);
        for (i, matrix) in [view, inverse(view), clip, inverse(clip)].into_iter().enumerate() {
            for (column, row) in rows[3 + 4 * i..][..4].iter_mut().enumerate() {
                *row = matrix.col(column);
            }
        }
        rows
    }
}

/// Images of the scene that a [`crate::Hook::Image`] function reads, each of the size of the frame. They show opaque and alpha-tested
/// triangles, without outlines, lines, points, overlays and 2D layers; one sample per pixel, at its center.
///
/// ```
/// use choreo_plugin::glam::Vec4;
/// use choreo_plugin::{EffectFrame, EffectImage, SceneImages};
/// let surface = [Vec4::new(0.0, 0.0, 1.0, 2.5), SceneImages::NO_SURFACE];
/// let rows = EffectFrame { time: 1.5, ..EffectFrame::default() }.rows();
/// let scene = SceneImages { surface: Some(EffectImage { size: [2, 1], rgba: &surface }), motion: None, rows: &rows };
/// let depth = |x| scene.surface.map(|image| image.at(x, 0).w);
/// assert_eq!((depth(0), depth(1), scene.rows[0].x), (Some(2.5), Some(1e9), 1.5));
/// ```
#[derive(Clone, Copy, Debug)]
pub struct SceneImages<'a> {
    /// World normal in xyz and depth in w: metres along the view direction. [`SceneImages::NO_SURFACE`] where there is no surface.
    pub surface: Option<EffectImage<'a>>,
    /// Motion in pixels since the frame before in xy, and the number of the actor, from 1, in z; zero where there is no surface.
    pub motion: Option<EffectImage<'a>>,
    /// [`EffectFrame::rows`].
    pub rows: &'a [Vec4; EffectFrame::ROWS],
}

impl SceneImages<'_> {
    /// The value of [`SceneImages::surface`] where there is no surface: no normal, at [`BACKGROUND_DISTANCE`].
    pub const NO_SURFACE: Vec4 = Vec4::new(0.0, 0.0, 0.0, BACKGROUND_DISTANCE);
}
