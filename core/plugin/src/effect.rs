//! Effects. An effect names its [`Hook`] and gives one WGSL function; Vulkan runs it as part of a shader, and the CPU renderer
//! evaluates the same text as an [`EffectFunction`].

use crate::{EffectScene, EffectTexture, Manifest, Overlay, PluginFile, SceneImages, SceneInputs};
use glam::{Vec2, Vec3, Vec4};

/// The step of drawing in which an effect changes a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Hook {
    /// A function of one pixel of the finished image.
    #[default]
    Pixel,
    /// A pass over the finished image: a function that reads any pixel of it.
    Image,
    /// A function of one point on a surface, after lighting.
    Surface,
    /// A function of one vertex: how far it is displaced.
    Vertex,
    /// A function of one light at one point on a surface: what the surface reflects of it.
    Lighting,
    /// An inverted hull around surfaces, or the edges of their triangles: [`Effect::inverted_hull`], [`Effect::wireframe`].
    Outline,
    /// Triangles, lines, points and lattices: [`Effect::overlay`].
    Overlay,
    /// How long the shutter is open: [`Effect::shutter`].
    Shutter,
}

impl Hook {
    /// Whether single actors can have the effect.
    pub fn applies_to_actors(self) -> bool {
        matches!(self, Hook::Outline | Hook::Overlay) || self.is_in_scene()
    }

    /// Whether effects have a function that both devices run: [`Effect::function`].
    pub fn has_function(self) -> bool {
        matches!(self, Hook::Pixel | Hook::Image) || self.is_in_scene()
    }

    /// Whether the function is part of the shaders that draw the scene.
    pub fn is_in_scene(self) -> bool {
        matches!(self, Hook::Surface | Hook::Vertex | Hook::Lighting)
    }
}

/// The order of an effect on images and the stage's view transform. The view transform brings scene-linear light to the colors
/// of a display.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
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
    /// Number of images; 1 or more.
    pub samples: u32,
    /// How long the shutter is open, as a share of the time between frames.
    pub open: f64,
    /// How much of that lies before the frame's own time, 0 to 1.
    pub before: f64,
}

/// An inverted hull: a shell around a surface of which only the inside is drawn, which makes an outline.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InvertedHull {
    /// Width of the outline in pixels, whatever the distance.
    pub width: f32,
    /// Linear color.
    pub color: Vec3,
    /// 0: the color as it is; 1: multiplied by the lit surface.
    pub lighting_mix: f32,
}

/// Input of a [`Hook::Surface`] function: one point on a surface. Same layout as the struct `Seen` of the shaders.
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

/// Input of a [`Hook::Vertex`] function: one vertex. Same layout as the struct `Place` of the shaders.
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

/// Input of a [`Hook::Lighting`] function: one light at one point on a surface. Same layout as the struct `Falling` of the
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

/// An image that a [`Hook::Image`] function reads: linear RGBA, rows from the top.
///
/// ```
/// use choreo_plugin::EffectImage;
/// use glam::Vec4;
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
}

/// The images that a [`Hook::Image`] function reads.
#[derive(Clone, Copy, Debug)]
pub struct EffectImages<'a> {
    /// Result of the pass before.
    pub now: EffectImage<'a>,
    /// Input of the effect's first pass.
    pub original: EffectImage<'a>,
    /// The scene one frame ago, two frames ago and so on, before any effect on images; as many as [`Effect::history`], or more.
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

/// The function of an effect: its WGSL, and the same function on the CPU. Each method but the first two belongs to one [`Hook`].
/// Where a result is NaN or infinite, or [`endless`], the renderers warn and draw magenta.
pub trait EffectFunction: Send + Sync {
    /// WGSL source of a function `effect`; colors are linear.
    /// - [`Hook::Pixel`]: `fn effect(color: vec4<f32>, uv: vec2<f32>, p: array<f32, 8>) -> vec4<f32>`, `uv` 0..1 from the top left.
    /// - [`Hook::Surface`]: `fn effect(color: vec4<f32>, seen: Seen, p: array<f32, 8>) -> vec4<f32>`.
    /// - [`Hook::Vertex`]: `fn effect(place: Place, p: array<f32, 8>) -> vec3<f32>`, the displacement. Normals follow it.
    /// - [`Hook::Lighting`]: `fn effect(falling: Falling, p: array<f32, 8>) -> vec3<f32>`, the reflected light.
    /// - [`Hook::Image`]: `fn effect(at: vec2<i32>, pass_number: u32, p: array<f32, 8>) -> vec4<f32>`, which may call
    ///   `picture(at)`, the result of the pass before, `original(at)`, the input of the first pass, `picture_size()` and
    ///   `original_size()`, in pixels, `shrink_factor()`, and with a history `previous(frames, at)`, which only the CPU runs. With
    ///   [`Effect::scene_inputs`] it may call `scene_surface(at)` and `scene_motion(at)`, the pixels of [`SceneImages`], and
    ///   `scene_row_0()` to `scene_row_18()`, the [`crate::EffectFrame::rows`].
    ///
    /// Each may call `NAME(uv)` of its [`Effect::textures`].
    fn wgsl(&self) -> &str;

    /// Places (`my.wgsl:3:5`) of the loops in [`EffectFunction::wgsl`] that count their rounds with `effect_round(cost, number)`,
    /// in the order of their numbers, which begin at 1.
    fn loops(&self) -> &[String] {
        &[]
    }

    /// [`Hook::Pixel`]: replaces linear colors; `uv` is 0 to 1 from the top left, one for each color.
    fn pixels(&self, colors: &mut [Vec4], uv: &[Vec2], parameters: &[f32; 8]);

    /// [`Hook::Image`]: writes row `y` of what a pass makes.
    fn image_row(
        &self,
        images: &EffectImages,
        y: u32,
        pass_number: u32,
        parameters: &[f32; 8],
        row: &mut [Vec4],
    );

    /// [`Hook::Surface`]: replaces the colors of surfaces, one for each sample.
    fn surfaces(&self, colors: &mut [Vec4], samples: &[SurfaceSample], parameters: &[f32; 8]);

    /// [`Hook::Vertex`]: the displacement in metres, or with [`Effect::in_model_space`] in model space.
    fn vertex(&self, sample: &VertexSample, parameters: &[f32; 8]) -> Vec3;

    /// [`Hook::Lighting`]: replaces [`LightSample::lit`] of each sample.
    fn lights(&self, samples: &mut [LightSample], parameters: &[f32; 8]);
}

/// An effect: its manifest, its hook, and the WGSL function `effect` of that hook. Parameters are in the order of the manifest.
///
/// Most effects are one file, read by the crate `choreo-wgsl-effect`; a type of its own is needed only for geometry that WGSL cannot
/// describe:
///
/// ```
/// use choreo_plugin::{Effect, EffectScene, Hook, Label, Manifest, Overlay};
/// use glam::Vec4;
///
/// /// The name of each actor above it.
/// struct Names(Manifest);
///
/// impl Effect for Names {
///     fn manifest(&self) -> &Manifest {
///         &self.0
///     }
///     fn hook(&self) -> Hook {
///         Hook::Overlay
///     }
///     fn overlay(&self, scene: &EffectScene, _: &[f32; 8]) -> Overlay {
///         let label = |actor: choreo_plugin::ActorInstance| Label {
///             at: actor.bounds().max,
///             text: actor.asset.name.clone(),
///             size: 12.0,
///             beside: 2.0,
///             color: Vec4::ONE,
///         };
///         Overlay { labels: scene.instances().map(label).collect(), ..Overlay::default() }
///     }
/// }
///
/// let names = Names(Manifest::new("names", "1", "the name of each actor above it"));
/// assert!(names.applies_to_actors() && names.function().is_none());
/// ```
pub trait Effect: Send + Sync {
    /// Name, description and parameters.
    fn manifest(&self) -> &Manifest;

    /// The file that the effect was read from, unless it is part of the program.
    fn file(&self) -> Option<&PluginFile> {
        None
    }

    /// The step of drawing in which the effect changes a frame.
    fn hook(&self) -> Hook {
        Hook::Pixel
    }

    /// Whether single actors can have the effect.
    fn applies_to_actors(&self) -> bool {
        self.hook().applies_to_actors()
    }

    /// The effect's function, on both devices; `None` for hooks without one.
    fn function(&self) -> Option<&dyn EffectFunction> {
        None
    }

    /// Why the effect changes nothing with these parameters ("strength is 0"): it is then left out. `None` if it does something.
    fn off(&self, _parameters: &[f32; 8]) -> Option<String> {
        None
    }

    /// [`Hook::Vertex`]: the largest displacement in metres; longer ones are cut off.
    fn reach(&self, _parameters: &[f32; 8]) -> f32 {
        0.0
    }

    /// [`Hook::Vertex`]: whether the displacement is in model space.
    fn in_model_space(&self) -> bool {
        false
    }

    /// The parts of a surface that a function of the scene reads.
    fn surface_inputs(&self, _parameters: &[f32; 8]) -> SurfaceInputs {
        SurfaceInputs::default()
    }

    /// [`Hook::Surface`] on everything: whether it changes the background too, as a surface without a normal at
    /// [`BACKGROUND_DISTANCE`].
    fn changes_background(&self, _parameters: &[f32; 8]) -> bool {
        false
    }

    /// [`Hook::Image`]: the parts of the scene that the function reads.
    fn scene_inputs(&self) -> SceneInputs {
        SceneInputs::default()
    }

    /// [`Hook::Image`]: number of passes, each over the result of the one before.
    fn passes(&self) -> u32 {
        1
    }

    /// [`Hook::Image`] and [`Hook::Overlay`]: how many frames back the effect looks. They are drawn, or for an overlay posed, for
    /// each frame, so that a frame is the same whether those before it were rendered or not; before the first frame stands the first.
    fn history(&self, _parameters: &[f32; 8]) -> u32 {
        0
    }

    /// [`Hook::Pixel`] and [`Hook::Image`]: on which side of the view transform it runs.
    fn view_order(&self) -> ViewOrder {
        ViewOrder::After
    }

    /// Images that the effect's function reads.
    fn textures(&self) -> &[EffectTexture] {
        &[]
    }

    /// [`Hook::Image`]: by which factor the image that a pass makes is smaller, each way; 1 or more. The last pass makes the whole
    /// image, of this size. `at` counts the pixels that a pass makes, `picture(at)` those of the pass before, `original(at)` those of
    /// the whole image.
    fn shrink(&self, _pass_number: u32, _size: [u32; 2], _parameters: &[f32; 8]) -> u32 {
        1
    }

    /// [`Hook::Outline`]: linear color of lines along the edges of triangles.
    fn wireframe(&self, _parameters: &[f32; 8]) -> Option<Vec3> {
        None
    }

    /// [`Hook::Overlay`]: what the effect draws.
    fn overlay(&self, _scene: &EffectScene, _parameters: &[f32; 8]) -> Overlay {
        Overlay::default()
    }

    /// [`Hook::Shutter`]: how the frame is exposed.
    fn shutter(&self, _parameters: &[f32; 8]) -> Option<Shutter> {
        None
    }

    /// [`Hook::Outline`]: the hull; `None` draws nothing.
    fn inverted_hull(&self, _parameters: &[f32; 8]) -> Option<InvertedHull> {
        None
    }
}
