//! Which shadow maps of the frame before are as they would be drawn now.

use crate::plan::{Draw, Features, Plan, ShadowView};
use crate::scene_resources::SceneResources;

/// Hash of everything that a shadow map is drawn from.
pub type MapKey = [u8; 32];

/// Features by which a map depends on more than the places of vertices: textures, widths of lines in pixels. Such maps are always drawn.
const MORE: Features =
    Features::ALPHA_MASK.with(Features::OUTLINE).with(Features::WIREFRAME).with(Features::THICK_LINES);

/// The key of a map; none where it must be drawn anew each time.
pub fn key(view: &ShadowView, plan: &Plan, resources: &SceneResources) -> Option<MapKey> {
    let fixed = |draw: &Draw| {
        let pipeline = &draw.pipeline;
        pipeline.displaced == 0
            && !pipeline.is_transparent()
            && pipeline.features.only(MORE) == Features::default()
    };
    if !view.draws.iter().all(fixed) {
        return None;
    }
    let mut hasher = blake3::Hasher::new();
    hasher.update(bytemuck::bytes_of(&view.clip_from_relative));
    hasher.update(bytemuck::cast_slice(&view.size));
    hasher.update(&[u8::from(view.penumbra > 0.0)]);
    let all = view.draws.iter().map(|draw| draw.pipeline.features);
    let features = all.fold(Features::default(), Features::with);
    if features.has(Features::SKIN) {
        hasher.update(bytemuck::cast_slice(&plan.joint_matrices));
    }
    if features.has(Features::MORPH) {
        hasher.update(bytemuck::cast_slice(&plan.morphs));
    }
    for draw in &view.draws {
        hasher.update(&resources.primitives[draw.primitive as usize].hash);
        hasher.update(format!("{:?}", draw.pipeline).as_bytes());
        let first = draw.first_instance as usize;
        for instance in &plan.instances[first..first + draw.instance_count as usize] {
            hasher.update(bytemuck::cast_slice(&instance.deformation()));
        }
    }
    Some(*hasher.finalize().as_bytes())
}
