// Overlays of effects (triangles, lines, points and lattices) as triangles from the plan, and their coverage of pixels.
// CPU reference: core/render/src/cpu/overlay.rs.

struct OverlayVertex {
    clip: vec4<f32>,
    color: vec4<f32>,
    // Stroke: pixels along and across, length, radius. Lattice: cells along both axes, offset from the center, 1 at the edge.
    shape: vec4<f32>,
    // x = 0: a stroke, 2: a filled triangle. Lattice: x = 1, interval of thick lines, widths of thin and of thick lines in
    // pixels.
    lattice: vec4<f32>,
}

@group(0) @binding(7) var<storage, read> overlay_vertices: array<OverlayVertex>;

struct OverlayOut {
    @builtin(position) position: vec4<f32>,
    @location(0) @interpolate(flat) color: vec4<f32>,
    @location(1) shape: vec4<f32>,
    @location(2) @interpolate(flat) lattice: vec4<f32>,
}

@vertex
fn overlay_vs(@builtin(vertex_index) index: u32) -> OverlayOut {
    let v = overlay_vertices[index];
    return OverlayOut(v.clip, v.color, v.shape, v.lattice);
}

// Coverage of a pixel by lines at the whole numbers of an axis. `step`: change of `at` from pixel to pixel.
fn lines(at: f32, step: f32, width: f32) -> f32 {
    let off = abs(at - floor(at + 0.5)) / max(step, 1e-9);
    return clamp(0.5 * width + 0.5 - off, 0.0, 1.0);
}

// Thin lines fade where fewer than eight pixels lie between them, and are gone at four.
fn axis(at: f32, step: f32, lattice: vec4<f32>) -> f32 {
    let thin = lines(at, step, lattice.z) * clamp((0.25 - step) * 8.0, 0.0, 1.0);
    let thick_step = step / lattice.y;
    let thick = lines(at / lattice.y, thick_step, lattice.w) * clamp((0.25 - thick_step) * 8.0, 0.0, 1.0);
    return max(thin, thick);
}

@fragment
fn overlay_fs(in: OverlayOut) -> @location(0) vec4<f32> {
    // Derivatives are taken in uniform control flow, before any branch.
    let right = dpdxFine(in.shape.xy);
    let down = dpdyFine(in.shape.xy);
    var cover: f32;
    if (in.lattice.x > 1.5) {
        cover = 1.0;
    } else if (in.lattice.x > 0.5) {
        let steps = sqrt(right * right + down * down);
        let rim = clamp(1.0 - length(in.shape.zw), 0.0, 1.0);
        cover = max(axis(in.shape.x, steps.x, in.lattice), axis(in.shape.y, steps.y, in.lattice));
        cover *= rim * rim * (3.0 - 2.0 * rim);
    } else {
        let off = vec2(in.shape.x - clamp(in.shape.x, 0.0, in.shape.z), in.shape.y);
        cover = clamp(in.shape.w + 0.5 - length(off), 0.0, 1.0);
    }
    return vec4(in.color.rgb, in.color.a * cover);
}
