// effect: shadow_catcher
// about: surfaces that are invisible except for the shadows on them
// hook: surface
// inputs: normals
// see_through: true
// param strength = 1 in 0..1: 1: as dark as on a white matte surface
// param color = rgb(0, 0, 0): color of the shadows
fn effect(color: vec4<f32>, surface: SurfaceSample, p: Parameters) -> vec4<f32> {
    return vec4(p.color, p.strength * surface.shadow);
}
