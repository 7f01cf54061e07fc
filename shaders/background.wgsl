// A vertical gradient behind everything: one triangle at depth 0, drawn last where the depth is still 0, so that
// covered pixels cost nothing.

struct BackgroundOut {
    @builtin(position) position: vec4<f32>,
}

@vertex
fn background_vs(@builtin(vertex_index) index: u32) -> BackgroundOut {
    let x = f32(i32(index & 1u) * 4 - 1);
    let y = f32(i32(index >> 1u) * 4 - 1);
    return BackgroundOut(vec4(x, y, 0.0, 1.0));
}

@fragment
fn background_fs(in: BackgroundOut) -> @location(0) vec4<f32> {
    let t = in.position.y / frame.size.y;
    return vec4(mix(frame.background_top.xyz, frame.background_bottom.xyz, t), 1.0);
}
