// effect: NAME
// about: bright parts have streaks to both sides
// version: 0.1.0
// hook: image
// param strength = 0.5 in 0..4: brightness of the streaks
// param reach = 24 px in 1..200: length of a streak to each side
//
// Returns the color of one pixel. picture(at) reads a pixel of the image, linear, clamped to the border; picture_size() is its size.
// // pass bright = 1/2: ABOUT declares an earlier pass: fn bright(at: vec2<i32>, p: Parameters) -> vec4<f32> writes a texture of half the
// size, which bright_at(at) and bright_uv(uv) read; effect then has no parameter pass_number. // history: 3 declares previous(1, at) to
// previous(3, at), the scene 1 to 3 frames ago. Inputs from the scene: depth_at(at) (metres, 1e9 at the background), normal_at(at),
// view_at(at), motion_at(at) (pixels since the previous frame), actor_at(at), time(), delta(), frame(), resolution(), view_from_world(),
// clip_from_view() and their inverses, sun_direction() and sun_at(). // texture paper = paper.png: ABOUT declares paper(uv).
// Put the file beside the script or into its folder plugins, or name its folder with --plugins; then: effect("NAME", #{ reach: 40 })
fn effect(at: vec2<i32>, pass_number: u32, p: Parameters) -> vec4<f32> {
    let here = picture(at);
    var sum = vec3(0.0);
    var weights = 0.0;
    for (var i = -8; i <= 8; i++) {
        let away = f32(i) / 8.0;
        let there = picture(at + vec2(i32(round(away * p.reach)), 0)).rgb;
        let weight = 1.0 - abs(away);
        sum += weight * max(there - 0.8, vec3(0.0));
        weights += weight;
    }
    return vec4(here.rgb + p.strength * sum / weights, here.a);
}
