// effect: bloom
// about: light that spills over around what is bright
// hook: image
// view: before
// passes: 4
// halve: radius to 8
// off: strength = 0
// param strength = 0.3 in 0..10: how much of it is added
// param threshold = 0.9 in 0..100: light above which it spills
// param radius = 0.03 in 0.001..0.2: how far, as a share of the picture's height
//
// Bright areas are drawn into a smaller image in which 8 pixels are three standard deviations or less, blurred by a Gaussian
// across and then down, and added to the image. What is bright is spread over pixels much larger than these, and no finer
// image would show.

// What of a color is above the threshold, with its hue.
fn bright(color: vec4<f32>, threshold: f32) -> vec3<f32> {
    let c = clamp(color.rgb, vec3<f32>(0.0), vec3<f32>(1000.0));
    let most = max(c.r, max(c.g, c.b));
    return c * (max(most - threshold, 0.0) / max(most, 1e-6));
}

fn effect(at: vec2<i32>, pass_number: u32, p: Parameters) -> vec4<f32> {
    let shrink = shrink_factor();
    var sum = vec3<f32>(0.0);
    if (pass_number == 0u) {
        for (var y = 0; y < shrink; y++) {
            for (var x = 0; x < shrink; x++) {
                sum += bright(picture(at * shrink + vec2<i32>(x, y)), p.threshold);
            }
        }
        return vec4<f32>(sum / f32(shrink * shrink), 1.0);
    }
    if (pass_number < 3u) {
        let along = select(vec2<i32>(0, 1), vec2<i32>(1, 0), pass_number == 1u);
        let sigma = max(p.radius * f32(original_size().y) / (3.0 * f32(shrink)), 0.1);
        // exp(−i² / 2σ²), each from the one before.
        var step = exp(-0.5 / (sigma * sigma));
        let steeper = step * step;
        var weight = 1.0;
        var weights = 1.0;
        sum = picture(at).rgb;
        for (var i = 1; i <= 8; i++) {
            weight *= step;
            step *= steeper;
            sum += weight * (picture(at + i * along).rgb + picture(at - i * along).rgb);
            weights += 2.0 * weight;
        }
        return vec4<f32>(sum / weights, 1.0);
    }
    let here = original(at);
    // Between the middles of four pixels of the smaller image.
    let place = (vec2<f32>(at) + 0.5) / f32(shrink) - 0.5;
    let corner = floor(place);
    let f = place - corner;
    let c = vec2<i32>(corner);
    let above = mix(picture(c).rgb, picture(c + vec2<i32>(1, 0)).rgb, f.x);
    let below = mix(picture(c + vec2<i32>(0, 1)).rgb, picture(c + vec2<i32>(1, 1)).rgb, f.x);
    return vec4<f32>(here.rgb + mix(above, below, f.y) * p.strength, here.a);
}
