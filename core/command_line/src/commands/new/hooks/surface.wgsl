// effect: NAME
// about: edges that glow
// version: 0.1.0
// hook: surface
// param strength = 1.0 in 0..4: how bright they are
// param width = 3.0 in 0.5..8: how narrow, higher is narrower
//
// A function of a place on a surface after light has fallen on it. seen: world, distance, normal, facing, uv, joints,
// background, viewer, shadow; // see_through: true lets its alpha mix with what is behind; // background: true has it called there, too.
// Put it beside the script, into a folder plugins there, or name its folder with --plugins; then: effect("NAME").on(anna)
fn effect(color: vec4<f32>, seen: Seen, p: Parameters) -> vec4<f32> {
    let edge = pow(1.0 - abs(seen.facing), p.width);
    return vec4(color.rgb + p.strength * edge * vec3(0.4, 0.7, 1.0), color.a);
}
