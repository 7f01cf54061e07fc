// Layers over, in or behind a metallic-roughness surface: clearcoat, sheen, transmission, thin films. Times π, as in brdf.wgsl.
// CPU reference: core/render/src/cpu/layers.rs, thin_film.rs.

@if(CLEARCOAT)
// Schlick's Fresnel of a coat of index 1.5 (KHR_materials_clearcoat, "Layering": by the angle to the viewer).
fn coat_fresnel(nv: f32) -> f32 {
    let x = 1.0 - nv;
    let x2 = x * x;
    return 0.04 + 0.96 * (x2 * x2 * x);
}

// GGX distribution times visibility of the coat, as for the surface below, without Fresnel.
fn coat_lobe(roughness: f32, n: vec3<f32>, v: vec3<f32>, l: vec3<f32>, nv: f32, nl: f32) -> f32 {
    let nh = clamp(dot(n, unit(l + v)), 0.0, 1.0);
    let alpha = roughness * roughness;
    let a2 = alpha * alpha;
    let d = nh * nh * (a2 - 1.0) + 1.0;
    let smith = nl * sqrt(nv * nv * (1.0 - a2) + a2) + nv * sqrt(nl * nl * (1.0 - a2) + a2);
    return 0.5 * a2 / (d * d * smith);
}
@end

@if(SHEEN)
// "Charlie" distribution (Estevez & Kulla 2017, eq. 2) with Neubelt's visibility, as KHR_materials_sheen has them.
fn sheen_lobe(roughness: f32, n: vec3<f32>, v: vec3<f32>, l: vec3<f32>, nv: f32, nl: f32) -> f32 {
    let nh = clamp(dot(n, unit(l + v)), 0.0, 1.0);
    let inverse = 1.0 / (roughness * roughness);
    let sine = max(1.0 - nh * nh, 1e-6);
    return (2.0 + inverse) * pow(sine, inverse * 0.5) * 0.125 / (nl + nv - nl * nv);
}

// Directional albedo of the sheen: its share of a white sky, at most 1, fitted to the integral of the lobe; see the CPU
// reference.
fn sheen_albedo(roughness: f32, nv: f32) -> f32 {
    let r = roughness;
    let height = exp(0.01213 - 0.81006 * r + 0.18394 / (r + 0.1));
    let power = 0.95739 + 4.27803 * r - 2.72933 * r * r + 0.90085 / r;
    let width = 0.98406 - 0.81087 * r + 0.12174 * r * r;
    return clamp(height * pow(1.0 - width * nv, power), 0.0, 1.0);
}
@end

@if(IRIDESCENCE)
fn squared(v: f32) -> f32 {
    return v * v;
}

// Color of one interference term: sensitivity of the eye in Fourier space, as sums of Gaussians (Belcour & Barla, "A Practical
// Extension to Microfacet Theory for the Modeling of Varying Iridescence", 2017, §4), in linear sRGB. `path`: metres; `shift`:
// radians, per channel.
fn film_color(path: f32, shift: vec3<f32>) -> vec3<f32> {
    let phase = 6.2831853 * path;
    let p2 = phase * phase;
    var xyz = vec3(0.84659, 1.0002219, 1.0011225)
        * cos(vec3(1.6810e6, 1.7953e6, 2.2084e6) * phase + shift)
        * exp(-p2 * vec3(4.3278e9, 9.3046e9, 6.6121e9));
    xyz.x += 0.15386831 * cos(2.2399e6 * phase + shift.x) * exp(-p2 * 4.5282e9);
    return vec3(
        dot(vec3(3.2404542, -1.5371385, -0.4985314), xyz),
        dot(vec3(-0.9692660, 1.8760108, 0.0415560), xyz),
        dot(vec3(0.0556434, -0.2040259, 1.0572252), xyz),
    );
}

// Reflectance of a film on a surface (KHR_materials_iridescence, "Iridescence"): the mean of Airy's sum and two further terms.
fn film_reflectance(ior: f32, nanometres: f32, nv: f32, f0: vec3<f32>) -> vec3<f32> {
    // The index of refraction fades to that of air as the thickness goes to zero.
    let eta = mix(1.0, ior, smoothstep(0.0, 0.03, nanometres));
    let inside2 = 1.0 - squared(1.0 / eta) * (1.0 - nv * nv);
    if (inside2 < 0.0) { return vec3(1.0); }
    let inside = sqrt(inside2);
    let x = 1.0 - nv;
    let r0 = squared((eta - 1.0) / (eta + 1.0));
    let r12 = r0 + (1.0 - r0) * (squared(x * x) * x);
    let t121 = 1.0 - r12;
    let root = sqrt(clamp(f0, vec3(0.0), vec3(0.9999)));
    let base = (1.0 + root) / (1.0 - root);
    let r1 = (base - eta) / (base + eta);
    let y = 1.0 - inside;
    let r23 = r1 * r1 + (1.0 - r1 * r1) * (squared(y * y) * y);
    let phi = 3.14159265 + select(vec3(0.0), vec3(3.14159265), base < vec3(eta));
    let path = 2e-9 * eta * nanometres * inside;
    let r123 = min(r12 * r23, vec3(0.9999));
    let step = sqrt(r123);
    let rs = t121 * t121 * r23 / (1.0 - r123);
    var sum = r12 + rs;
    var c = rs - t121;
    c *= step;
    sum += c * 2.0 * film_color(path, phi);
    c *= step;
    sum += c * 2.0 * film_color(2.0 * path, 2.0 * phi);
    return max(sum, vec3(0.0));
}

// Inverse of Schlick's Fresnel: the F0 that gives this reflectance at this angle.
fn film_f0(reflectance: vec3<f32>, nv: f32) -> vec3<f32> {
    let x = 1.0 - nv;
    let x5 = min(x * x * x * x * x, 0.9999);
    return max((reflectance - x5) / (1.0 - x5), vec3(0.0));
}
@end

@if(LAYERS && UV0 || LAYERS && UV1)
fn layer_uv(in: VertexOut, slot: u32) -> vec2<f32> {
    @if(UV0 && !UV1) let uv = in.uv0;
    @if(UV1 && !UV0) let uv = in.uv1;
    @if(UV0 && UV1) let uv = select(in.uv0, in.uv1, layers.uv[slot].x.w > 0.5);
    @if(!UV_TRANSFORM) let placed = uv;
    @if(UV_TRANSFORM) let t = layers.uv[slot];
    @if(UV_TRANSFORM) let placed = vec2(dot(t.x.xy, uv) + t.x.z, dot(t.y.xy, uv) + t.y.z);
    @if(!PARALLAX) return placed;
    @if(PARALLAX) return placed + parallax;
}
@end
