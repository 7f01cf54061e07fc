// effect: NAME
// about: surfaces that ripple
// version: 0.1.0
// hook: vertex
// reach: height
// param height = 0.03 m in 0..1: largest displacement
// param length = 0.4 m in 0.01..100: wavelength
// param phase = 0 in -1000..1000: phase in wavelengths; key it over time
//
// Returns the displacement of a vertex: metres in world space, at most // reach: METRES or a parameter. vertex: world, normal, uv, model
// (position in model space, before skinning). With // space: model the displacement is in model space. Shadows and normals follow.
// Put the file beside the script or into its folder plugins, or name its folder with --plugins; then:
// effect("NAME").on(anna).key("phase", [[0.0, 0.0], [10.0, 20.0]])
fn effect(vertex: VertexSample, p: Parameters) -> vec3<f32> {
    let wave = sin(6.2831853 * (vertex.world.y / p.length - p.phase));
    return p.height * wave * vertex.normal;
}
