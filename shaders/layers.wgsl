// What lies over, in or behind a metallic-roughness surface: clearcoat, sheen, transmission. Times π, as in brdf.wgsl.

@if(CLEARCOAT)
// Schlick's Fresnel of a coat of index 1.5 (KHR_materials_clearcoat, "Layering": by the angle to the viewer).
fn coat_fresnel(nv: f32) -> f32 {
    let x = 1.0 - nv;
    let x2 = x * x;
    return 0.04 + 0.96 * (x2 * x2 * x);
}

// Distribution times visibility of the coat: GGX as the surface below has it, without Fresnel.
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

// How much of a white sky such a sheen gives back, at most 1: fitted to the integral of the lobe; see the CPU twin.
fn sheen_albedo(roughness: f32, nv: f32) -> f32 {
    let r = roughness;
    let height = exp(0.01213 - 0.81006 * r + 0.18394 / (r + 0.1));
    let power = 0.95739 + 4.27803 * r - 2.72933 * r * r + 0.90085 / r;
    let width = 0.98406 - 0.81087 * r + 0.12174 * r * r;
    return clamp(height * pow(1.0 - width * nv, power), 0.0, 1.0);
}
@end

@if(LAYERS && UV0 || LAYERS && UV1)
fn layer_uv(in: VertexOut, slot: u32) -> vec2<f32> {
    @if(UV0 && !UV1) let uv = in.uv0;
    @if(UV1 && !UV0) let uv = in.uv1;
    @if(UV0 && UV1) let uv = select(in.uv0, in.uv1, layers.uv[slot].x.w > 0.5);
    @if(!UV_TRANSFORM) return uv;
    @if(UV_TRANSFORM)
    let t = layers.uv[slot];
    return vec2(dot(t.x.xy, uv) + t.x.z, dot(t.y.xy, uv) + t.y.z);
    @end
}
@end
