// Thick lines and points. CPU reference: core/render/src/scene_resources/thick_lines.rs.

@if(THICK_LINES)
// Clip-space position of a vertex, from both ends of its line. The offset is scaled by w, so that it is the same on screen
// anywhere on the line; the near plane then clips it like any triangle.
fn spread(own: vec4<f32>, other: vec4<f32>, corner: vec3<f32>, width: f32) -> vec4<f32> {
    let second = corner.z > 0.5;
    let a = select(own, other, second);
    let b = select(other, own, second);
    // The direction from the first end to the second in the image: d(xy/w) is proportional to this.
    let way = (b.xy * a.w - a.xy * b.w) * frame.size;
    let most = max(abs(way.x), abs(way.y));
    var along = vec2(1.0, 0.0);
    if (most > 0.0) {
        let scaled = way / most;
        along = scaled / sqrt(dot(scaled, scaled));
    }
    // Half the width in pixels, times w.
    let least = 0.5 * own.w;
    var radius = least * max(width, 1.0);
    if (width < 0.0) {
        let rows = transpose(frame.clip_from_relative);
        radius = max(0.25 * -width * frame.size.y * tall(rows), least);
    }
    let off = along * corner.x + vec2(-along.y, along.x) * corner.y;
    return own + vec4(off * (2.0 * radius) / frame.size, 0.0, 0.0);
}
@end
