//! Joint indices and weights of vertices (glTF 2.0 §3.7.3.3), normalized to 0, 4 or 8 influences whose weights sum to 1.

use crate::accessor::Integers;
use crate::file::File;
use crate::problem::{Problem, Result, WithPlace};
use choreo_asset::Primitive;
use gltf::json::mesh::{Primitive as JsonPrimitive, Semantic};
use gltf::json::validation::Checked;

pub(crate) fn read(
    file: &File<'_>,
    json: &JsonPrimitive,
    place: &dyn Fn() -> String,
    out: &mut Primitive,
) -> Result<()> {
    let vertices = out.positions.len();
    let attribute = |s: Semantic| json.attributes.get(&Checked::Valid(s)).map(|i| i.value());
    let mut sets = Vec::new();
    for set in 0.. {
        let (joints, weights) = match (attribute(Semantic::Joints(set)), attribute(Semantic::Weights(set))) {
            (Some(j), Some(w)) => (j, w),
            (None, None) => break,
            _ => {
                let what = format!("has one of JOINTS_{set} and WEIGHTS_{set}, but not the other");
                return Err(Problem::new(place(), what));
            }
        };
        let user = |name: &str| format!("{}.{name}_{set}", place());
        let joints = file.read_integers::<4>(joints).at(|| user("JOINTS"))?;
        let weights = file.read_floats::<4>(weights, Integers::Normalized).at(|| user("WEIGHTS"))?;
        if joints.len() != vertices || weights.len() != vertices {
            return Err(Problem::new(
                place(),
                format!(
                    "has {vertices} positions, but {} JOINTS_{set} and {} WEIGHTS_{set}",
                    joints.len(),
                    weights.len()
                ),
            ));
        }
        sets.push((joints, weights));
    }
    if sets.is_empty() || vertices == 0 {
        return Ok(());
    }
    // A second set is often all zero, and would double the cost of skinning.
    while sets.len() > 1 && sets.last().is_some_and(|(_, w)| w.as_flattened().iter().all(|w| *w == 0.0)) {
        sets.pop();
    }
    out.influences = if sets.len() > 1 { 8 } else { 4 };
    file.charge(vertices as u64, out.influences * 6).at(place)?;
    out.joint_indices.reserve_exact(vertices * out.influences);
    out.joint_weights.reserve_exact(vertices * out.influences);

    let mut counts = RepairCounts::default();
    let mut row: Vec<(u32, f32)> = Vec::new();
    for vertex in 0..vertices {
        row.clear();
        for (joints, weights) in &sets {
            row.extend(joints[vertex].into_iter().zip(weights[vertex]));
        }
        normalize_influences(&mut row, out.influences, &mut counts);
        for (joint, weight) in &row {
            let joint = u16::try_from(*joint).map_err(|_| {
                Problem::new(place(), format!("vertex {vertex} uses joint {joint}; the limit is 65535"))
            })?;
            out.joint_indices.push(joint);
            out.joint_weights.push(*weight);
        }
    }
    counts.warn(file, place, vertices);
    Ok(())
}

#[derive(Default)]
struct RepairCounts {
    zero_sum: usize,
    negative: usize,
    too_many: usize,
}

impl RepairCounts {
    fn warn(&self, file: &File<'_>, place: &dyn Fn() -> String, vertices: usize) {
        for (count, text) in [
            (self.zero_sum, "have weights that sum to 0; their first joint gets weight 1"),
            (self.negative, "have negative weights; 0 is used"),
            (self.too_many, "have more than 8 joints; the 8 strongest are used"),
        ] {
            if count > 0 {
                file.warn(place(), format!("{count} of {vertices} vertices {text}"));
            }
        }
    }
}

/// Brings a vertex to `n` influences with non-negative weights that sum to 1. Influences without weight name joint 0.
fn normalize_influences(row: &mut Vec<(u32, f32)>, n: usize, counts: &mut RepairCounts) {
    if row.iter().any(|(_, w)| *w < 0.0) {
        counts.negative += 1;
        row.iter_mut().for_each(|(_, w)| *w = w.max(0.0));
    }
    if row.len() > n {
        if row.iter().filter(|(_, w)| *w > 0.0).count() > n {
            counts.too_many += 1;
        }
        row.sort_by(|a, b| b.1.total_cmp(&a.1));
        row.truncate(n);
    }
    let sum: f32 = row.iter().map(|(_, w)| w).sum();
    if sum > 0.0 && sum.is_finite() {
        if sum != 1.0 {
            row.iter_mut().for_each(|(_, w)| *w /= sum);
        }
    } else {
        counts.zero_sum += 1;
        row.iter_mut().enumerate().for_each(|(k, (_, w))| *w = if k == 0 { 1.0 } else { 0.0 });
    }
    for (joint, weight) in row.iter_mut() {
        if *weight == 0.0 {
            *joint = 0;
        }
    }
    row.resize(n, (0, 0.0));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn influences_are_merged_limited_and_normalized() {
        let mut counts = RepairCounts::default();
        let mut tidied = |mut row: Vec<(u32, f32)>, n| {
            normalize_influences(&mut row, n, &mut counts);
            row
        };
        assert_eq!(
            tidied(vec![(3, 1.0), (4, 3.0), (9, 0.0), (9, 0.0)], 4),
            [(3, 0.25), (4, 0.75), (0, 0.0), (0, 0.0)]
        );
        assert_eq!(tidied(vec![(7, 0.0); 4], 4), [(7, 1.0), (0, 0.0), (0, 0.0), (0, 0.0)]);
        assert_eq!(tidied(vec![(7, -1.0), (8, 0.5)], 4), [(0, 0.0), (8, 1.0), (0, 0.0), (0, 0.0)]);
        let twelve: Vec<(u32, f32)> = (0..12).map(|i| (i, if i < 4 { 1.0 } else { 2.0 })).collect();
        let eight = tidied(twelve, 8);
        assert_eq!(eight, (4..12).map(|i| (i, 0.125)).collect::<Vec<_>>());
        assert_eq!((counts.zero_sum, counts.negative, counts.too_many), (1, 1, 1));
    }
}
