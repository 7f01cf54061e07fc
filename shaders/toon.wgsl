// MToon (VRMC_materials_mtoon 1.0). CPU reference: core/render/src/cpu/toon.rs.

@if(TOON)
// §"Lighting": share of the lit color, linearstep(−1 + toony, 1 − toony, NL + shift).
fn toon_lit(nl: f32, shift: f32) -> f32 {
    let half = 1.0 - material.toon.shading_toony;
    return clamp((nl + shift + half) / max(2.0 * half, 1e-4), 0.0, 1.0);
}

// §"Global Illumination": rawGi is the hemisphere light, uniformedGi its mean from above and below.
fn toon_ambient(n: vec3<f32>) -> vec3<f32> {
    let even = (ambient(vec3(0.0, 1.0, 0.0)) + ambient(vec3(0.0, -1.0, 0.0))) * 0.5;
    return mix(ambient(n), even, material.toon.gi_equalization);
}

// §"Rim Lighting", parametric.
fn toon_rim(n: vec3<f32>, v: vec3<f32>) -> vec3<f32> {
    let edge = clamp(1.0 - dot(n, v) + material.toon.rim_lift, 0.0, 1.0);
    // pow(0, x) is not defined everywhere.
    return material.toon.rim_color * pow(max(edge, 1e-20), max(material.toon.rim_fresnel_power, 1e-5));
}

// §"MatCap"; v points down in glTF's textures.
fn matcap_uv(n: vec3<f32>, v: vec3<f32>) -> vec2<f32> {
    let x = unit(vec3(v.z, 0.0, -v.x));
    let y = cross(v, x);
    return vec2(dot(x, n), -dot(y, n)) * 0.495 + 0.5;
}
@end
