// Image-based light. The maps are computed on the CPU (core/render/src/sky): spherical harmonics for diffuse light, an atlas of
// octahedral maps prefiltered by roughness for specular light.
// CPU reference: core/render/src/cpu/sky.rs.

@if(SKY || SKY_BACKGROUND)
struct Sky {
    // Coefficients of 1, y, z, x, xy, yz, 3z² − 1, xz, x² − y²
    harmonics: array<vec4<f32>, 9>,
    // xy: first texel inside the border; z: side in texels
    levels: array<vec4<f32>, 8>,
    // Cosine and sine of the rotation, strength, index of the last level
    turn: vec4<f32>,
    // xy = 1 / size of the atlas in texels; z = 1 if the sky is the background
    texel: vec4<f32>,
    // A pixel's ray has the direction x · right + y · down + ahead, with x and y from −1 to 1
    right: vec4<f32>,
    down: vec4<f32>,
    ahead: vec4<f32>,
}

@group(2) @binding(5) var<uniform> sky: Sky;

// Direction in the panorama for a direction in the world.
fn sky_turned(way: vec3<f32>) -> vec3<f32> {
    return vec3(sky.turn.x * way.x - sky.turn.y * way.z, way.y, sky.turn.y * way.x + sky.turn.x * way.z);
}
@end

@if(SKY)
@group(2) @binding(6) var sky_map: texture_2d<f32>;
@group(2) @binding(7) var sky_sampler: sampler;

fn sky_diffuse(normal: vec3<f32>) -> vec3<f32> {
    let n = sky_turned(normal);
    let light = sky.harmonics[0].xyz + sky.harmonics[1].xyz * n.y + sky.harmonics[2].xyz * n.z + sky.harmonics[3].xyz * n.x
        + sky.harmonics[4].xyz * (n.x * n.y) + sky.harmonics[5].xyz * (n.y * n.z)
        + sky.harmonics[6].xyz * (3.0 * n.z * n.z - 1.0) + sky.harmonics[7].xyz * (n.x * n.z)
        + sky.harmonics[8].xyz * (n.x * n.x - n.y * n.y);
    return max(light, vec3(0.0)) * sky.turn.z;
}

fn sky_level(place: vec2<f32>, index: u32) -> vec3<f32> {
    let level = sky.levels[index];
    return textureSampleLevel(sky_map, sky_sampler, (level.xy + place * level.z) * sky.texel.xy, 0.0).rgb;
}

fn sky_mirrored(direction: vec3<f32>, roughness: f32) -> vec3<f32> {
    let way = sky_turned(direction);
    let p = way.xz / max(abs(way.x) + abs(way.y) + abs(way.z), 1e-20);
    let folded = (1.0 - abs(p.yx)) * select(vec2(-1.0), vec2(1.0), p >= vec2(0.0));
    let place = select(folded, p, way.y >= 0.0) * 0.5 + 0.5;
    let level = clamp(roughness, 0.0, 1.0) * sky.turn.w;
    let low = floor(level);
    let sharp = sky_level(place, u32(low));
    let rough = sky_level(place, u32(min(low + 1.0, sky.turn.w)));
    return mix(sharp, rough, level - low) * sky.turn.z;
}
@end

@if(SKY_BACKGROUND)
@group(2) @binding(8) var sky_picture: texture_2d<f32>;

// The panorama as the background, interpolated between the four nearest texels: at the seam a sampler's filter would mix both
// ends.
@fragment
fn sky_fs(in: BackgroundOut) -> @location(0) vec4<f32> {
    let at = in.position.xy / frame.size * 2.0 - 1.0;
    let way = sky_turned(normalize(sky.right.xyz * at.x + sky.down.xyz * at.y + sky.ahead.xyz));
    let size = vec2<f32>(textureDimensions(sky_picture));
    let u = 0.5 + atan2(way.x, -way.z) / 6.2831853;
    let v = acos(clamp(way.y, -1.0, 1.0)) / 3.14159265;
    let place = vec2(u, v) * size - 0.5;
    let low = floor(place);
    let t = place - low;
    let last = vec2<i32>(size) - 1;
    let x0 = (i32(low.x) + last.x + 1) % (last.x + 1);
    let x1 = (x0 + 1) % (last.x + 1);
    let y0 = clamp(i32(low.y), 0, last.y);
    let y1 = clamp(i32(low.y) + 1, 0, last.y);
    let above = mix(textureLoad(sky_picture, vec2(x0, y0), 0).rgb, textureLoad(sky_picture, vec2(x1, y0), 0).rgb, t.x);
    let below = mix(textureLoad(sky_picture, vec2(x0, y1), 0).rgb, textureLoad(sky_picture, vec2(x1, y1), 0).rgb, t.x);
    let light = mix(above, below, t.y) * sky.turn.z;
    @if(EXPOSURE || VIEW_TRANSFORM) let color = vec4(displayed(light), 1.0);
    @if(!EXPOSURE && !VIEW_TRANSFORM) let color = vec4(light, 1.0);
    return shown_behind(color, in.position.xy);
}
@end
