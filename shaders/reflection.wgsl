// Reflections of Blinn–Phong and Phong surfaces. CPU reference: core/render/src/cpu/reflection.rs.

@if(REFLECTION)
// Reflectivity of the surface.
fn mirrored_share(in: VertexOut) -> vec3<f32> {
    var share = material.phong.reflection;
    @if(REFLECTION_TEXTURE && !TRIPLANAR) share *= textureSample(reflection_texture, reflection_sampler, texture_uv(in, 5u)).rgb;
    @if(REFLECTION_TEXTURE && TRIPLANAR) share *= from_three_sides(reflection_texture, reflection_sampler, 5u).rgb;
    return share;
}

@if(!ENVIRONMENT_TEXTURE)
fn surroundings(way: vec3<f32>) -> vec3<f32> {
    return mirrored(way, material.phong.reflection_roughness);
}
@end

// The environment map, an equirectangular panorama. The level is explicit, since texture coordinates jump where the panorama's
// ends meet: its texels are as wide as the directions of the pixel, or as the highlight, whose half vectors lie within α on each
// side.
@if(ENVIRONMENT_TEXTURE)
fn surroundings(way: vec3<f32>) -> vec3<f32> {
    // Any longitude is valid at the poles, but atan2(0, 0) is undefined.
    let flat = select(vec2(way.x, -way.z), vec2(0.0, 1.0), way.x == 0.0 && way.z == 0.0);
    let place = vec2(0.5 + atan2(flat.x, flat.y) / 6.2831853, acos(clamp(way.y, -1.0, 1.0)) / 3.14159265);
    let across = dpdxFine(way);
    let down = dpdyFine(way);
    let angle = max(sqrt(max(dot(across, across), dot(down, down))), 2.0 * material.phong.reflection_roughness * material.phong.reflection_roughness);
    let level = log2(max(angle * f32(textureDimensions(environment_texture).x) / 6.2831853, 1.0));
    return textureSampleLevel(environment_texture, environment_sampler, place, level).rgb;
}
@end
@end
