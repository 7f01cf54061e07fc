// effect: heat_haze
// about: hot air that rises and bends the view of what is far
// hook: image
// view: before
// off: strength = 0
// param strength = 0.004 in 0..0.1: how far it bends the view, as a share of the image's height
// param scale = 0.03 in 0.002..1: size of the swirls, as a share of the image's height
// param speed = 0.12 in 0..5: how fast they rise, image heights a second
// param start = 3 m in 0..100000: distance from which the air bends the view
// param full = 15 m in 0.01..100000: distance from which the effect has its full strength
//
// The image is read beside each pixel, by the slope of rising gradient noise (Perlin, "Improving Noise", SIGGRAPH 2002). A nearer
// surface is not bent into the view of what lies behind it.

fn corner(cell: vec3<i32>, off: vec3<f32>) -> f32 {
    var h = u32(cell.x) * 0x8da6b343u + u32(cell.y) * 0xd8163841u + u32(cell.z) * 0xcb1ab31fu;
    h = (h ^ (h >> 15u)) * 0x2c1b3c6du;
    h = (h ^ (h >> 12u)) * 0x297a2d39u;
    h = h ^ (h >> 15u);
    let angle = f32(h & 0xffffu) / 65536.0 * 6.2831853;
    let z = f32(h >> 16u) / 32768.0 - 1.0;
    let ring = sqrt(max(1.0 - z * z, 0.0));
    return dot(vec3<f32>(ring * cos(angle), ring * sin(angle), z), off);
}

// Gradient noise, about −0.7 to 0.7.
fn noise(at: vec3<f32>) -> f32 {
    let base = floor(at);
    let f = at - base;
    let c = vec3<i32>(base);
    let w = f * f * f * (f * (f * 6.0 - 15.0) + 10.0);
    var sum = 0.0;
    for (var i = 0; i < 8; i++) {
        let step = vec3<i32>(i & 1, (i >> 1u) & 1, (i >> 2u) & 1);
        let s = vec3<f32>(step);
        let share = mix(1.0 - w, w, s);
        sum += share.x * share.y * share.z * corner(c + step, f - s);
    }
    return sum;
}

fn effect(at: vec2<i32>, pass_number: u32, p: Parameters) -> vec4<f32> {
    let depth = depth_at(at);
    let amount = smoothstep(p.start, max(p.full, p.start + 0.001), depth);
    if (amount == 0.0) { return picture(at); }
    let height = resolution().y;
    let place = vec2<f32>(at) / (p.scale * height);
    // Rows go down: what rises comes from below.
    let rising = vec3<f32>(place.x, place.y + time() * p.speed / p.scale, 0.6 * time());
    let bend = vec2<f32>(noise(rising), noise(rising + vec3<f32>(37.0, 17.0, 5.0)));
    let source = vec2<f32>(at) + bend * (amount * p.strength * height * 1.4);
    let corner_pixel = vec2<i32>(floor(source));
    let f = source - floor(source);
    var sum = vec4<f32>(0.0);
    for (var i = 0; i < 4; i++) {
        let step = vec2<i32>(i & 1, i >> 1u);
        let share = mix(1.0 - f, f, vec2<f32>(step));
        var there = corner_pixel + step;
        if (depth_at(there) < 0.8 * min(depth, 1e6)) { there = at; }
        sum += share.x * share.y * picture(there);
    }
    return sum;
}
