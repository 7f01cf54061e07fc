// effect: fog
// about: fog that hides distant objects, thicker near the ground
// hook: surface
// background: not sky
// off: density = 0
// param density = 0.08 in 0..10: approximate share of the light lost per metre
// param start = 0 m in 0..1000000: distance from the camera at which the fog starts
// param height = 0 m in -10000..10000: height above which the fog thins
// param falloff = 0 1/m in 0..100: how fast the fog thins with height; 0: equally thick everywhere
// param sky = true: the fog has the color of the background or sky, so that objects fade into it
// param color = rgb(0.6, 0.65, 0.7): color of the fog where sky is false
//
// Beer–Lambert: exp(−∫ density ds), integrated in closed form along the ray to the viewer (as Wenzel, "Real-time Atmospheric
// Effects in Games", SIGGRAPH 2006 course, but with as much fog everywhere below the height). Where its color is the sky's,
// nothing of the background changes.

// How much of unit density lies below a height above the one from which the fog thins.
fn fog_up_to(y: f32, falloff: f32) -> f32 {
    if (y > 0.0) { return (1.0 - exp(-falloff * y)) / falloff; }
    return y;
}

fn mean_density(low: f32, high: f32, falloff: f32) -> f32 {
    let rise = high - low;
    // Their difference would be rounding only.
    if (abs(rise) * falloff < 0.02) { return exp(-falloff * max((low + high) * 0.5, 0.0)); }
    return (fog_up_to(high, falloff) - fog_up_to(low, falloff)) / rise;
}

fn effect(color: vec4<f32>, surface: SurfaceSample, p: Parameters) -> vec4<f32> {
    let metres = max(surface.distance - p.start, 0.0);
    let share = min(p.start / max(surface.distance, 1e-6), 1.0);
    let y = surface.viewer.y + (surface.world.y - surface.viewer.y) * share;
    let left = exp(-p.density * metres * mean_density(y - p.height, surface.world.y - p.height, p.falloff));
    let fog = select(p.color, surface.background, p.sky);
    return vec4<f32>(fog + (color.rgb - fog) * left, color.a);
}
