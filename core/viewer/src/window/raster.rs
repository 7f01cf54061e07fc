//! CPU rasterizer of egui's triangles, for a window that no Vulkan driver can draw. Colors are blended as egui expects: premultiplied alpha, in
//! sRGB. A pixel belongs to a triangle that contains its center. Of two triangles with a common edge it belongs to exactly one, because both
//! compute the same end of a row from that edge, and the spans of rows are half-open.

use egui::epaint::{ImageDelta, Primitive, Vertex};
use egui::{ClippedPrimitive, Color32, ImageData, Pos2, Rect, TextureFilter, TextureId, TexturesDelta};
use glam::{Vec2, Vec4};
use std::collections::BTreeMap;

/// A texture with premultiplied colors.
pub struct Texture {
    width: usize,
    height: usize,
    pixels: Vec<Color32>,
    is_nearest_filtered: bool,
}

impl Texture {
    /// An opaque texture from rows of RGBA bytes, whose alpha is ignored. `old`: a texture whose memory is reused.
    pub fn opaque(old: Option<Texture>, width: u32, height: u32, rgba: &[u8]) -> Texture {
        let mut pixels = old.map(|old| old.pixels).unwrap_or_default();
        pixels.clear();
        pixels.extend(rgba.chunks_exact(4).map(|p| Color32::from_rgb(p[0], p[1], p[2])));
        Texture { width: width as usize, height: height as usize, pixels, is_nearest_filtered: false }
    }

    /// Bilinear sample at texture coordinates from 0 to 1, clamped to the edge. RGBA, 0 to 255.
    fn sample(&self, at: Vec2) -> Vec4 {
        let (x, y) = (at.x * self.width as f32 - 0.5, at.y * self.height as f32 - 0.5);
        let part = |at: f32, size: usize| {
            let at = at.clamp(0.0, (size - 1) as f32);
            let low = at as usize;
            (low, (low + 1).min(size - 1), at - low as f32)
        };
        let (x0, x1, fx) = part(x, self.width);
        let (y0, y1, fy) = part(y, self.height);
        let at = |x: usize, y: usize| vec4_from_color(self.pixels[y * self.width + x]);
        // If texels map to pixels one to one, the bytes are used unchanged.
        const MAX_TEXEL_OFFSET: f32 = 1.0 / 256.0;
        let near = |f: f32| !(MAX_TEXEL_OFFSET..=1.0 - MAX_TEXEL_OFFSET).contains(&f);
        if self.is_nearest_filtered || (near(fx) && near(fy)) {
            return at(if fx > 0.5 { x1 } else { x0 }, if fy > 0.5 { y1 } else { y0 });
        }
        at(x0, y0).lerp(at(x1, y0), fx).lerp(at(x0, y1).lerp(at(x1, y1), fx), fy)
    }
}

/// Red, green, blue and alpha, 0 to 255.
fn vec4_from_color(color: Color32) -> Vec4 {
    Vec4::from_array(color.to_array().map(f32::from))
}

/// All textures of a window.
#[derive(Default)]
pub struct Textures(BTreeMap<TextureId, Texture>);

impl Textures {
    pub fn insert(&mut self, id: TextureId, make: impl FnOnce(Option<Texture>) -> Texture) {
        let old = self.0.remove(&id);
        self.0.insert(id, make(old));
    }

    /// Applies changed textures and empties their list. Textures to free stay in the list, since the frame may still use them.
    pub fn apply_changes(&mut self, delta: &mut TexturesDelta) {
        // The list is emptied at once: egui reports an error if it is dropped with content.
        for (id, deltas) in std::mem::take(&mut delta.set) {
            deltas.into_iter().for_each(|delta| self.set(id, delta));
        }
    }

    pub fn free(&mut self, delta: &mut TexturesDelta) {
        for id in std::mem::take(&mut delta.free) {
            self.0.remove(&id);
        }
    }

    fn set(&mut self, id: TextureId, delta: ImageDelta) {
        let ImageData::Color(image) = &delta.image;
        let [width, height] = image.size;
        let is_nearest_filtered = delta.options.magnification == TextureFilter::Nearest;
        match (delta.pos, self.0.get_mut(&id)) {
            (None, _) => {
                let pixels = image.pixels.clone();
                self.0.insert(id, Texture { width, height, pixels, is_nearest_filtered });
            }
            (Some([left, top]), Some(texture)) if width > 0 => {
                for (row, from) in image.pixels.chunks_exact(width).enumerate() {
                    let at = (top + row) * texture.width + left;
                    if let Some(to) = texture.pixels.get_mut(at..at + width) {
                        to.copy_from_slice(from);
                    }
                }
            }
            _ => {}
        }
    }
}

/// Some rows of pixels of a window, 0x00RRGGBB.
struct RowTarget<'a> {
    width: usize,
    /// Index of the first row.
    first_row: usize,
    pixels: &'a mut [u32],
}

/// Draws triangles into a window, with its rows divided among threads.
pub fn draw(
    pixels: &mut [u32],
    width: usize,
    primitives: &[ClippedPrimitive],
    pixels_per_point: f32,
    textures: &Textures,
) {
    let threads = std::thread::available_parallelism().map_or(1, usize::from).min(MAX_THREADS);
    let rows = (pixels.len() / width.max(1)).div_ceil(threads).max(1);
    std::thread::scope(|scope| {
        let mut parts = pixels.chunks_mut(width.max(1) * rows).enumerate();
        let own = parts.next();
        let draw = move |(part, pixels)| {
            RowTarget { width, first_row: part * rows, pixels }.draw(primitives, pixels_per_point, textures);
        };
        parts.for_each(|part| drop(scope.spawn(move || draw(part))));
        own.into_iter().for_each(draw);
    });
}

/// More threads find little to do.
const MAX_THREADS: usize = 8;

impl RowTarget<'_> {
    /// Draws triangles over the existing pixels.
    fn draw(&mut self, primitives: &[ClippedPrimitive], pixels_per_point: f32, textures: &Textures) {
        for ClippedPrimitive { clip_rect, primitive } in primitives {
            let Primitive::Mesh(mesh) = primitive else { continue };
            let Some(texture) = textures.0.get(&mesh.texture_id).filter(|t| !t.pixels.is_empty()) else {
                continue;
            };
            let clip = self.clip_in_pixels(*clip_rect * pixels_per_point);
            if clip[0] >= clip[2] || clip[1] >= clip[3] {
                continue;
            }
            let vertex = |index: u32| {
                let vertex = mesh.vertices.get(index as usize)?;
                Some(Vertex { pos: vertex.pos * pixels_per_point, ..*vertex })
            };
            for indices in mesh.indices.chunks_exact(3) {
                if let [Some(a), Some(b), Some(c)] = [indices[0], indices[1], indices[2]].map(vertex) {
                    self.draw_triangle([a, b, c], clip, texture);
                }
            }
        }
    }

    /// Left, top, right and bottom of a clip rectangle in whole pixels of the window, limited to this target.
    fn clip_in_pixels(&self, rect: Rect) -> [usize; 4] {
        let within = |at: f32, [low, high]: [usize; 2]| at.round().clamp(low as f32, high as f32) as usize;
        let (columns, rows) =
            ([0, self.width], [self.first_row, self.first_row + self.pixels.len() / self.width.max(1)]);
        [
            within(rect.min.x, columns),
            within(rect.min.y, rows),
            within(rect.max.x, columns),
            within(rect.max.y, rows),
        ]
    }

    fn draw_triangle(&mut self, mut vertices: [Vertex; 3], clip: [usize; 4], texture: &Texture) {
        vertices.sort_by(|a, b| a.pos.y.total_cmp(&b.pos.y));
        let [a, b, c] = vertices.map(|vertex| vertex.pos);
        let rows = pixel_range(a.y, c.y, clip[1], clip[3]);
        if rows.is_empty() {
            return;
        }
        let Some(paint) = TrianglePaint::new(&vertices, texture) else { return };
        let (long, upper, lower) = (Edge::new(a, c), Edge::new(a, b), Edge::new(b, c));
        for y in rows {
            let center = y as f32 + 0.5;
            let long = long.crossing(center);
            let short = if center < b.y { upper.crossing(center) } else { lower.crossing(center) };
            let span = pixel_range(long.min(short), long.max(short), clip[0], clip[2]);
            if span.is_empty() {
                continue;
            }
            let from = span.start as f32 + 0.5;
            let start = (y - self.first_row) * self.width;
            paint.row(&mut self.pixels[start + span.start..start + span.end], from, center);
        }
    }
}

/// Pixels whose centers lie in [low, high), limited to `from..until`.
fn pixel_range(low: f32, high: f32, from: usize, until: usize) -> std::ops::Range<usize> {
    let first = |at: f32| {
        let at = (at - 0.5).clamp(from as f32, until.max(from) as f32);
        let whole = at as usize;
        whole + usize::from((whole as f32) < at)
    };
    first(low)..first(high)
}

/// An edge of a triangle, given by its upper end.
struct Edge {
    from: Pos2,
    /// Change of x per row.
    slope: f32,
}

impl Edge {
    /// The edge between two vertices, the same for both triangles that share it.
    fn new(a: Pos2, b: Pos2) -> Edge {
        // A horizontal edge may have its vertices in any order, and is crossed by no row center.
        let (a, b) = if (a.y, a.x) <= (b.y, b.x) { (a, b) } else { (b, a) };
        let slope = if b.y <= a.y { 0.0 } else { (b.x - a.x) / (b.y - a.y) };
        Edge { from: a, slope }
    }

    /// X coordinate of the edge at the center of a row.
    fn crossing(&self, y: f32) -> f32 {
        self.from.x + (y - self.from.y) * self.slope
    }
}

/// Linear interpolation over a triangle: the value at a vertex, and its change per pixel to the right and down.
#[derive(Clone, Copy)]
struct Gradient<T> {
    value_at_vertex: T,
    d_dx: T,
    d_dy: T,
}

/// Edges of a triangle from its first vertex, and twice its area.
struct TriangleEdges {
    to_b: egui::Vec2,
    to_c: egui::Vec2,
    doubled_area: f32,
}

impl<T> Gradient<T>
where
    T: Copy + PartialEq + std::ops::Sub<Output = T> + std::ops::Add<Output = T>,
    T: std::ops::Mul<f32, Output = T> + std::ops::Div<f32, Output = T>,
{
    /// Interpolation of values at the vertices. `None` if they are all equal.
    fn new([a, b, c]: [T; 3], edges: &TriangleEdges) -> Option<Gradient<T>> {
        if a == b && a == c {
            return None;
        }
        let (b, c, TriangleEdges { to_b, to_c, doubled_area }) = (b - a, c - a, edges);
        let d_dx = (b * to_c.y - c * to_b.y) / *doubled_area;
        let d_dy = (c * to_b.x - b * to_c.x) / *doubled_area;
        Some(Gradient { value_at_vertex: a, d_dx, d_dy })
    }

    fn value(&self, right: f32, down: f32) -> T {
        self.value_at_vertex + self.d_dx * right + self.d_dy * down
    }
}

/// Interpolated colors of one triangle.
struct TrianglePaint<'a> {
    origin: Pos2,
    texture: &'a Texture,
    /// Vertex colors, premultiplied, 0 to 255. `None` if they are all equal.
    tint: Option<Gradient<Vec4>>,
    uv: Option<Gradient<Vec2>>,
    /// Vertex color and texel at the first vertex.
    first_vertex: (Vec4, Vec4),
}

impl TrianglePaint<'_> {
    /// `None` for a triangle without area.
    fn new<'a>(vertices: &[Vertex; 3], texture: &'a Texture) -> Option<TrianglePaint<'a>> {
        let [a, b, c] = vertices;
        let (to_b, to_c) = (b.pos - a.pos, c.pos - a.pos);
        let edges = TriangleEdges { to_b, to_c, doubled_area: to_b.x * to_c.y - to_b.y * to_c.x };
        if !(edges.doubled_area.abs() > 1e-12 && edges.doubled_area.is_finite()) {
            return None;
        }
        let uv = |vertex: &Vertex| Vec2::new(vertex.uv.x, vertex.uv.y);
        Some(TrianglePaint {
            origin: a.pos,
            texture,
            tint: Gradient::new([a, b, c].map(|vertex| vec4_from_color(vertex.color)), &edges),
            uv: Gradient::new([a, b, c].map(uv), &edges),
            first_vertex: (vec4_from_color(a.color), texture.sample(uv(a))),
        })
    }

    /// Draws a row of pixels, the first with its center at `x`.
    fn row(&self, row: &mut [u32], x: f32, y: f32) {
        let (dx, dy) = (x - self.origin.x, y - self.origin.y);
        let (tint, texel) = self.first_vertex;
        let pixels = (0u32..).zip(row.iter_mut()).map(|(step, pixel)| (dx + step as f32, pixel));
        match (&self.tint, &self.uv) {
            (None, None) => {
                let color = multiply_colors(tint, texel);
                match color.w >= OPAQUE_ALPHA {
                    true => row.fill(pack_color(color)),
                    false => row.iter_mut().for_each(|pixel| *pixel = blend_over(color, *pixel)),
                }
            }
            (Some(tint), None) => {
                pixels.for_each(|(right, pixel)| {
                    paint_pixel(pixel, multiply_colors(tint.value(right, dy), texel))
                });
            }
            (None, Some(uv)) => pixels.for_each(|(right, pixel)| {
                paint_pixel(pixel, multiply_colors(tint, self.texture.sample(uv.value(right, dy))));
            }),
            (Some(tint), Some(uv)) => pixels.for_each(|(right, pixel)| {
                let texel = self.texture.sample(uv.value(right, dy));
                paint_pixel(pixel, multiply_colors(tint.value(right, dy), texel));
            }),
        }
    }
}

/// Alpha above which a color is drawn as opaque.
const OPAQUE_ALPHA: f32 = 254.5;

fn multiply_colors(a: Vec4, b: Vec4) -> Vec4 {
    (a * b / 255.0).clamp(Vec4::ZERO, Vec4::splat(255.0))
}

fn paint_pixel(pixel: &mut u32, color: Vec4) {
    // Most pixels of a glyph's quad are empty.
    if color != Vec4::ZERO {
        *pixel = if color.w >= OPAQUE_ALPHA { pack_color(color) } else { blend_over(color, *pixel) };
    }
}

fn pack_color(color: Vec4) -> u32 {
    let [r, g, b, _] = color.to_array().map(|c| (c + 0.5) as u32);
    r << 16 | g << 8 | b
}

/// A premultiplied color over an opaque one (Porter and Duff 1984).
fn blend_over(color: Vec4, below: u32) -> u32 {
    let through = 1.0 - color.w / 255.0;
    let channel = |shift: u32| (below >> shift & 0xff) as f32;
    let below = Vec4::new(channel(16), channel(8), channel(0), 0.0);
    pack_color((color + below * through).min(Vec4::splat(255.0)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use egui::epaint::Mesh;
    use egui::{ColorImage, pos2};

    const WHITE: Pos2 = pos2(0.5, 0.5);

    fn textures() -> Textures {
        let mut textures = Textures::default();
        let image = ColorImage::filled([1, 1], Color32::WHITE);
        textures.set(TextureId::default(), ImageDelta::full(image, egui::TextureOptions::LINEAR));
        textures
    }

    fn draw_mesh(mesh: Mesh, size: usize, below: u32, textures: &Textures) -> Vec<u32> {
        let clip_rect = Rect::from_min_size(Pos2::ZERO, egui::Vec2::splat(size as f32));
        let primitive = ClippedPrimitive { clip_rect, primitive: Primitive::Mesh(mesh) };
        let mut pixels = vec![below; size * size];
        draw(&mut pixels, size, &[primitive], 1.0, textures);
        pixels
    }

    /// Random numbers from 0 to 1 (Marsaglia's xorshift, 2003).
    struct Random(u64);

    impl Random {
        fn next(&mut self) -> f32 {
            self.0 ^= self.0 << 13;
            self.0 ^= self.0 >> 7;
            self.0 ^= self.0 << 17;
            (self.0 % 10_000) as f32 / 10_000.0
        }
    }

    /// Ground truth: the signs of three cross products in f64. Centers extremely close to an edge may go either way.
    #[test]
    fn a_triangle_covers_the_pixels_whose_centers_it_holds() {
        let mut random = Random(7);
        for _ in 0..200 {
            let mut point = || pos2(random.next() * 40.0 - 4.0, random.next() * 40.0 - 4.0);
            let positions = [point(), point(), point()];
            let vertices = positions.map(|pos| Vertex { pos, uv: WHITE, color: Color32::WHITE }).to_vec();
            let mesh = Mesh { vertices, indices: vec![0, 1, 2], ..Mesh::default() };
            let pixels = draw_mesh(mesh, 32, 0, &textures());
            for (at, pixel) in pixels.iter().enumerate() {
                let center = [(at % 32) as f64 + 0.5, (at / 32) as f64 + 0.5];
                let side = |i: usize| {
                    let (a, b) = (positions[i], positions[(i + 1) % 3]);
                    let (a, b) = ([f64::from(a.x), f64::from(a.y)], [f64::from(b.x), f64::from(b.y)]);
                    (b[0] - a[0]) * (center[1] - a[1]) - (b[1] - a[1]) * (center[0] - a[0])
                };
                let sides = [side(0), side(1), side(2)];
                if sides.iter().any(|s| s.abs() < 1e-3) {
                    continue;
                }
                let inside = sides.iter().all(|s| *s > 0.0) || sides.iter().all(|s| *s < 0.0);
                assert_eq!(*pixel != 0, inside, "{positions:?} at {center:?}");
            }
        }
    }

    /// Half-transparent triangles around a point: a pixel covered by two of them would be brighter, and one covered by none darker.
    #[test]
    fn triangles_with_common_edges_cover_each_pixel_once() {
        let mut random = Random(99);
        for _ in 0..50 {
            let around = [pos2(-9.0, -9.0), pos2(41.0, -9.0), pos2(41.0, 41.0), pos2(-9.0, 41.0)];
            let middle = pos2((random.next() * 64.0).round() / 2.0, random.next() * 32.0);
            let mut mesh = Mesh::default();
            let color = Color32::from_rgba_premultiplied(100, 100, 100, 128);
            let vertices = around.into_iter().chain([middle]).map(|pos| Vertex { pos, uv: WHITE, color });
            mesh.vertices = vertices.collect();
            mesh.indices = (0..4).flat_map(|i| [i, (i + 1) % 4, 4]).collect();
            let pixels = draw_mesh(mesh, 32, 0, &textures());
            assert!(pixels.iter().all(|p| *p == 0x646464), "{middle:?}");
        }
    }

    /// Ground truth: the closed forms of a gradient and of blending, in f64.
    #[test]
    fn colors_are_interpolated_and_blended() {
        let mut mesh = Mesh::default();
        let vertex = |x: f32, y: f32, value: u8, alpha: u8| Vertex {
            pos: pos2(x, y),
            uv: WHITE,
            color: Color32::from_rgba_premultiplied(value, 0, 0, alpha),
        };
        mesh.vertices = vec![
            vertex(0.0, 0.0, 0, 50),
            vertex(32.0, 0.0, 160, 200),
            vertex(0.0, 32.0, 0, 50),
            vertex(32.0, 32.0, 160, 200),
        ];
        mesh.indices = vec![0, 1, 2, 1, 2, 3];
        let pixels = draw_mesh(mesh, 32, 0x404040, &textures());
        for (at, pixel) in pixels.iter().enumerate() {
            let along = ((at % 32) as f64 + 0.5) / 32.0;
            let alpha = 50.0 + 150.0 * along;
            let red = 160.0 * along + 64.0 * (1.0 - alpha / 255.0);
            let green = 64.0 * (1.0 - alpha / 255.0);
            let off = |shift: u32, wanted: f64| ((pixel >> shift & 0xff) as f64 - wanted).abs();
            assert!(off(16, red) < 0.51 && off(8, green) < 0.51, "{pixel:x} at {at}: {red} {green}");
        }
    }

    /// An image drawn pixel by pixel keeps its bytes, also away from the origin; at twice the size it has the means of neighboring pixels.
    #[test]
    fn opaque_images_are_copied_byte_for_byte() {
        let rgba: Vec<u8> = (0..64).flat_map(|i| [i as u8 * 4, 255 - i as u8, 7, 0]).collect();
        let mut textures = textures();
        let id = TextureId::User(3);
        textures.insert(id, |old| Texture::opaque(old, 8, 8, &rgba));
        let shown = |size: f32| {
            let mut mesh = Mesh::with_texture(id);
            let place = Rect::from_min_size(pos2(5.0, 9.0), egui::Vec2::splat(size));
            mesh.add_rect_with_uv(place, Rect::from_min_max(Pos2::ZERO, pos2(1.0, 1.0)), Color32::WHITE);
            draw_mesh(mesh, 32, 0, &textures)
        };
        let pixels = shown(8.0);
        for y in 0..8 {
            for x in 0..8 {
                let i = (y * 8 + x) as u32;
                let wanted = (i * 4) << 16 | (255 - i) << 8 | 7;
                assert_eq!(pixels[(y + 9) * 32 + x + 5], wanted);
            }
        }
        assert_eq!(pixels.iter().filter(|p| **p != 0).count(), 64);
        // A quarter of the way from pixel 0 to pixel 1: 0 + 4 · 0.25.
        assert_eq!(shown(16.0)[9 * 32 + 5 + 1] >> 16, 1);
    }
}
