// effect: depth_of_field
// about: blurs what is nearer or farther than the focus, as a camera lens does
// hook: image
// view: before
// off: limit = 0
// param focus = 3 m in 0.05..100000: distance before the camera that is sharp
// param f_number = 2.8 in 0.5..64: focal length divided by the aperture diameter; smaller values blur more
// param sensor = 24 mm in 1..1000: height of the sensor; the focal length follows from it and the camera's field of view
// param samples = int(64) in 8..256: samples per pixel: more for less noise
// param limit = 0.04 in 0..0.2: largest radius of a blurred point, as a share of the image's height; 0: no blur
//
// Thin lens (Potmesil and Chakravarty, "A Lens and Aperture Camera Model for Synthetic Image Generation", SIGGRAPH 1981): a point at
// distance z is a disk of diameter f² / (N (s − f)) · |z − s| / z on the sensor. Each pixel gathers the disks that reach it, on a spiral
// of golden angles; disks behind the pixel's own surface reach no farther than that surface's own.

// Radius in pixels of a point at a depth.
fn radius_of(depth: f32, p: Parameters) -> f32 {
    let m = clip_from_view();
    let height = p.sensor * 0.001;
    let focal = 0.5 * height * abs(m[1].y);
    let s = max(p.focus, focal * 1.01);
    let diameter = focal * focal / (p.f_number * (s - focal)) * abs(depth - s) / max(depth, 1e-4);
    // Without perspective there is no lens.
    let pixels = select(0.0, 0.5 * diameter / height * resolution().y, m[2].w < -0.5);
    return min(pixels, p.limit * resolution().y);
}

fn effect(at: vec2<i32>, pass_number: u32, p: Parameters) -> vec4<f32> {
    let own_depth = depth_at(at);
    let own = radius_of(own_depth, p);
    let most = p.limit * resolution().y;
    let here = picture(at);
    // A pixel's share of its own disk.
    let own_share = 0.31830989 / max(own * own, 0.25);
    var sum = here * own_share;
    var weights = own_share;
    let turn = 6.2831853 * fract(52.9829189 * fract(dot(vec2<f32>(at), vec2<f32>(0.06711056, 0.00583715))));
    let half = p.samples / 2;
    // Half of the samples lie in the pixel's own disk, where most of its light comes from, the others around that.
    let inner = clamp(own, 1.5, max(most, 1.5));
    let rest = max(most * most - inner * inner, 0.0);
    for (var i = 0; i < 2 * half; i++) {
        let is_inner = i < half;
        let share = (f32(select(i - half, i, is_inner)) + 0.5) / f32(half);
        let distance = sqrt(select(inner * inner + share * rest, share * inner * inner, is_inner));
        let angle = f32(i) * 2.39996323 + turn;
        let there = at + vec2<i32>(round(distance * vec2<f32>(cos(angle), sin(angle))));
        let depth = depth_at(there);
        var radius = radius_of(depth, p);
        if (depth > own_depth) { radius = min(radius, own); }
        // A disk's edge is a pixel wide. A sample stands for the pixels of its part of the ring.
        let reaches = clamp(radius - distance + 0.5, 0.0, 1.0);
        let pixels = select(rest, inner * inner, is_inner) / f32(half);
        let weight = reaches * pixels / max(radius * radius, 0.25);
        sum += weight * picture(there);
        weights += weight;
    }
    return sum / weights;
}
