// effect: NAME
// about: light in two tones
// version: 0.1.0
// hook: lighting
// param edge = 0.1 in -1..1: cosine between the normal and the light where the tones meet
// param soft = 0.05 in 0.001..1: how soft the edge is
// param dark = 0.25 in 0..1: how bright the darker tone is
//
// What comes of one light at a place on a surface. falling: cosine (normal to light, -1 to 1), share (what shadows let through),
// color (of the light as it arrives), base (of the surface), normal, viewer, light, and lit, what the surface's own model makes of it.
// Put it beside the script, into a folder plugins there, or name its folder with --plugins; then: effect("NAME").on(anna)
fn effect(falling: Falling, p: Parameters) -> vec3<f32> {
    let bright = smoothstep(p.edge - p.soft, p.edge + p.soft, falling.cosine) * falling.share;
    return falling.base * falling.color * mix(p.dark, 1.0, bright);
}
