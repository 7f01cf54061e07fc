//! Shaders without a GPU: every combination of features that a plan can ask for compiles.

use choreo_plugin::Hook;
use choreo_render::plan::{Features, Glass, PipelineKey};
use choreo_render::shader::*;

fn sources() -> ShaderSources {
    ShaderSources::default()
}

/// Which lights a variant asks.
fn loop_of(one: bool) -> LightLoop {
    if one { LightLoop::One } else { LightLoop::All }
}

/// Everything that vertex and fragment shader can be asked for, without repeating combinations of switches that
/// never meet in one expression: all vertex inputs × shading, and all subsets of textures × shading.
fn variants() -> Vec<SceneVariant> {
    let mirrors = Features::BLINN_PHONG.with(Features::REFLECTION);
    let shadings =
        [Features(0), Features::METALLIC_ROUGHNESS, Features::BLINN_PHONG, mirrors, Features::TOON];
    let textures = [
        Features::BASE_COLOR_TEXTURE,
        Features::METALLIC_ROUGHNESS_TEXTURE,
        Features::NORMAL_TEXTURE,
        Features::OCCLUSION_TEXTURE,
        Features::EMISSIVE_TEXTURE.with(Features::EMISSIVE),
        Features::SPECULAR_TEXTURE,
        Features::SPECULAR_COLOR_TEXTURE,
    ];
    let vertex = [
        Features(0),
        Features::SKIN,
        Features::SKIN.with(Features::SKIN_8),
        Features::SKIN.with(Features::SKIN_DUAL),
        Features::SKIN.with(Features::SKIN_8).with(Features::SKIN_DUAL),
        Features::SKIN.with(Features::SKIN_PLACED),
        Features::SKIN.with(Features::SKIN_8).with(Features::SKIN_DUAL).with(Features::SKIN_PLACED),
        Features::MORPH,
        Features::MORPH.with(Features::SKIN),
        Features::MORPH.with(Features::SKIN).with(Features::SKIN_8),
    ];
    let mut list = Vec::new();
    for shading in shadings {
        for subset in 0..1u32 << textures.len() {
            let mut features = shading;
            for (i, t) in textures.iter().enumerate() {
                if subset & (1 << i) != 0 {
                    features = features.with(*t);
                }
            }
            // Unlit materials have no maps but the base colour's.
            if !shading.is_lit() && subset > 1 {
                continue;
            }
            let uvs = if subset == 0 { [Features(0)].as_slice() } else { &UVS };
            for (i, uv) in uvs.iter().enumerate() {
                let extra = [Features(0), Features::UV_TRANSFORM, Features::ALPHA_MASK][i % 3];
                list.push(SceneVariant {
                    key: PipelineKey {
                        double_sided: subset % 2 == 1,
                        blend: subset % 3 == 1,
                        coverage: subset % 3 == 2 && extra == Features::ALPHA_MASK,
                        ..PipelineKey::of(features.with(*uv).with(extra))
                    },
                    tint: subset % 5 == 2,
                    joints_uniform: false,
                    lights: loop_of(subset % 2 == 0),
                    shadow_pass: false,
                    peel: PeelPass::No,
                    deferred: DeferredPass::No,
                });
            }
        }
        for v in vertex {
            for rest in 0..64u32 {
                let mut features = shading.with(v);
                let on = |bit: u32| rest & (1 << bit) != 0;
                if on(0) {
                    features = features.with(Features::VERTEX_COLOR);
                }
                if on(1) && shading.is_lit() {
                    features = features.with(Features::NORMAL_TEXTURE).with(Features::UV0);
                }
                if on(2) && shading.is_lit() {
                    features = features.with(Features::LOCAL_LIGHTS);
                }
                if on(5) && shading.is_lit() {
                    features = features.with(Features::EMISSIVE);
                }
                list.push(SceneVariant {
                    key: PipelineKey::of(features),
                    tint: on(3),
                    joints_uniform: on(4) && v.has(Features::SKIN),
                    lights: loop_of(on(3)),
                    shadow_pass: false,
                    peel: PeelPass::No,
                    deferred: DeferredPass::No,
                });
            }
        }
    }
    list
}

const UVS: [Features; 3] = [Features::UV0, Features::UV1, Features::UV0.with(Features::UV1)];

/// All subsets of coat, sheen, transmission and volume, each with and without its textures.
fn layer_variants() -> Vec<SceneVariant> {
    let coat = Features::CLEARCOAT_TEXTURE.with(Features::CLEARCOAT_ROUGHNESS_TEXTURE);
    let parts = [
        (Features::CLEARCOAT, coat),
        (Features::SHEEN, Features::SHEEN_COLOR_TEXTURE.with(Features::SHEEN_ROUGHNESS_TEXTURE)),
        (Features::TRANSMISSION, Features::TRANSMISSION_TEXTURE),
        (Features::TRANSMISSION.with(Features::VOLUME), Features::THICKNESS_TEXTURE),
        (Features::CLEARCOAT, Features::CLEARCOAT_NORMAL_TEXTURE),
        (Features::CLEARCOAT, Features::CLEARCOAT_NORMAL_TEXTURE.with(Features::NORMAL_TEXTURE)),
        (Features::IRIDESCENCE, Features::IRIDESCENCE_TEXTURE.with(Features::IRIDESCENCE_THICKNESS_TEXTURE)),
        (Features::ANISOTROPY, Features::ANISOTROPY_TEXTURE),
        (
            Features::DIFFUSE_TRANSMISSION,
            Features::DIFFUSE_TRANSMISSION_TEXTURE.with(Features::DIFFUSE_TRANSMISSION_COLOR_TEXTURE),
        ),
    ];
    let mut list = Vec::new();
    for subset in 1..1u32 << parts.len() {
        for textured in [false, true] {
            let mut features = Features::METALLIC_ROUGHNESS.with(Features::LAYERS);
            for (i, (part, textures)) in parts.iter().enumerate().filter(|(i, _)| subset >> i & 1 == 1) {
                features = features.with(*part);
                if textured {
                    features = features.with(*textures).with(UVS[(subset as usize + i) % 3]);
                }
            }
            if subset % 2 == 0 {
                features = features.with(Features::LOCAL_LIGHTS).with(Features::UV_TRANSFORM);
            }
            let glasses: &[Glass] = match features.has(Features::TRANSMISSION) {
                true => &[Glass::Filter, Glass::Light],
                false => &[Glass::No],
            };
            list.extend(glasses.iter().map(|glass| SceneVariant {
                key: PipelineKey {
                    double_sided: subset % 3 == 0,
                    blend: subset % 5 == 0,
                    coverage: false,
                    glass: *glass,
                    ..PipelineKey::of(features)
                },
                tint: subset % 7 == 0,
                joints_uniform: false,
                lights: loop_of(subset % 2 == 1),
                shadow_pass: false,
                peel: PeelPass::No,
                deferred: DeferredPass::No,
            }));
            if features.has(Features::TRANSMISSION) {
                // Bent, with one index or three.
                let bent = if textured {
                    Features::REFRACTION.with(Features::DISPERSION)
                } else {
                    Features::REFRACTION
                };
                let last = list[list.len() - 1];
                let features = features.with(bent);
                list.push(SceneVariant {
                    key: PipelineKey { features, glass: Glass::Refract, ..last.key },
                    ..last
                });
            }
        }
    }
    list
}

/// Lit by every model with shadows, and depth alone of every shape, whole and with holes.
fn shadow_variants() -> Vec<SceneVariant> {
    let variant = |features: Features, shadow_pass: bool, bits: u32| SceneVariant {
        key: PipelineKey {
            double_sided: bits & 1 != 0,
            blend: bits & 2 != 0 && !shadow_pass,
            ..PipelineKey::of(features)
        },
        tint: bits & 4 != 0 && !shadow_pass,
        joints_uniform: bits & 8 != 0 && features.has(Features::SKIN),
        lights: loop_of(bits & 16 != 0),
        shadow_pass,
        peel: PeelPass::No,
        deferred: DeferredPass::No,
    };
    let shadings = [Features::METALLIC_ROUGHNESS, Features::BLINN_PHONG, Features::TOON];
    let normal_map = Features::NORMAL_TEXTURE.with(Features::UV0);
    let coat = Features::LAYERS.with(Features::CLEARCOAT).with(Features::SHEEN);
    let leaf = Features::LAYERS.with(Features::DIFFUSE_TRANSMISSION);
    let mut list = Vec::new();
    for bits in 0..32 {
        for shading in shadings {
            for extra in [Features(0), Features::LOCAL_LIGHTS, normal_map] {
                list.push(variant(shading.with(Features::SHADOW).with(extra), false, bits));
            }
        }
        for shading in shadings {
            list.push(variant(shading.with(Features::SKY), false, bits));
            let local = Features::LOCAL_LIGHTS.with(Features::POLYNOMIAL);
            list.push(variant(shading.with(local), false, bits));
            let listed = variant(shading.with(local).with(Features::SHADOW), false, bits);
            list.push(SceneVariant { lights: LightLoop::Lists, ..listed });
            list.push(variant(
                shading.with(Features::SKY).with(Features::SHADOW).with(normal_map),
                false,
                bits,
            ));
        }
        let layered = Features::METALLIC_ROUGHNESS.with(coat).with(Features::SHADOW);
        list.push(variant(layered.with(Features::SKY), false, bits));
        let phong = Features::BLINN_PHONG.with(Features::PHONG);
        list.push(variant(phong.with(Features::LOCAL_LIGHTS).with(Features::SHADOW), false, bits));
        list.push(variant(phong.with(Features::REFLECTION).with(Features::SKY), false, bits));
        list.push(variant(layered, false, bits));
        list.push(variant(Features::METALLIC_ROUGHNESS.with(leaf).with(Features::SHADOW), false, bits));
    }
    let all = Features::SKIN.with(Features::SKIN_8).with(Features::MORPH);
    for shape in [Features(0), Features::SKIN, Features::MORPH, all] {
        let cut_out = Features::ALPHA_MASK;
        let textured = cut_out.with(Features::BASE_COLOR_TEXTURE).with(Features::UV0);
        let moved = textured.with(Features::UV_TRANSFORM).with(Features::VERTEX_COLOR).with(Features::UV1);
        for holes in [Features(0), cut_out, textured, moved, moved.with(Features::UV_MASK)] {
            list.push(variant(shape.with(holes), true, 9));
            list.push(variant(shape.with(holes), true, 0));
        }
    }
    list
}

/// Hulls of every shape, lit and not, with and without what their width and textures ask for; textures that a mask moves.
fn outline_variants() -> Vec<SceneVariant> {
    let all = Features::SKIN.with(Features::SKIN_8).with(Features::MORPH);
    let mut list = Vec::new();
    for shape in [Features(0), Features::SKIN, Features::MORPH, all] {
        for shading in [Features(0), Features::TOON, Features::METALLIC_ROUGHNESS, Features::BLINN_PHONG] {
            for bits in 0..32u32 {
                let on = |bit: u32, f: Features| if bits >> bit & 1 == 1 { f } else { Features(0) };
                let uv = UVS[bits as usize % 3];
                let features = shape
                    .with(shading)
                    .with(on(0, Features::SHELL))
                    .with(on(1, Features::OUTLINE_WIDTH_TEXTURE.with(uv)))
                    .with(on(2, Features::UV_MASK.with(uv)))
                    .with(on(3, Features::BASE_COLOR_TEXTURE.with(Features::UV_TRANSFORM).with(uv)))
                    .with(on(4, Features::ALPHA_MASK));
                list.push(SceneVariant {
                    key: PipelineKey::of(features),
                    tint: bits % 2 == 0,
                    joints_uniform: false,
                    lights: loop_of(bits % 3 == 0),
                    shadow_pass: false,
                    peel: PeelPass::No,
                    deferred: DeferredPass::No,
                });
            }
        }
    }
    list
}

/// What is kept of every surface that can be, and light on it with all that a scene may have.
fn deferred_variants() -> Vec<SceneVariant> {
    let kept = |v: &SceneVariant| {
        v.key.features.has(Features::METALLIC_ROUGHNESS) && !v.key.is_transparent() && !v.key.coverage
    };
    let base = variants();
    // Each ninth: switches of shapes and of textures never meet in one expression.
    let geometry = base.iter().filter(|v| kept(v)).step_by(9).enumerate().map(|(i, v)| {
        let extra = [Features(0), Features::SHADOW, Features::RELIEF.with(NORMAL_MAP)][i % 3];
        let features =
            v.key.features.with(if v.key.features.has(Features::UV0) { extra } else { Features(0) });
        let (key, lights) = (PipelineKey { features, ..v.key }, LightLoop::All);
        SceneVariant { key, lights, deferred: DeferredPass::Geometry, ..*v }
    });
    let mut list: Vec<SceneVariant> = geometry.collect();
    let bits = [
        Features::SHADOW,
        Features::SKY,
        Features::LOCAL_LIGHTS,
        Features::LOCAL_LIGHTS.with(Features::POLYNOMIAL),
        Features::EMISSIVE,
        Features::SEEN_NORMALS,
    ];
    for subset in 0..1u32 << bits.len() {
        let on = bits.iter().enumerate().filter(|(i, _)| subset >> i & 1 == 1);
        let features = on.fold(Features::METALLIC_ROUGHNESS, |all, (_, f)| all.with(*f));
        for lights in [LightLoop::One, LightLoop::All, LightLoop::Lists] {
            let (key, tint, deferred) = (PipelineKey::of(features), false, DeferredPass::Light);
            list.push(SceneVariant { key, lights, tint, joints_uniform: false, deferred, ..base[0] });
        }
    }
    list
}

const NORMAL_MAP: Features = Features::NORMAL_TEXTURE.with(Features::UV0);

#[test]
fn every_combination_compiles() {
    let files = sources().files(&SCENE).unwrap();
    let variants = variants();
    assert!(variants.len() > 1000, "{}", variants.len());
    let stages = [("vs", naga::ShaderStage::Vertex), ("fs", naga::ShaderStage::Fragment)];
    for v in &variants {
        let on = switches(v);
        compile(&files, &on, &stages, false).unwrap_or_else(|e| panic!("{on:?}: {e}"));
    }
    for v in layer_variants().iter().chain(&outline_variants()) {
        let on = switches(v);
        compile(&files, &on, &stages, false).unwrap_or_else(|e| panic!("{on:?}: {e}"));
    }
    for v in &deferred_variants() {
        let on = switches(v);
        let vs = if v.deferred == DeferredPass::Light { "light_vs" } else { "vs" };
        let stages = [(vs, naga::ShaderStage::Vertex), ("fs", naga::ShaderStage::Fragment)];
        compile(&files, &on, &stages, false).unwrap_or_else(|e| panic!("{on:?}: {e}"));
    }
    for v in &shadow_variants() {
        let on = switches(v);
        let shadow_stages = [("vs", naga::ShaderStage::Vertex), ("shadow_fs", naga::ShaderStage::Fragment)];
        let cut_out = v.key.features.has(Features::ALPHA_MASK);
        let stages = match v.shadow_pass {
            true => &shadow_stages[..if cut_out { 2 } else { 1 }],
            false => &stages[..],
        };
        compile(&files, &on, stages, false).unwrap_or_else(|e| panic!("{on:?}: {e}"));
    }
    let all = Features((1 << 54) - (1 << 32) + (1 << 19) - 1 - Features::BLINN_PHONG.0 + Features::SHADOW.0);
    let all = SceneVariant {
        key: PipelineKey::of(all),
        tint: true,
        joints_uniform: true,
        lights: loop_of(true),
        shadow_pass: false,
        peel: PeelPass::No,
        deferred: DeferredPass::No,
    };
    compile(&files, &switches(&all), &stages, true).unwrap();
    // Effects on surfaces of every kind, two of which use the same names.
    let text = |k: &str| {
        format!(
            "const k = {k};\nfn part(x: f32) -> f32 {{ return x * k; }}\n\
             fn effect(color: vec4<f32>, seen: Seen, p: array<f32, 8>) -> vec4<f32> {{\n\
             return color * part(seen.distance) + vec4<f32>(seen.normal + seen.joints + seen.background, seen.uv.x * p[0]); }}"
        )
    };
    let vertex = "fn effect(place: Place, p: array<f32, 8>) -> vec3<f32> {\n\
                  return place.normal * place.world.x + place.model + vec3(place.uv, paper(place.uv).x); }\n\
                  fn paper(uv: vec2<f32>) -> vec4<f32> { return effect_texture(0u, vec2(2u, 2u), uv); }";
    let lighting = "fn effect(falling: Falling, p: array<f32, 8>) -> vec3<f32> {\n\
                    return falling.lit + falling.cosine * falling.share * falling.color * falling.base * falling.light; }";
    let hooked = |bit: u8, hook: Hook, wgsl: &str| SceneEffect {
        bit,
        name: format!("e{bit}"),
        wgsl: wgsl.into(),
        hook,
        along_model: bit == 4,
    };
    let files = |key: &PipelineKey| {
        let all = [
            hooked(0, Hook::Surface, &text("0.5")),
            hooked(1, Hook::Vertex, vertex),
            hooked(2, Hook::Lighting, lighting),
            hooked(3, Hook::Surface, &text("2.0")),
            hooked(4, Hook::Vertex, vertex),
        ];
        let used: Vec<SceneEffect> = all.into_iter().filter(|e| key.effects() >> e.bit & 1 == 1).collect();
        let mut files = sources().files(&SCENE).unwrap();
        files.push(sources().file("textures.wgsl").unwrap());
        files.extend(surface_files(&used));
        files
    };
    for shading in [Features(0), Features::METALLIC_ROUGHNESS, Features::TOON, Features::BLINN_PHONG] {
        for bits in 0..64u32 {
            let on = |bit: u32, f: Features| if bits >> bit & 1 == 1 { f } else { Features(0) };
            let features = shading
                .with(on(0, Features::SEEN_NORMALS))
                .with(on(1, Features::SKIN.with(Features::SEEN_JOINTS)))
                .with(on(2, Features::UV0))
                .with(on(3, Features::EDGES));
            let cut = bits & 24 == 8;
            let features = if cut { features.with(Features::ALPHA_MASK) } else { features };
            let (displaced, lighting) = if bits & 32 != 0 { (18, 4) } else { (0, 0) };
            let key = PipelineKey {
                surface: if bits & 33 == 33 { 0 } else { 9 },
                displaced,
                lighting,
                blend: bits & 16 != 0,
                coverage: cut,
                double_sided: bits & 1 == 0,
                ..PipelineKey::of(features)
            }
            .of_lit();
            let v = SceneVariant {
                key,
                tint: false,
                joints_uniform: false,
                lights: loop_of(bits & 3 == 1),
                shadow_pass: false,
                peel: PeelPass::No,
                deferred: DeferredPass::No,
            };
            let mut on = switches(&v);
            on.push("TEXTURES");
            compile(&files(&key), &on, &stages, false).unwrap_or_else(|e| panic!("{on:?}: {e}"));
            // Seen from a light it is moved as it is in the picture.
            if displaced != 0 {
                let features = features.of_depth().with(on_corners(bits));
                let key = PipelineKey { features, surface: 0, lighting: 0, coverage: false, ..key };
                let v = SceneVariant { key, shadow_pass: true, lights: loop_of(false), ..v };
                let mut on = switches(&v);
                on.push("TEXTURES");
                compile(&files(&key), &on, &stages[..1], false).unwrap_or_else(|e| panic!("{on:?}: {e}"));
            }
        }
    }
    let glass = Features::METALLIC_ROUGHNESS.with(Features::LAYERS).with(Features::TRANSMISSION);
    for glass_pass in [Glass::Filter, Glass::Light] {
        let key = PipelineKey { surface: 9, glass: glass_pass, ..PipelineKey::of(glass) };
        let v = SceneVariant {
            key,
            tint: false,
            joints_uniform: false,
            lights: loop_of(false),
            shadow_pass: false,
            peel: PeelPass::No,
            deferred: DeferredPass::No,
        };
        let mut on = switches(&v);
        on.push("TEXTURES");
        compile(&files(&key), &on, &stages, false).unwrap();
    }
    let files = sources().files(&BACKGROUND).unwrap();
    parse(&files, &[]).unwrap();
    parse(&sources().files(&UNDER).unwrap(), &[]).unwrap();
    parse(&sources().files(&SKY).unwrap(), &["SKY_BACKGROUND"]).unwrap();
}

/// What effects that move corners read beside places.
fn on_corners(bits: u32) -> Features {
    let normals = if bits & 1 != 0 { Features::SEEN_NORMALS } else { Features(0) };
    normals.with(if bits & 4 != 0 { Features::UV0 } else { Features(0) })
}
