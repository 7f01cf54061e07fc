//! The traits of effects, one for each [`Hook`](crate::Hook): an author implements [`EffectPlugin`], [`EffectShader`] where the hook has a
//! function in WGSL, and the trait of the hook.
//!
//! `parameters` are everywhere the numbers of the manifest's options in their order, [`Manifest::parameters`]. Colors are linear, lengths
//! metres, angles radians unless a method states something else.

use crate::effect_data::{
    EffectImages, ImagePass, InvertedHull, LightSample, Shutter, SurfaceInputs, SurfaceSample, VertexSample,
    ViewOrder,
};
use crate::{Effect, EffectScene, EffectTexture, Manifest, Overlay, PluginFile, SceneInputs};
use glam::{Vec2, Vec3, Vec4};

/// The methods of effects of all hooks.
///
/// ```
/// use choreo_plugin::{EffectPlugin, Manifest};
///
/// struct Fade(Manifest);
///
/// impl EffectPlugin for Fade {
///     fn manifest(&self) -> &Manifest {
///         &self.0
///     }
///     fn off(&self, parameters: &[f32]) -> Option<String> {
///         (parameters[0] == 0.0).then(|| "amount is 0".into())
///     }
/// }
///
/// let fade = Fade(Manifest::new("fade", "1", "fades to black").number("amount", "how much", 0.0, 0.0..=1.0));
/// assert_eq!(fade.off(&fade.manifest().parameters(&[])).as_deref(), Some("amount is 0"));
/// ```
pub trait EffectPlugin: Send + Sync {
    /// Name, description and parameters.
    fn manifest(&self) -> &Manifest;

    /// The file that the effect was read from, unless it is part of the program.
    fn file(&self) -> Option<&PluginFile> {
        None
    }

    /// Why the effect changes nothing with these parameters ("strength is 0"): it is then left out. `None` if it does something.
    fn off(&self, _parameters: &[f32]) -> Option<String> {
        None
    }

    /// Places (`my.wgsl:3:5`) of the counted loops in the effect's WGSL, in the order of their numbers, which begin at 1.
    /// [`EffectShader::wgsl`] counts their rounds by `effect_round(cost, number)`. Warnings about endless loops name the places.
    fn loops(&self) -> &[String] {
        &[]
    }
}

/// The function of an effect in WGSL. The CPU renderer calls the same function as a method of the hook's trait. Where a result is NaN or
/// infinite, or [`endless`](crate::effect::endless), the renderers warn and draw magenta.
///
/// ```
/// use choreo_plugin::glam::{Vec2, Vec4};
/// use choreo_plugin::{Effect, EffectPlugin, EffectShader, EffectTexture, Manifest, PixelEffect};
///
/// /// The image on paper.
/// #[derive(Clone)]
/// struct Paper {
///     manifest: Manifest,
///     textures: Vec<EffectTexture>,
/// }
///
/// impl EffectPlugin for Paper {
///     fn manifest(&self) -> &Manifest {
///         &self.manifest
///     }
/// }
///
/// impl EffectShader for Paper {
///     fn wgsl(&self) -> &str {
///         "fn effect(color: vec4<f32>, uv: vec2<f32>, p: array<f32, 8>) -> vec4<f32> { return color * paper(uv); }"
///     }
///     fn reads_frame(&self) -> bool {
///         false
///     }
///     fn textures(&self) -> &[EffectTexture] {
///         &self.textures
///     }
///     fn with_images(&self, name: &str, images: &[EffectTexture]) -> Option<Effect> {
///         let mut other = Paper { textures: images.to_vec(), ..self.clone() };
///         other.manifest.name = name.into();
///         Some(Effect::pixel(other))
///     }
/// }
///
/// impl PixelEffect for Paper {
///     fn pixels(&self, colors: &mut [Vec4], uv: &[Vec2], _: &[f32]) {
///         colors.iter_mut().zip(uv).for_each(|(color, uv)| *color *= self.textures[0].sample(*uv));
///     }
/// }
///
/// let gray = |value: u8| EffectTexture::new("paper", [1, 1], &[value, value, value, 255], false).unwrap().of_file(None);
/// let manifest = Manifest::new("paper", "1", "on paper").texture("paper", "the paper", "paper.png", false);
/// let effect = Effect::pixel(Paper { manifest, textures: vec![gray(255)] });
/// assert_eq!((effect.textures().len(), effect.reads_frame(), effect.loops().len()), (1, false, 0));
/// let darker = effect.shader().unwrap().with_images("paper 2", &[gray(0)]).unwrap();
/// assert!(darker.manifest().name == "paper 2" && !darker.is_same(&effect) && effect.is_same(&effect.clone()));
/// ```
pub trait EffectShader: EffectPlugin {
    /// WGSL source of a function `effect`; the trait of the hook states its form. `N` is [`Manifest::parameter_length`]: 8 for up to 8
    /// numbers. The function may call `NAME(uv)` of its [`EffectShader::textures`].
    fn wgsl(&self) -> &str;

    /// Whether the function reads the time, the frame number or the image size. (Effects on images state this in
    /// [`ImageEffect::scene_inputs`].) On the CPU, [`EffectFrame::numbers`](crate::EffectFrame::numbers) then follow the function's
    /// parameters; in WGSL, `effect_frame_row_0()` and `effect_frame_row_1()` return four of these numbers each. A scene with such an
    /// effect is drawn again for each frame.
    fn reads_frame(&self) -> bool {
        false
    }

    /// Images that the function reads, including those of [`OptionKind::Texture`](crate::OptionKind::Texture).
    fn textures(&self) -> &[EffectTexture] {
        &[]
    }

    /// A copy of the effect with another name, in which `images` replace the textures of the same names. `None` if the effect has no
    /// texture of these names, or does not support this.
    fn with_images(&self, _name: &str, _images: &[EffectTexture]) -> Option<Effect> {
        None
    }
}

/// A function of one pixel of the image: `fn effect(color: vec4<f32>, uv: vec2<f32>, p: array<f32, N>) -> vec4<f32>`, `uv` from 0 to 1
/// from the top left.
///
/// ```
/// use choreo_plugin::glam::{Vec2, Vec4};
/// use choreo_plugin::{Effect, EffectPlugin, EffectShader, Hook, Manifest, PixelEffect};
///
/// struct Fade(Manifest);
///
/// impl EffectPlugin for Fade {
///     fn manifest(&self) -> &Manifest {
///         &self.0
///     }
/// }
///
/// impl EffectShader for Fade {
///     fn wgsl(&self) -> &str {
///         "fn effect(color: vec4<f32>, uv: vec2<f32>, p: array<f32, 8>) -> vec4<f32> { return color * p[0]; }"
///     }
/// }
///
/// impl PixelEffect for Fade {
///     fn pixels(&self, colors: &mut [Vec4], _: &[Vec2], parameters: &[f32]) {
///         colors.iter_mut().for_each(|color| *color *= parameters[0]);
///     }
/// }
///
/// let fade = Fade(Manifest::new("fade", "1", "fades to black").number("amount", "of the light", 0.5, 0.0..=1.0));
/// let mut colors = [Vec4::ONE];
/// fade.pixels(&mut colors, &[Vec2::ZERO], &fade.0.parameters(&[]));
/// assert_eq!((colors, Effect::pixel(fade).hook()), ([Vec4::splat(0.5)], Hook::Pixel));
/// ```
pub trait PixelEffect: EffectShader {
    /// Whether the effect runs before, after or in place of the view transform.
    fn view_order(&self) -> ViewOrder {
        ViewOrder::After
    }

    /// Replaces colors; `uv` is 0 to 1 from the top left, one for each color.
    fn pixels(&self, colors: &mut [Vec4], uv: &[Vec2], parameters: &[f32]);
}

/// A pass over the image whose function reads any pixel of it: `fn effect(at: vec2<i32>, pass_number: u32, p: array<f32, N>) ->
/// vec4<f32>`. It may call `picture(at)`, the result of the pass before, `original(at)`, the input of the first pass, `picture_size()`
/// and `original_size()`, in pixels, `shrink_factor()`, and with a history `previous(frames, at)`, which only the CPU runs. With
/// [`ImageEffect::scene_inputs`] it may call `scene_surface(at)` and `scene_motion(at)`, the pixels of
/// [`SceneImages`](crate::SceneImages), and `scene_row_0()` to `scene_row_18()`, the [`EffectFrame::rows`](crate::EffectFrame::rows).
///
/// ```
/// use choreo_plugin::glam::{Vec4};
/// use choreo_plugin::*;
///
/// struct Mine(Manifest);
///
/// impl EffectPlugin for Mine {
///     fn manifest(&self) -> &Manifest {
///         &self.0
///     }
/// }
///
/// impl EffectShader for Mine {
///     fn wgsl(&self) -> &str {
///         "fn effect(at: vec2<i32>, pass_number: u32, p: array<f32, 8>) -> vec4<f32> { return picture(vec2<i32>(i32(picture_size().x) - 1 - at.x, at.y)); }"
///     }
/// }
///
/// impl ImageEffect for Mine {
///     /// The image in a mirror.
///     fn image_row(&self, images: &EffectImages, y: u32, _: u32, _: &[f32], row: &mut [Vec4]) {
///         let last = images.now.size[0] as i32 - 1;
///         for (x, pixel) in row.iter_mut().enumerate() {
///             *pixel = images.now.at(last - x as i32, y as i32);
///         }
///     }
/// }
///
/// let mine = Mine(Manifest::new("mine", "1", "an example"));
/// let image = EffectImage { size: [2, 1], rgba: &[Vec4::ZERO, Vec4::ONE] };
/// let mut row = [Vec4::ZERO; 2];
/// mine.image_row(&EffectImages { now: image, original: image, passes: &[], before: &[], scene: None }, 0, 0, &[], &mut row);
/// assert_eq!(row, [Vec4::ONE, Vec4::ZERO]);
/// ```
///
/// An effect with passes that have textures, and inputs:
///
/// ```
/// use choreo_plugin::glam::Vec4;
/// use choreo_plugin::stage::OffScreenActors;
/// use choreo_plugin::*;
///
/// /// The scene one frame ago, half as large, mixed in where something moves.
/// struct Trail(Manifest, [ImagePass; 2], [String; 1]);
///
/// impl EffectPlugin for Trail {
///     fn manifest(&self) -> &Manifest {
///         &self.0
///     }
///     fn loops(&self) -> &[String] {
///         &self.2
///     }
/// }
///
/// impl EffectShader for Trail {
///     fn wgsl(&self) -> &str {
///         "fn small(at: vec2<i32>, p: array<f32, 8>) …, and fn trail"
///     }
/// }
///
/// impl ImageEffect for Trail {
///     fn view_order(&self) -> ViewOrder {
///         ViewOrder::Before
///     }
///     fn named_passes(&self) -> &[ImagePass] {
///         &self.1
///     }
///     fn shrink(&self, pass_number: u32, _: [u32; 2], _: &[f32]) -> u32 {
///         2 - pass_number
///     }
///     fn history(&self, _: &[f32]) -> u32 {
///         1
///     }
///     fn scene_inputs(&self) -> SceneInputs {
///         SceneInputs { motion: true, ..SceneInputs::default() }
///     }
///     fn image_row(&self, images: &EffectImages, y: u32, pass_number: u32, _: &[f32], row: &mut [Vec4]) {
///         for (x, pixel) in (0..).zip(row) {
///             let y = y as i32;
///             *pixel = match (pass_number, images.passes.first().copied().flatten()) {
///                 (1, Some(small)) => 0.5 * (images.now.at(x, y) + small.at(x / 2, y / 2)),
///                 _ => images.before.first().unwrap_or(&images.original).at(2 * x, 2 * y),
///             };
///         }
///     }
/// }
///
/// let passes = [ImagePass::new("small", &[]), ImagePass::new("trail", &[0])];
/// let trail = Effect::image(Trail(Manifest::new("trail", "1", "an example"), passes, ["trail.wgsl:9:5".into()]));
/// assert_eq!((trail.view_order(), trail.passes(), trail.named_passes().len()), (ViewOrder::Before, 2, 2));
/// assert_eq!((trail.shrink(0, [64, 64], &[]), trail.history(&[]), trail.loops()[0].as_str()), (2, 1, "trail.wgsl:9:5"));
/// assert!(trail.scene_inputs().motion && trail.off_screen_actors() == OffScreenActors::All);
/// assert!(!trail.in_model_space() && !trail.changes_background(&[]));
/// let image = EffectImage { size: [2, 2], rgba: &[Vec4::ONE; 4] };
/// assert_eq!(trail.over_image(image, None, &[]), [Vec4::ONE; 4]);
/// ```
pub trait ImageEffect: EffectShader {
    /// Whether the effect runs before, after or in place of the view transform.
    fn view_order(&self) -> ViewOrder {
        ViewOrder::After
    }

    /// Number of passes, 1 or more; each reads the result of the pass before. Not called for effects with [`ImageEffect::named_passes`].
    fn passes(&self) -> u32 {
        1
    }

    /// Named passes in the order in which they run, each of which writes its own texture; empty for effects without named passes.
    /// `picture(at)` is the input of the effect in all of them. A pass whose texture nothing reads is skipped. To read a texture `NAME`,
    /// the function calls `NAME_at(at)` for one pixel, `NAME_uv(uv)` for a bilinear sample with `uv` from 0 to 1 over the whole image, and
    /// `NAME_size()` for the size in pixels. [`ImageEffect::shrink`] is the scale of each pass.
    fn named_passes(&self) -> &[ImagePass] {
        &[]
    }

    /// Downscale factor of a pass's image, per axis, 1 or more. The last pass always writes the whole image; `_size` is its size in pixels.
    /// `at` counts pixels of the pass's own image, `picture(at)` those of the pass before, `original(at)` those of the whole image.
    fn shrink(&self, _pass_number: u32, _size: [u32; 2], _parameters: &[f32]) -> u32 {
        1
    }

    /// Number of previous frames that the effect reads. They are drawn again for each frame, so that a frame is the same whether its
    /// predecessors were rendered or not. Before the first frame, the first frame is repeated.
    fn history(&self, _parameters: &[f32]) -> u32 {
        0
    }

    /// The parts of the scene that the function reads.
    fn scene_inputs(&self) -> SceneInputs {
        SceneInputs::default()
    }

    /// Writes row `y` of a pass's image.
    fn image_row(
        &self,
        images: &EffectImages,
        y: u32,
        pass_number: u32,
        parameters: &[f32],
        row: &mut [Vec4],
    );
}

/// A function of one point on a surface, after lighting: `fn effect(color: vec4<f32>, surface: SurfaceSample, p: array<f32, N>) -> vec4<f32>`.
///
/// ```
/// use choreo_plugin::glam::{Vec4};
/// use choreo_plugin::*;
///
/// struct Mine(Manifest);
///
/// impl EffectPlugin for Mine {
///     fn manifest(&self) -> &Manifest {
///         &self.0
///     }
/// }
///
/// impl EffectShader for Mine {
///     fn wgsl(&self) -> &str {
///         "fn effect(color: vec4<f32>, surface: SurfaceSample, p: array<f32, 8>) -> vec4<f32> { return vec4<f32>(vec3<f32>(surface.facing), color.w); }"
///     }
/// }
///
/// impl SurfaceEffect for Mine {
///     fn changes_background(&self, _: &[f32]) -> bool {
///         false
///     }
///     fn surface_inputs(&self, _: &[f32]) -> SurfaceInputs {
///         SurfaceInputs { normals: true, ..SurfaceInputs::default() }
///     }
///     /// White where a surface faces the viewer.
///     fn surfaces(&self, colors: &mut [Vec4], samples: &[SurfaceSample], _: &[f32]) {
///         for (color, sample) in colors.iter_mut().zip(samples) {
///             *color = glam::Vec3::splat(sample.facing).extend(color.w);
///         }
///     }
/// }
///
/// let mine = Mine(Manifest::new("mine", "1", "an example"));
/// let mut colors = [Vec4::ONE];
/// mine.surfaces(&mut colors, &[SurfaceSample { facing: 0.5, ..SurfaceSample::default() }], &[]);
/// assert_eq!(colors[0].x, 0.5);
/// ```
pub trait SurfaceEffect: EffectShader {
    /// The parts of a surface that the function reads.
    fn surface_inputs(&self, _parameters: &[f32]) -> SurfaceInputs {
        SurfaceInputs::default()
    }

    /// Whether the effect also changes the background when it applies to the whole scene. The background counts as a surface without a
    /// normal at [`BACKGROUND_DISTANCE`](crate::BACKGROUND_DISTANCE).
    fn changes_background(&self, _parameters: &[f32]) -> bool {
        false
    }

    /// Replaces the colors of surfaces, one for each sample.
    fn surfaces(&self, colors: &mut [Vec4], samples: &[SurfaceSample], parameters: &[f32]);
}

/// A function of one vertex: `fn effect(vertex: VertexSample, p: array<f32, N>) -> vec3<f32>`, its displacement. Normals follow the displacement.
///
/// ```
/// use choreo_plugin::glam::{Vec3};
/// use choreo_plugin::*;
///
/// struct Mine(Manifest);
///
/// impl EffectPlugin for Mine {
///     fn manifest(&self) -> &Manifest {
///         &self.0
///     }
/// }
///
/// impl EffectShader for Mine {
///     fn wgsl(&self) -> &str {
///         "fn effect(vertex: VertexSample, p: array<f32, 8>) -> vec3<f32> { return vertex.normal * 0.1; }"
///     }
/// }
///
/// impl VertexEffect for Mine {
///     fn surface_inputs(&self, _: &[f32]) -> SurfaceInputs {
///         SurfaceInputs { normals: true, ..SurfaceInputs::default() }
///     }
///     fn reach(&self, _: &[f32]) -> f32 {
///         0.1
///     }
///     fn in_model_space(&self) -> bool {
///         false
///     }
///     /// Ten centimetres thicker.
///     fn vertex(&self, sample: &VertexSample, _: &[f32]) -> Vec3 {
///         sample.normal * 0.1
///     }
/// }
///
/// let mine = Mine(Manifest::new("mine", "1", "an example"));
/// assert_eq!(mine.vertex(&VertexSample { normal: Vec3::Y, ..VertexSample::default() }, &[]), Vec3::Y * 0.1);
/// ```
pub trait VertexEffect: EffectShader {
    /// The parts of a vertex that the function reads: normals and texture coordinates.
    fn surface_inputs(&self, _parameters: &[f32]) -> SurfaceInputs {
        SurfaceInputs::default()
    }

    /// The largest displacement in metres; longer ones are cut off at this length.
    fn reach(&self, parameters: &[f32]) -> f32;

    /// Whether the displacement is in model space, not in the world.
    fn in_model_space(&self) -> bool {
        false
    }

    /// The displacement in metres, or with [`VertexEffect::in_model_space`] in model space.
    fn vertex(&self, sample: &VertexSample, parameters: &[f32]) -> Vec3;
}

/// A function of one light at one point on a surface: `fn effect(sample: LightSample, p: array<f32, N>) -> vec3<f32>`, the reflected light.
///
/// ```
/// use choreo_plugin::glam::{Vec3};
/// use choreo_plugin::*;
///
/// struct Mine(Manifest);
///
/// impl EffectPlugin for Mine {
///     fn manifest(&self) -> &Manifest {
///         &self.0
///     }
/// }
///
/// impl EffectShader for Mine {
///     fn wgsl(&self) -> &str {
///         "fn effect(sample: LightSample, p: array<f32, 8>) -> vec3<f32> { return sample.base * sample.color * sample.share; }"
///     }
/// }
///
/// impl LightingEffect for Mine {
///     /// Light that does not depend on the angle, as on felt.
///     fn lights(&self, samples: &mut [LightSample], _: &[f32]) {
///         for sample in samples {
///             sample.lit = sample.base * sample.color * sample.share;
///         }
///     }
/// }
///
/// let mine = Mine(Manifest::new("mine", "1", "an example"));
/// let mut sample = [LightSample { base: Vec3::ONE, color: Vec3::X, share: 0.5, ..LightSample::default() }];
/// mine.lights(&mut sample, &[]);
/// assert_eq!(sample[0].lit, Vec3::X * 0.5);
/// ```
pub trait LightingEffect: EffectShader {
    /// The parts of a surface that the function reads.
    fn surface_inputs(&self, _parameters: &[f32]) -> SurfaceInputs {
        SurfaceInputs::default()
    }

    /// Replaces [`LightSample::lit`] of each sample.
    fn lights(&self, samples: &mut [LightSample], parameters: &[f32]);
}

/// An effect that draws an inverted hull around surfaces, or a wireframe of their triangles.
///
/// ```
/// use choreo_plugin::glam::Vec3;
/// use choreo_plugin::{Effect, EffectPlugin, InvertedHull, Manifest, OutlineEffect};
///
/// struct Ink(Manifest);
///
/// impl EffectPlugin for Ink {
///     fn manifest(&self) -> &Manifest {
///         &self.0
///     }
/// }
///
/// impl OutlineEffect for Ink {
///     fn wireframe(&self, _: &[f32]) -> Option<Vec3> {
///         None
///     }
///     fn inverted_hull(&self, _: &[f32]) -> Option<InvertedHull> {
///         Some(InvertedHull { width: 2.0, color: Vec3::ZERO, lighting_mix: 0.0 })
///     }
/// }
///
/// assert!(Effect::outline(Ink(Manifest::new("ink", "1", "black outlines"))).applies_to_actors());
/// ```
pub trait OutlineEffect: EffectPlugin {
    /// The hull; `None` draws none.
    fn inverted_hull(&self, _parameters: &[f32]) -> Option<InvertedHull> {
        None
    }

    /// Wireframe color of the edges of triangles, linear; `None` draws none.
    fn wireframe(&self, _parameters: &[f32]) -> Option<Vec3> {
        None
    }
}

/// An effect that draws triangles, lines, points, lattices and labels.
///
/// ```
/// use choreo_plugin::glam::Vec4;
/// use choreo_plugin::{Effect, EffectPlugin, EffectScene, Label, Manifest, Overlay, OverlayEffect};
///
/// /// The name of each actor above it.
/// struct Names(Manifest);
///
/// impl EffectPlugin for Names {
///     fn manifest(&self) -> &Manifest {
///         &self.0
///     }
/// }
///
/// impl OverlayEffect for Names {
///     fn history(&self, _: &[f32]) -> u32 {
///         0
///     }
///     fn overlay(&self, scene: &EffectScene, _: &[f32]) -> Overlay {
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
/// let names = Effect::overlay(Names(Manifest::new("names", "1", "the name of each actor above it")));
/// assert!(names.applies_to_actors() && names.shader().is_none());
/// ```
pub trait OverlayEffect: EffectPlugin {
    /// Whether the effect can be put on single actors.
    fn applies_to_actors(&self) -> bool {
        true
    }

    /// Number of previous frames that the effect reads. They are posed again for each frame; before the first frame, the first frame is
    /// repeated.
    fn history(&self, _parameters: &[f32]) -> u32 {
        0
    }

    /// Geometry and labels that the effect draws.
    fn overlay(&self, scene: &EffectScene, parameters: &[f32]) -> Overlay;
}

/// An effect that opens the shutter for a time (motion blur).
pub trait ShutterEffect: EffectPlugin {
    /// Exposure of the frame; `None`: no motion blur.
    fn shutter(&self, parameters: &[f32]) -> Option<Shutter>;
}
