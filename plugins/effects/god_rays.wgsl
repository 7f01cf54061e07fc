// effect: god_rays
// about: shafts of sunlight between objects in front of the sky
// hook: image
// view: before
// off: strength = 0
// param strength = 0.6 in 0..10: how bright the shafts are
// param reach = 0.9 in 0.05..1: how far they reach, as a share of the way to the sun
// param decay = 1.5 in 0..10: how fast they fade: brightness at their end is e to the power of minus this
// param radius = 0.6 in 0.02..10: width of the bright sky around the sun, as a share of the image's height
// param samples = int(64) in 8..256: samples along the way to the sun
// param color = rgb(1, 0.9, 0.7): color of the light
//
// Radial light scattering (Mitchell, "Volumetric Light Scattering as a Post-Process", GPU Gems 3, chapter 13): the sky that is seen
// towards the sun is summed along the line from the pixel to it; what stands before the sky takes its share away.

fn effect(at: vec2<i32>, pass_number: u32, p: Parameters) -> vec4<f32> {
    let here = picture(at);
    let sun = sun_at();
    if (sun.z < 0.5) { return here; }
    let start = vec2<f32>(at) + 0.5;
    let way = (sun.xy - start) * p.reach;
    let count = p.samples;
    let wide = p.radius * resolution().y;
    // Turned by a noise of the pixel, steps are not seen.
    let jitter = fract(52.9829189 * fract(dot(vec2<f32>(at), vec2<f32>(0.06711056, 0.00583715))));
    var light = vec3<f32>(0.0);
    for (var i = 0; i < count; i++) {
        let share = (f32(i) + jitter) / f32(count);
        let place = start + way * share;
        let pixel = vec2<i32>(floor(place));
        let off = (place - sun.xy) / wide;
        let sky = select(0.0, exp(-dot(off, off) - p.decay * share), depth_at(pixel) > 1e8);
        light += sky * clamp(picture(pixel).rgb, vec3<f32>(0.0), vec3<f32>(100.0));
    }
    // It fades as the sun goes out of view beside the camera.
    let ahead = -(view_from_world() * vec4<f32>(sun_direction(), 0.0)).z;
    let scale = p.strength * smoothstep(0.0, 0.3, ahead) / f32(count);
    return vec4<f32>(here.rgb + light * scale * p.color, here.a);
}
