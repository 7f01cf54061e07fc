//! Effects: one of each [`Hook`]. Vulkan runs the function of an effect as part of a shader, and the CPU renderer calls it as a method of
//! the hook's trait.

pub use crate::effect_data::{
    BACKGROUND_DISTANCE, EffectImage, EffectImages, ImagePass, InvertedHull, LightSample, MAX_EFFECT_STEPS,
    Shutter, SurfaceInputs, SurfaceSample, VertexSample, ViewOrder, endless, endless_loop,
};
use crate::effect_hooks::{
    EffectPlugin, EffectShader, ImageEffect, LightingEffect, OutlineEffect, OverlayEffect, PixelEffect,
    ShutterEffect, SurfaceEffect, VertexEffect,
};
use crate::{EffectTexture, Manifest, PluginFile, SceneImages, SceneInputs};
use choreo_stage::OffScreenActors;
use glam::Vec4;
use std::sync::Arc;

/// The step of drawing in which an effect changes a frame.
///
/// ```
/// use choreo_plugin::Hook;
/// assert!(Hook::Surface.applies_to_actors() && Hook::Surface.is_in_scene());
/// assert!(Hook::Image.has_function() && !Hook::Image.applies_to_actors());
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[non_exhaustive]
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
    /// A function of one light at one point on a surface: the light that the surface reflects.
    Lighting,
    /// An inverted hull around surfaces, or the edges of their triangles: [`OutlineEffect`].
    Outline,
    /// Triangles, lines, points and lattices: [`OverlayEffect`].
    Overlay,
    /// How long the shutter is open: [`ShutterEffect`].
    Shutter,
}

impl Hook {
    /// Whether single actors can have the effect.
    pub fn applies_to_actors(self) -> bool {
        matches!(self, Hook::Outline | Hook::Overlay) || self.is_in_scene()
    }

    /// Whether effects have a function that both devices run: [`Effect::shader`].
    pub fn has_function(self) -> bool {
        matches!(self, Hook::Pixel | Hook::Image) || self.is_in_scene()
    }

    /// Whether the function is part of the shaders that draw the scene.
    pub fn is_in_scene(self) -> bool {
        matches!(self, Hook::Surface | Hook::Vertex | Hook::Lighting)
    }
}

/// An effect of any hook. Clones share it.
///
/// Most effects are one file, read by the crate `choreo-wgsl-effect`; an effect in Rust implements the trait of its hook.
///
/// ```
/// use choreo_plugin::{Effect, EffectPlugin, Hook, Manifest, Registry, Shutter, ShutterEffect};
///
/// /// 180 degrees, half of them before the frame's time.
/// struct Film(Manifest);
///
/// impl EffectPlugin for Film {
///     fn manifest(&self) -> &Manifest {
///         &self.0
///     }
/// }
///
/// impl ShutterEffect for Film {
///     fn shutter(&self, _: &[f32]) -> Option<Shutter> {
///         Some(Shutter { samples: 16, open: 180.0 / 360.0, before: 0.5 })
///     }
/// }
///
/// let film = Effect::shutter(Film(Manifest::new("film", "1", "motion blur as on film")));
/// assert_eq!((film.hook(), film.manifest().name.as_str()), (Hook::Shutter, "film"));
/// let mut registry = Registry::default();
/// registry.add_effect(film);
/// ```
#[derive(Clone)]
#[non_exhaustive]
pub enum Effect {
    /// A function of one pixel of the finished image.
    Pixel(Arc<dyn PixelEffect>),
    /// A pass over the finished image.
    Image(Arc<dyn ImageEffect>),
    /// A function of one point on a surface.
    Surface(Arc<dyn SurfaceEffect>),
    /// A function of one vertex.
    Vertex(Arc<dyn VertexEffect>),
    /// A function of one light at one point on a surface.
    Lighting(Arc<dyn LightingEffect>),
    /// An inverted hull or edges.
    Outline(Arc<dyn OutlineEffect>),
    /// Geometry that the effect generates.
    Overlay(Arc<dyn OverlayEffect>),
    /// How long the shutter is open.
    Shutter(Arc<dyn ShutterEffect>),
}

macro_rules! constructors {
    ($($(#[$doc:meta])* $name:ident: $variant:ident, $hook:ident;)*) => {
        $(
            $(#[$doc])*
            pub fn $name(effect: impl $hook + 'static) -> Effect {
                Effect::$variant(Arc::new(effect))
            }
        )*
    };
}

impl Effect {
    constructors! {
        /// An effect on pixels.
        pixel: Pixel, PixelEffect;
        /// An effect on images.
        image: Image, ImageEffect;
        /// An effect on surfaces.
        surface: Surface, SurfaceEffect;
        /// An effect on vertices.
        vertex: Vertex, VertexEffect;
        /// An effect on reflected light.
        lighting: Lighting, LightingEffect;
        /// An effect that outlines surfaces.
        outline: Outline, OutlineEffect;
        /// An effect that generates geometry.
        overlay: Overlay, OverlayEffect;
        /// An effect on the shutter.
        shutter: Shutter, ShutterEffect;
    }

    /// The step of drawing in which the effect changes a frame.
    pub fn hook(&self) -> Hook {
        match self {
            Effect::Pixel(_) => Hook::Pixel,
            Effect::Image(_) => Hook::Image,
            Effect::Surface(_) => Hook::Surface,
            Effect::Vertex(_) => Hook::Vertex,
            Effect::Lighting(_) => Hook::Lighting,
            Effect::Outline(_) => Hook::Outline,
            Effect::Overlay(_) => Hook::Overlay,
            Effect::Shutter(_) => Hook::Shutter,
        }
    }

    /// The methods that effects of all hooks have in common.
    fn plugin(&self) -> &dyn EffectPlugin {
        match self {
            Effect::Pixel(effect) => &**effect,
            Effect::Image(effect) => &**effect,
            Effect::Surface(effect) => &**effect,
            Effect::Vertex(effect) => &**effect,
            Effect::Lighting(effect) => &**effect,
            Effect::Outline(effect) => &**effect,
            Effect::Overlay(effect) => &**effect,
            Effect::Shutter(effect) => &**effect,
        }
    }

    /// Whether both are clones of one effect.
    pub fn is_same(&self, other: &Effect) -> bool {
        std::ptr::addr_eq(self.plugin(), other.plugin())
    }

    /// The function in WGSL; `None` for hooks without one.
    pub fn shader(&self) -> Option<&dyn EffectShader> {
        Some(match self {
            Effect::Pixel(effect) => &**effect,
            Effect::Image(effect) => &**effect,
            Effect::Surface(effect) => &**effect,
            Effect::Vertex(effect) => &**effect,
            Effect::Lighting(effect) => &**effect,
            Effect::Outline(_) | Effect::Overlay(_) | Effect::Shutter(_) => return None,
        })
    }

    /// Name, description and parameters.
    pub fn manifest(&self) -> &Manifest {
        self.plugin().manifest()
    }

    /// The file that the effect was read from, unless it is part of the program.
    pub fn file(&self) -> Option<&PluginFile> {
        self.plugin().file()
    }

    /// Why the effect changes nothing with these parameters; `None` if it does something.
    pub fn off(&self, parameters: &[f32]) -> Option<String> {
        self.plugin().off(parameters)
    }

    /// Places of the loops in the effect's WGSL: [`EffectPlugin::loops`].
    pub fn loops(&self) -> &[String] {
        self.plugin().loops()
    }

    /// Whether single actors can have the effect.
    pub fn applies_to_actors(&self) -> bool {
        match self {
            Effect::Overlay(effect) => effect.applies_to_actors(),
            other => other.hook().applies_to_actors(),
        }
    }

    /// Images that the effect's function reads.
    pub fn textures(&self) -> &[EffectTexture] {
        self.shader().map_or(&[], |shader| shader.textures())
    }

    /// Whether [`EffectFrame::numbers`](crate::EffectFrame::numbers) follow the function's parameters.
    pub fn reads_frame(&self) -> bool {
        self.hook() != Hook::Image && self.shader().is_some_and(|shader| shader.reads_frame())
    }

    /// The parts of a surface that the function reads; none for hooks without surfaces.
    pub fn surface_inputs(&self, parameters: &[f32]) -> SurfaceInputs {
        match self {
            Effect::Surface(effect) => effect.surface_inputs(parameters),
            Effect::Vertex(effect) => effect.surface_inputs(parameters),
            Effect::Lighting(effect) => effect.surface_inputs(parameters),
            _ => SurfaceInputs::default(),
        }
    }

    /// The parts of the scene that an effect on images reads.
    pub fn scene_inputs(&self) -> SceneInputs {
        match self {
            Effect::Image(effect) => effect.scene_inputs(),
            _ => SceneInputs::default(),
        }
    }

    /// Whether an effect on pixels or images runs before, after or in place of the view transform; `After` for all other effects.
    pub fn view_order(&self) -> ViewOrder {
        match self {
            Effect::Pixel(effect) => effect.view_order(),
            Effect::Image(effect) => effect.view_order(),
            _ => ViewOrder::After,
        }
    }

    /// Number of passes; 1 for all effects but those on images.
    pub fn passes(&self) -> u32 {
        match self {
            Effect::Image(effect) if effect.named_passes().is_empty() => effect.passes(),
            Effect::Image(effect) => effect.named_passes().len() as u32,
            _ => 1,
        }
    }

    /// The passes of an effect on images whose passes have textures; empty for all others.
    pub fn named_passes(&self) -> &[ImagePass] {
        match self {
            Effect::Image(effect) => effect.named_passes(),
            _ => &[],
        }
    }

    /// Runs all passes of an effect on images on the CPU, without previous frames, as tests of effects do. Returns the image unchanged for
    /// other hooks. `scene`: the parts of the scene that the effect reads.
    ///
    /// ```
    /// use choreo_plugin::glam::Vec4;
    /// use choreo_plugin::{Effect, EffectImage};
    /// fn darkest(effect: &Effect, rgba: &[Vec4], size: [u32; 2]) -> f32 {
    ///     let out = effect.over_image(EffectImage { size, rgba }, None, &effect.manifest().parameters(&[]));
    ///     out.iter().map(|color| color.x).fold(f32::INFINITY, f32::min)
    /// }
    /// ```
    pub fn over_image(
        &self,
        original: EffectImage,
        scene: Option<SceneImages>,
        parameters: &[f32],
    ) -> Vec<Vec4> {
        let mut now = original.rgba.to_vec();
        let Effect::Image(effect) = self else { return now };
        let (mut now_size, mut textures) = (original.size, Vec::<(Vec<Vec4>, [u32; 2])>::new());
        let (count, named) = (self.passes(), !effect.named_passes().is_empty());
        for pass in 0..count {
            let shrink =
                if pass + 1 < count { effect.shrink(pass, original.size, parameters).max(1) } else { 1 };
            let size = original.size.map(|s| s.div_ceil(shrink));
            let passes: Vec<_> =
                textures.iter().map(|(rgba, size)| Some(EffectImage { size: *size, rgba })).collect();
            let picture = EffectImage { size: now_size, rgba: &now };
            let images = EffectImages { now: picture, original, passes: &passes, before: &[], scene };
            let mut made = vec![Vec4::ZERO; size[0] as usize * size[1] as usize];
            for (y, row) in (0..).zip(made.chunks_mut(size[0].max(1) as usize)) {
                effect.image_row(&images, y, pass, parameters, row);
            }
            match named && pass + 1 < count {
                true => textures.push((made, size)),
                false => (now, now_size) = (made, size),
            }
        }
        now
    }

    /// Downscale factor of the image that a pass writes, per axis; 1 for all effects but those on images.
    pub fn shrink(&self, pass_number: u32, size: [u32; 2], parameters: &[f32]) -> u32 {
        match self {
            Effect::Image(effect) => effect.shrink(pass_number, size, parameters),
            _ => 1,
        }
    }

    /// Number of previous frames that the effect reads; 0 for hooks without a history.
    pub fn history(&self, parameters: &[f32]) -> u32 {
        match self {
            Effect::Image(effect) => effect.history(parameters),
            Effect::Overlay(effect) => effect.history(parameters),
            _ => 0,
        }
    }

    /// The actors outside the image whose poses the effect can need. Vertices and outlines can be moved into the image, motion is
    /// read where an actor was one frame ago, and an overlay may draw anything.
    pub fn off_screen_actors(&self) -> OffScreenActors {
        match self {
            Effect::Pixel(_) | Effect::Surface(_) | Effect::Lighting(_) | Effect::Shutter(_) => {
                OffScreenActors::None
            }
            Effect::Image(_) if !self.scene_inputs().motion => OffScreenActors::None,
            Effect::Image(_) | Effect::Overlay(_) => OffScreenActors::All,
            Effect::Vertex(_) | Effect::Outline(_) => OffScreenActors::Affected,
        }
    }

    /// Whether an effect on vertices displaces them in model space.
    pub fn in_model_space(&self) -> bool {
        matches!(self, Effect::Vertex(effect) if effect.in_model_space())
    }

    /// The largest displacement of an effect on vertices, metres; 0 for other effects.
    pub fn reach(&self, parameters: &[f32]) -> f32 {
        match self {
            Effect::Vertex(effect) => effect.reach(parameters),
            _ => 0.0,
        }
    }

    /// Whether an effect on surfaces also changes the background.
    pub fn changes_background(&self, parameters: &[f32]) -> bool {
        matches!(self, Effect::Surface(effect) if effect.changes_background(parameters))
    }
}
