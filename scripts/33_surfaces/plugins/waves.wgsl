// effect: waves
// about: a surface with three waves in different directions
// version: 1
// hook: vertex
// reach: height
// param height = 0.12 in 0..2: amplitude of all waves together, metres
// param length = 1.6 in 0.1..100: wavelength of the first wave, metres
// param phase = 0 in -1000..1000: phase of the first wave, in wavelengths
//
// The displacement of each vertex in world-space metres; shadows and normals follow.
const TURN = 6.2831853;

fn wave(place: vec3<f32>, way: vec2<f32>, phase: f32) -> f32 {
    return sin(TURN * (dot(place.xz, way) - phase));
}

fn effect(vertex: VertexSample, p: Parameters) -> vec3<f32> {
    let k = 1.0 / p.length;
    let rise = 0.5 * wave(vertex.world, k * vec2(0.8, 0.6), p.phase)
        + 0.3 * wave(vertex.world, 1.7 * k * vec2(-0.3, 0.95), 1.3 * p.phase)
        + 0.2 * wave(vertex.world, 2.9 * k * vec2(1.0, -0.1), 1.7 * p.phase);
    return vec3(0.0, p.height * rise, 0.0);
}
