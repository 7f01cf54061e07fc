//! Arguments and results of effects: samples of surfaces, vertices and lights, images, shutters and hulls.

use crate::SceneImages;
use glam::{Vec2, Vec3, Vec4};

/// Whether an effect on images runs before, after or in place of the stage's view transform, which maps scene-linear light to display
/// colors.
///
/// ```
/// use choreo_plugin::ViewOrder;
/// // A glow needs bright light as it is, before the view transform maps it to display colors.
/// let glow = ViewOrder::Before;
/// assert_ne!(glow, ViewOrder::default());
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum ViewOrder {
    /// The effect runs on the colors that the view transform gives.
    #[default]
    After,
    /// The effect runs on scene-linear light of any strength; the view transform follows as a pass over the whole image.
    Before,
    /// The effect takes the place of the view transform: it maps light to display colors itself.
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
    /// Share of the open time that lies before the frame's own time, 0 to 1.
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
    /// Mix of the plain color (0) and the color multiplied by the lit surface (1).
    pub lighting_mix: f32,
}

/// Input of a [`Hook::Surface`](crate::Hook::Surface) function: one point on a surface. Same layout as the struct `SurfaceSample` of the shaders.
///
/// ```
/// use choreo_plugin::SurfaceSample;
/// use choreo_plugin::glam::Vec3;
/// let surface = SurfaceSample { normal: Vec3::Z, facing: 1.0, distance: 5.0, ..SurfaceSample::default() };
/// # assert_eq!(surface.shadow, 0.0);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SurfaceSample {
    /// Position in the world in metres; f32, so accurate near the origin.
    pub world: Vec3,
    /// Distance from the camera in metres; for orthographic cameras, the depth along the view direction.
    pub distance: f32,
    /// Unit normal towards the viewer's side; zero without [`SurfaceInputs::normals`] and for meshes without normals.
    pub normal: Vec3,
    /// Cosine between the normal and the direction to the viewer.
    pub facing: f32,
    /// The stage's background at this pixel, linear.
    pub background: Vec3,
    /// Colors of the joints that move the point, weighted by their skin weights; with [`SurfaceInputs::joints`].
    pub joints: Vec3,
    /// Texture coordinates with [`SurfaceInputs::uvs`]; zero for meshes without them.
    pub uv: Vec2,
    /// Share of the light on a white matte surface here that shadows block, by luminance; with [`SurfaceInputs::shadow`]. Zero for unlit
    /// materials.
    pub shadow: f32,
    /// World position of the viewer, metres; for orthographic cameras, the origin of the ray to the point.
    pub viewer: Vec3,
}

/// Input of a [`Hook::Vertex`](crate::Hook::Vertex) function: one vertex. Same layout as the struct `Place` of the shaders.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct VertexSample {
    /// Posed position in the world in metres; f32, so accurate near the origin.
    pub world: Vec3,
    /// Unit normal in the world; zero for meshes without normals, and where neither [`SurfaceInputs::normals`] nor lighting needs it.
    pub normal: Vec3,
    /// Texture coordinates with [`SurfaceInputs::uvs`]; zero for meshes without them.
    pub uv: Vec2,
    /// Position in model space, after morph targets and before skinning. Patterns based on it move with the character.
    pub model: Vec3,
}

/// Input of a [`Hook::Lighting`](crate::Hook::Lighting) function: one light at one point on a surface. Same layout as the struct `LightSample`
/// of the shaders.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LightSample {
    /// Cosine between the normal and the direction to the light, −1 to 1.
    pub cosine: f32,
    /// Share of the light that shadows let through, 0 to 1.
    pub share: f32,
    /// Incident light, linear, after distance and cone attenuation, without [`LightSample::share`]: illuminance in lux over π, so that
    /// `base` · `color` · `cosine` is the light that a matte surface reflects.
    pub color: Vec3,
    /// Base color of the surface, linear.
    pub base: Vec3,
    /// Unit normal in the world, from the normal map where there is one.
    pub normal: Vec3,
    /// Unit direction to the viewer.
    pub viewer: Vec3,
    /// Unit direction to the light.
    pub light: Vec3,
    /// Reflected light of the surface's own shading model. The effect adds to it or replaces it.
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
    /// A pixel; coordinates beyond the border read the nearest pixel.
    pub fn at(&self, x: i32, y: i32) -> Vec4 {
        let [w, h] = self.size.map(|s| s as i32);
        let (x, y) = (x.clamp(0, w - 1), y.clamp(0, h - 1));
        self.rgba[y as usize * w as usize + x as usize]
    }

    /// Bilinear sample at `place`, in pixels from the top left; pixel centers lie at half-integers.
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

/// A named pass of an effect on images, which writes a texture for the passes after it.
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
    /// Result of the previous pass.
    pub now: EffectImage<'a>,
    /// Input of the effect's first pass.
    pub original: EffectImage<'a>,
    /// The textures of the effect's earlier passes by their number, where passes have textures
    /// ([`ImageEffect::named_passes`](crate::ImageEffect::named_passes)); `None` for one that nothing reads.
    pub passes: &'a [Option<EffectImage<'a>>],
    /// The scene one frame ago, two frames ago and so on, before any effect on images; at least as many as
    /// [`ImageEffect::history`](crate::ImageEffect::history).
    pub before: &'a [EffectImage<'a>],
    /// Scene inputs of the frame. `None` if they are unknown: effects then find no surfaces, and every number is 0.
    pub scene: Option<SceneImages<'a>>,
}

/// Step limit of one call of an effect's function. A round of a loop counts the statements of the loop's body.
pub const MAX_EFFECT_STEPS: u32 = 100_000;

/// Bits of the NaN that marks a result which took more than [`MAX_EFFECT_STEPS`]; the lower 16 bits hold the loop's number.
const ENDLESS: u32 = 0x7fc1_0000;

/// NaN for the first component of the result of a call that took too many steps. It holds the number of the loop; 0: no loop.
///
/// ```
/// use choreo_plugin::effect::{endless, endless_loop};
/// assert_eq!((endless_loop(endless(3)), endless_loop(f32::NAN), endless_loop(1.0)), (Some(3), None, None));
/// ```
pub fn endless(loop_number: u32) -> f32 {
    f32::from_bits(ENDLESS | loop_number & 0xffff)
}

/// Loop number of a NaN made by [`endless`]; `None` for any other value.
pub fn endless_loop(value: f32) -> Option<u32> {
    (value.to_bits() & 0xffff_0000 == ENDLESS).then_some(value.to_bits() & 0xffff)
}
