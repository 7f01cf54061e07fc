// The fragment shader of the scene: linear colour out, the target encodes sRGB.

@if(UV0 || UV1)
fn texture_uv(in: VertexOut, slot: u32) -> vec2<f32> {
    @if(UV0 && !UV1) let uv = in.uv0;
    @if(UV1 && !UV0) let uv = in.uv1;
    @if(UV0 && UV1) let uv = select(in.uv0, in.uv1, material.uv[slot].x.w > 0.5);
    @if(!UV_TRANSFORM) return uv;
    @if(UV_TRANSFORM)
    let t = material.uv[slot];
    return vec2(dot(t.x.xy, uv) + t.x.z, dot(t.y.xy, uv) + t.y.z);
    @end
}
@end

@fragment
fn fs(in: VertexOut, @builtin(front_facing) front: bool) -> @location(0) vec4<f32> {
    var base = material.base_color;
    @if(VERTEX_COLOR || TINT) base *= in.color;
    @if(BASE_COLOR_TEXTURE) base *= textureSample(base_color_texture, base_color_sampler, texture_uv(in, 0u));
    @if(ALPHA_MASK) if (base.a < material.alpha_cutoff) { discard; }
    @if(BLEND) let alpha = base.a;
    @if(!BLEND) let alpha = 1.0;

    @if(!LIT) var color = base.rgb;

    @if(LIT)
    var n = unit(in.normal);
    @if(NORMAL_TEXTURE)
    // MikkTSpace: the interpolated vectors are not made orthogonal again.
    let b = cross(in.normal, in.tangent.xyz) * in.tangent.w;
    var t = textureSample(normal_texture, normal_sampler, texture_uv(in, 2u)).xyz * 2.0 - 1.0;
    t = vec3(t.xy * material.normal_scale, t.z);
    n = unit(t.x * in.tangent.xyz + t.y * b + t.z * in.normal);
    @end
    @if(DOUBLE_SIDED) n = select(-n, n, front);
    let v = unit(frame.eye.xyz - in.relative * frame.eye.w);
    @end

    @if(METALLIC_ROUGHNESS)
    var metallic = material.metallic;
    var roughness = material.roughness;
    @if(METALLIC_ROUGHNESS_TEXTURE)
    let mr = textureSample(metallic_roughness_texture, metallic_roughness_sampler, texture_uv(in, 1u));
    roughness *= mr.g;
    metallic *= mr.b;
    @end
    var specular = material.specular;
    @if(SPECULAR_TEXTURE) specular *= textureSample(specular_texture, specular_sampler, texture_uv(in, 5u)).a;
    @end
    @if(LIT)
    var specular_color = material.specular_color;
    @if(SPECULAR_COLOR_TEXTURE) specular_color *= textureSample(specular_color_texture, specular_color_sampler, texture_uv(in, 6u)).rgb;
    @end
    @if(LIT && !TOON)
    var occlusion = 1.0;
    @if(OCCLUSION_TEXTURE) occlusion += material.occlusion_strength * (textureSample(occlusion_texture, occlusion_sampler, texture_uv(in, 3u)).r - 1.0);
    @end

    @if(METALLIC_ROUGHNESS)
    let s = surface_of(base.rgb, metallic, roughness, specular, specular_color);
    let nv = clamp(dot(n, v), 0.001, 1.0);
    var color = (s.diffuse * ambient(n) + ambient(reflect(-v, n)) * ambient_specular(s.f0, s.f90, s.roughness, nv)) * occlusion;
    @end
    @if(BLINN_PHONG) var color = base.rgb * ambient(n) * occlusion;
    @if(TOON)
    @if(TINT) specular_color *= in.color.rgb;
    var shift = material.toon.x;
    @if(SPECULAR_TEXTURE) shift += material.toon.w * textureSample(specular_texture, specular_sampler, texture_uv(in, 5u)).r;
    // All the light that there is, for the rim.
    var lighting = toon_ambient(n);
    var color = base.rgb * lighting;
    @end

    @if(LIT && !ONE_LIGHT)
    for (var i = 0u; i < frame.light_count; i++) {
        let light = lights[i];
    @end
    // One light, the usual case: no loop, and no branch that lavapipe would have to mask.
    @if(ONE_LIGHT)
    {
        let light = lights[0];
    @end
    @if(LIT)
        @if(LOCAL_LIGHTS) let arriving = incoming(light, in.relative);
        @if(LOCAL_LIGHTS) let l = arriving.direction;
        @if(LOCAL_LIGHTS) let light_color = arriving.color;
        @if(!LOCAL_LIGHTS) let l = -light.direction.xyz;
        @if(!LOCAL_LIGHTS) let light_color = light.color.xyz;
        // Behind the surface nl is 0, and everything it is multiplied with is finite.
        let nl = clamp(dot(n, l), 0.0, 1.0);
        @if(METALLIC_ROUGHNESS) color += reflect_light(s, n, v, l, nv, nl) * light_color * nl;
        @if(TOON) color += mix(specular_color, base.rgb, toon_lit(dot(n, l), shift)) * light_color;
        @if(TOON) lighting += light_color;
        @if(BLINN_PHONG) color += reflect_light(base.rgb, specular_color, n, v, l) * light_color * nl;
    }
    @end

    @if(TOON)
    var rim = toon_rim(n, v);
    @if(METALLIC_ROUGHNESS_TEXTURE) rim += material.matcap.xyz * textureSample(metallic_roughness_texture, metallic_roughness_sampler, matcap_uv(n, v)).rgb;
    @if(OCCLUSION_TEXTURE) rim *= textureSample(occlusion_texture, occlusion_sampler, texture_uv(in, 3u)).rgb;
    color += rim * mix(vec3(1.0), lighting, material.rim_lighting_mix);
    @end

    @if(EMISSIVE && !EMISSIVE_TEXTURE) color += material.emissive;
    @if(EMISSIVE_TEXTURE) color += material.emissive * textureSample(emissive_texture, emissive_sampler, texture_uv(in, 4u)).rgb;
    return vec4(color, alpha);
}
