//! Arguments and results of effects: samples of surfaces, vertices and lights, images, shutters and hulls.

use crate::SceneImages;
use glam::{Vec2, Vec3, Vec4};

/// The order of an effect on images and the stage's view transform. The view transform brings scene-linear light to the colors
/// of a display.
///
/// ```
/// use choreo_plugin::ViewOrder;
/// // Glow of bright light needs it as it is, before the view transform brings it to the colors of a display.
/// let glow = ViewOrder::Before;
/// assert_ne!(glow, ViewOrder::default());
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum ViewOrder {
    /// The effect runs on the colors that the view transform gives.
    #[default]
    After,
    /// The effect runs on light of any strength; the view transform follows as a pass over the whole image.
    Before,
    /// The effect takes the place of the view transform: it brings light to colors itself.
    Replaces,
}

/// An open shutter: the frame is the mean of several images.
///
/// ```
/// use choreo_plugin::Shutter;
/// // 180 degrees, half of them before the frame's time.
/// let film = Shutter { samples: 16, open: 180.0 / 360.0, before: 0.5 };
/// assert_eq!(film.open, 0.5);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shutter {
    /// Number of images at most, 1 or more. Fewer are drawn where the fastest pixel moves by fewer pixels.
    pub samples: u32,
    /// How long the shutter is open, as a share of the time between frames.
    pub open: f64,
    /// How much of that lies before the frame's own time, 0 to 1.
    pub before: f64,
}

/// An inverted hull: a shell around a surface of which only the inside is drawn, which makes an outline.
///
/// ```
/// use choreo_plugin::InvertedHull;
/// use choreo_plugin::glam::Vec3;
/// let ink = InvertedHull { width: 2.0, color: Vec3::ZERO, lighting_mix: 0.0 };
/// # assert_eq!(ink.width, 2.0);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InvertedHull {
    /// Width of the outline in pixels, whatever the distance.
    pub width: f32,
    /// Linear color.
    pub color: Vec3,
    /// 0: the color as it is; 1: multiplied by the lit surface.
    pub lighting_mix: f32,
}

/// Input of a [`Hook::Surface`](crate::Hook::Surface) function: one point on a surface. Same layout as the struct `Seen` of the shaders.
///
/// ```
/// use choreo_plugin::SurfaceSample;
/// use choreo_plugin::glam::Vec3;
/// let seen = SurfaceSample { normal: Vec3::Z, facing: 1.0, distance: 5.0, ..SurfaceSample::default() };
/// # assert_eq!(seen.shadow, 0.0);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SurfaceSample {
    /// Position in the world in metres; f32, so accurate near the origin.
    pub world: Vec3,
    /// Distance from the camera in metres; of orthographic cameras along their view.
    pub distance: f32,
    /// Unit normal towards the viewer's side; zero without [`SurfaceInputs::normals`] and of meshes without normals.
    pub normal: Vec3,
    /// Cosine between the normal and the direction to the viewer.
    pub facing: f32,
    /// The stage's background at this pixel, linear.
    pub background: Vec3,
    /// Colors of the joints that move the point, weighted; with [`SurfaceInputs::joints`].
    pub joints: Vec3,
    /// Texture coordinates with [`SurfaceInputs::uvs`]; zero of meshes without them.
    pub uv: Vec2,
    /// Share of the light that a white matte surface would reflect here and that shadows take, by luminance; with
    /// [`SurfaceInputs::shadow`]. Zero of unlit materials.
    pub shadow: f32,
    /// Position of the viewer in the world; of orthographic cameras where the ray to the point begins.
    pub viewer: Vec3,
}

/// Input of a [`Hook::Vertex`](crate::Hook::Vertex) function: one vertex. Same layout as the struct `Place` of the shaders.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct VertexSample {
    /// Posed position in the world in metres; f32, so accurate near the origin.
    pub world: Vec3,
    /// Unit normal in the world; zero of meshes without normals, and where neither [`SurfaceInputs::normals`] nor light needs it.
    pub normal: Vec3,
    /// Texture coordinates with [`SurfaceInputs::uvs`]; zero of meshes without them.
    pub uv: Vec2,
    /// Position in model space, after morph targets and before skinning: a pattern by it moves with the character.
    pub model: Vec3,
}

/// Input of a [`Hook::Lighting`](crate::Hook::Lighting) function: one light at one point on a surface. Same layout as the struct `Falling` of the
/// shaders.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LightSample {
    /// Cosine between the normal and the direction to the light, −1 to 1.
    pub cosine: f32,
    /// Share of the light that shadows let through, 0 to 1.
    pub share: f32,
    /// The light as it arrives, after distance and cone, linear, without [`LightSample::share`]: lux over π, so that base color ·
    /// this · cosine is the light of a matte surface.
    pub color: Vec3,
    /// Base color of the surface, linear.
    pub base: Vec3,
    /// Unit normal in the world, from the normal map where there is one.
    pub normal: Vec3,
    /// Unit direction to the viewer.
    pub viewer: Vec3,
    /// Unit direction to the light.
    pub light: Vec3,
    /// The reflected light by the surface's own shading model: to be added to, or replaced.
    pub lit: Vec3,
}

/// Distance of the background in metres: larger than any scene, and finite.
pub const BACKGROUND_DISTANCE: f32 = 1e9;

/// The parts of a [`SurfaceSample`] that an effect reads; the others are not computed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SurfaceInputs {
    /// [`SurfaceSample::normal`] and [`SurfaceSample::facing`].
    pub normals: bool,
    /// [`SurfaceSample::uv`].
    pub uvs: bool,
    /// [`SurfaceSample::joints`].
    pub joints: bool,
    /// [`SurfaceSample::shadow`].
    pub shadow: bool,
    /// The effect returns alpha: the surface is blended with what is behind it.
    pub see_through: bool,
}

/// An image that a [`Hook::Image`](crate::Hook::Image) function reads: linear RGBA, rows from the top.
///
/// ```
/// use choreo_plugin::EffectImage;
/// use choreo_plugin::glam::Vec4;
/// let image = EffectImage { size: [2, 1], rgba: &[Vec4::ZERO, Vec4::ONE] };
/// assert_eq!(image.at(7, -3), Vec4::ONE);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct EffectImage<'a> {
    /// Width and height.
    pub size: [u32; 2],
    /// The pixels, as many as `size` states.
    pub rgba: &'a [Vec4],
}

impl EffectImage<'_> {
    /// A pixel; beyond the border the nearest one.
    pub fn at(&self, x: i32, y: i32) -> Vec4 {
        let [w, h] = self.size.map(|s| s as i32);
        let (x, y) = (x.clamp(0, w - 1), y.clamp(0, h - 1));
        self.rgba[y as usize * w as usize + x as usize]
    }

    /// The image between the middles of its pixels, which lie at halves: `place` is in pixels from the top left.
    ///
    /// ```
    /// # use choreo_plugin::EffectImage;
    /// # use choreo_plugin::glam::{Vec2, Vec4};
    /// let image = EffectImage { size: [2, 1], rgba: &[Vec4::ZERO, Vec4::ONE] };
    /// assert_eq!([0.5, 1.0, 9.0].map(|x| image.between(Vec2::new(x, 0.5)).x), [0.0, 0.5, 1.0]);
    /// ```
    pub fn between(&self, place: Vec2) -> Vec4 {
        let last = Vec2::new(self.size[0] as f32, self.size[1] as f32);
        let place = (place - 0.5).clamp(Vec2::NEG_ONE, last);
        let corner = place.floor();
        let f = place - corner;
        let (x, y) = (corner.x as i32, corner.y as i32);
        let mix = |a: Vec4, b: Vec4, t: f32| a * (1.0 - t) + b * t;
        let above = mix(self.at(x, y), self.at(x + 1, y), f.x);
        mix(above, mix(self.at(x, y + 1), self.at(x + 1, y + 1), f.x), f.y)
    }
}

/// A pass of an effect on images whose passes have textures.
///
/// ```
/// use choreo_plugin::ImagePass;
/// let bright = ImagePass::new("bright", &[]);
/// let blurred = ImagePass::new("blurred", &[0]);
/// # assert_eq!((bright.name.as_str(), blurred.reads), ("bright", vec![0]));
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct ImagePass {
    /// Name of the texture that it writes. The last pass makes the image.
    pub name: String,
    /// Numbers of the passes before it whose textures it reads, at most [`ImagePass::MOST_READ`].
    pub reads: Vec<u32>,
}

impl ImagePass {
    /// Largest number of textures that one pass reads.
    pub const MOST_READ: usize = 8;

    /// A pass with its texture's name and the numbers of the passes whose textures it reads.
    pub fn new(name: &str, reads: &[u32]) -> ImagePass {
        ImagePass { name: name.into(), reads: reads.to_vec() }
    }
}

/// The images that a [`Hook::Image`](crate::Hook::Image) function reads.
///
/// ```
/// use choreo_plugin::{EffectImage, EffectImages};
/// use choreo_plugin::glam::Vec4;
/// let image = EffectImage { size: [1, 1], rgba: &[Vec4::ONE] };
/// let images = EffectImages { now: image, original: image, passes: &[], before: &[], scene: None };
/// assert_eq!(images.now.at(0, 0), images.original.at(0, 0));
/// ```
#[derive(Clone, Copy, Debug)]
pub struct EffectImages<'a> {
    /// Result of the pass before.
    pub now: EffectImage<'a>,
    /// Input of the effect's first pass.
    pub original: EffectImage<'a>,
    /// The textures of the effect's earlier passes by their number, where passes have textures
    /// ([`ImageEffect::named_passes`](crate::ImageEffect::named_passes)); `None` for one that nothing reads.
    pub passes: &'a [Option<EffectImage<'a>>],
    /// The scene one frame ago, two frames ago and so on, before any effect on images; as many as [`ImageEffect::history`](crate::ImageEffect::history), or more.
    pub before: &'a [EffectImage<'a>],
    /// The scene behind the image; `None` where it is not known: then no surface is anywhere, and every number is 0.
    pub scene: Option<SceneImages<'a>>,
}

/// Steps that one call of an effect's function may take: rounds of its loops, each times the statements of the loop's body.
pub const MAX_EFFECT_STEPS: u32 = 100_000;

/// Bits of a NaN that stands for a result that took more than [`MAX_EFFECT_STEPS`], without the loop's number.
const ENDLESS: u32 = 0x7fc1_0000;

/// The result of a call that took too many steps, in its first component: a NaN with the number of the loop, 0 for none.
///
/// ```
/// use choreo_plugin::effect::{endless, endless_loop};
/// assert_eq!((endless_loop(endless(3)), endless_loop(f32::NAN), endless_loop(1.0)), (Some(3), None, None));
/// ```
pub fn endless(loop_number: u32) -> f32 {
    f32::from_bits(ENDLESS | loop_number & 0xffff)
}

/// The number of the loop, where a value is one of [`endless`].
pub fn endless_loop(value: f32) -> Option<u32> {
    (value.to_bits() & 0xffff_0000 == ENDLESS).then_some(value.to_bits() & 0xffff)
}
