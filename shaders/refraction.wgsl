// Refraction: the scene color copy where the refracted ray leaves the volume. CPU reference: core/render/src/cpu/refraction.rs.

@if(REFRACTION)
// Refracted ray inside the volume by Snell's law, unit length; zero in total reflection.
fn bent(n: vec3<f32>, v: vec3<f32>, ior: f32) -> vec3<f32> {
    let eta = 1.0 / ior;
    let nv = dot(n, v);
    let k = 1.0 - eta * eta * (1.0 - nv * nv);
    if (k < 0.0) { return vec3(0.0); }
    return n * (eta * nv - sqrt(k)) - v * eta;
}

// Scene color where the refracted ray leaves the volume after `depth` metres (glTF-Sample-Viewer, `getVolumeTransmissionRay`),
// blurred by the surface's roughness.
fn behind_glass(relative: vec3<f32>, n: vec3<f32>, v: vec3<f32>, ior: f32, depth: f32, roughness: f32) -> vec3<f32> {
    let clip = frame.clip_from_relative * vec4(relative + bent(n, v, ior) * depth, 1.0);
    let at = clip.xy / max(clip.w, 1e-6) * 0.5 + 0.5;
    let lod = log2(frame.size.y) * roughness * clamp(2.0 * ior - 2.0, 0.0, 1.0);
    return textureSampleLevel(behind_texture, behind_sampler, at, lod).rgb;
}
@end
