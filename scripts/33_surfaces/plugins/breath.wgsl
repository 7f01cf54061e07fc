// effect: breath
// about: a body that swells where it is widest, and shrinks again
// version: 1
// hook: vertex
// space: model
// reach: 0.1
// param deep = 0.04 in 0..0.1: metres that it swells
// param low = 0.9 in 0..10: metres above its feet where swelling begins
// param high = 1.4 in 0..10: metres above its feet where it ends
//
// By the place in the body, not in the world: it moves as the body moves.
fn effect(vertex: VertexSample, p: Parameters) -> vec3<f32> {
    let t = clamp((vertex.model.y - p.low) / (p.high - p.low), 0.0, 1.0);
    let swell = 4.0 * t * (1.0 - t);
    return p.deep * swell * swell * normalize(vec3(vertex.model.x, 0.0, vertex.model.z + 0.001));
}
