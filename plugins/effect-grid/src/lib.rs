//! The floor's metres as lines.

use choreo_plugin::{Effect, Hook, Lattice, Manifest, Overlay, Scene};
use glam::{DVec3, Vec4};
use std::sync::LazyLock;

static MANIFEST: LazyLock<Manifest> = LazyLock::new(|| {
    Manifest::new("grid", env!("CARGO_PKG_VERSION"), "the floor's metres as lines, each tenth a thicker one")
        .number("cell", "metres from line to line", 1.0, 1e-3..=1e4)
        .number("height", "of the floor, metres", 0.0, -1e6..=1e6)
        .number("fade", "metres from the viewer at which it has faded out", 60.0, 0.1..=1e6)
        .number("opacity", "of the lines", 0.5, 0.0..=1.0)
        .color("color", "of the lines", [0.02, 0.02, 0.03])
        .flag("over", "over the picture, rather than hidden by what is nearer", false)
});

#[derive(Clone, Copy, Debug, Default)]
pub struct Grid;

impl Effect for Grid {
    fn manifest(&self) -> &Manifest {
        &MANIFEST
    }

    fn hook(&self) -> Hook {
        Hook::Overlay
    }

    /// It belongs to the world.
    fn of_actors(&self) -> bool {
        false
    }

    fn overlay(&self, _: &Scene, p: &[f32; 8]) -> Overlay {
        let [cell, height, fade, opacity, r, g, b, over] = *p;
        let lattice = Lattice {
            origin: DVec3::Y * f64::from(height),
            along: [DVec3::X, DVec3::Z],
            cell: f64::from(cell),
            every: 10,
            widths: [1.0, 2.0],
            color: Vec4::new(r, g, b, opacity),
            fade: f64::from(fade),
        };
        Overlay { lattices: vec![lattice], over: over > 0.5, ..Overlay::default() }
    }
}
