//! The shader features that a draw requests. Each feature is described in the table, [`crate::plan::shader_features`].

use crate::plan::left_out::left_out_names;
use crate::plan::shader_features::absences;
use crate::plan::{Features, LeftOut, is_lit};
use crate::scene_resources::PrimitiveResource;
use crate::scene_resources::material::{
    BASE_SLOTS, LAYER_SLOTS, MaterialResource, MaterialTexture, TOON_SLOT,
};
use crate::scene_resources::thick_lines::line_style;
use choreo_asset::{AlphaMode, MaterialLayers, Shading, TextureSlot};
use choreo_plugin::SceneInputs;
use glam::{Affine2, Vec3};

/// The requests of a draw for features that do not come from its primitive and material.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DrawNeeds {
    pub skinned: bool,
    /// The joints lead to model space, and the instance's matrix leads on from there.
    pub placed: bool,
    /// The skin uses dual quaternions.
    pub dual: bool,
    pub morphed: bool,
    pub local_lights: bool,
    /// Whether a sky lights the surface.
    pub sky: bool,
    /// Some light has a polynomial falloff.
    pub polynomial: bool,
    /// Features of exposure and view transform.
    pub display: Features,
}

/// Shading model of a draw, as far as features depend on it.
struct ShadingModel {
    lit: bool,
    metallic_roughness: bool,
    toon: bool,
    phong: bool,
    /// Blinn–Phong or Phong with reflections.
    reflects: bool,
    /// Textures are mapped from three sides (triplanar); textures that do not support this are not read.
    triplanar: bool,
}

impl ShadingModel {
    fn of(normals: bool, material: &MaterialResource) -> ShadingModel {
        let m = &material.material;
        let lit = is_lit(m.shading) && normals;
        let phong = lit && matches!(m.shading, Shading::BlinnPhong | Shading::Phong);
        ShadingModel {
            lit,
            metallic_roughness: lit && m.shading == Shading::MetallicRoughness,
            toon: lit && m.shading == Shading::Toon,
            phong,
            reflects: phong && m.environment_reflection().is_some(),
            triplanar: m.triplanar.is_some() && normals && m.shading != Shading::Toon,
        }
    }

    /// The textures that this shading model reads, with their features.
    fn textures(&self, m: &MaterialResource) -> Vec<(Option<MaterialTexture>, Features)> {
        let of_toon = |toon: Features, other: Features| if self.toon { toon } else { other.when(self.lit) };
        let [of_metallic_roughness, of_specular] = match (self.toon, self.reflects) {
            (true, _) => [Features::MATCAP_TEXTURE, Features::SHADING_SHIFT_TEXTURE],
            (_, true) => [Features::ENVIRONMENT_TEXTURE, Features::REFLECTION_TEXTURE],
            _ => [Features::METALLIC_ROUGHNESS_TEXTURE, Features::SPECULAR_TEXTURE]
                .map(|bit| bit.when(self.metallic_roughness)),
        };
        let layers = m.material.layers.as_deref().filter(|_| self.metallic_roughness);
        let base = [
            (m.texture(TextureSlot::BaseColor), Features::BASE_COLOR_TEXTURE),
            (m.texture(TextureSlot::MetallicRoughness), of_metallic_roughness),
            (m.texture(TextureSlot::Normal), Features::NORMAL_TEXTURE.when(self.lit)),
            (m.texture(TextureSlot::Occlusion), of_toon(Features::RIM_TEXTURE, Features::OCCLUSION_TEXTURE)),
            (m.texture(TextureSlot::Emissive), Features::EMISSIVE_TEXTURE.when(self.lit)),
            (m.texture(TextureSlot::Specular), of_specular),
            (
                m.texture(TextureSlot::SpecularColor),
                of_toon(Features::SHADE_COLOR_TEXTURE, Features::SPECULAR_COLOR_TEXTURE),
            ),
        ];
        base.into_iter().chain(layer_textures(m, layers)).filter(|(_, bit)| !bit.is_empty()).collect()
    }
}

/// Textures that triplanar mapping supports. The others are not read with it.
const TRIPLANAR_TEXTURES: Features = Features::BASE_COLOR_TEXTURE
    .with(Features::NORMAL_TEXTURE)
    .with(Features::SPECULAR_COLOR_TEXTURE)
    .with(Features::REFLECTION_TEXTURE);

/// Features of a draw: only those that change a pixel. `force_all` also sets every bit that leaves the pixels as they are; see
/// [`Features`] for the values that a shader reads if its primitive or material lacks the data.
pub(crate) fn features(
    primitive: &PrimitiveResource,
    material: &MaterialResource,
    needs: DrawNeeds,
    force_all: bool,
) -> Features {
    let m = &material.material;
    let model = ShadingModel::of(!primitive.primitive().normals.is_empty(), material);
    let ShadingModel { lit, toon, phong, reflects, .. } = model;
    let parallax = lit && !toon && m.relief > 0.0 && reads_normal_map(primitive, material);
    let line_style =
        line_style(primitive.primitive().topology, m).filter(|_| !needs.skinned && !needs.morphed);
    let layers = m.layers.as_deref().filter(|_| model.metallic_roughness);
    let set = [
        (Features::METALLIC_ROUGHNESS, model.metallic_roughness),
        (Features::BLINN_PHONG, phong),
        (Features::PHONG, lit && m.shading == Shading::Phong),
        (Features::TOON, toon),
        (Features::REFLECTION, reflects || (phong && force_all)),
        (Features::SKIN, needs.skinned || force_all),
        (Features::SKIN_8, (needs.skinned && primitive.info.influences == 8) || force_all),
        (Features::DUAL_QUATERNIONS, needs.skinned && needs.dual),
        (Features::SKIN_INSTANCED, needs.skinned && needs.placed),
        (Features::MORPH, needs.morphed || force_all),
        (Features::VERTEX_COLOR, (primitive.info.colored || force_all) && !toon),
        (Features::PARALLAX, parallax),
        (Features::THICK_LINES, line_style.is_some()),
        (Features::ROUND_LINES, line_style.is_some_and(|style| style.round)),
        (Features::EMISSIVE, lit && (m.emissive != Vec3::ZERO || force_all)),
        (Features::ALPHA_MASK, matches!(m.alpha_mode, AlphaMode::Mask(_)) || force_all),
        (Features::LOCAL_LIGHTS, lit && (needs.local_lights || force_all)),
        (Features::SKY, lit && needs.sky),
        (Features::POLYNOMIAL_FALLOFF, lit && needs.polynomial),
        (Features::EXPOSURE, lit && (needs.display.has(Features::EXPOSURE) || force_all)),
        // The view transform does not apply to toon shading, which gives display colors.
        (needs.display.without(Features::EXPOSURE), lit && !toon),
    ];
    let all = set.iter().fold(Features::default(), |all, (bit, on)| all.with(bit.when(*on)));
    let layers = layer_features(layers, !primitive.primitive().tangents.is_empty(), force_all);
    all.with(layers).with(texture_features(primitive, material, &model, force_all))
}

/// The textures that a draw reads, and the texture coordinates that they need.
fn texture_features(
    primitive: &PrimitiveResource,
    material: &MaterialResource,
    model: &ShadingModel,
    force_all: bool,
) -> Features {
    let p = primitive.primitive();
    let mut f = Features::default();
    for (texture, bit) in model.textures(material) {
        // A matcap is looked up by the normal, an environment map by the reflected direction: neither needs texture coordinates.
        // Without an environment map the sky is reflected.
        if bit == Features::MATCAP_TEXTURE || bit == Features::ENVIRONMENT_TEXTURE {
            f = f.with(bit.when(texture.is_some() || (model.toon && force_all)));
            continue;
        }
        // A texture without texture coordinates, or a normal map without tangents, is left out even if everything is forced in.
        let needs_tangents = bit.has_tangents() || bit == Features::ANISOTROPY_TEXTURE;
        let unusable = texture.is_some_and(|t| {
            let without_uvs = p.uvs[t.uv_set as usize].is_empty() && !model.triplanar;
            let not_triplanar = model.triplanar && !TRIPLANAR_TEXTURES.has(bit);
            without_uvs || not_triplanar || (needs_tangents && p.tangents.is_empty())
        });
        if unusable || (texture.is_none() && !force_all) {
            continue;
        }
        f = f.with(bit).with(Features::TRIPLANAR.when(model.triplanar && texture.is_some()));
        f = f.with(match texture {
            Some(t) if model.triplanar => uv_features(t).only(Features::UV_TRANSFORM),
            Some(t) => uv_features(t),
            None => Features::default(),
        });
        let forced = Features::UV0.with(Features::UV1).with(Features::UV_TRANSFORM);
        f = f.with(forced.when(force_all));
    }
    let mask =
        material.textures[TOON_SLOT + 1].filter(|t| model.toon && !p.uvs[t.uv_set as usize].is_empty());
    mask.map_or(f, |mask| f.with(Features::UV_MOTION_MASK).with(uv_features(mask)))
}

/// The textures that a material has and that its shading model reads.
pub(crate) fn material_textures(material: &MaterialResource) -> Features {
    let there = ShadingModel::of(true, material).textures(material).into_iter().filter(|(t, _)| t.is_some());
    there.fold(Features::default(), |all, (_, bit)| all.with(bit))
}

/// Features of a texture's set of texture coordinates and of its transform.
fn uv_features(t: MaterialTexture) -> Features {
    let set = if t.uv_set == 0 { Features::UV0 } else { Features::UV1.when(t.uv_set == 1) };
    set.with(Features::UV_TRANSFORM.when(t.uv_transform != Affine2::IDENTITY))
}

/// Textures of layers that are on, with their features. A coat's normal map is never forced in: it needs tangents.
fn layer_textures(
    material: &MaterialResource,
    layers: Option<&MaterialLayers>,
) -> impl Iterator<Item = (Option<MaterialTexture>, Features)> {
    let layer = |slot: usize| material.textures[BASE_SLOTS + slot];
    let bits: [Features; LAYER_SLOTS] = layers.map_or_else(Default::default, |l| {
        let coat = l.clearcoat > 0.0;
        let sheen = l.sheen_color != Vec3::ZERO;
        let film = l.iridescence > 0.0;
        let behind = l.diffuse_transmission > 0.0;
        [
            Features::CLEARCOAT_TEXTURE.when(coat),
            Features::CLEARCOAT_ROUGHNESS_TEXTURE.when(coat),
            Features::CLEARCOAT_NORMAL_TEXTURE.when(coat && layer(2).is_some()),
            Features::SHEEN_COLOR_TEXTURE.when(sheen),
            Features::SHEEN_ROUGHNESS_TEXTURE.when(sheen),
            Features::TRANSMISSION_TEXTURE.when(l.transmission > 0.0),
            Features::THICKNESS_TEXTURE.when(l.absorbs() || l.refracts()),
            Features::IRIDESCENCE_TEXTURE.when(film),
            Features::IRIDESCENCE_THICKNESS_TEXTURE.when(film),
            Features::ANISOTROPY_TEXTURE.when(layer(9).is_some()),
            Features::DIFFUSE_TRANSMISSION_TEXTURE.when(behind),
            Features::DIFFUSE_TRANSMISSION_COLOR_TEXTURE.when(behind),
        ]
    });
    let textures: [Option<MaterialTexture>; LAYER_SLOTS] = std::array::from_fn(layer);
    textures.into_iter().zip(bits)
}

/// Features of the layers themselves. A coat, sheen, film or diffuse transmission with weight 0 changes no pixel, so each can be
/// forced in if the material has layers at all.
pub(crate) fn layer_features(layers: Option<&MaterialLayers>, tangents: bool, force_all: bool) -> Features {
    let Some(l) = layers else { return Features::default() };
    let set = [
        (Features::LAYERS, true),
        (Features::CLEARCOAT, l.clearcoat > 0.0 || force_all),
        (Features::SHEEN, l.sheen_color != Vec3::ZERO || force_all),
        (Features::TRANSMISSION, l.transmission > 0.0),
        (Features::VOLUME, l.absorbs()),
        (Features::REFRACTION, l.refracts()),
        (Features::DISPERSION, l.refracts() && l.dispersion > 0.0),
        (Features::IRIDESCENCE, l.iridescence > 0.0 || force_all),
        (Features::ANISOTROPY, l.anisotropy > 0.0 && tangents),
        (Features::DIFFUSE_TRANSMISSION, l.diffuse_transmission > 0.0 || force_all),
    ];
    set.iter().fold(Features::default(), |all, (bit, on)| all.with(bit.when(*on)))
}

/// Whether the primitive has the data that the material's normal map needs.
fn reads_normal_map(primitive: &PrimitiveResource, material: &MaterialResource) -> bool {
    let p = primitive.primitive();
    let has_uvs = |t: MaterialTexture| !p.uvs[t.uv_set as usize].is_empty();
    !p.tangents.is_empty()
        && material.material.triplanar.is_none()
        && material.texture(TextureSlot::Normal).is_some_and(has_uvs)
}

/// Features of the outline around a surface with these features. Without a mix of the surface's lighting it only needs the shape.
pub(crate) fn outline_features(
    features: Features,
    primitive: &PrimitiveResource,
    material: &MaterialResource,
    blended: bool,
) -> Features {
    let outline = material.material.toon.as_ref().and_then(|t| t.outline.as_ref());
    let lit = outline.is_some_and(|o| o.lighting_mix > 0.0);
    let base = if lit { features } else { features.of_alpha(blended) };
    let uvs = &primitive.primitive().uvs;
    let width = material.textures[TOON_SLOT].filter(|t| !uvs[t.uv_set as usize].is_empty());
    let width = width.map_or_else(Features::default, |width| {
        // The width texture uses the second set of texture coordinates unless it names the first.
        let set = if width.uv_set == 0 { Features::UV0 } else { Features::UV1 };
        uv_features(width).with(set).with(Features::OUTLINE_WIDTH_TEXTURE)
    });
    base.with(Features::OUTLINE).with(width)
}

/// Facts about a frame that give the reasons why parts are left out.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Facts {
    /// Features of all objects of the stage, visible or not: skins, morph targets, lit materials, a sky.
    pub in_stage: Features,
    pub lit_exist: bool,
    pub lights_exist: bool,
    /// 2D layers behind and in front of the scene.
    pub layers_2d: usize,
    pub lit_drawn: bool,
    pub blended: usize,
    pub copies: usize,
    pub culled: usize,
    pub hidden_actors: usize,
    /// Actors that are culled with their shadows in any pose, so that they are not posed.
    pub unposed_actors: usize,
    pub draws: usize,
    pub drawn_copies: usize,
    pub samples: u32,
    /// Whether some cut-out uses alpha to coverage.
    pub coverage: bool,
    pub post_passes: usize,
    /// The inputs from the scene that effects on images read.
    pub inputs: SceneInputs,
    pub surface_effects: usize,
    pub dark_lights: usize,
    /// Whether some light that shines casts shadows.
    pub casting: bool,
    pub shadow_views: usize,
    /// Actors that do not cast or do not receive shadows.
    pub unshadowed: usize,
    pub overlays: usize,
    pub shadows_beyond: usize,
    /// Whether enough lights have a range for clustered lighting.
    pub many_lights: bool,
    /// Instances that are drawn at a coarser level of detail, in view or casting shadows.
    pub coarse: usize,
    /// Copies small enough for levels of detail, of models whose levels are not made.
    pub small: usize,
    /// Triangles in view of watertight surfaces with double-sided materials.
    pub closed: usize,
}

/// The features and passes that a frame does not use, and why: those of the scene, then features in the table's order, then whole
/// passes.
pub(crate) fn left_out(all: Features, facts: &Facts) -> Vec<LeftOut> {
    let of_features = absences(all, facts.in_stage).map(|(what, why)| (what, why.to_string()));
    let reports = scene_reports(facts).into_iter().chain(of_features);
    let reports = reports.chain(light_reports(all, facts)).chain(pass_reports(all, facts));
    let known = |what| left_out_names().any(|known| known == what);
    reports
        .inspect(|(what, _)| debug_assert!(known(*what), "{what} is not among the names"))
        .map(|(part, why)| LeftOut { part: part.into(), why })
        .collect()
}

type AbsenceReports = Vec<(&'static str, String)>;

fn report(on: bool, what: &'static str, why: impl Into<String>) -> Option<(&'static str, String)> {
    on.then(|| (what, why.into()))
}

fn scene_reports(facts: &Facts) -> AbsenceReports {
    let Facts { hidden_actors, unposed_actors, culled, copies, coarse, small, closed, .. } = facts;
    let reports = [
        report(*hidden_actors > 0, "hidden actors", format!("{hidden_actors} set invisible")),
        report(
            *unposed_actors > 0,
            "actors outside the view",
            format!(
                "neither posed nor drawn, because no pose of their clips and no shadow reaches into the view: {unposed_actors}"
            ),
        ),
        report(
            *culled > 0,
            "primitives outside the view",
            format!("bounds outside the frustum: {culled} of {copies}"),
        ),
        report(
            *coarse > 0,
            "triangles too small to see",
            format!("copies drawn at a level of detail without a visible difference at their size: {coarse}"),
        ),
        report(
            *small > 0,
            "triangles too small to see",
            format!(
                "about {small} models have triangles smaller than pixels: a render draws levels of detail of them, which `explain` does not build"
            ),
        ),
        report(
            *closed > 0,
            "back faces of watertight meshes",
            format!(
                "{closed} triangles of double-sided materials belong to watertight meshes that are seen from outside"
            ),
        ),
    ];
    reports.into_iter().flatten().collect()
}

fn light_reports(all: Features, facts: &Facts) -> AbsenceReports {
    let unlit = if facts.lit_exist { "nothing lit is in view" } else { "every material is unlit" };
    let fewer = format!(
        "fewer than {} point and spot lights have a range",
        crate::plan::light_clusters::MIN_RANGED_LIGHTS
    );
    let dark = format!("{} have no intensity, no color or a value that is not finite", facts.dark_lights);
    let no_shadows = match facts {
        f if !f.casting => "no light casts shadows",
        f if !f.lit_drawn => "nothing lit is in view",
        f if f.unshadowed > 0 => {
            "no shadow of an actor that casts is seen on one that receives; some are switched off by `shadow`"
        }
        _ => "no shadow of an actor falls on anything in view",
    };
    let beyond = format!(
        "{} lights: there are at most 32 maps, together at most 8192 texels a side",
        facts.shadows_beyond
    );
    let local = all.has(Features::LOCAL_LIGHTS);
    let lit_by = facts.lit_drawn && facts.lights_exist;
    let reports = [
        report(!facts.lit_drawn, "normals, lights and ambient light", unlit),
        report(facts.lit_drawn && !facts.lights_exist, "lights", "none shines; ambient light only"),
        report(facts.dark_lights > 0, "dark lights", dark),
        report(lit_by && !local, "distance and cone attenuation", "no point or spot light shines"),
        report(facts.lit_drawn && local && !facts.many_lights, "clustered lighting", fewer),
        report(facts.shadow_views == 0, "shadow maps", no_shadows),
        report(facts.shadows_beyond > 0, "shadows beyond the limit", beyond),
    ];
    reports.into_iter().flatten().collect()
}

fn pass_reports(all: Features, facts: &Facts) -> AbsenceReports {
    let uvs = all.has_any(Features::UV0.with(Features::UV1));
    let whole = match facts.samples {
        1 => "one sample per pixel is requested: cutouts have hard edges",
        _ => "all cutouts are \"hard\", or no drawn material has an alpha cutoff above 0",
    };
    let (over_image, inputs) = (facts.post_passes > 0, facts.inputs);
    let alone = "no two drawn primitives are equal in shape, material and state";
    let reports = [
        report(facts.layers_2d == 0, "2D layers", "no text, image, panel or letterbox is visible"),
        report(!uvs, "texture coordinates", "no drawn material has a texture"),
        report(facts.surface_effects == 0, "effects on surfaces", "none is on"),
        report(all.has(Features::ALPHA_MASK) && !facts.coverage, "alpha to coverage", whole),
        report(facts.blended == 0, "blending and sorting back to front", "everything drawn is opaque"),
        report(facts.drawn_copies == facts.draws, "instancing", alone),
        report(facts.samples == 1, "multisampling", "one sample per pixel is requested"),
        report(facts.post_passes == 0, "full-screen passes and float target", "no effect is on"),
        report(facts.overlays == 0, "overlays of effects", "no effect draws any"),
        report(
            over_image && !inputs.surface,
            "depth and normals for effects",
            "no effect that is on reads them",
        ),
        report(over_image && !inputs.motion, "motion vectors for effects", "no effect that is on reads them"),
    ];
    reports.into_iter().flatten().collect()
}
