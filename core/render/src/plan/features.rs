//! Which shader features a draw needs, and words for those that nothing needs.

use crate::plan::{Features, LEFT_OUT, LeftOut, is_lit};
use crate::scene_resources::PrimitiveResource;
use crate::scene_resources::material::{MaterialResource, MaterialTexture, TOON_SLOT};
use choreo_asset::{AlphaMode, Shading, TextureSlot};
use glam::{Affine2, Vec3};

/// What a draw brings besides primitive and material.
#[derive(Clone, Copy, Debug)]
pub struct DrawNeeds {
    pub skinned: bool,
    /// Its joints lead to model space, and the copy's own map on.
    pub placed: bool,
    /// Dual quaternion skinning.
    pub dual: bool,
    pub morphed: bool,
    pub local_lights: bool,
    /// A sky shines.
    pub sky: bool,
    /// Some light falls off by a polynomial.
    pub polynomial: bool,
}

/// Only what changes a pixel. `force_all` sets every bit that leaves the pixels as they are; see [`Features`] for
/// what a renderer then feeds to a shader whose primitive or material lacks the data.
pub fn features(
    primitive: &PrimitiveResource,
    material: &MaterialResource,
    needs: DrawNeeds,
    force_all: bool,
) -> Features {
    let p = primitive.primitive();
    let m = &material.material;
    let lit = is_lit(m.shading) && !p.normals.is_empty();
    let mut f = Features::default();
    let mut set = |on: bool, bit: Features| {
        if on {
            f = f.with(bit);
        }
    };
    let metallic_roughness = lit && m.shading == Shading::MetallicRoughness;
    let toon = lit && m.shading == Shading::Toon;
    let phong = lit && matches!(m.shading, Shading::BlinnPhong | Shading::Phong);
    let mirrors = phong && m.mirrors().is_some();
    // What is laid on from three sides; the other textures are not read then.
    let triplanar = m.triplanar.is_some() && !p.normals.is_empty() && m.shading != Shading::Toon;
    let from_sides = [
        Features::BASE_COLOR_TEXTURE,
        Features::NORMAL_TEXTURE,
        Features::SPECULAR_COLOR_TEXTURE,
        // The reflection map: of other shading it is left out where textures come from three sides.
        if mirrors { Features::SPECULAR_TEXTURE } else { Features::SPECULAR_COLOR_TEXTURE },
    ];
    // (texture, its bit, whether this kind of shading reads it)
    let textures = [
        (material.texture(TextureSlot::BaseColor), Features::BASE_COLOR_TEXTURE, true),
        (
            material.texture(TextureSlot::MetallicRoughness),
            Features::METALLIC_ROUGHNESS_TEXTURE,
            metallic_roughness || toon || mirrors,
        ),
        (material.texture(TextureSlot::Normal), Features::NORMAL_TEXTURE, lit),
        (material.texture(TextureSlot::Occlusion), Features::OCCLUSION_TEXTURE, lit),
        (material.texture(TextureSlot::Emissive), Features::EMISSIVE_TEXTURE, lit),
        (
            material.texture(TextureSlot::Specular),
            Features::SPECULAR_TEXTURE,
            metallic_roughness || toon || mirrors,
        ),
        (material.texture(TextureSlot::SpecularColor), Features::SPECULAR_COLOR_TEXTURE, lit),
    ];
    let layers = m.layers.as_deref().filter(|_| metallic_roughness);
    let of_layers = crate::plan::features_layers::textures(material, layers);
    for (texture, bit, read) in textures.into_iter().chain(of_layers) {
        if (toon || mirrors) && bit == Features::METALLIC_ROUGHNESS_TEXTURE {
            // A matcap is looked up by the normal; an environment map by what is mirrored, and without one that is the sky.
            set(texture.is_some() || (toon && force_all), bit);
            continue;
        }
        // A texture without its uvs, a normal map without tangents: out, even where everything is forced in.
        let unusable = texture.is_some_and(|t| p.uvs[t.uv_set as usize].is_empty() && !triplanar)
            || (triplanar && texture.is_some() && !from_sides.contains(&bit))
            || ((bit.has_tangents() || bit == Features::ANISOTROPY_TEXTURE)
                && texture.is_some()
                && p.tangents.is_empty());
        if !read || unusable {
            continue;
        }
        set(texture.is_some() || force_all, bit);
        set(triplanar && texture.is_some(), Features::TRIPLANAR);
        set(texture.is_some_and(|t| t.uv_set == 0 && !triplanar) || force_all, Features::UV0);
        set(texture.is_some_and(|t| t.uv_set == 1 && !triplanar) || force_all, Features::UV1);
        set(
            texture.is_some_and(|t| t.uv_transform != Affine2::IDENTITY) || force_all,
            Features::UV_TRANSFORM,
        );
    }
    let mask = material.textures[TOON_SLOT + 1].filter(|t| toon && !p.uvs[t.uv_set as usize].is_empty());
    if let Some(mask) = mask {
        set(true, Features::UV_MASK);
        set(mask.uv_set == 0, Features::UV0);
        set(mask.uv_set == 1, Features::UV1);
        set(mask.uv_transform != Affine2::IDENTITY, Features::UV_TRANSFORM);
    }
    crate::plan::features_layers::bits(layers, !p.tangents.is_empty(), force_all)
        .into_iter()
        .for_each(|(on, bit)| set(on, bit));
    set(needs.skinned || force_all, Features::SKIN);
    set((needs.skinned && primitive.info.influences == 8) || force_all, Features::SKIN_8);
    set(needs.skinned && needs.dual, Features::SKIN_DUAL);
    set(needs.skinned && needs.placed, Features::SKIN_PLACED);
    set(needs.morphed || force_all, Features::MORPH);
    set((primitive.info.colored || force_all) && !toon, Features::VERTEX_COLOR);
    set(metallic_roughness, Features::METALLIC_ROUGHNESS);
    set(phong, Features::BLINN_PHONG);
    set(mirrors || (phong && force_all), Features::REFLECTION);
    set(lit && m.shading == Shading::Phong, Features::PHONG);
    let relief = reads_normal_map(primitive, material) && m.relief > 0.0;
    set(lit && !toon && relief, Features::RELIEF);
    let pen =
        crate::scene_resources::thick_lines::pen(p.topology, m).filter(|_| !needs.skinned && !needs.morphed);
    set(pen.is_some(), Features::WIDE);
    set(pen.is_some_and(|pen| pen.round), Features::ROUND);
    set(toon, Features::TOON);
    set(lit && (m.emissive != Vec3::ZERO || force_all), Features::EMISSIVE);
    set(matches!(m.alpha_mode, AlphaMode::Mask(_)) || force_all, Features::ALPHA_MASK);
    set(lit && (needs.local_lights || force_all), Features::LOCAL_LIGHTS);
    set(lit && needs.sky, Features::SKY);
    set(lit && needs.polynomial, Features::POLYNOMIAL);
    f
}

/// Whether its normal map can be read.
fn reads_normal_map(primitive: &PrimitiveResource, material: &MaterialResource) -> bool {
    let p = primitive.primitive();
    let has_uvs = |t: MaterialTexture| !p.uvs[t.uv_set as usize].is_empty();
    !p.tangents.is_empty()
        && material.material.triplanar.is_none()
        && material.texture(TextureSlot::Normal).is_some_and(has_uvs)
}

/// Features of the hull around a surface with these features: light on the surface does not count, its shape alone.
pub fn shell_features(
    features: Features,
    primitive: &PrimitiveResource,
    material: &MaterialResource,
    blended: bool,
) -> Features {
    let mix =
        material.material.toon.as_ref().and_then(|t| t.outline.as_ref()).map_or(0.0, |o| o.lighting_mix);
    let base = if mix > 0.0 { features } else { features.of_alpha(blended) };
    let mut f = base.with(Features::SHELL);
    let uvs = &primitive.primitive().uvs;
    if let Some(width) = material.textures[TOON_SLOT].filter(|t| !uvs[t.uv_set as usize].is_empty()) {
        f = f.with(Features::OUTLINE_WIDTH_TEXTURE);
        f = f.with(if width.uv_set == 0 { Features::UV0 } else { Features::UV1 });
        if width.uv_transform != Affine2::IDENTITY {
            f = f.with(Features::UV_TRANSFORM);
        }
    }
    f
}

/// Facts of a frame from which the reasons are made.
#[derive(Clone, Copy, Debug, Default)]
pub struct Facts {
    /// Visible or not: some actor's mesh has a skin, morph targets, a lit material.
    pub skins_exist: bool,
    pub morphs_exist: bool,
    pub lit_exist: bool,
    pub lights_exist: bool,
    pub sky_exists: bool,
    /// 2D layers under and over the scene.
    pub flats: usize,
    pub lit_drawn: bool,
    pub blended: usize,
    pub copies: usize,
    pub culled: usize,
    pub hidden_actors: usize,
    /// Out of the view beyond doubt, with their shadows, and so not even posed.
    pub unposed_actors: usize,
    pub draws: usize,
    pub drawn_copies: usize,
    pub samples: u32,
    /// Some cut-out keeps samples.
    pub coverage: bool,
    pub post_passes: usize,
    pub surface_effects: usize,
    pub dark_lights: usize,
    /// Some light that shines casts shadows.
    pub casting: bool,
    pub shadow_views: usize,
    pub overlays: usize,
    pub shadows_beyond: usize,
    /// Enough lamps have a range to list where they reach.
    pub many_lights: bool,
    /// Copies of crowds that are drawn coarser, in view or casting.
    pub coarse: usize,
    /// Triangles in view of closed surfaces of two-sided materials.
    pub closed: usize,
}

pub fn left_out(all: Features, facts: &Facts) -> Vec<LeftOut> {
    let mut out = Vec::new();
    let mut say = |on: bool, what: &str, why: String| {
        debug_assert!(LEFT_OUT.contains(&what), "{what} is not in LEFT_OUT");
        if on {
            out.push(LeftOut { what: what.into(), why });
        }
    };
    let nothing_drawn_uses = |thing: &str| format!("no drawn material has {thing}");
    if facts.hidden_actors > 0 {
        say(true, "hidden actors", format!("{} set invisible", facts.hidden_actors));
    }
    if facts.unposed_actors > 0 {
        let why = format!(
            "{} are nowhere near the view in any pose of their clips, nor are their shadows: neither posed nor drawn",
            facts.unposed_actors
        );
        say(true, "actors outside the view", why);
    }
    if facts.culled > 0 {
        say(
            true,
            "primitives outside the view",
            format!("{} of {} have their bounds outside the frustum", facts.culled, facts.copies),
        );
    }
    if facts.coarse > 0 {
        let why = format!(
            "{} copies in crowds of {} and more are drawn coarser, by at most {} pixel",
            facts.coarse,
            crate::scene_resources::lod::CROWD,
            crate::scene_resources::lod::TOLERANCE
        );
        say(true, "triangles too small to see", why);
    }
    if facts.closed > 0 {
        let why = format!(
            "{} triangles of two-sided materials are parts of watertight meshes, seen from outside",
            facts.closed
        );
        say(true, "back faces of closed surfaces", why);
    }
    let skin_why = if facts.skins_exist { "no skinned mesh is in view" } else { "no mesh has a skin" };
    say(!all.has(Features::SKIN), "skinning", skin_why.into());
    say(
        all.has(Features::SKIN) && !all.has(Features::SKIN_8),
        "influences 5 to 8",
        "no vertex is moved by more than four joints".into(),
    );
    say(
        all.has(Features::SKIN) && !all.has(Features::SKIN_DUAL),
        "dual quaternions",
        "every skin is blended linearly".into(),
    );
    say(
        all.has(Features::SKIN) && !all.has(Features::SKIN_PLACED),
        "copies of skinned meshes",
        "every skinned body stands once".into(),
    );
    let morph_why =
        if facts.morphs_exist { "every weight in view is zero" } else { "no mesh has morph targets" };
    say(!all.has(Features::MORPH), "morph targets", morph_why.into());
    let unlit_why = if facts.lit_exist { "nothing lit is in view" } else { "every material is unlit" };
    say(!facts.lit_drawn, "normals, lights and ambient light", unlit_why.into());
    say(facts.lit_drawn && !facts.lights_exist, "lights", "none shines; ambient light only".into());
    say(
        facts.dark_lights > 0,
        "dark lights",
        format!("{} have no intensity, no colour or a value that is not finite", facts.dark_lights),
    );
    say(
        facts.lit_drawn && facts.lights_exist && !all.has(Features::LOCAL_LIGHTS),
        "distance and cone attenuation",
        "no point or spot light shines".into(),
    );
    say(
        facts.lit_drawn && all.has(Features::LOCAL_LIGHTS) && !facts.many_lights,
        "lists of lights",
        format!("fewer than {} point and spot lights have a range", crate::plan::light_clusters::MANY),
    );
    say(facts.flats == 0, "flat layers", "no text, picture, panel or letterbox is seen".into());
    let no_sky = if facts.sky_exists { "its strength is zero" } else { "the stage has no sky" };
    say(facts.lit_drawn && !all.has(Features::SKY), "image-based light", no_sky.into());
    say(!all.has(Features::VERTEX_COLOR), "vertex colours", "no drawn mesh has any but white".into());
    say(
        !all.has(Features::UV0) && !all.has(Features::UV1),
        "texture coordinates",
        nothing_drawn_uses("a texture"),
    );
    say(
        all.has(Features::UV0) && !all.has(Features::UV1),
        "second texture coordinates",
        "no drawn texture uses them".into(),
    );
    let textures = [
        (Features::BASE_COLOR_TEXTURE, "base colour textures", "a base colour texture", false),
        (Features::METALLIC_ROUGHNESS_TEXTURE, "metallic-roughness textures", "one that matters", true),
        (Features::NORMAL_TEXTURE, "normal maps and tangents", "a normal map", true),
        (Features::OCCLUSION_TEXTURE, "occlusion textures", "one", true),
        (Features::EMISSIVE_TEXTURE, "emissive textures", "one that is not multiplied by zero", true),
        (Features::SPECULAR_TEXTURE, "specular textures", "one", true),
        (Features::SPECULAR_COLOR_TEXTURE, "specular colour textures", "one", true),
    ];
    for (bit, what, thing, lit_only) in textures {
        say(!all.has(bit) && (facts.lit_drawn || !lit_only), what, nothing_drawn_uses(thing));
    }
    for (bit, what, thing) in crate::plan::features_layers::WORDS {
        say(facts.lit_drawn && !all.has(*bit), what, nothing_drawn_uses(thing));
    }
    let mirror_why = "no drawn Blinn–Phong material mirrors its surroundings";
    say(facts.lit_drawn && !all.has(Features::REFLECTION), "reflections of Blinn–Phong", mirror_why.into());
    say(facts.lit_drawn && !all.has(Features::EMISSIVE), "emission", "no drawn material emits light".into());
    say(!all.has(Features::EDGES), "edges", "no effect shows them".into());
    say(facts.surface_effects == 0, "effects on surfaces", "none is on".into());
    say(!all.has(Features::SHELL), "outlines", "no drawn material and no effect has one".into());
    say(
        (all.has(Features::UV0) || all.has(Features::UV1)) && !all.has(Features::UV_TRANSFORM),
        "texture transforms",
        "all are identity".into(),
    );
    say(!all.has(Features::ALPHA_MASK), "alpha test", nothing_drawn_uses("an alpha cutoff"));
    let whole = if facts.samples == 1 {
        "one sample a pixel was asked for: cut-outs keep or lose whole pixels"
    } else {
        "all cutouts are \"hard\", or nothing is cut at an alpha above 0"
    };
    say(all.has(Features::ALPHA_MASK) && !facts.coverage, "alpha to coverage", whole.into());
    say(facts.blended == 0, "blending and sorting back to front", "everything drawn is opaque".into());
    say(
        facts.drawn_copies == facts.draws,
        "instancing",
        "no two drawn primitives are equal in shape, material and state".into(),
    );
    say(facts.samples == 1, "multisampling", "one sample a pixel was asked for".into());
    say(facts.post_passes == 0, "full-screen passes and float target", "no effect is on".into());
    say(facts.overlays == 0, "lines, points and triangles of effects", "no effect draws any".into());
    let no_shadows = match facts {
        f if !f.casting => "no light casts shadows",
        f if !f.lit_drawn => "nothing lit is in view",
        _ => "nothing stands between a light that casts and what it lights",
    };
    say(facts.shadow_views == 0, "shadow maps", no_shadows.into());
    say(
        facts.shadows_beyond > 0,
        "shadows beyond the limit",
        format!("{} lights: all maps together are at most 32 and 8192 texels a side", facts.shadows_beyond),
    );
    out
}
