// The fragment shader of the scene: linear color out, the target encodes sRGB.
// CPU reference: core/render/src/cpu/shade.rs.

@if(UV_MOTION_MASK) var<private> uv_mask: f32;
@if(PARALLAX) var<private> parallax: vec2<f32>;

@if(UV0 || UV1)
fn texture_uv(in: VertexOut, slot: u32) -> vec2<f32> {
    @if(UV0 && !UV1) let uv = in.uv0;
    @if(UV1 && !UV0) let uv = in.uv1;
    @if(UV0 && UV1) let uv = select(in.uv0, in.uv1, material.uv[slot].x.w > 0.5);
    @if(!UV_TRANSFORM) let placed = uv;
    @if(UV_TRANSFORM) let t = material.uv[slot];
    @if(UV_TRANSFORM) let placed = vec2(dot(t.x.xy, uv) + t.x.z, dot(t.y.xy, uv) + t.y.z);
    @if(!UV_MOTION_MASK && !PARALLAX) return placed;
    @if(!UV_MOTION_MASK && PARALLAX) return placed + parallax;
    // UV animation of MToon: rotation about the center, then translation, both scaled by the mask.
    @if(UV_MOTION_MASK)
    let angle = material.uv_motion.z * uv_mask;
    let off = placed - 0.5;
    let turned = vec2(cos(angle) * off.x - sin(angle) * off.y, sin(angle) * off.x + cos(angle) * off.y);
    return turned + 0.5 + material.uv_motion.xy * uv_mask;
    @end
}
@end

@if(UV_MOTION_MASK)
fn read_uv_mask(in: VertexOut) {
    uv_mask = 0.0;
    uv_mask = textureSample(uv_motion_mask_texture, uv_motion_mask_sampler, texture_uv(in, 8u)).b;
}
@end

@if(LIT && LIGHT_CLUSTERS)
// Range of the light lists for the point's cluster. Lights without a range are not listed. CPU reference: `LightClusters::of`.
fn light_list(pixel: vec2<f32>, relative: vec3<f32>) -> vec2<u32> {
    let depth = (frame.clip_from_relative * vec4(relative, 1.0)).w;
    let scale = bitcast<f32>(light_lists[4]);
    let slice = u32(clamp(floor(log2(max(depth, 1e-6)) * scale + bitcast<f32>(light_lists[5])), 0.0, f32(light_lists[2] - 1u)));
    let square = min(vec2<u32>(pixel) / 64u, vec2(light_lists[0] - 1u, light_lists[1] - 1u));
    let cell = 8u + (slice * light_lists[1] + square.y) * light_lists[0] + square.x;
    return vec2(light_lists[cell], light_lists[cell + 1u]);
}
@end

@if(PARALLAX)
// Premecz, "Iterative Parallax Mapping with Slope Information", CESCG 2006: four steps towards where the view ray meets the
// heights in the normal map's alpha. At grazing angles the shift is limited to about three times the depth.
fn read_parallax(in: VertexOut) {
    parallax = vec2(0.0);
    let at = texture_uv(in, 2u);
    let v = frame.eye.xyz - in.relative * frame.eye.w;
    let b = cross(in.normal, in.tangent.xyz) * in.tangent.w;
    let up = dot(v, in.normal);
    // Rows of a texture run downwards, the bitangent upwards.
    let way = vec2(dot(v, in.tangent.xyz), -dot(v, b)) / max(abs(up), 0.3 * length(v));
    var depth = 0.0;
    for (var i = 0; i < 4; i++) {
        let texel = textureSample(normal_texture, normal_sampler, at + parallax);
        let below = (texel.a - 1.0) * material.parallax_depth;
        depth += (below - depth) * clamp(texel.z * 2.0 - 1.0, 0.0, 1.0);
        parallax = way * depth;
    }
}
@end

@if(!LIGHT_PASS)
// Fault records are side effects, with which hidden pixels would be shaded; early tests prevent that if nothing is discarded.
@if(FAULT_RECORDS && SURFACE && !ALPHA_MASK && !COVERAGE && !PEEL_PASS || FAULT_RECORDS && LIGHTING && !ALPHA_MASK && !COVERAGE && !PEEL_PASS) @early_depth_test(force)
@fragment
@if(!GEOMETRY) fn fs(in: VertexOut, @builtin(front_facing) front: bool) -> @location(0) vec4<f32> {
@if(GEOMETRY) fn fs(in: VertexOut, @builtin(front_facing) front: bool) -> GBuffer {
    @if(SURFACE || LIGHTING) effect_at(in.position.xy);
    @if(UV_MOTION_MASK) read_uv_mask(in);
    @if(PARALLAX) read_parallax(in);
    @if(TRIPLANAR) read_planes(in);
    var base = material.base_color;
    @if(VERTEX_COLOR || TINT) base *= in.color;
    @if(BASE_COLOR_TEXTURE && !TRIPLANAR) base *= textureSample(base_color_texture, base_color_sampler, texture_uv(in, 0u));
    @if(BASE_COLOR_TEXTURE && TRIPLANAR) base *= from_three_sides(base_color_texture, base_color_sampler, 0u);
    @if(ALPHA_MASK && !COVERAGE) if (base.a < material.alpha_cutoff) { discard; }
    @if(COVERAGE)
    // The alpha is sharpened so that edges are one pixel wide, independent of the texture's own gradient (Golus, "Anti-aliased
    // Alpha Test: The Esoteric Alpha To Coverage", 2017), and rounded to whole samples of four. A sixteenth less, so that devices
    // that round and those that compare keep equal numbers.
    let edge = max(abs(dpdxFine(base.a)) + abs(dpdyFine(base.a)), 0.0001);
    let kept = floor(clamp((base.a - material.alpha_cutoff) / edge + 0.5, 0.0, 1.0) * 4.0 + 0.5);
    if (kept < 1.0) { discard; }
    let alpha = select(kept * 0.25 - 0.0625, 1.0, kept > 3.5);
    @end
    @if(BLEND) let alpha = base.a;
    @if(!BLEND && !COVERAGE) let alpha = 1.0;

    @if(!LIT) var color = base.rgb;

    @if(LIT)
    var n = unit(in.normal);
    @if(CLEARCOAT) var coat_n = n;
    @if(SHADOW || GEOMETRY) var own_n = n;
    // MikkTSpace: the interpolated vectors are not made orthogonal again.
    @if(TANGENT) let b = cross(in.normal, in.tangent.xyz) * in.tangent.w;
    @if(NORMAL_TEXTURE && TRIPLANAR) n = triplanar_normal(in);
    @if(NORMAL_TEXTURE && !TRIPLANAR)
    var t = textureSample(normal_texture, normal_sampler, texture_uv(in, 2u)).xyz * 2.0 - 1.0;
    t = vec3(t.xy * material.normal_scale, t.z);
    n = unit(t.x * in.tangent.xyz + t.y * b + t.z * in.normal);
    @end
    @if(CLEARCOAT_NORMAL_TEXTURE)
    var c = textureSample(clearcoat_normal_texture, clearcoat_normal_sampler, layer_uv(in, 2u)).xyz * 2.0 - 1.0;
    c = vec3(c.xy * layers.clearcoat_normal_scale, c.z);
    coat_n = unit(c.x * in.tangent.xyz + c.y * b + c.z * in.normal);
    @end
    @if(DOUBLE_SIDED) n = select(-n, n, front);
    @if(DOUBLE_SIDED && SHADOW || DOUBLE_SIDED && GEOMETRY) own_n = select(-own_n, own_n, front);
    @if(DOUBLE_SIDED && CLEARCOAT) coat_n = select(-coat_n, coat_n, front);
    let v = unit(frame.eye.xyz - in.relative * frame.eye.w);
    @end

    @if(METALLIC_ROUGHNESS)
    var metallic = material.metallic_roughness.metallic;
    var roughness = material.metallic_roughness.roughness;
    @if(METALLIC_ROUGHNESS_TEXTURE)
    let mr = textureSample(metallic_roughness_texture, metallic_roughness_sampler, texture_uv(in, 1u));
    roughness *= mr.g;
    metallic *= mr.b;
    @end
    var specular = material.metallic_roughness.specular;
    @if(SPECULAR_TEXTURE) specular *= textureSample(specular_texture, specular_sampler, texture_uv(in, 5u)).a;
    @end
    @if(TOON) var shade_color = material.toon.shade_color;
    @if(SHADE_COLOR_TEXTURE) shade_color *= textureSample(shade_color_texture, shade_color_sampler, texture_uv(in, 6u)).rgb;
    @if(LIT && !TOON)
    @if(METALLIC_ROUGHNESS) var specular_color = material.metallic_roughness.specular_color;
    @if(BLINN_PHONG) var specular_color = material.phong.specular_color;
    @if(SPECULAR_COLOR_TEXTURE && !TRIPLANAR) specular_color *= textureSample(specular_color_texture, specular_color_sampler, texture_uv(in, 6u)).rgb;
    @if(SPECULAR_COLOR_TEXTURE && TRIPLANAR) specular_color *= from_three_sides(specular_color_texture, specular_color_sampler, 6u).rgb;
    @end
    @if(LIT && !TOON)
    var occlusion = 1.0;
    @if(OCCLUSION_TEXTURE) occlusion += material.occlusion_strength * (textureSample(occlusion_texture, occlusion_sampler, texture_uv(in, 3u)).r - 1.0);
    @end

    // A reflection replaces its share of the base color, so that no surface reflects more light than it gets: a reflectivity of 1
    // is a mirror.
    @if(REFLECTION) let mirrored_part = mirrored_share(in);
    @if(REFLECTION) base = vec4(base.rgb * (vec3(1.0) - mirrored_part), base.a);

    @if(METALLIC_ROUGHNESS) var s = surface_of(base.rgb, metallic, roughness, specular, specular_color);
    @if(GEOMETRY)
    var emitted = material.emissive;
    @if(EMISSIVE_TEXTURE) emitted *= textureSample(emissive_texture, emissive_sampler, texture_uv(in, 4u)).rgb;
    return pack_gbuffer(in.position.z, n, own_n, s, occlusion, emitted);
}
    @end
    @end
@if(LIGHT_PASS)
// Lights the surface that the G-buffer holds for this pixel.
@fragment
fn fs(at: LightOut) -> @location(0) vec4<f32> {
    @if(SURFACE) effect_at(at.position.xy);
    let stored = gbuffer_at(at.position);
    let in = stored.place;
    let front = true;
    let n = stored.normal;
    @if(SHADOW) let own_n = in.normal;
    let v = unit(frame.eye.xyz - in.relative * frame.eye.w);
    var s = stored.surface;
    let occlusion = stored.occlusion;
    let alpha = 1.0;
@end

    @if(!GEOMETRY)
    @if(METALLIC_ROUGHNESS)
    let nv = clamp(dot(n, v), 0.001, 1.0);
    var sky_f0 = s.f0;
    var mirror = reflect(-v, n);
    @if(ANISOTROPY)
    var direction = vec2(1.0, 0.0);
    var anisotropy = layers.anisotropy;
    @if(ANISOTROPY_TEXTURE)
    let brushed = textureSample(anisotropy_texture, anisotropy_sampler, layer_uv(in, 9u)).xyz;
    direction = brushed.xy * 2.0 - 1.0;
    anisotropy *= brushed.z;
    @end
    let turn = layers.anisotropy_direction;
    direction = vec2(turn.x * direction.x - turn.y * direction.y, turn.y * direction.x + turn.x * direction.y);
    s.along = unit(direction.x * in.tangent.xyz + direction.y * b);
    s.across = unit(cross(n, s.along));
    let alpha_across = s.roughness * s.roughness;
    s.alphas = vec2(mix(alpha_across, 1.0, anisotropy * anisotropy), alpha_across);
    // The sky is reflected across the direction of the brushing ("Bent normal" of the extension's implementation notes).
    let fan = unit(cross(cross(s.across, v), s.across));
    let straight = 1.0 - anisotropy * (1.0 - s.roughness);
    let straight2 = straight * straight;
    mirror = reflect(-v, unit(mix(fan, n, straight2 * straight2)));
    @end
    @if(IRIDESCENCE)
    s.film_share = layers.iridescence;
    @if(IRIDESCENCE_TEXTURE) s.film_share *= textureSample(iridescence_texture, iridescence_sampler, layer_uv(in, 7u)).r;
    var thickness = layers.iridescence_thickness.y;
    @if(IRIDESCENCE_THICKNESS_TEXTURE) thickness = mix(layers.iridescence_thickness.x, thickness, textureSample(iridescence_thickness_texture, iridescence_thickness_sampler, layer_uv(in, 8u)).g);
    s.film = film_reflectance(layers.iridescence_ior, thickness, nv, s.f0);
    sky_f0 = mix(s.f0, film_f0(s.film, nv), s.film_share);
    @end
    @if(VOLUME || REFRACTION)
    var depth = layers.thickness * in.scale;
    @if(THICKNESS_TEXTURE) depth *= textureSample(thickness_texture, thickness_sampler, layer_uv(in, 6u)).g;
    @end
    @if(VOLUME) let absorbed = exp(-layers.extinction * depth);
    @if(TRANSMISSION)
    // Transmission of the light that is neither reflected nor scattered (KHR_materials_transmission), less the absorption of the
    // volume (KHR_materials_volume, Beer-Lambert). Thin glass has no blurred image of the scene behind it: the share that a rough
    // surface blurs is replaced by the environment light along the ray.
    var transmission = layers.transmission * (1.0 - metallic);
    @if(TRANSMISSION_TEXTURE) transmission *= textureSample(transmission_texture, transmission_sampler, layer_uv(in, 5u)).r;
    var through = base.rgb * transmission * (vec3(1.0) - ambient_specular(s.f0, s.f90, s.roughness, nv));
    @if(VOLUME) through *= absorbed;
    let blurred = roughness * roughness;
    s.diffuse *= 1.0 - transmission;
    @end
    @if(REFRACTION)
    var behind = behind_glass(in.relative, n, v, layers.iors.y, depth, roughness);
    @if(DISPERSION) behind.x = behind_glass(in.relative, n, v, layers.iors.x, depth, roughness).x;
    @if(DISPERSION) behind.z = behind_glass(in.relative, n, v, layers.iors.z, depth, roughness).z;
    @end
    @if(DIFFUSE_TRANSMISSION)
    // A share of the diffuse light comes from behind instead (KHR_materials_diffuse_transmission), less the reflected part.
    var from_behind = layers.diffuse_transmission;
    @if(DIFFUSE_TRANSMISSION_TEXTURE) from_behind *= textureSample(diffuse_transmission_texture, diffuse_transmission_sampler, layer_uv(in, 10u)).a;
    var behind_color = layers.diffuse_transmission_color;
    @if(DIFFUSE_TRANSMISSION_COLOR_TEXTURE) behind_color *= textureSample(diffuse_transmission_color_texture, diffuse_transmission_color_sampler, layer_uv(in, 11u)).rgb;
    @if(VOLUME) behind_color *= absorbed;
    let grazing = 1.0 - nv;
    let reflected_here = s.f0 + (vec3(s.f90) - s.f0) * (grazing * grazing * grazing * grazing * grazing);
    behind_color *= from_behind * (1.0 - metallic) * (1.0 - max(reflected_here.x, max(reflected_here.y, reflected_here.z)));
    s.diffuse *= 1.0 - from_behind;
    @end
    @if(SHEEN)
    var sheen_color = layers.sheen_color;
    @if(SHEEN_COLOR_TEXTURE) sheen_color *= textureSample(sheen_color_texture, sheen_color_sampler, layer_uv(in, 3u)).rgb;
    var sheen_roughness = layers.sheen_roughness;
    @if(SHEEN_ROUGHNESS_TEXTURE) sheen_roughness *= textureSample(sheen_roughness_texture, sheen_roughness_sampler, layer_uv(in, 4u)).a;
    sheen_roughness = max(sheen_roughness, 0.07);
    let sheen_share = sheen_albedo(sheen_roughness, nv);
    // The surface below gets only the light that the sheen leaves ("Albedo-Scaling technique", with the angle to the viewer).
    let below_sheen = 1.0 - max(sheen_color.x, max(sheen_color.y, sheen_color.z)) * sheen_share;
    var sheen = ambient(n) * sheen_share * occlusion;
    @end
    @if(CLEARCOAT)
    var coat_weight = layers.clearcoat;
    @if(CLEARCOAT_TEXTURE) coat_weight *= textureSample(clearcoat_texture, clearcoat_sampler, layer_uv(in, 0u)).r;
    var coat_roughness = layers.clearcoat_roughness;
    @if(CLEARCOAT_ROUGHNESS_TEXTURE) coat_roughness *= textureSample(clearcoat_roughness_texture, clearcoat_roughness_sampler, layer_uv(in, 1u)).g;
    coat_roughness = max(coat_roughness, 0.045);
    let coat_nv = clamp(dot(coat_n, v), 0.001, 1.0);
    coat_weight *= coat_fresnel(coat_nv);
    var coat = mirrored(reflect(-v, coat_n), coat_roughness) * occlusion;
    @end
    var color = (s.diffuse * ambient(n) + mirrored(mirror, s.roughness) * ambient_specular(sky_f0, s.f90, s.roughness, nv)) * occlusion;
    @if(DIFFUSE_TRANSMISSION) color += behind_color * ambient(-n) * occlusion;
    @end
    @if(BLINN_PHONG) var color = base.rgb * ambient(n) * occlusion;
    @if(REFLECTION) color += mirrored_part * surroundings(reflect(-v, n)) * occlusion;
    @if(TOON)
    @if(TINT) shade_color *= in.color.rgb;
    var shift = material.toon.shading_shift;
    @if(SHADING_SHIFT_TEXTURE) shift += material.toon.shading_shift_scale * textureSample(shading_shift_texture, shading_shift_sampler, texture_uv(in, 5u)).r;
    // Sum of all light, for the rim.
    var lighting = toon_ambient(n);
    var color = base.rgb * lighting;
    @end

    @if(EFFECT_SHADOW && SHADOW) light_whole = luminance(ambient(own_n));

    @if(LIT && LIGHT_CLUSTERS)
    let listed = light_list(in.position.xy, in.relative);
    let everywhere = light_lists[3];
    for (var i = 0u; i < everywhere + listed.y - listed.x; i++) {
        var index = i;
        if (i >= everywhere) { index = light_lists[listed.x + i - everywhere]; }
        let light = lights[index];
    @end
    @if(LIT && !ONE_LIGHT && !LIGHT_CLUSTERS)
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
        @if(LOCAL_LIGHTS) var light_color = arriving.color;
        @if(!LOCAL_LIGHTS) let l = -light.direction;
        @if(!LOCAL_LIGHTS) var light_color = light.color;
        @if(SHADOW && !DIFFUSE_TRANSMISSION) let share = shadow_share(light, in.relative, own_n, l);
        // Light from behind falls on the back of the surface.
        @if(SHADOW && DIFFUSE_TRANSMISSION) let share = shadow_share(light, in.relative, select(own_n, -own_n, dot(n, l) < 0.0), l);
        @if(EFFECT_SHADOW && SHADOW)
        let falling = luminance(light_color) * clamp(dot(own_n, l), 0.0, 1.0);
        light_whole += falling;
        light_lost += falling * (1.0 - share);
        @end
        @if(LIGHTING) let arrived = light_color;
        @if(SHADOW && !TOON) light_color *= share;
        // Light from behind the surface has nl = 0, and all other factors are finite.
        let nl = clamp(dot(n, l), 0.0, 1.0);
        @if(METALLIC_ROUGHNESS) let lit = reflect_light(s, n, v, l, nv, nl) * light_color * nl;
        @if(DIFFUSE_TRANSMISSION) color += behind_color * light_color * clamp(-dot(n, l), 0.0, 1.0);
        @if(TOON && !SHADOW) color += mix(shade_color, base.rgb, toon_lit(dot(n, l), shift)) * light_color;
        @if(TOON && SHADOW) color += mix(shade_color, base.rgb, toon_lit(dot(n, l), shift) * share) * light_color;
        @if(TOON) lighting += light_color;
        @if(SHEEN) sheen += sheen_lobe(sheen_roughness, n, v, l, nv, max(nl, 0.001)) * light_color * nl;
        @if(CLEARCOAT) let coat_nl = clamp(dot(coat_n, l), 0.0, 1.0);
        @if(CLEARCOAT) coat += coat_lobe(coat_roughness, coat_n, v, l, coat_nv, coat_nl) * light_color * coat_nl;
        @if(BLINN_PHONG) let lit = reflect_light(base.rgb, specular_color, n, v, l) * light_color * nl;
        @if(!TOON && !LIGHTING) color += lit;
        @if(LIGHTING && SHADOW) color += light_effects(LightSample(dot(n, l), share, arrived, base.rgb, n, v, l, lit));
        @if(LIGHTING && !SHADOW) color += light_effects(LightSample(dot(n, l), 1.0, arrived, base.rgb, n, v, l, lit));
    }
    @end

    @if(TOON)
    var rim = toon_rim(n, v);
    @if(MATCAP_TEXTURE) rim += material.toon.matcap * textureSample(matcap_texture, matcap_sampler, matcap_uv(n, v)).rgb;
    @if(RIM_TEXTURE) rim *= textureSample(rim_texture, rim_sampler, texture_uv(in, 3u)).rgb;
    color += rim * mix(vec3(1.0), lighting, material.toon.rim_lighting_mix);
    @end

    @if(TRANSMISSION && !REFRACTION) color += through * blurred * mirrored(-v, s.roughness);
    @if(SHEEN) color = color * below_sheen + sheen_color * sheen;
    @if(EMISSIVE && LIGHT_PASS) color += stored.emitted;
    @if(EMISSIVE && !EMISSIVE_TEXTURE && !LIGHT_PASS) color += material.emissive;
    @if(EMISSIVE_TEXTURE) color += material.emissive * textureSample(emissive_texture, emissive_sampler, texture_uv(in, 4u)).rgb;
    @if(CLEARCOAT) color = mix(color, coat, coat_weight);
    @if(EXPOSURE && LIT) color *= frame.exposure;
    // The view transform does not apply to toon shading, which gives display colors.
    @if(VIEW_TRANSFORM && LIT && !TOON) color = view_transform(color);
    @if(REFRACTION)
    // The scene color copy holds display colors already.
    behind *= through;
    @if(SHEEN) behind *= below_sheen;
    @if(CLEARCOAT) behind *= 1.0 - coat_weight;
    color += behind;
    @end
    @if(OUTLINE || WIREFRAME) color = material.outline.color * mix(vec3(1.0), color, material.outline.lighting_mix);
    @if(LIGHTING) if (effect_light_failed) { color = vec3(1.0, 0.0, 1.0); }
    @if(!GLASS && !SURFACE) return vec4(color, alpha);
    @if(!GLASS && SURFACE && !COVERAGE) return surface_effects(vec4(color, alpha), surface_sample(in, front));
    @if(SURFACE && COVERAGE) return vec4(surface_effects(vec4(color, 1.0), surface_sample(in, front)).rgb, alpha);
    // Thin glass is drawn twice: first the image behind is multiplied by the transmitted color, then the light of the surface is
    // added.
    @if(GLASS_LIGHT && !SURFACE) return vec4(color * alpha, alpha);
    @if(GLASS_LIGHT && SURFACE) return vec4(surface_effects(vec4(color, alpha), surface_sample(in, front)).rgb * alpha, alpha);
    @if(GLASS_FILTER)
    through *= 1.0 - blurred;
    @if(SHEEN) through *= below_sheen;
    @if(CLEARCOAT) through *= 1.0 - coat_weight;
    return vec4(mix(vec3(1.0), through, alpha), alpha);
    @end
}
    @end
