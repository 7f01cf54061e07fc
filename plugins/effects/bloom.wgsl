// effect: bloom
// about: glow around bright areas: light spills over as in a lens
// hook: image
// view: before
// off: strength = 0
// param strength = 0.3 in 0..10: how much of the blurred light is added
// param threshold = 0.9 in 0..100: brightness above which light spills over
// param radius = 0.03 in 0.001..0.2: reach of the glow, as a share of the image's height
// pass bright = halve radius to 8: the light above the threshold
// pass across = halve radius to 8: that light, blurred across
// pass blurred = halve radius to 8: that light, blurred across and down
//
// Bright areas are drawn into a smaller image in which 8 pixels are three standard deviations or less, blurred by a Gaussian
// across and then down, and added to the image. What is bright is spread over pixels much larger than these, and no finer
// image would show.

fn bright(at: vec2<i32>, p: Parameters) -> vec4<f32> {
    let side = shrink_factor();
    var sum = vec3<f32>(0.0);
    for (var y = 0; y < side; y++) {
        for (var x = 0; x < side; x++) {
            let c = clamp(picture(at * side + vec2<i32>(x, y)).rgb, vec3<f32>(0.0), vec3<f32>(1000.0));
            // The part of the color above the threshold, with its hue.
            let most = max(c.r, max(c.g, c.b));
            sum += c * (max(most - p.threshold, 0.0) / max(most, 1e-6));
        }
    }
    return vec4<f32>(sum / f32(side * side), 1.0);
}

// exp(−i² / 2σ²) of i = 1 in the pixels of a pass; the others follow from it.
fn falloff(p: Parameters) -> f32 {
    let sigma = max(p.radius * f32(original_size().y) / (3.0 * f32(shrink_factor())), 0.1);
    return exp(-0.5 / (sigma * sigma));
}

fn across(at: vec2<i32>, p: Parameters) -> vec4<f32> {
    var step = falloff(p);
    let steeper = step * step;
    var weight = 1.0;
    var weights = 1.0;
    var sum = bright_at(at);
    for (var i = 1; i <= 8; i++) {
        weight *= step;
        step *= steeper;
        sum += weight * (bright_at(at + vec2<i32>(i, 0)) + bright_at(at - vec2<i32>(i, 0)));
        weights += 2.0 * weight;
    }
    return sum / weights;
}

fn blurred(at: vec2<i32>, p: Parameters) -> vec4<f32> {
    var step = falloff(p);
    let steeper = step * step;
    var weight = 1.0;
    var weights = 1.0;
    var sum = across_at(at);
    for (var i = 1; i <= 8; i++) {
        weight *= step;
        step *= steeper;
        sum += weight * (across_at(at + vec2<i32>(0, i)) + across_at(at - vec2<i32>(0, i)));
        weights += 2.0 * weight;
    }
    return sum / weights;
}

fn effect(at: vec2<i32>, p: Parameters) -> vec4<f32> {
    let here = picture(at);
    return vec4<f32>(here.rgb + blurred_uv(uv_at(at)).rgb * p.strength, here.a);
}
