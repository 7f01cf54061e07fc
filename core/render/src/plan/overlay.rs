//! Overlays: triangles that effects draw on the screen, in drawing order.

use glam::Vec4;

#[derive(Clone, Debug, Default, PartialEq)]
pub struct PlanOverlay {
    pub vertices: Vec<OverlayVertex>,
    pub parts: Vec<OverlayPart>,
}

/// The triangles of one effect.
#[derive(Clone, Debug, PartialEq)]
pub struct OverlayPart {
    /// Plugin name.
    pub effect: String,
    /// Drawn without a depth test.
    pub over: bool,
    /// Range of the vertices, three for each triangle.
    pub first: u32,
    pub count: u32,
}

/// A vertex; see shaders/overlay.wgsl. Laid out as the shader reads it.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct OverlayVertex {
    pub clip: Vec4,
    /// Linear, straight alpha.
    pub color: Vec4,
    /// Stroke: pixels along and across, length, radius. Grid: cells along both axes, position from the center, 1 at the edge.
    pub shape: Vec4,
    /// x: 0 for a stroke, 2 for a filled triangle. Grid: 1, interval of thick lines, widths of thin and of thick lines in pixels.
    pub lattice: Vec4,
}
