//! Converts strips, fans and loops to plain lists (glTF 2.0 §3.7.2.1).

use choreo_asset::Topology;
use gltf::json::mesh::Mode;

/// The topology and indices of the list form, and the number of indices left over at the end.
pub(crate) fn to_list(mode: Mode, i: Vec<u32>) -> (Topology, Vec<u32>, usize) {
    let n = i.len();
    match mode {
        Mode::Points => (Topology::Points, i, 0),
        Mode::Lines => {
            let rest = n % 2;
            (Topology::Lines, truncated(i, n - rest), rest)
        }
        Mode::LineStrip if n >= 2 => (Topology::Lines, i.windows(2).flatten().copied().collect(), 0),
        Mode::LineLoop if n >= 2 => {
            let mut lines: Vec<u32> = i.windows(2).flatten().copied().collect();
            lines.extend([i[n - 1], i[0]]);
            (Topology::Lines, lines, 0)
        }
        Mode::LineStrip | Mode::LineLoop => (Topology::Lines, Vec::new(), n),
        Mode::Triangles => {
            let rest = n % 3;
            (Topology::Triangles, truncated(i, n - rest), rest)
        }
        // p_k = {v_k, v_{k+1+k%2}, v_{k+2−k%2}}: every second triangle is turned to keep the winding.
        Mode::TriangleStrip if n >= 3 => {
            let triangle = |k: usize| [i[k], i[k + 1 + k % 2], i[k + 2 - k % 2]];
            (Topology::Triangles, (0..n - 2).flat_map(triangle).collect(), 0)
        }
        // p_k = {v_{k+1}, v_{k+2}, v_0}
        Mode::TriangleFan if n >= 3 => {
            (Topology::Triangles, (0..n - 2).flat_map(|k| [i[k + 1], i[k + 2], i[0]]).collect(), 0)
        }
        Mode::TriangleStrip | Mode::TriangleFan => (Topology::Triangles, Vec::new(), n),
    }
}

fn truncated(mut i: Vec<u32>, len: usize) -> Vec<u32> {
    i.truncate(len);
    i
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strips_fans_and_loops_become_lists() {
        let five = || vec![10, 11, 12, 13, 14];
        use Topology::{Lines, Points, Triangles};
        assert_eq!(to_list(Mode::Points, five()), (Points, five(), 0));
        assert_eq!(to_list(Mode::Lines, five()), (Lines, vec![10, 11, 12, 13], 1));
        assert_eq!(to_list(Mode::LineStrip, vec![1, 2, 3]), (Lines, vec![1, 2, 2, 3], 0));
        assert_eq!(to_list(Mode::LineLoop, vec![1, 2, 3]), (Lines, vec![1, 2, 2, 3, 3, 1], 0));
        assert_eq!(to_list(Mode::Triangles, five()), (Triangles, vec![10, 11, 12], 2));
        assert_eq!(
            to_list(Mode::TriangleStrip, five()),
            (Triangles, vec![10, 11, 12, 11, 13, 12, 12, 13, 14], 0)
        );
        assert_eq!(
            to_list(Mode::TriangleFan, five()),
            (Triangles, vec![11, 12, 10, 12, 13, 10, 13, 14, 10], 0)
        );
        for mode in [Mode::LineStrip, Mode::LineLoop, Mode::TriangleStrip, Mode::TriangleFan, Mode::Triangles]
        {
            assert_eq!(to_list(mode, vec![7]).1, Vec::<u32>::new());
            assert_eq!(to_list(mode, vec![]).1, Vec::<u32>::new());
        }
    }
}
