// effect: smear
// about: motion blur of one image: blurs each pixel along the motion of its surface
// hook: image
// view: before
// off: shutter = 0
// param shutter = 1 in 0..2: time during which the shutter is open, in frames
// param samples = int(12) in 2..64: samples per pixel
//
// motion_at(at) names an input of the scene, so the frame draws motion vectors; depth_at(at) adds depth and normals. Without an effect that
// names them neither is drawn. What moves behind a nearer surface is not smeared over it.
fn effect(at: vec2<i32>, pass_number: u32, p: Parameters) -> vec4<f32> {
    let way = motion_at(at) * p.shutter;
    let here = picture(at);
    if (length(way) < 0.5) { return here; }
    let depth = depth_at(at);
    let count = p.samples;
    var sum = here;
    var weights = 1.0;
    for (var i = 0; i < count; i++) {
        let share = (f32(i) + 0.5) / f32(count) - 0.5;
        let there = at + vec2<i32>(round(way * share));
        if (depth_at(there) > 0.95 * depth) {
            sum += picture(there);
            weights += 1.0;
        }
    }
    return sum / weights;
}
