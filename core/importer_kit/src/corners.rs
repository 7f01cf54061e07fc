//! Corners of faces that are the same vertex, found without hashing.

/// Vertices at one point that a corner is compared with; beyond that it gets a vertex of its own, so that the time stays
/// proportional to the file whatever is in it.
const MAX_COMPARED: usize = 64;
const NONE: u32 = u32::MAX;

/// The vertices of one primitive by the point of the file that they stand at: those at one point are few.
#[derive(Clone, Debug, Default)]
pub struct Joined {
    /// The latest vertex of each point.
    latest: Vec<u32>,
    /// The vertex before each vertex at the same point.
    before: Vec<u32>,
}

impl Joined {
    /// Starts the next primitive, whose points are below `points`.
    pub fn start(&mut self, points: usize) {
        self.before.clear();
        self.latest.clear();
        self.latest.resize(points, NONE);
    }

    /// The vertex of a corner at a point, and whether it is a new one, which gets the next number. `same` compares the
    /// corner with a vertex.
    #[inline]
    pub fn vertex(&mut self, point: u32, same: impl Fn(u32) -> bool) -> (u32, bool) {
        let latest = self.latest[point as usize];
        let mut vertex = latest;
        for _ in 0..MAX_COMPARED {
            if vertex == NONE {
                break;
            }
            if same(vertex) {
                return (vertex, false);
            }
            vertex = self.before[vertex as usize];
        }
        let new = self.before.len() as u32;
        self.before.push(latest);
        self.latest[point as usize] = new;
        (new, true)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_that_are_the_same_share_a_vertex() {
        let corners = [(0, 'a'), (1, 'a'), (0, 'b'), (0, 'a'), (0, 'b'), (1, 'a')];
        let mut joined = Joined::default();
        for _ in 0..2 {
            joined.start(2);
            let mut vertices: Vec<(u32, char)> = Vec::new();
            let indices = corners.map(|(point, what)| {
                let (vertex, new) = joined.vertex(point, |v| vertices[v as usize] == (point, what));
                if new {
                    vertices.push((point, what));
                }
                vertex
            });
            assert_eq!(indices, [0, 1, 2, 0, 2, 1]);
        }
    }

    #[test]
    fn a_million_vertices_at_one_point_take_no_time() {
        let mut joined = Joined::default();
        joined.start(1);
        for n in 0..1_000_000 {
            assert_eq!(joined.vertex(0, |_| false), (n, true));
        }
    }
}
