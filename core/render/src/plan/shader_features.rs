//! The table of shader features. Each row has the feature's name, which is also its switch in WGSL, the part of the scene that
//! requests it, its conditions, the texture that it reads, and the report of a frame that does not use it. Everything else about
//! features is derived from this table: the bits of [`Features`], the switches of `@if`, the bindings of material textures, the
//! reports, and the set of all pipeline keys that the planner can produce, which `tests/shaders/keys.rs` compiles.

/// A set of shader features, a bit for each row of [`FEATURES`], in the table's order.
///
/// A bit may be set where primitive or material lacks the data (`PlanOptions::force_all`). The shader then reads:
/// uv 0, color 1, tangent 0, joint indices 0 with weights (1,0,0,0 | 0,0,0,0), normal scale 0, cutoff 0,
/// identity uv transforms, and a white texture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Features(u128);

impl Features {
    pub const fn has(self, other: Features) -> bool {
        self.0 & other.0 == other.0
    }
    pub const fn has_any(self, other: Features) -> bool {
        self.0 & other.0 != 0
    }
    pub const fn with(self, other: Features) -> Features {
        Features(self.0 | other.0)
    }
    pub const fn only(self, other: Features) -> Features {
        Features(self.0 & other.0)
    }
    pub const fn without(self, other: Features) -> Features {
        Features(self.0 & !other.0)
    }
    /// `self` if `on`, else the empty set.
    pub const fn when(self, on: bool) -> Features {
        if on { self } else { Features(0) }
    }
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// All features of a part of the shader.
    pub(crate) const fn of_part(part: ShaderPart) -> Features {
        let (mut all, mut row) = (Features(0), 0);
        while row < FEATURES.len() {
            all = all.with(FEATURES[row].bit.when(FEATURES[row].part as u8 == part as u8));
            row += 1;
        }
        all
    }

    /// The features that the depth of a draw depends on.
    pub(crate) const fn of_depth(self) -> Features {
        self.of_alpha(false)
    }
    /// The features that depth depends on, and those of alpha if the surface is `blended` or cut out.
    pub(crate) const fn of_alpha(self, blended: bool) -> Features {
        let alpha = ALPHA.when(blended || self.has(Features::ALPHA_MASK));
        self.only(Features::SKINNING.with(alpha))
    }
    /// Whether tangents are read, by a normal map or by anisotropy.
    pub(crate) const fn has_tangents(self) -> bool {
        const READ: Features =
            Features::NORMAL_TEXTURE.with(Features::CLEARCOAT_NORMAL_TEXTURE).with(Features::ANISOTROPY);
        self.has_any(READ)
    }
    pub const fn has_normals(self) -> bool {
        const READ: Features = Features::OUTLINE.with(Features::EFFECT_NORMALS).with(Features::TRIPLANAR);
        self.is_lit() || self.has_any(READ)
    }
    pub(crate) const fn is_lit(self) -> bool {
        const MODELS: Features =
            Features::METALLIC_ROUGHNESS.with(Features::BLINN_PHONG).with(Features::TOON);
        self.has_any(MODELS)
    }

    /// Features that deform vertices: skin and morph targets.
    pub const SKINNING: Features = Features::of_part(ShaderPart::Pose);
    /// Every feature.
    pub const ALL: Features = Features((1 << FEATURES.len()) - 1);
    /// Features of lighting that depend on the scene instead of the surface.
    pub const LIGHTS: Features = Features::of_part(ShaderPart::Light);
    /// Features that turn light into display colors.
    pub const DISPLAY: Features = Features::EXPOSURE.with(Features::VIEW_TRANSFORM).with(Features::AGX);
    /// All material layers and their textures.
    pub(crate) const ALL_LAYERS: Features = Features::of_part(ShaderPart::Layer);
}

pub(crate) const ALPHA: Features = Features::of_part(ShaderPart::Alpha);

/// The part of a scene that requests a feature.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RequestedBy {
    Mesh,
    Material,
    /// The scene's lights, shadows and sky.
    Lights,
    Effects,
    /// The recording, for meshes with many draws.
    Recording,
}

/// The part of the shader that a feature belongs to. Some passes leave out whole parts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ShaderPart {
    /// Deformation of vertices.
    Pose,
    /// Alpha test and blending.
    Alpha,
    /// The shading model and its inputs.
    Surface,
    /// Layers over, in or behind a metallic-roughness surface.
    Layer,
    /// Inputs of lighting from the scene.
    Light,
    /// Drawing that replaces the surface, and inputs of effects.
    Other,
}

/// Binding of a material texture: set 3, bindings 1 + 2 · slot and, for its sampler, 2 + 2 · slot. Features of different shading
/// models may share a slot, as no material has both.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TextureSlot {
    pub slot: usize,
    /// Whether the vertex stage reads the texture instead of the fragment stage.
    pub vertex: bool,
}

/// The report of a frame in which no draw has a feature.
#[derive(Clone, Copy, Debug)]
pub struct Absence {
    pub what: &'static str,
    pub why: &'static str,
    /// Replaces `why` if nothing in the stage has the feature, in view or not.
    pub absent_from_stage: Option<&'static str>,
    /// Condition on the features of all draws under which the absence is reported.
    pub when: &'static str,
}

/// One row of the table.
#[derive(Clone, Copy, Debug)]
pub struct Feature {
    /// The name of the constant of [`Features`] and of the switch in WGSL.
    pub name: &'static str,
    pub bit: Features,
    pub by: RequestedBy,
    pub part: ShaderPart,
    /// Conditions that all hold wherever the feature is on, in the syntax of `@if`.
    pub needs: &'static [&'static str],
    pub texture: Option<TextureSlot>,
    pub absence: Option<Absence>,
}

const DEFAULT_FEATURE: Feature = Feature {
    name: "",
    bit: Features(0),
    by: RequestedBy::Material,
    part: ShaderPart::Surface,
    needs: &[],
    texture: None,
    absence: None,
};

const fn slot(slot: usize) -> Option<TextureSlot> {
    Some(TextureSlot { slot, vertex: false })
}

const fn absence(what: &'static str, why: &'static str, when: &'static str) -> Option<Absence> {
    Some(Absence { what, why, absent_from_stage: None, when })
}

const fn absence_by_stage(
    what: &'static str,
    [why, absent_from_stage]: [&'static str; 2],
    when: &'static str,
) -> Option<Absence> {
    Some(Absence { what, why, absent_from_stage: Some(absent_from_stage), when })
}

macro_rules! features {
    ($($(#[$doc:meta])* $name:ident { $($field:ident: $value:expr),* $(,)? })*) => {
        #[allow(non_camel_case_types, clippy::upper_case_acronyms)]
        enum Row { $($name),* }

        impl Features {
            $($(#[$doc])* pub const $name: Features = Features(1 << Row::$name as u32);)*
        }

        /// The table, in the order of the bits, which is the order in which pipelines are sorted.
        pub const FEATURES: &[Feature] =
            &[$(Feature { name: stringify!($name), bit: Features::$name, $($field: $value,)* ..DEFAULT_FEATURE }),*];
    };
}

const UV: &str = "UV0 || UV1";
const UV_OR_TRIPLANAR: &str = "UV0 || UV1 || TRIPLANAR";

features! {
    /// Linear blend skinning by up to 4 joints per vertex.
    SKIN { by: RequestedBy::Mesh, part: ShaderPart::Pose,
        absence: absence_by_stage("skinning", ["no skinned mesh is in view", "no mesh has a skin"], "") }
    /// Skinning by up to 8 joints per vertex instead of 4.
    SKIN_8 { by: RequestedBy::Mesh, part: ShaderPart::Pose, needs: &["SKIN"],
        absence: absence("influences 5 to 8", "no vertex is moved by more than four joints", "SKIN") }
    /// Morph targets (blend shapes).
    MORPH { by: RequestedBy::Mesh, part: ShaderPart::Pose,
        absence: absence_by_stage("morph targets", ["every weight in view is zero", "no mesh has morph targets"], "") }
    VERTEX_COLOR { by: RequestedBy::Mesh, part: ShaderPart::Alpha, needs: &["!TOON"],
        absence: absence("vertex colors", "no drawn mesh has any but white", "") }
    UV0 { by: RequestedBy::Mesh, part: ShaderPart::Alpha }
    UV1 { by: RequestedBy::Mesh, part: ShaderPart::Alpha,
        absence: absence("second texture coordinates", "no drawn texture uses them", "UV0") }
    /// Lit by the metallic-roughness model.
    METALLIC_ROUGHNESS { needs: &["!BLINN_PHONG", "!TOON"] }
    /// Lit by Blinn–Phong. A surface without this, METALLIC_ROUGHNESS and TOON is unlit.
    BLINN_PHONG { needs: &["!TOON"] }
    BASE_COLOR_TEXTURE { part: ShaderPart::Alpha, needs: &[UV_OR_TRIPLANAR], texture: slot(0),
        absence: absence("base color textures", "no drawn material has a base color texture", "") }
    METALLIC_ROUGHNESS_TEXTURE { needs: &["METALLIC_ROUGHNESS", UV], texture: slot(1),
        absence: absence("metallic-roughness textures", "no drawn material has one that matters", "LIT") }
    /// Toon: matcap, an image of all light that is looked up by the normal.
    MATCAP_TEXTURE { needs: &["TOON"], texture: slot(1) }
    /// Reflections of Blinn–Phong: an equirectangular panorama in place of the sky.
    ENVIRONMENT_TEXTURE { needs: &["REFLECTION"], texture: slot(1) }
    NORMAL_TEXTURE { needs: &["LIT", UV_OR_TRIPLANAR], texture: slot(2),
        absence: absence("normal maps and tangents", "no drawn material has a normal map", "LIT") }
    OCCLUSION_TEXTURE { needs: &["LIT", "!TOON", UV], texture: slot(3),
        absence: absence("occlusion textures", "no drawn material has one", "LIT") }
    /// Toon: mask of the rim light.
    RIM_TEXTURE { needs: &["TOON", UV], texture: slot(3) }
    EMISSIVE { needs: &["LIT"], absence: absence("emission", "no drawn material emits light", "LIT") }
    EMISSIVE_TEXTURE { needs: &["LIT", UV], texture: slot(4),
        absence: absence("emissive textures", "no drawn material has one that is not multiplied by zero", "LIT") }
    SPECULAR_TEXTURE { needs: &["METALLIC_ROUGHNESS", UV], texture: slot(5),
        absence: absence("specular textures", "no drawn material has one", "LIT") }
    /// Toon: shifts the border between light and shade.
    SHADING_SHIFT_TEXTURE { needs: &["TOON", UV], texture: slot(5) }
    /// Reflectivity of a Blinn–Phong surface.
    REFLECTION_TEXTURE { needs: &["REFLECTION", UV_OR_TRIPLANAR], texture: slot(5) }
    SPECULAR_COLOR_TEXTURE { needs: &["LIT", "!TOON", UV_OR_TRIPLANAR], texture: slot(6),
        absence: absence("specular color textures", "no drawn material has one", "LIT") }
    /// Toon: the color of shade.
    SHADE_COLOR_TEXTURE { needs: &["TOON", UV], texture: slot(6) }
    ALPHA_MASK { part: ShaderPart::Alpha,
        absence: absence("alpha test", "no drawn material has an alpha cutoff", "") }
    /// Some texture has a uv transform other than identity.
    UV_TRANSFORM { part: ShaderPart::Alpha,
        absence: absence("texture transforms", "all are identity", "UV0 || UV1") }
    /// Point or spot lights shine, in addition to directional ones.
    LOCAL_LIGHTS { by: RequestedBy::Lights, part: ShaderPart::Light, needs: &["LIT"] }
    /// Lit by toon shading (MToon).
    TOON { }
    /// The surface receives shadows.
    SHADOW { by: RequestedBy::Lights, part: ShaderPart::Light, needs: &["LIT"] }
    /// Inverted-hull outline in place of the surface: pushed out along the normals, back faces only, in the outline's color.
    OUTLINE { part: ShaderPart::Other, needs: &["!WIREFRAME", "!THICK_LINES"],
        absence: absence("outlines", "no drawn material and no effect has one", "") }
    OUTLINE_WIDTH_TEXTURE { part: ShaderPart::Other, needs: &["OUTLINE", UV],
        texture: Some(TextureSlot { slot: 19, vertex: true }) }
    /// Toon: mask of the UV animation.
    UV_MOTION_MASK { part: ShaderPart::Alpha, needs: &["!PARALLAX", "!TRIPLANAR", UV], texture: slot(20) }
    /// Normals for effects on surfaces, even with an unlit shading model.
    EFFECT_NORMALS { by: RequestedBy::Effects, part: ShaderPart::Other }
    /// Colors of joints for effects on surfaces.
    EFFECT_JOINTS { by: RequestedBy::Effects, part: ShaderPart::Other, needs: &["SKIN", "!DUAL_QUATERNIONS"] }
    /// The edges of triangles as lines, a little nearer than the surface, in the outline's color.
    WIREFRAME { by: RequestedBy::Effects, part: ShaderPart::Other, needs: &["!LIT", "!THICK_LINES"],
        absence: absence("edges", "no effect shows them", "") }
    /// The share of light taken by shadows, for effects on surfaces.
    EFFECT_SHADOW { by: RequestedBy::Effects, part: ShaderPart::Light, needs: &["SURFACE"] }
    /// Lines and points have a width. A different way of drawing, not an addition: never forced in.
    THICK_LINES { by: RequestedBy::Mesh, part: ShaderPart::Other }
    /// Points are discs, lines have round ends.
    ROUND_LINES { by: RequestedBy::Mesh, part: ShaderPart::Other, needs: &["THICK_LINES"] }
    /// Triplanar mapping: textures are mapped from three sides. Never forced in.
    TRIPLANAR { part: ShaderPart::Alpha, needs: &["!TOON"] }
    /// The skin's joints are dual quaternions. A different way of skinning, not an addition: never forced in.
    DUAL_QUATERNIONS { by: RequestedBy::Mesh, part: ShaderPart::Pose, needs: &["SKIN"],
        absence: absence("dual quaternions", "every skin is blended linearly", "SKIN") }

    /// Some layer is on, so the layers' uniform is read.
    LAYERS { part: ShaderPart::Layer, needs: &["METALLIC_ROUGHNESS"] }
    CLEARCOAT { part: ShaderPart::Layer, needs: &["LAYERS"],
        absence: absence("clear coats", "no drawn material has one", "LIT") }
    CLEARCOAT_TEXTURE { part: ShaderPart::Layer, needs: &["CLEARCOAT", UV], texture: slot(7) }
    CLEARCOAT_ROUGHNESS_TEXTURE { part: ShaderPart::Layer, needs: &["CLEARCOAT", UV], texture: slot(8) }
    CLEARCOAT_NORMAL_TEXTURE { part: ShaderPart::Layer, needs: &["CLEARCOAT", UV], texture: slot(9) }
    SHEEN { part: ShaderPart::Layer, needs: &["LAYERS"],
        absence: absence("sheen", "no drawn material has any", "LIT") }
    SHEEN_COLOR_TEXTURE { part: ShaderPart::Layer, needs: &["SHEEN", UV], texture: slot(10) }
    SHEEN_ROUGHNESS_TEXTURE { part: ShaderPart::Layer, needs: &["SHEEN", UV], texture: slot(11) }
    TRANSMISSION { part: ShaderPart::Layer, needs: &["LAYERS"],
        absence: absence("transmission", "no drawn material has any: none transmits light", "LIT") }
    TRANSMISSION_TEXTURE { part: ShaderPart::Layer, needs: &["TRANSMISSION", UV], texture: slot(12) }
    /// Transmitted light is absorbed in a volume.
    VOLUME { part: ShaderPart::Layer, needs: &["TRANSMISSION || DIFFUSE_TRANSMISSION"],
        absence: absence("absorption", "no drawn material has a volume that absorbs light", "LIT") }
    THICKNESS_TEXTURE { part: ShaderPart::Layer, needs: &["VOLUME || REFRACTION", UV], texture: slot(13) }
    /// A thin film tints reflections.
    IRIDESCENCE { part: ShaderPart::Layer, needs: &["LAYERS"],
        absence: absence("iridescence", "no drawn material has a thin film", "LIT") }
    IRIDESCENCE_TEXTURE { part: ShaderPart::Layer, needs: &["IRIDESCENCE", UV], texture: slot(14) }
    IRIDESCENCE_THICKNESS_TEXTURE { part: ShaderPart::Layer, needs: &["IRIDESCENCE", UV], texture: slot(15) }
    /// Highlights are stretched along the tangent. Never forced in: it needs tangents.
    ANISOTROPY { part: ShaderPart::Layer, needs: &["LAYERS"],
        absence: absence("anisotropy", "no drawn material has anisotropic highlights", "LIT") }
    ANISOTROPY_TEXTURE { part: ShaderPart::Layer, needs: &["LAYERS", UV], texture: slot(16) }
    /// Light that falls on the back is scattered out in front.
    DIFFUSE_TRANSMISSION { part: ShaderPart::Layer, needs: &["LAYERS"],
        absence: absence("diffuse transmission", "no drawn material has any: none transmits light from behind", "LIT") }
    DIFFUSE_TRANSMISSION_TEXTURE { part: ShaderPart::Layer, needs: &["DIFFUSE_TRANSMISSION", UV], texture: slot(17) }
    DIFFUSE_TRANSMISSION_COLOR_TEXTURE { part: ShaderPart::Layer, needs: &["DIFFUSE_TRANSMISSION", UV], texture: slot(18) }
    /// The scene color copy is sampled where the refracted ray leaves the volume.
    REFRACTION { part: ShaderPart::Layer, needs: &["TRANSMISSION"],
        absence: absence("refraction", "no drawn material has a volume that refracts light", "LIT") }
    /// Red, green and blue are refracted by different indices.
    DISPERSION { part: ShaderPart::Layer, needs: &["REFRACTION"],
        absence: absence("dispersion", "no drawn material has a volume that disperses light", "LIT") }

    /// Parallax mapping by heights in the normal texture's alpha. Never forced in: other files store other data there.
    PARALLAX { needs: &["NORMAL_TEXTURE", "!TOON", "!TRIPLANAR", UV] }
    /// A skin whose copies are placed by instance matrices: joints lead to model space, the instance's matrix leads on from
    /// there, as with dual quaternions. Never forced in.
    SKIN_INSTANCED { by: RequestedBy::Mesh, part: ShaderPart::Pose, needs: &["SKIN"],
        absence: absence("copies of skinned meshes", "every skinned mesh has one copy", "SKIN") }
    /// Blinn–Phong with reflections of its surroundings.
    REFLECTION { needs: &["BLINN_PHONG"],
        absence: absence("reflections of Blinn–Phong", "no drawn Blinn–Phong material reflects its surroundings", "LIT") }
    /// A sky's maps light the surface, or effects sample the sky behind it. Never forced in.
    SKY { by: RequestedBy::Lights, part: ShaderPart::Light, needs: &["LIT || SURFACE"],
        absence: absence_by_stage("image-based light", ["its strength is zero", "the stage has no sky"], "LIT") }
    /// Phong's highlights in place of Blinn's. Never forced in.
    PHONG { needs: &["BLINN_PHONG"] }
    /// Some light has a polynomial falloff over distance. Never forced in.
    POLYNOMIAL_FALLOFF { by: RequestedBy::Lights, part: ShaderPart::Light, needs: &["LIT"] }
    /// Light is multiplied by the stage's exposure.
    EXPOSURE { by: RequestedBy::Lights, part: ShaderPart::Light, needs: &["LIT || SKY"],
        absence: absence("exposure", "it is 0 stops", "LIT") }
    /// The view transform from the light of surfaces and of the sky to display colors: Khronos PBR Neutral. Never forced in.
    VIEW_TRANSFORM { by: RequestedBy::Lights, part: ShaderPart::Light, needs: &["LIT || SKY"],
        absence: absence("view transform", "the stage's view is \"none\", or an image effect applies it", "LIT") }
    /// AgX in place of Khronos PBR Neutral. Never forced in.
    AGX { by: RequestedBy::Lights, part: ShaderPart::Light, needs: &["VIEW_TRANSFORM"] }
    /// Vertices are read from the pre-skinning compute pass. Occurs in recordings only; a plan keeps the features that deform
    /// vertices.
    PRE_SKINNED { by: RequestedBy::Recording, part: ShaderPart::Other,
        needs: &["!SKIN", "!MORPH", "!DISPLACED", "!THICK_LINES", "!VOLUME", "!REFRACTION", "!TRIPLANAR"] }
}

const _: () = assert!(FEATURES.len() <= u128::BITS as usize, "Features needs a wider type");

/// Names of the features in a set, in the order of the table.
pub fn names(features: Features) -> impl Iterator<Item = &'static str> {
    FEATURES.iter().filter(move |f| features.has(f.bit)).map(|f| f.name)
}

/// Whether a condition in the syntax of `@if` holds: `||` of `&&` of names, each with or without `!`.
pub fn holds(condition: &str, is_on: impl Fn(&str) -> bool) -> bool {
    let term = |term: &str| match term.trim().strip_prefix('!') {
        Some(name) => !is_on(name.trim()),
        None => is_on(term.trim()),
    };
    condition.split("||").any(|group| group.split("&&").all(term))
}

/// Reports of the features that none of a frame's draws has, with the reasons. `in_stage`: the features of all objects of the
/// stage, in view or not.
pub(crate) fn absences(
    all: Features,
    in_stage: Features,
) -> impl Iterator<Item = (&'static str, &'static str)> {
    let mut on: Vec<&str> = names(all).collect();
    on.extend(all.is_lit().then_some("LIT"));
    FEATURES.iter().filter(move |f| !all.has(f.bit)).filter_map(move |f| {
        let absence = f.absence?;
        let why = absence.absent_from_stage.filter(|_| !in_stage.has(f.bit)).unwrap_or(absence.why);
        let reported = absence.when.is_empty() || holds(absence.when, |name| on.contains(&name));
        reported.then_some((absence.what, why))
    })
}

/// Slots of material textures that the features read, one bit each.
pub fn texture_slots(features: Features) -> u32 {
    let read = FEATURES.iter().filter(|f| features.has(f.bit)).filter_map(|f| f.texture);
    read.fold(0, |slots, t| slots | 1 << t.slot)
}

/// Slot of a feature's material texture.
pub(crate) const fn texture_slot(feature: Features) -> usize {
    match FEATURES[feature.0.trailing_zeros() as usize].texture {
        Some(texture) => texture.slot,
        None => panic!("the feature reads no texture"),
    }
}
