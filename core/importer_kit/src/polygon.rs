//! Triangulation of polygons of any shape, by ear clipping.

use glam::{DVec2, DVec3};

/// Largest number of point tests for the polygons of one file. Ear clipping of n vertices, r of them reflex, takes at least n · r tests.
/// Beyond this budget, polygons become triangle fans.
const MAX_POINT_TESTS: u64 = 50_000_000;

/// Triangulates the polygons of one file, and reuses its buffers from one to the next.
#[derive(Debug, Default)]
pub struct Triangulator {
    spent: u64,
    flat: Vec<DVec2>,
    next: Vec<u32>,
    previous: Vec<u32>,
    reflex: Vec<u32>,
}

/// How a polygon was cut.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cut {
    Whole,
    /// The polygon crosses itself, or has no area: the triangles are a guess.
    Crossing,
    /// The budget of the file is spent: the polygon, or the rest of it, is a triangle fan.
    OverBudget,
}

/// Buffers for polygons of more vertices are freed instead of reused.
const MAX_KEPT_VERTICES: usize = 1 << 16;

impl Triangulator {
    /// Passes the triangles of a polygon to `out`, as numbers of its vertices, with the winding of the polygon: always `count − 2` of them;
    /// none for fewer than three vertices. `vertex` returns the position of a vertex. Convex polygons and quads are not copied, so that
    /// they take no memory, whatever their size.
    pub fn triangulate(
        &mut self,
        count: usize,
        vertex: impl Fn(usize) -> DVec3,
        mut out: impl FnMut([u32; 3]),
    ) -> Cut {
        match count {
            0..=2 => return Cut::Whole,
            3 => {
                out([0, 1, 2]);
                return Cut::Whole;
            }
            _ => {}
        }
        let in_plane = plane(count, &vertex);
        let flat = |i: usize| in_plane(vertex(i));
        if count == 4 {
            let quad = [0, 1, 2, 3].map(flat);
            let turn = |a: usize, b: usize, c: usize| twice_signed_area(quad[a], quad[b], quad[c]);
            // A diagonal fits if both of its triangles have the right winding. If both diagonals fit, the one from the first vertex is
            // taken.
            let (a, b) = ((turn(0, 1, 2), turn(0, 2, 3)), (turn(0, 1, 3), turn(1, 2, 3)));
            if a.0 >= 0.0 && a.1 >= 0.0 && (a.0 > 0.0 || a.1 > 0.0) {
                [[0, 1, 2], [0, 2, 3]].into_iter().for_each(out);
                return Cut::Whole;
            }
            if b.0 >= 0.0 && b.1 >= 0.0 {
                [[0, 1, 3], [1, 2, 3]].into_iter().for_each(out);
                return Cut::Whole;
            }
        }
        self.reflex.clear();
        let (mut before, mut at) = (flat(count - 1), flat(0));
        for i in 0..count {
            let after = flat(if i + 1 < count { i + 1 } else { 0 });
            if twice_signed_area(before, at, after) < 0.0 {
                self.reflex.push(i as u32);
            }
            (before, at) = (at, after);
        }
        let cost = count as u64 * self.reflex.len() as u64;
        if self.reflex.is_empty() || self.spent + cost > MAX_POINT_TESTS {
            (2..count as u32).for_each(|i| out([0, i - 1, i]));
            return if self.reflex.is_empty() { Cut::Whole } else { Cut::OverBudget };
        }
        self.flat.clear();
        self.flat.extend((0..count).map(flat));
        let cut = self.clip(count, &mut out);
        if count > MAX_KEPT_VERTICES {
            *self = Triangulator { spent: self.spent, ..Triangulator::default() };
        }
        cut
    }

    fn clip(&mut self, n: usize, out: &mut impl FnMut([u32; 3])) -> Cut {
        let (first, last) = (0u32, n as u32 - 1);
        self.next.clear();
        self.next.extend((0..n as u32).map(|i| if i == last { first } else { i + 1 }));
        self.previous.clear();
        self.previous.extend((0..n as u32).map(|i| if i == first { last } else { i - 1 }));
        let mut cut = Cut::Whole;
        let mut left = n;
        let mut at = first;
        // Number of vertices tested since the last ear.
        let mut since_last_ear = 0;
        while left > 3 {
            let (before, after) = (self.previous[at as usize], self.next[at as usize]);
            let gone_round = since_last_ear >= left;
            if gone_round || self.is_ear(before, at, after) {
                if gone_round {
                    cut = Cut::Crossing;
                }
                out([before, at, after]);
                self.next[before as usize] = after;
                self.previous[after as usize] = before;
                left -= 1;
                since_last_ear = 0;
                // A reflex vertex may have become straight or convex.
                self.update_reflex(before, after, at);
                at = after;
                if self.spent > MAX_POINT_TESTS {
                    self.fan_rest(at, left, out);
                    return Cut::OverBudget;
                }
            } else {
                since_last_ear += 1;
                at = after;
            }
        }
        out([self.previous[at as usize], at, self.next[at as usize]]);
        cut
    }

    /// Removes the vertices that are no longer reflex from the list of reflex vertices.
    fn update_reflex(&mut self, before: u32, after: u32, removed: u32) {
        let (flat, next, previous) = (&self.flat, &self.next, &self.previous);
        self.spent += self.reflex.len() as u64;
        self.reflex.retain(|d| {
            let neighbor = *d == before || *d == after;
            let at = |i: u32| flat[i as usize];
            *d != removed
                && (!neighbor
                    || twice_signed_area(at(previous[*d as usize]), at(*d), at(next[*d as usize])) < 0.0)
        });
    }

    /// Whether a vertex is an ear: convex, with no reflex vertex in its triangle. A reflex vertex at the position of one of the triangle's
    /// vertices does not count: polygons with holes run along a seam there and back.
    fn is_ear(&mut self, before: u32, at: u32, after: u32) -> bool {
        let [a, b, c] = [before, at, after].map(|i| self.flat[i as usize]);
        if twice_signed_area(a, b, c) < 0.0 || self.reflex.binary_search(&at).is_ok() {
            return false;
        }
        self.spent += self.reflex.len() as u64;
        !self.reflex.iter().filter(|d| **d != before && **d != after).map(|d| self.flat[*d as usize]).any(
            |p| {
                p != a
                    && p != b
                    && p != c
                    && twice_signed_area(a, b, p) >= 0.0
                    && twice_signed_area(b, c, p) >= 0.0
                    && twice_signed_area(c, a, p) >= 0.0
            },
        )
    }

    fn fan_rest(&self, from: u32, left: usize, out: &mut impl FnMut([u32; 3])) {
        let mut at = self.next[from as usize];
        for _ in 2..left {
            let after = self.next[at as usize];
            out([from, at, after]);
            at = after;
        }
    }
}

/// Projection onto the two axes in which the polygon's area is largest, counter-clockwise; exact, because it only drops a coordinate. The
/// sum of the cross products is twice the area vector (Newell), which is right for concave polygons, too.
fn plane(count: usize, vertex: &impl Fn(usize) -> DVec3) -> fn(DVec3) -> DVec2 {
    let first = vertex(0);
    let mut before = DVec3::ZERO;
    let normal: DVec3 = (1..count)
        .map(|i| {
            let edge = vertex(i) - first;
            std::mem::replace(&mut before, edge).cross(edge)
        })
        .sum();
    let size = normal.abs();
    match (size.x >= size.y && size.x >= size.z, size.y >= size.z) {
        (true, _) if normal.x >= 0.0 => |p| DVec2::new(p.y, p.z),
        (true, _) => |p| DVec2::new(p.z, p.y),
        (_, true) if normal.y >= 0.0 => |p| DVec2::new(p.z, p.x),
        (_, true) => |p| DVec2::new(p.x, p.z),
        _ if normal.z >= 0.0 => |p| DVec2::new(p.x, p.y),
        _ => |p| DVec2::new(p.y, p.x),
    }
}

/// Twice the area of a triangle, positive where it is counter-clockwise. For coordinates that were f32, the differences and
/// products in f64 are exact or nearly so.
fn twice_signed_area(a: DVec2, b: DVec2, c: DVec2) -> f64 {
    (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cut(vertices: &[[f64; 2]]) -> (Vec<[u32; 3]>, Cut) {
        let vertices: Vec<DVec3> = vertices.iter().map(|c| DVec3::new(c[0], c[1], 0.0)).collect();
        let mut out = Vec::new();
        let how = Triangulator::default().triangulate(vertices.len(), |i| vertices[i], |t| out.push(t));
        assert_eq!(out.len(), vertices.len().saturating_sub(2));
        (out, how)
    }

    fn area(vertices: &[[f64; 2]], triangle: [u32; 3]) -> f64 {
        let [a, b, c] = triangle.map(|i| DVec2::from(vertices[i as usize]));
        twice_signed_area(a, b, c) / 2.0
    }

    fn polygon_area(vertices: &[[f64; 2]]) -> f64 {
        let n = vertices.len();
        (0..n)
            .map(|i| vertices[i][0] * vertices[(i + 1) % n][1] - vertices[(i + 1) % n][0] * vertices[i][1])
            .sum::<f64>()
            / 2.0
    }

    /// Checks that all triangles have the winding of the polygon, and that their areas add up to that of the polygon: they cover it without
    /// overlap.
    fn check_coverage(vertices: &[[f64; 2]]) {
        let (triangles, how) = cut(vertices);
        let areas: Vec<f64> = triangles.iter().map(|t| area(vertices, *t)).collect();
        assert!(areas.iter().all(|a| *a >= 0.0), "{areas:?}");
        assert!((areas.iter().sum::<f64>() - polygon_area(vertices)).abs() < 1e-9, "{areas:?}");
        assert_eq!(how, Cut::Whole);
    }

    #[test]
    fn concave_polygons_stars_and_holes_are_covered() {
        check_coverage(&[[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]]);
        // A reflex vertex at each of the four vertices of a quad in turn.
        let arrow = [[0.0, 0.0], [2.0, 1.0], [0.0, 2.0], [0.5, 1.0]];
        for turn in 0..4 {
            check_coverage(&[0, 1, 2, 3].map(|i| arrow[(i + turn) % 4]));
        }
        check_coverage(&[
            [0.0, 0.0],
            [4.0, 0.0],
            [4.0, 3.0],
            [3.0, 3.0],
            [3.0, 1.0],
            [1.0, 1.0],
            [1.0, 3.0],
            [0.0, 3.0],
        ]);
        // A square with a square hole; the seam is run there and back.
        check_coverage(&[
            [0.0, 0.0],
            [4.0, 0.0],
            [4.0, 4.0],
            [0.0, 4.0],
            [0.0, 0.0],
            [1.0, 1.0],
            [1.0, 3.0],
            [3.0, 3.0],
            [3.0, 1.0],
            [1.0, 1.0],
        ]);
        let star: Vec<[f64; 2]> = (0..200)
            .map(|i| {
                let (angle, r) =
                    (f64::from(i) * std::f64::consts::TAU / 200.0, if i % 2 == 0 { 1.0 } else { 0.2 });
                [angle.cos() * r, angle.sin() * r]
            })
            .collect();
        check_coverage(&star);
        // Collinear and repeated points.
        check_coverage(&[[0.0, 0.0], [1.0, 0.0], [1.0, 0.0], [2.0, 0.0], [2.0, 2.0], [1.0, 1.0], [0.0, 2.0]]);
    }

    #[test]
    fn the_result_is_independent_of_plane_and_winding() {
        let arrow = [[0.0, 0.0], [2.0, 1.0], [0.0, 2.0], [0.5, 1.0], [0.4, 0.7]];
        for axes in [[0, 1, 2], [1, 2, 0], [2, 0, 1], [1, 0, 2], [0, 2, 1], [2, 1, 0]] {
            let vertices: Vec<DVec3> = arrow
                .iter()
                .map(|c| {
                    let mut p = [0.0; 3];
                    (p[axes[0]], p[axes[1]], p[axes[2]]) = (c[0], c[1], c[0] * 0.1);
                    DVec3::from(p)
                })
                .collect();
            let mut out = Vec::new();
            let how = Triangulator::default().triangulate(vertices.len(), |i| vertices[i], |t| out.push(t));
            assert_eq!(how, Cut::Whole);
            let vector = |t: &[u32; 3]| {
                let [a, b, c] = t.map(|i| vertices[i as usize]);
                (b - a).cross(c - a)
            };
            let whole: DVec3 = out.iter().map(vector).sum();
            assert!(out.iter().all(|t| vector(t).dot(whole) > 0.0), "{axes:?}");
        }
    }

    #[test]
    fn crossing_and_oversized_polygons_terminate() {
        assert_eq!(cut(&[[0.0; 2]; 9]).1, Cut::Whole);
        // A bow tie.
        let (_, how) = cut(&[[0.0, 0.0], [2.0, 2.0], [2.0, 0.0], [0.0, 2.0], [-1.0, 1.0]]);
        assert!(matches!(how, Cut::Crossing | Cut::Whole));
        // A comb of a hundred thousand teeth is beyond the budget.
        let comb: Vec<[f64; 2]> =
            (0..100_000).map(|i| [f64::from(i), f64::from(i % 2) * 5.0]).chain([[5e4, 9e9]]).collect();
        assert_eq!(cut(&comb).1, Cut::OverBudget);
        assert_eq!((cut(&[]).0.len(), cut(&[[0.0; 2]; 2]).0.len()), (0, 0));
    }
}
