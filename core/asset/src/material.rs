//! Materials: parameters of the shading models, textures, alpha, lines.

use crate::image_sequence::{ImageSequence, frame_index};
use crate::material_layers::MaterialLayers;
use crate::reflection::Reflection;
use crate::texture::TextureRef;
use crate::toon::{Toon, UvMotion};
use choreo_motion::Time;
use glam::{Affine2, Vec2, Vec3, Vec4};
use std::sync::Arc;

/// How alpha is drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum AlphaMode {
    /// Alpha has no effect.
    #[default]
    Opaque,
    /// Fragments with alpha below the cutoff are discarded.
    Mask(f32),
    /// Source-over blending, sorted back to front.
    Blend,
}

/// Shading model.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Shading {
    /// glTF 2.0 Appendix B (GGX, Smith, Schlick), with KHR_materials_specular.
    #[default]
    MetallicRoughness,
    /// Lambert + normalized Blinn–Phong with `specular_color` and `shininess`.
    BlinnPhong,
    /// Like Blinn–Phong, but the highlight falls off from the mirrored light's direction (Phong 1975).
    Phong,
    /// The base color itself, without lighting.
    Unlit,
    /// Cel shading: two colors with a boundary between, see [`Toon`]. Vertex colors are ignored.
    Toon,
}

/// How a surface looks. Colors are linear; factors multiply their textures.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// Name in the file.
    pub name: String,
    /// Shading model.
    pub shading: Shading,
    /// Linear RGBA factor.
    pub base_color: Vec4,
    /// sRGB color, linear alpha.
    pub base_color_texture: Option<TextureRef>,
    /// 0 for dielectrics, 1 for metals.
    pub metallic: f32,
    /// 0 for a mirror, 1 for matte.
    pub roughness: f32,
    /// G roughness, B metallic, linear.
    pub metallic_roughness_texture: Option<TextureRef>,
    /// Normal map in tangent space, +Y up.
    pub normal_texture: Option<TextureRef>,
    /// Factor of the normal map's x and y.
    pub normal_scale: f32,
    /// Parallax depth: distance below the surface where the normal texture's alpha is 0, in widths of the texture. 0: alpha is
    /// ignored.
    pub relief: f32,
    /// Ambient occlusion in R, linear.
    pub occlusion_texture: Option<TextureRef>,
    /// How much the occlusion texture darkens, 0 to 1.
    pub occlusion_strength: f32,
    /// Emitted light, linear RGB, emissive strength already multiplied in.
    pub emissive: Vec3,
    /// sRGB.
    pub emissive_texture: Option<TextureRef>,
    /// KHR_materials_specular factor, multiplied by A of its texture.
    pub specular: f32,
    /// Strength of the specular reflection in alpha.
    pub specular_texture: Option<TextureRef>,
    /// KHR_materials_specular color, or the Blinn–Phong specular color.
    pub specular_color: Vec3,
    /// sRGB.
    pub specular_color_texture: Option<TextureRef>,
    /// Blinn–Phong exponent.
    pub shininess: f32,
    /// The environment reflection of Blinn–Phong and Phong materials; `None`: no reflection.
    pub reflection: Option<Box<Reflection>>,
    /// Parameters of [`Shading::Toon`], ignored by other models; `None`: the defaults.
    pub toon: Option<Arc<Toon>>,
    /// How alpha is drawn.
    pub alpha_mode: AlphaMode,
    /// Whether both faces are drawn.
    pub double_sided: bool,
    /// UV animation of all textures. [`Shading::Toon`] ignores it and uses [`Toon::uv_motion`].
    pub uv_motion: Option<UvMotion>,
    /// Flipbook: all textures hold frames side by side, of which one is shown at a time.
    pub flipbook: Option<FrameStrip>,
    /// Image sequences whose first images are textures of this material.
    pub sequence: Option<Arc<ImageSequence>>,
    /// Clearcoat, sheen, transmission and the like; metallic-roughness surfaces only.
    pub layers: Option<Box<MaterialLayers>>,
    /// Width and shape of lines and points; `None`: one pixel wide. Ignored for triangles, and for meshes with a skin or morphs.
    pub line_style: Option<LineStyle>,
    /// Triplanar mapping: base color, normals and specular color are projected from three sides, and texture coordinates are
    /// ignored. Normals need tangents, each at a right angle to its normal.
    pub triplanar: Option<Triplanar>,
}

/// Triplanar mapping: textures are projected along the x, y and z axes of the mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Triplanar {
    /// The center of the images, mesh space.
    pub middle: Vec3,
    /// Width of an image in metres.
    pub size: f32,
    /// Exponent of the normal's components that weight the three projections; the higher, the narrower the transitions.
    pub sharpness: f32,
}

/// Style of lines and points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LineStyle {
    /// Width of lines and points, in the unit that `metres` selects; 0 draws nothing, other widths at least one pixel.
    pub width: f32,
    /// Whether `width` is in metres of the model; otherwise it is in pixels, at any distance.
    pub metres: bool,
    /// Whether points are discs and lines have round caps; otherwise points are squares along the image's edges, and lines have
    /// butt caps.
    pub round: bool,
}

/// Flipbook: frames of a texture in columns and rows, from the top left, row by row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameStrip {
    /// Number of images in a row.
    pub columns: u32,
    /// Number of rows.
    pub rows: u32,
    /// Number of frames; at most columns · rows.
    pub count: u32,
    /// Frames per second.
    pub fps: f32,
    /// Whether the last frame stays; otherwise the first follows it.
    pub once: bool,
}

impl FrameStrip {
    /// Transform of texture coordinates to the frame that is shown at a time.
    pub fn cell(&self, time: Time) -> Affine2 {
        let (columns, rows) = (self.columns.max(1), self.rows.max(1));
        let count = self.count.clamp(1, columns * rows) as usize;
        let frame = frame_index(time, self.fps, count, self.once) as u32;
        let scale = Vec2::new(1.0 / columns as f32, 1.0 / rows as f32);
        let at = Vec2::new((frame % columns) as f32, (frame / columns) as f32);
        Affine2::from_scale_angle_translation(scale, 0.0, at * scale)
    }
}

impl Default for Material {
    /// glTF's default material: white, metallic 1, roughness 1.
    fn default() -> Self {
        Material {
            name: String::new(),
            shading: Shading::MetallicRoughness,
            base_color: Vec4::ONE,
            base_color_texture: None,
            metallic: 1.0,
            roughness: 1.0,
            metallic_roughness_texture: None,
            normal_texture: None,
            normal_scale: 1.0,
            relief: 0.0,
            occlusion_texture: None,
            occlusion_strength: 1.0,
            emissive: Vec3::ZERO,
            emissive_texture: None,
            specular: 1.0,
            specular_texture: None,
            specular_color: Vec3::ONE,
            specular_color_texture: None,
            shininess: 32.0,
            reflection: None,
            toon: None,
            alpha_mode: AlphaMode::Opaque,
            double_sided: false,
            uv_motion: None,
            flipbook: None,
            sequence: None,
            layers: None,
            line_style: None,
            triplanar: None,
        }
    }
}

impl Material {
    /// The environment reflection, if the shading model has one and it is not black.
    pub fn environment_reflection(&self) -> Option<&Reflection> {
        let phong = matches!(self.shading, Shading::BlinnPhong | Shading::Phong);
        self.reflection.as_deref().filter(|r| phong && r.color.max_element() > 0.0)
    }

    /// Roughness (the square root of GGX's α) of an environment reflection that is as sharp as the highlight. Blinn–Phong: α² = 2
    /// / (s + 2) (Walter et al. 2007, "Microfacet Models for Refraction through Rough Surfaces", 5.2); Phong: its lobe is as wide
    /// as Blinn's with four times the exponent (Fisher & Woo 1994, "R.E versus N.H Specular Highlights", Graphics Gems IV).
    pub fn mirror_roughness(&self) -> f32 {
        let times = if self.shading == Shading::Phong { 4.0 } else { 1.0 };
        (2.0 / (self.shininess.max(0.0) * times + 2.0)).sqrt().sqrt()
    }
}
