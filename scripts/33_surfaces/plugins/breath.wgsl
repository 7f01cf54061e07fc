// effect: breath
// about: a chest that rises and falls, as in breathing
// version: 1
// hook: vertex
// space: model
// reach: 0.1
// param deep = 0.04 in 0..0.1: largest displacement in metres
// param low = 0.9 in 0..10: lower end of the chest, metres above the feet
// param high = 1.4 in 0..10: upper end of the chest, metres above the feet
//
// The displacement depends on the position in model space, so that it follows the pose.
fn effect(vertex: VertexSample, p: Parameters) -> vec3<f32> {
    let t = clamp((vertex.model.y - p.low) / (p.high - p.low), 0.0, 1.0);
    let swell = 4.0 * t * (1.0 - t);
    return p.deep * swell * swell * normalize(vec3(vertex.model.x, 0.0, vertex.model.z + 0.001));
}
