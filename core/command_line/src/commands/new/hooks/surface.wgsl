// effect: NAME
// about: edges that glow
// version: 0.1.0
// hook: surface
// param strength = 1.0 in 0..4: brightness of the edges
// param width = 3.0 in 0.5..8: exponent, higher is narrower
//
// Returns the color of one point of a surface, after lighting. surface: world, distance, normal, facing, uv, joints, background, viewer,
// shadow. With // see_through: true the returned alpha blends the surface with the colors behind it; with // background: true the function
// is also called for the background.
// Put the file beside the script or into its folder plugins, or name its folder with --plugins; then: effect("NAME").on(anna)
fn effect(color: vec4<f32>, surface: SurfaceSample, p: Parameters) -> vec4<f32> {
    let edge = pow(1.0 - abs(surface.facing), p.width);
    return vec4(color.rgb + p.strength * edge * vec3(0.4, 0.7, 1.0), color.a);
}
