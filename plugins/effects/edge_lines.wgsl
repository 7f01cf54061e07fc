// effect: edge_lines
// about: ink lines where the depth or direction of surfaces changes
// hook: image
// off: strength = 0
// param strength = 1 in 0..1: how much of the image the lines cover
// param width = int(1) px in 1..16: width of the lines
// param depth = 0.01 in 0.0001..1: step between surfaces that makes a line, as a share of the distance
// param angle = 30 degrees in 1..180: angle between surfaces that makes a line
// param far = 1000 m in 0.1..1000000: distance at which lines have faded
// param color = rgb(0, 0, 0): color of the lines
//
// Roberts cross (Roberts, "Machine Perception of Three-Dimensional Solids", 1963) over depth and normals, as Saito and Takahashi,
// "Comprehensible Rendering of 3-D Shapes", SIGGRAPH 1990. Depth is compared with the tangent plane of the other pixel, so that
// surfaces seen at a grazing angle make no line.

// 1 where a line lies between two pixels.
fn edge(a: vec2<i32>, b: vec2<i32>, step: f32, cosine: f32) -> f32 {
    let start = view_at(a);
    let end = view_at(b);
    let near = min(-start.z, -end.z);
    if (near > 1e8) { return 0.0; }
    if (max(-start.z, -end.z) > 1e8) { return 1.0; }
    let world = view_from_world();
    let n = (world * vec4<f32>(normal_at(a), 0.0)).xyz;
    let m = (world * vec4<f32>(normal_at(b), 0.0)).xyz;
    let off = max(abs(dot(n, end - start)), abs(dot(m, end - start)));
    let turned = smoothstep(0.0, 0.1, cosine - dot(n, m));
    return max(smoothstep(1.0, 1.5, off / (step * near)), turned);
}

fn effect(at: vec2<i32>, pass_number: u32, p: Parameters) -> vec4<f32> {
    let color = picture(at);
    let low = p.width / 2;
    let high = p.width - low;
    let a = at - low;
    let b = at + high;
    let cosine = cos(radians(p.angle));
    let first = edge(a, b, p.depth, cosine);
    let second = edge(vec2<i32>(b.x, a.y), vec2<i32>(a.x, b.y), p.depth, cosine);
    var near = min(min(depth_at(a), depth_at(b)), min(depth_at(vec2<i32>(b.x, a.y)), depth_at(vec2<i32>(a.x, b.y))));
    let faded = 1.0 - smoothstep(0.5 * p.far, p.far, near);
    let line = max(first, second) * p.strength * faded;
    return vec4<f32>(mix(color.rgb, p.color, line), color.a);
}
