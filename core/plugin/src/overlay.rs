//! What effects draw of their own, beside the meshes of the stage: lines and points as wide as pixels say, and lattices.
//! Both renderers draw it after everything else of the scene, with smooth edges whatever the number of samples.

use choreo_stage::{EffectTarget, Snapshot, Stage};
use glam::{DVec3, Vec4};

/// What an effect may look at to draw: the stage, and how it is at a time.
#[derive(Clone, Copy)]
pub struct Scene<'a> {
    pub stage: &'a Stage,
    pub snapshot: &'a Snapshot,
    /// On these only; empty: on everything.
    pub on: &'a [EffectTarget],
}

/// Drawn in this order: lattices, then strokes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Overlay {
    pub strokes: Vec<Stroke>,
    pub lattices: Vec<Lattice>,
    pub labels: Vec<Label>,
    /// Over everything that is drawn, rather than hidden by what is nearer.
    pub over: bool,
}

/// A line with round ends; where both ends are one, a disc.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stroke {
    /// World, metres.
    pub from: DVec3,
    pub to: DVec3,
    /// Pixels of the picture, 1 to 64.
    pub width: f32,
    /// Linear, straight alpha.
    pub color: Vec4,
}

/// Words right of a place, over everything.
#[derive(Clone, Debug, PartialEq)]
pub struct Label {
    /// World, metres.
    pub at: DVec3,
    pub text: String,
    /// Of the font, pixels.
    pub size: f32,
    /// How far right of the place they begin, pixels.
    pub beside: f32,
    /// Linear, straight alpha.
    pub color: Vec4,
}

/// A plane of lines at right angles, without end, of which a disc around the point below the viewer is seen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lattice {
    /// Where two lines meet; world, metres.
    pub origin: DVec3,
    /// Unit, at right angles: along the lines.
    pub along: [DVec3; 2],
    /// Metres from line to line.
    pub cell: f64,
    /// Each so manieth line is a thick one, and stays where there are too many thin ones for the pixels.
    pub every: u32,
    /// Pixels, of thin lines and of thick ones.
    pub widths: [f32; 2],
    /// Linear, straight alpha.
    pub color: Vec4,
    /// Metres from the middle at which it has faded out.
    pub fade: f64,
}
