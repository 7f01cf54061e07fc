//! Welding: face vertices with the same values become one vertex, found without hashing.

/// Largest number of vertices at one point with which a face vertex is compared. Beyond it, the face vertex gets a vertex of its own, so
/// that the time stays proportional to the file, whatever the file contains.
const MAX_COMPARED: usize = 64;
const NONE: u32 = u32::MAX;

/// The vertices of one primitive, by the point of the file at which they are. Few vertices share a point.
#[derive(Clone, Debug, Default)]
pub struct Welder {
    /// Number of the primitive, counted from 1.
    primitive: u32,
    /// The primitive that used each point last, and its latest vertex there.
    latest: Vec<(u32, u32)>,
    /// The vertex before each vertex at the same point.
    before: Vec<u32>,
}

impl Welder {
    /// Begins the next primitive, whose point numbers are below `points`.
    pub fn start(&mut self, points: usize) {
        self.before.clear();
        self.primitive += 1;
        if self.latest.len() < points {
            self.latest.resize(points, (0, NONE));
        }
    }

    /// The vertex for a face vertex at a point, and whether it is new; a new vertex gets the next number. `same` compares the face vertex
    /// with an existing vertex.
    #[inline]
    pub fn vertex(&mut self, point: u32, same: impl Fn(u32) -> bool) -> (u32, bool) {
        let latest = &mut self.latest[point as usize];
        let head = if latest.0 == self.primitive { latest.1 } else { NONE };
        let mut vertex = head;
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
        self.before.push(head);
        *latest = (self.primitive, new);
        (new, true)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_face_vertices_share_a_vertex() {
        let face_vertices = [(0, 'a'), (1, 'a'), (0, 'b'), (0, 'a'), (0, 'b'), (1, 'a')];
        let mut welder = Welder::default();
        for _ in 0..2 {
            welder.start(2);
            let mut vertices: Vec<(u32, char)> = Vec::new();
            let indices = face_vertices.map(|(point, what)| {
                let (vertex, new) = welder.vertex(point, |v| vertices[v as usize] == (point, what));
                if new {
                    vertices.push((point, what));
                }
                vertex
            });
            assert_eq!(indices, [0, 1, 2, 0, 2, 1]);
        }
    }

    #[test]
    fn welding_a_million_vertices_at_one_point_is_fast() {
        let mut welder = Welder::default();
        welder.start(1);
        for n in 0..1_000_000 {
            assert_eq!(welder.vertex(0, |_| false), (n, true));
        }
    }
}
