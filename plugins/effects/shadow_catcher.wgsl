// effect: shadow_catcher
// about: surfaces of which only the shadows on them are seen
// hook: surface
// inputs: normals
// see_through: true
// param strength = 1 in 0..1: 1: as dark as on a white matte surface
// param color = rgb(0, 0, 0): of the shadows
fn effect(color: vec4<f32>, surface: SurfaceSample, p: Parameters) -> vec4<f32> {
    return vec4(p.color, p.strength * surface.shadow);
}
