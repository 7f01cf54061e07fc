//! Morph targets: the vertices that each target moves, and their offsets as shaders read them (pose.wgsl).
//!
//! A target costs memory and time from the first vertex that it moves to the last, so vertices moved by the same targets are
//! grouped. RobotExpressive's face keeps 31 % of its offsets, which all move a vertex. Godette's keeps 40 %, although only 17 % do: an
//! index for each vertex would save the rest, but costs a second read. Some exporters move every vertex
//! (`cargo test -p choreo-render --test geometry morphs -- --nocapture`).

use choreo_asset::{MorphTarget, Primitive};
use glam::Vec3;
use std::ops::Range;

/// Whether a target changes a vertex's position, normal or tangent; NaN counts as a change.
fn moves(target: &MorphTarget, vertex: u32) -> bool {
    let is_there = |list: &Vec<Vec3>| list.get(vertex as usize).is_some_and(|v| *v != Vec3::ZERO);
    [&target.positions, &target.normals, &target.tangents].into_iter().any(is_there)
}

/// Range of positions in `order` (vertices of the primitive) from the first vertex that each target moves to the last; empty if
/// it moves none.
pub fn morphed_ranges(p: &Primitive, order: &[u32]) -> Vec<Range<u32>> {
    let span = |target: &MorphTarget| {
        let first = order.iter().position(|v| moves(target, *v)).unwrap_or(0);
        let end = order.iter().rposition(|v| moves(target, *v)).map_or(0, |last| last + 1);
        first as u32..end as u32
    };
    p.morphs.iter().map(span).collect()
}

/// Number of vertices that any target moves.
pub fn morphed_vertices(p: &Primitive) -> usize {
    (0..p.positions.len() as u32).filter(|v| p.morphs.iter().any(|target| moves(target, *v))).count()
}

/// Groups vertices that the same targets move, unmoved ones at the end. The order is otherwise kept.
pub(crate) fn group_morphed(p: &Primitive, order: &mut [u32]) {
    if p.morphs.is_empty() {
        return;
    }
    let first = |v: &u32| p.morphs.iter().position(|target| moves(target, *v)).unwrap_or(usize::MAX);
    let last = |v: &u32| p.morphs.iter().rposition(|target| moves(target, *v)).unwrap_or(usize::MAX);
    order.sort_by_cached_key(|v| (first(v), last(v)));
}

/// Packs morph targets as words of 16 bytes: for each target its first vertex, the number of vertices and the start of its
/// offsets; then for each target the offsets of positions and, with 2 and 3 `lists`, of normals and tangents.
pub(crate) fn pack_morphs(p: &Primitive, order: &[u32], lists: usize) -> Vec<u8> {
    let spans = morphed_ranges(p, order);
    if spans.is_empty() {
        // A buffer has at least one word, even if a mesh is forced to have targets.
        return vec![0; 16];
    }
    let words: usize = spans.iter().map(|s| s.len() * lists).sum::<usize>() + spans.len();
    let mut out = Vec::with_capacity(16 * words);
    let mut begin = spans.len() as u32;
    for span in &spans {
        out.extend_from_slice(bytemuck::cast_slice(&[span.start, span.len() as u32, begin, 0]));
        begin += (span.len() * lists) as u32;
    }
    for (target, span) in p.morphs.iter().zip(spans) {
        for list in [&target.positions, &target.normals, &target.tangents].into_iter().take(lists) {
            for &v in &order[span.start as usize..span.end as usize] {
                let offset = list.get(v as usize).copied().unwrap_or_default().extend(0.0);
                out.extend_from_slice(bytemuck::bytes_of(&offset));
            }
        }
    }
    out
}
