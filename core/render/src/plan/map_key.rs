//! Keys of shadow maps by their content. A map of the frame before with an equal key can be kept.

use crate::plan::{Draw, Features, Plan, ShadowMaps, ShadowView};
use crate::scene_resources::SceneResources;

/// Hash of everything that a shadow map is drawn from.
pub(crate) type MapKey = [u8; 32];

/// Features with which a map depends on more than vertex positions: textures, line widths in pixels. Such maps are always
/// redrawn.
const FEATURES_BEYOND_POSITIONS: Features =
    Features::ALPHA_MASK.with(Features::OUTLINE).with(Features::WIREFRAME).with(Features::THICK_LINES);

/// Key of each map; `None` for a map that must be redrawn in every frame.
pub(crate) fn map_keys(shadows: &ShadowMaps, plan: &Plan, resources: &SceneResources) -> Vec<Option<MapKey>> {
    let all = shadows.views.iter().flat_map(|view| &view.draws).map(|draw| draw.pipeline.features);
    let features = all.fold(Features::default(), Features::with);
    let hash = |asked: bool, bytes: &[u8]| asked.then(|| *blake3::hash(bytes).as_bytes());
    let joints = hash(features.has(Features::SKIN), bytemuck::cast_slice(&plan.joint_matrices));
    let morphs = hash(features.has(Features::MORPH), bytemuck::cast_slice(&plan.morphs));
    shadows.views.iter().map(|view| map_key(view, plan, resources, [joints, morphs])).collect()
}

/// Key of one map. `joints`, `morphs`: hashes of the frame's joint matrices and morph weights.
fn map_key(
    view: &ShadowView,
    plan: &Plan,
    resources: &SceneResources,
    [joints, morphs]: [Option<[u8; 32]>; 2],
) -> Option<MapKey> {
    let fixed = |draw: &Draw| {
        let pipeline = &draw.pipeline;
        pipeline.displaced == 0
            && !pipeline.is_transparent()
            && pipeline.features.only(FEATURES_BEYOND_POSITIONS) == Features::default()
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
        hasher.update(&joints.unwrap_or_default());
    }
    if features.has(Features::MORPH) {
        hasher.update(&morphs.unwrap_or_default());
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
