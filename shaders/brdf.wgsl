// Shading formulas. choreo's light convention: radiance = π · f · color · intensity · NL, so that a white diffuse
// surface facing a directional light of intensity 1 (π lux, see core/render/src/plan/lights.rs) is 1; the functions below return π · f.
// CPU reference: core/render/src/cpu/brdf.rs.

fn unit(v: vec3<f32>) -> vec3<f32> {
    // A zero vector (a degenerate normal) stays zero instead of turning into NaN.
    return v * inverseSqrt(max(dot(v, v), 1e-20));
}

@if(METALLIC_ROUGHNESS)
struct Surface {
    diffuse: vec3<f32>,
    f0: vec3<f32>,
    f90: f32,
    roughness: f32,
    // Unit directions along and across the stretch of highlights, and the GGX alpha in each.
    @if(ANISOTROPY) along: vec3<f32>,
    @if(ANISOTROPY) across: vec3<f32>,
    @if(ANISOTROPY) alphas: vec2<f32>,
    // Reflectance under a thin film at this angle, and the film's share of the surface.
    @if(IRIDESCENCE) film: vec3<f32>,
    @if(IRIDESCENCE) film_share: f32,
}

// glTF 2.0 Appendix B.3 and KHR_materials_specular.
fn surface_of(base: vec3<f32>, metallic: f32, roughness: f32, specular: f32, specular_color: vec3<f32>) -> Surface {
    let dielectric = min(0.04 * specular_color, vec3(1.0)) * specular;
    var s: Surface;
    s.diffuse = base * (1.0 - metallic);
    s.f0 = mix(dielectric, base, metallic);
    s.f90 = mix(specular, 1.0, metallic);
    s.roughness = max(roughness, 0.045);
    return s;
}

// Diffuse + GGX with Smith's height-correlated visibility (Heitz 2014) and Schlick's Fresnel, times π.
fn reflect_light(s: Surface, n: vec3<f32>, v: vec3<f32>, l: vec3<f32>, nv: f32, nl: f32) -> vec3<f32> {
    let h = unit(l + v);
    let nh = clamp(dot(n, h), 0.0, 1.0);
    let vh = clamp(dot(v, h), 0.0, 1.0);
    @if(!ANISOTROPY)
    let alpha = s.roughness * s.roughness;
    let a2 = alpha * alpha;
    let d = nh * nh * (a2 - 1.0) + 1.0;
    // Distribution a2 / d² and visibility 0.5 / (…) in one division.
    let smith = nl * sqrt(nv * nv * (1.0 - a2) + a2) + nv * sqrt(nl * nl * (1.0 - a2) + a2);
    let lobe = 0.5 * a2 / (d * d * smith);
    @end
    @if(ANISOTROPY)
    // KHR_materials_anisotropy, "Implementation": the same distribution and visibility with an alpha in each direction.
    let at = s.alphas.x;
    let ab = s.alphas.y;
    let a2 = at * ab;
    let d = vec3(ab * dot(s.along, h), at * dot(s.across, h), a2 * nh);
    let w = a2 / dot(d, d);
    let smith = nl * length(vec3(at * dot(s.along, v), ab * dot(s.across, v), nv))
        + nv * length(vec3(at * dot(s.along, l), ab * dot(s.across, l), nl));
    let lobe = 0.5 * a2 * w * w / smith;
    @end
    let x = 1.0 - vh;
    let x2 = x * x;
    @if(!IRIDESCENCE) let fresnel = s.f0 + (vec3(s.f90) - s.f0) * (x2 * x2 * x);
    @if(IRIDESCENCE) let fresnel = mix(s.f0 + (vec3(s.f90) - s.f0) * (x2 * x2 * x), s.film, s.film_share);
    let share = 1.0 - max(fresnel.x, max(fresnel.y, fresnel.z));
    return s.diffuse * share + fresnel * lobe;
}

// "Physically Based Shading on Mobile" (Karis 2014): the split-sum's second half.
fn ambient_specular(f0: vec3<f32>, f90: f32, roughness: f32, nv: f32) -> vec3<f32> {
    let r = roughness * vec4(-1.0, -0.0275, -0.572, 0.022) + vec4(1.0, 0.0425, 1.04, -0.04);
    let a = min(r.x * r.x, exp2(-9.28 * nv)) * r.x + r.y;
    return f0 * (-1.04 * a + r.z) + vec3(f90 * (1.04 * a + r.w));
}
@end

@if(BLINN_PHONG)
// Lambert + normalized Blinn–Phong or Phong, times π.
fn reflect_light(base: vec3<f32>, specular: vec3<f32>, n: vec3<f32>, v: vec3<f32>, l: vec3<f32>) -> vec3<f32> {
    @if(PHONG)
    let rv = clamp(dot(reflect(-l, n), v), 0.0, 1.0);
    return base + specular * ((material.phong.shininess + 2.0) * 0.5 * pow(rv, material.phong.shininess));
    @end
    @if(!PHONG)
    let nh = clamp(dot(n, unit(l + v)), 0.0, 1.0);
    return base + specular * ((material.phong.shininess + 8.0) * 0.125 * pow(nh, material.phong.shininess));
    @end
}
@end

@if(EFFECT_SHADOW)
// ITU-R BT.709.
fn luminance(c: vec3<f32>) -> f32 {
    return dot(c, vec3(0.2126, 0.7152, 0.0722));
}
@end

@if(LIT)
fn hemisphere(n: vec3<f32>) -> vec3<f32> {
    return mix(frame.ambient_down.xyz, frame.ambient_up.xyz, n.y * 0.5 + 0.5);
}

// Environment light on a white diffuse surface with this normal.
fn ambient(n: vec3<f32>) -> vec3<f32> {
    @if(!SKY) return hemisphere(n);
    @if(SKY) return hemisphere(n) + sky_diffuse(n);
}

// Environment light reflected along `way` by a surface of this roughness.
fn mirrored(way: vec3<f32>, roughness: f32) -> vec3<f32> {
    @if(!SKY) return hemisphere(way);
    @if(SKY) return hemisphere(way) + sky_mirrored(way, roughness);
}
@end
