// Brings light of any strength into what a screen can show. p[0] curve: 0 ACES, 1 AgX, 2 none; p[1] exposure in stops.
// Twin: `Tonemap::cpu` in lib.rs.

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

// Troy Sobotka's AgX by Benjamin Wrensch's polynomial ("Minimal AgX Implementation", 2023): 16.5 stops, mid grey at 10 of them.
fn agx(color: vec3<f32>) -> vec3<f32> {
    let inset = vec3<f32>(
        dot(vec3<f32>(0.842479062253094, 0.0784335999999992, 0.0792237451477643), color),
        dot(vec3<f32>(0.0423282422610123, 0.878468636469772, 0.0791661274605434), color),
        dot(vec3<f32>(0.0423756549057051, 0.0784336, 0.879142973793104), color),
    );
    let x = clamp((log2(max(inset, vec3<f32>(1e-10))) + 12.47393) / 16.5, vec3<f32>(0.0), vec3<f32>(1.0));
    let x2 = x * x;
    let x4 = x2 * x2;
    let y = 15.5 * x4 * x2 - 40.14 * x4 * x + 31.96 * x4 - 6.868 * x2 * x + 0.4298 * x2 + 0.1191 * x - 0.00232;
    let out = vec3<f32>(
        dot(vec3<f32>(1.19687900512017, -0.0980208811401368, -0.0990297440797205), y),
        dot(vec3<f32>(-0.0528968517574562, 1.15190312990417, -0.0989611768448433), y),
        dot(vec3<f32>(-0.0529716355144438, -0.0980434501171241, 1.15107367264116), y),
    );
    // The curve gives codes of a 2.2 display; the picture is linear.
    return pow(max(out, vec3<f32>(0.0)), vec3<f32>(2.2));
}

fn effect(color: vec4<f32>, uv: vec2<f32>, p: array<f32, 8>) -> vec4<f32> {
    // More than 2²⁴ would overflow the squares.
    let light = clamp(color.rgb * exp2(p[1]), vec3<f32>(0.0), vec3<f32>(16777216.0));
    var mapped = light;
    if (p[0] < 0.5) {
        mapped = aces(light);
    } else if (p[0] < 1.5) {
        mapped = agx(light);
    }
    return vec4<f32>(clamp(mapped, vec3<f32>(0.0), vec3<f32>(1.0)), color.a);
}
