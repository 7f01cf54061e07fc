//! The key of a frame by its content: its plan, the scene resources and the effects. Plans with equal keys give equal images on
//! one device, at any time and with any version of the script.

use crate::plan::{Draw, Plan, PostPass, ShadowMaps, ShadowView};
use crate::scene_resources::SceneResources;
use crate::scene_resources::content_hash::material_content;
use choreo_plugin::{Effect, FrameWish};

pub type Key = [u8; 32];

/// A draw as text, by the content of the resources that it refers to.
fn draw_text(draw: &Draw, resources: &SceneResources) -> String {
    let primitive = resources.primitives.get(draw.primitive as usize).map(|p| p.hash);
    let material = resources.materials.get(draw.material as usize).map(|m| m.hash);
    let Draw { pipeline, material_override, first_instance, instance_count, .. } = draw;
    format!("{primitive:?} {material:?} {material_override:?} {pipeline:?} {first_instance} {instance_count}")
}

/// Hash of all inputs of the frame's image.
pub fn frame_key(plan: &Plan, resources: &SceneResources, effects: &[Effect]) -> Key {
    let layers = plan.layers_in_front.as_ref().map(|layers| layers.hash);
    let mut hasher = blake3::Hasher::new();
    hasher.update(&scene_key(plan, resources, effects));
    hasher.update(&layers.unwrap_or_default());
    *hasher.finalize().as_bytes()
}

/// Hash of all inputs of the frame's image except the 2D layers over it.
pub fn scene_key(plan: &Plan, resources: &SceneResources, effects: &[Effect]) -> Key {
    let mut hasher = blake3::Hasher::new();
    let mut add = |bytes: &[u8]| {
        hasher.update(&(bytes.len() as u64).to_le_bytes());
        hasher.update(bytes);
    };
    // All fields are listed, which makes this function longer than 80 lines: a new field does not compile until it is hashed or
    // ignored here.
    let Plan {
        size,
        samples,
        wish,
        view,
        background,
        ambient_up,
        ambient_down,
        exposure,
        display,
        lights,
        sky,
        layers_behind,
        // Part of `frame_key` instead.
        layers_in_front: _,
        shadow_maps,
        scene_color_copy,
        depth_peeling,
        deferred,
        instances,
        instance_actors: _,
        joint_matrices,
        morphs,
        draws,
        material_overrides,
        scene_effects,
        post,
        scene_inputs,
        inputs_only,
        effect_frame,
        background_effects,
        overlay,
        subframes,
        history,
        dissolve,
        displacement_limits,
        linear,
        pre_skinning,
        left_out: _,
        effect_faults: _,
        shutter_motion: _,
        // Both follow from instances and lights.
        dirty_rect: _,
        light_clusters: _,
    } = plan;
    // Numbers are printed so that different numbers give different texts: the shortest text that reads as the same number.
    add(format!("{size:?} {samples} {view:?} {background:?} {ambient_up:?} {ambient_down:?}").as_bytes());
    add(format!("{exposure:?} {display:?}").as_bytes());
    add(format!("{:?}", layers_behind.as_ref().map(|layers| layers.hash)).as_bytes());
    add(format!("{sky:?} {:?}", sky.and(resources.sky.as_ref()).map(|s| s.hash())).as_bytes());
    add(bytemuck::cast_slice(lights));
    add(bytemuck::cast_slice(instances));
    add(bytemuck::cast_slice(joint_matrices));
    add(bytemuck::cast_slice(morphs));
    // Draws are hashed by content, because indices of another version of the scene may differ.
    let draw_text = |draw: &Draw| draw_text(draw, resources);
    draws.iter().for_each(|draw| add(draw_text(draw).as_bytes()));
    material_overrides.iter().for_each(|m| add(&material_content(m, &resources.textures)));
    if let Some(shadows) = shadow_maps {
        add_shadow_maps(shadows, &draw_text, &mut add);
    }
    add(format!("{scene_color_copy:?}").as_bytes());
    // Deferred shading rounds differently.
    add(&[u8::from(deferred.is_some())]);
    add(format!("{:?}", depth_peeling.as_ref().map(|peeling| peeling.layers)).as_bytes());
    scene_effects.iter().chain(post).for_each(|pass| add_pass(pass, effects, &mut add));
    add(bytemuck::cast_slice(&overlay.vertices));
    add(format!(
        "{:?} {linear} {background_effects} {displacement_limits:?} {pre_skinning:?}",
        overlay.parts
    )
    .as_bytes());
    if *wish != FrameWish::Bytes {
        add(format!("{wish:?}").as_bytes());
    }
    // The draws of the inputs follow from those above, and their instances are among the plan's.
    let inputs = scene_inputs.as_ref().map(|pass| (pass.inputs, pass.clip_before, pass.camera_before));
    add(format!("{inputs:?} {inputs_only} {effect_frame:?}").as_bytes());
    add(format!("{} {}", subframes.len(), history.len()).as_bytes());
    subframes.iter().chain(history).for_each(|part| add(&frame_key(part, resources, effects)));
    if let Some(dissolve) = dissolve {
        add(format!("{:?}", dissolve.share).as_bytes());
        add(&scene_key(&dissolve.plan, resources, effects));
    }
    *hasher.finalize().as_bytes()
}

fn add_shadow_maps(shadows: &ShadowMaps, draw_text: &dyn Fn(&Draw) -> String, add: &mut dyn FnMut(&[u8])) {
    add(format!("{:?} {:?}", shadows.image, shadows.size).as_bytes());
    for map in &shadows.views {
        let ShadowView { light, at, size, clip_from_relative, texel, penumbra, draws } = map;
        add(format!("{light} {at:?} {size:?} {clip_from_relative:?} {texel} {penumbra}").as_bytes());
        draws.iter().for_each(|draw| add(draw_text(draw).as_bytes()));
    }
}

/// A pass of an effect with the effect's code and textures.
fn add_pass(pass: &PostPass, effects: &[Effect], add: &mut dyn FnMut(&[u8])) {
    add(format!("{pass:?}").as_bytes());
    let effect = effects.iter().find(|e| e.manifest().name == pass.effect);
    add(effect.and_then(|e| e.shader()).map_or("", |shader| shader.wgsl()).as_bytes());
    let halves = effect.iter().flat_map(|e| e.textures()).map(|t| &t.halves);
    halves.for_each(|halves| add(bytemuck::cast_slice(halves)));
}
