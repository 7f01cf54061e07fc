// effect: tonemap
// about: maps light of any brightness into the range of a screen
// view: replaced
// param curve = aces of aces|agx|neutral|none: how bright colors are rolled off: aces has contrast, agx keeps hues, neutral base colors
// param exposure = 0 in -10..10: stops before the curve: 1 is twice the light

// Stephen Hill's fit of the ACES reference and output transforms, sRGB to sRGB (BakingLab, ACES.hlsl).
fn aces(color: vec3<f32>) -> vec3<f32> {
    let v = vec3<f32>(
        dot(vec3<f32>(0.59719, 0.35458, 0.04823), color),
        dot(vec3<f32>(0.07600, 0.90834, 0.01566), color),
        dot(vec3<f32>(0.02840, 0.13383, 0.83777), color),
    );
    let a = v * (v + 0.0245786) - 0.000090537;
    let b = v * (0.983729 * v + 0.4329510) + 0.238081;
    let c = a / b;
    return vec3<f32>(
        dot(vec3<f32>(1.60475, -0.53108, -0.07367), c),
        dot(vec3<f32>(-0.10208, 1.10813, -0.00605), c),
        dot(vec3<f32>(-0.00327, -0.07276, 1.07602), c),
    );
}

// Troy Sobotka's AgX by Benjamin Wrensch's polynomial ("Minimal AgX Implementation", 2023): 16.5 stops, mid gray at 10 of them.
fn agx(color: vec3<f32>) -> vec3<f32> {
    let inset = vec3<f32>(
        dot(vec3<f32>(0.84247905, 0.0784336, 0.079223745), color),
        dot(vec3<f32>(0.042328242, 0.8784686, 0.07916613), color),
        dot(vec3<f32>(0.042375655, 0.0784336, 0.879143), color),
    );
    let x = clamp((log2(max(inset, vec3<f32>(1e-10))) + 12.47393) / 16.5, vec3<f32>(0.0), vec3<f32>(1.0));
    let x2 = x * x;
    let x4 = x2 * x2;
    let y = 15.5 * x4 * x2 - 40.14 * x4 * x + 31.96 * x4 - 6.868 * x2 * x + 0.4298 * x2 + 0.1191 * x - 0.00232;
    let out = vec3<f32>(
        dot(vec3<f32>(1.196879, -0.09802088, -0.09902974), y),
        dot(vec3<f32>(-0.052896852, 1.1519032, -0.098961174), y),
        dot(vec3<f32>(-0.052971636, -0.09804345, 1.1510737), y),
    );
    // The curve gives codes of a 2.2 display; the image is linear.
    return pow(max(out, vec3<f32>(0.0)), vec3<f32>(2.2));
}

// Khronos PBR Neutral Tone Mapper 1.0.
fn neutral(light: vec3<f32>) -> vec3<f32> {
    let least = min(light.x, min(light.y, light.z));
    let low = min(least, 0.08);
    let color = light - (low - 6.25 * low * low);
    let peak = max(color.x, max(color.y, color.z));
    if (peak < 0.76) {
        return color;
    }
    let shown = 1.0 - 0.0576 / (peak - 0.52);
    let pale = 1.0 - 1.0 / (0.15 * (peak - shown) + 1.0);
    return mix(color * (shown / peak), vec3<f32>(shown), vec3<f32>(pale));
}

fn effect(color: vec4<f32>, uv: vec2<f32>, p: Parameters) -> vec4<f32> {
    // More than 2²⁴ would overflow the squares.
    let light = clamp(color.rgb * exp2(p.exposure), vec3<f32>(0.0), vec3<f32>(16777216.0));
    var mapped = light;
    if (p.curve == CURVE_ACES) {
        mapped = aces(light);
    } else if (p.curve == CURVE_AGX) {
        mapped = agx(light);
    } else if (p.curve == CURVE_NEUTRAL) {
        mapped = neutral(light);
    }
    return vec4<f32>(clamp(mapped, vec3<f32>(0.0), vec3<f32>(1.0)), color.a);
}
