// effect: views
// about: debug views of a mesh instead of its material
// hook: surface
// inputs: show
// param show = normals of normals|uvs|joints|distance: normals (as normal maps have them, in the world), uvs (red u, green v, a checker of tenths), joints (a color each, by weight), distance (10 m a band)
fn effect(color: vec4<f32>, surface: SurfaceSample, p: Parameters) -> vec4<f32> {
    if (p.show == SHOW_NORMALS) { return vec4<f32>(surface.normal * 0.5 + 0.5, color.a); }
    if (p.show == SHOW_UVS) {
        let uv = fract(surface.uv);
        let odd = (floor(uv.x * 10.0) + floor(uv.y * 10.0)) % 2.0;
        return vec4<f32>(vec3<f32>(uv, 0.0) * (1.0 - 0.4 * odd) + 0.1 * odd, color.a);
    }
    if (p.show == SHOW_JOINTS) { return vec4<f32>(surface.joints, color.a); }
    return vec4<f32>(vec3<f32>(1.0 - fract(surface.distance / 10.0)), color.a);
}
