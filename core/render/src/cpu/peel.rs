//! Depth peeling of transparent surfaces, from the back. CPU reference of peel.wgsl and of the passes around it.

use super::raster::rasterize;
use super::target::Target;
use super::tile::{SampleTest, Tile, TileBuffers, TriangleId};

impl Tile<'_, '_> {
    /// Peels layers from the back. For each layer, finds at each sample the farthest surface that is nearer than the previous layer
    /// (for the first layer: than the opaque scene), and blends the surfaces at that depth. Surfaces nearer than the last layer are
    /// blended in drawing order.
    pub(super) fn peel<T: Target, const S: usize>(&self, b: &mut TileBuffers<T>, ids: &[TriangleId]) {
        let TileBuffers { layers: [layer, previous], depth, .. } = b;
        layer.clone_from(depth);
        previous.clone_from(depth);
        for _ in 0..self.layers {
            let [layer, previous] = &mut b.layers;
            std::mem::swap(layer, previous);
            layer.fill(1.0);
            let mut found = false;
            for id in ids {
                rasterize::<S>(self.triangle(id), self.at, |index, covered, z| {
                    for i in 0..4 {
                        if covered[i] && z[i] > previous[index + i] && z[i] < layer[index + i] {
                            layer[index + i] = z[i];
                            found = true;
                        }
                    }
                });
            }
            if !found {
                return;
            }
            ids.iter().for_each(|id| self.draw_triangle::<T, S>(b, id, SampleTest::Layer));
        }
        ids.iter().for_each(|id| self.draw_triangle::<T, S>(b, id, SampleTest::Nearer));
    }
}
