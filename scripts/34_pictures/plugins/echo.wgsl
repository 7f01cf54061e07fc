// effect: echo
// about: earlier frames over the image, fainter and bluer
// version: 1
// hook: image
// history: 6
// param strength = 0.6 in 0..1: brightness of the earlier frames
// param steps = 3 in 1..6: number of earlier frames; up to 3 are two frames apart
//
// picture(at) is the image now, previous(frames, at) the scene `frames` frames ago; picture_size() in pixels.
fn effect(at: vec2<i32>, pass_number: u32, p: Parameters) -> vec4<f32> {
    let here = picture(at);
    var color = here.rgb;
    var weight = p.strength;
    let count = u32(p.steps);
    for (var i = 1u; i <= count; i++) {
        let frames = select(i, 2u * i, count <= 3u);
        let then = previous(frames, at).rgb;
        // Where it was brighter than what is there now, it glows on.
        color += weight * vec3(0.5, 0.75, 1.0) * max(then - here.rgb, vec3(0.0));
        weight *= p.strength;
    }
    return vec4(color, here.a);
}
