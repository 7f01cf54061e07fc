//! Overlays of effects (triangles, lines, points and grids) as screen triangles, the same for both renderers.

use crate::effect_faults::{FaultPlace, PlanFault};
use crate::layers_2d::ScreenLabel;
use crate::plan::build::effects::active_uses;
use crate::plan::options::PlanOptions;
use crate::plan::{LeftOut, OverlayPart, OverlayVertex, PlanOverlay, View};
use choreo_plugin::{Effect, EffectScene, Label, Lattice, Overlay, Stroke, Triangle};
use choreo_stage::{Snapshot, Stage};
use glam::{DVec3, Vec2, Vec4, Vec4Swizzles};

/// Largest number of labels; more would be unreadable.
const MOST_LABELS: usize = 2_000;

/// The overlays of a frame.
#[derive(Default)]
pub(crate) struct DrawnOverlays {
    pub overlay: PlanOverlay,
    pub labels: Vec<ScreenLabel>,
    pub left_out: Vec<LeftOut>,
    pub faults: Vec<PlanFault>,
}

pub(crate) fn overlays(
    stage: &Stage,
    snapshot: &Snapshot,
    view: &View,
    options: &PlanOptions,
) -> DrawnOverlays {
    let mut all = DrawnOverlays::default();
    let DrawnOverlays { overlay, labels, left_out, faults } = &mut all;
    let size = Vec2::new(options.size[0] as f32, options.size[1] as f32);
    for (effect, used, state) in active_uses(stage, snapshot, options.effects) {
        let Effect::Overlay(drawing) = effect else { continue };
        let parameters = options.effect_parameters(effect, &state.parameters);
        let mut drawn = drawing
            .overlay(&EffectScene { stage, snapshot, before: options.before, on: &used.on }, &parameters);
        leave_out_faulty(effect, &mut drawn, faults);
        // Six vertices of 64 bytes for each stroke: 38 MB at most.
        let most = Overlay::MOST;
        let counts = [("lines and points", drawn.strokes.len()), ("triangles", drawn.triangles.len())];
        let many = counts.into_iter().filter(|(_, count)| *count > most);
        drawn.left_out.extend(many.map(|(what, n)| format!("{n} {what}, at most {most} are drawn")));
        drawn.strokes.truncate(most);
        drawn.triangles.truncate(most);
        let part = format!("part of effect \"{}\"", used.plugin);
        left_out.extend(drawn.left_out.into_iter().map(|why| LeftOut { part: part.clone(), why }));
        labels
            .extend(drawn.labels.into_iter().filter_map(|l| label(l, view)).take(MOST_LABELS - labels.len()));
        let first = overlay.vertices.len();
        drawn.lattices.iter().for_each(|l| lattice(l, view, &mut overlay.vertices));
        triangles(&drawn.triangles, view, &mut overlay.vertices);
        drawn.strokes.iter().for_each(|s| stroke(s, view, size, &mut overlay.vertices));
        let count = overlay.vertices.len() - first;
        if count > 0 {
            overlay.parts.push(OverlayPart {
                effect: used.effect_name().into_owned(),
                over: drawn.over,
                first: first as u32,
                count: count as u32,
            });
        }
    }
    all
}

/// Removes parts of an overlay whose numbers are not finite, and reports one fault for each kind.
fn leave_out_faulty(effect: &Effect, drawn: &mut Overlay, faults: &mut Vec<PlanFault>) {
    let mut is_good = |result: &[f32], places: &[DVec3], place: FaultPlace| {
        let far = places.iter().all(|place| place.is_finite());
        let fault = PlanFault::of(effect, result, place);
        let fault = fault.or_else(|| PlanFault::of(effect, &[f32::NAN], place).filter(|_| !far));
        let good = fault.is_none();
        faults.extend(fault.filter(|fault| !faults.contains(fault)));
        good
    };
    let with = |color: Vec4, other: [f32; 3]| {
        let [r, g, b, a] = color.to_array();
        [r, g, b, a, other[0], other[1], other[2]]
    };
    drawn.strokes.retain(|s| is_good(&with(s.color, [s.width, 0.0, 0.0]), &[s.from, s.to], FaultPlace::Line));
    drawn.triangles.retain(|t| is_good(&t.color.to_array(), &t.vertices, FaultPlace::Triangle));
    drawn.lattices.retain(|l| {
        let lengths = DVec3::new(l.cell, l.fade, 0.0);
        let places = [l.origin, l.along[0], l.along[1], lengths];
        is_good(&with(l.color, [l.widths[0], l.widths[1], 0.0]), &places, FaultPlace::Lattice)
    });
    drawn.labels.retain(|l| is_good(&with(l.color, [l.size, l.beside, 0.0]), &[l.at], FaultPlace::Label));
}

/// A label at its position in the image; `None` if that is outside the image.
fn label(l: Label, view: &View) -> Option<ScreenLabel> {
    let clip = view.clip_from_relative * (l.at - view.position).as_vec3().extend(1.0);
    let seen = clip.w > 1e-6 && clip.z <= clip.w && clip.x.abs() <= clip.w && clip.y.abs() <= clip.w;
    let at = clip.xy() / clip.w * 0.5 + 0.5;
    let good = l.size.is_finite() && l.beside.is_finite() && l.color.is_finite();
    (seen && good && !l.text.is_empty()).then(|| ScreenLabel {
        at: at.as_dvec2(),
        size: l.size.clamp(4.0, 256.0),
        beside: l.beside,
        color: l.color,
        text: l.text,
    })
}

/// Triangles in view, back to front by the depth of their centers; those of equal depth keep their order.
fn triangles(all: &[Triangle], view: &View, out: &mut Vec<OverlayVertex>) {
    let mut seen: Vec<(f32, [Vec4; 3], Vec4)> = Vec::new();
    for t in all.iter().filter(|t| t.color.is_finite() && t.color.w > 0.0) {
        let relative = t.vertices.map(|c| (c - view.position).as_vec3());
        let clip = relative.map(|r| view.clip_from_relative * r.extend(1.0));
        let beside = |c: &Vec4| [c.w - c.z, c.z, c.w + c.x, c.w - c.x, c.w + c.y, c.w - c.y];
        let [a, b, c] = [0, 1, 2].map(|i| beside(&clip[i]));
        let outside = (0..6).any(|i| a[i] < 0.0 && b[i] < 0.0 && c[i] < 0.0);
        if clip.iter().all(|c| c.is_finite()) && !outside {
            let middle = (relative[0] + relative[1] + relative[2]) / 3.0;
            seen.push((view.depth(middle), clip, t.color));
        }
    }
    seen.sort_by(|a, b| b.0.total_cmp(&a.0));
    let vertex =
        |clip, color| OverlayVertex { clip, color, lattice: Vec4::X * 2.0, ..OverlayVertex::default() };
    out.extend(seen.into_iter().flat_map(|(_, clip, color)| clip.map(|clip| vertex(clip, color))));
}

/// The visible part of a line as a rectangle in the image plane, larger on all sides by half the line's width and a pixel.
fn stroke(s: &Stroke, view: &View, size: Vec2, out: &mut Vec<OverlayVertex>) {
    let clip = |world: DVec3| {
        let relative = (world - view.position).as_vec3();
        view.clip_from_relative * relative.extend(1.0)
    };
    let Some([a, b]) = clip_segment(clip(s.from), clip(s.to)) else { return };
    // Attributes are interpolated linearly in the image, so w is divided out here.
    let flat = |c: Vec4| (c.xyz() / c.w).extend(1.0);
    let (a, b) = (flat(a), flat(b));
    if !a.is_finite() || !b.is_finite() || !s.color.is_finite() {
        return;
    }
    let way = (b.xy() - a.xy()) * size * 0.5;
    let length = way.dot(way).sqrt();
    let along = if length > 1e-4 { way / length } else { Vec2::X };
    let radius = s.width.clamp(1.0, 64.0) * 0.5;
    let reach = radius + 1.0;
    let vertex = |end: Vec4, along_by: f32, across_by: f32, at: f32| {
        let off = along * along_by + Vec2::new(-along.y, along.x) * across_by;
        OverlayVertex {
            clip: end + (off * 2.0 / size).extend(0.0).extend(0.0),
            color: s.color,
            shape: Vec4::new(at + along_by, across_by, length, radius),
            lattice: Vec4::ZERO,
        }
    };
    let vertices = [
        vertex(a, -reach, -reach, 0.0),
        vertex(a, -reach, reach, 0.0),
        vertex(b, reach, -reach, length),
        vertex(b, reach, reach, length),
    ];
    out.extend([0, 1, 2, 2, 1, 3].map(|i| vertices[i]));
}

/// The part of a segment between the near and far planes and within twice the image.
fn clip_segment(a: Vec4, b: Vec4) -> Option<[Vec4; 2]> {
    // Reversed Z: nearer than the near plane is z > w. Thick lines reach into the image from outside.
    let planes = |c: Vec4| {
        [c.w - c.z, c.z, 2.0 * c.w + c.x, 2.0 * c.w - c.x, 2.0 * c.w + c.y, 2.0 * c.w - c.y, c.w - 1e-6]
    };
    let (mut from, mut to) = (0.0f32, 1.0f32);
    for (fa, fb) in planes(a).into_iter().zip(planes(b)) {
        if fa < 0.0 && fb < 0.0 {
            return None;
        }
        if fa < 0.0 {
            from = from.max(fa / (fa - fb));
        } else if fb < 0.0 {
            to = to.min(fa / (fa - fb));
        }
    }
    (from <= to).then(|| [a + (b - a) * from, a + (b - a) * to])
}

/// A square of a grid's plane around the point below the camera. Positions count cells from a nearby thick line, so that they are
/// small wherever the camera is.
fn lattice(l: &Lattice, view: &View, out: &mut Vec<OverlayVertex>) {
    let good = l.cell > 0.0 && l.cell.is_finite() && l.fade > 0.0 && l.fade.is_finite();
    if !good || !l.origin.is_finite() || !l.along.iter().all(|a| a.is_finite()) {
        return;
    }
    let every = f64::from(l.every.max(1));
    let period = l.cell * every;
    let beside = view.position - l.origin;
    // The crossing of thick lines nearest to the point below the camera, and that point relative to the crossing, in f64, so
    // exact far from the origin.
    let foot = l.along.map(|a| beside.dot(a));
    let crossing = foot.map(|f| libm::floor(f / period + 0.5) * period);
    let middle = l.origin + l.along[0] * crossing[0] + l.along[1] * crossing[1];
    let off = [foot[0] - crossing[0], foot[1] - crossing[1]];
    let vertex = |x: f64, y: f64| {
        let (x, y) = (off[0] + x * l.fade, off[1] + y * l.fade);
        let world = middle + l.along[0] * x + l.along[1] * y;
        let relative = (world - view.position).as_vec3();
        let cells = (x / l.cell, y / l.cell);
        OverlayVertex {
            clip: view.clip_from_relative * relative.extend(1.0),
            color: l.color,
            shape: Vec4::new(
                cells.0 as f32,
                cells.1 as f32,
                ((x - off[0]) / l.fade) as f32,
                ((y - off[1]) / l.fade) as f32,
            ),
            lattice: Vec4::new(1.0, every as f32, l.widths[0], l.widths[1]),
        }
    };
    let vertices = [vertex(-1.0, -1.0), vertex(1.0, -1.0), vertex(-1.0, 1.0), vertex(1.0, 1.0)];
    if vertices.iter().all(|c| c.clip.is_finite()) {
        out.extend([0, 1, 2, 2, 1, 3].map(|i| vertices[i]));
    }
}
