// effect: NAME
// about: fades the image to shades of one color
// version: 0.1.0
// param amount = 1.0 in 0..1: 0 = unchanged, 1 = shades only
// param warmth = 0.5 in -1..1: -1 = blue, 1 = brown
//
// Returns the color of one pixel from its linear color, its uv (0 to 1 from the top left) and the parameters.
// Put the file beside the script or into its folder plugins, or name its folder with --plugins; then: effect("NAME", #{ amount: 0.5 })
fn effect(color: vec4<f32>, uv: vec2<f32>, p: Parameters) -> vec4<f32> {
    let grey = dot(color.rgb, vec3(0.2126, 0.7152, 0.0722));
    let shade = grey * vec3(1.0 + 0.2 * p.warmth, 1.0, 1.0 - 0.2 * p.warmth);
    return vec4(mix(color.rgb, shade, p.amount), color.a);
}
