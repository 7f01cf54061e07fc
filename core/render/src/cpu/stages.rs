//! Images of the rasterizer's stages: the vertices of each mesh, the scene in front of the camera, clip space, the pixels that
//! triangles cover, their depths, and the shaded frame.

use super::CpuRenderer;
use super::preskin::DeformedMeshes;
use super::raster::{TILE_HEIGHT, TILE_PIXELS, TILE_WIDTH, rasterize};
use super::tile::{Batch, BatchShading};
use crate::error::RenderError;
use crate::plan::Plan;
use crate::renderer::Renderer;
use choreo_asset::{Primitive, Topology};
use choreo_plugin::Frame;
use glam::{Vec2, Vec3};

/// Names of the stages, in order.
pub const STAGE_IMAGE_NAMES: [&str; 6] = ["model", "view", "clip", "raster", "depth", "shade"];

const BACKGROUND_COLOR: [u8; 4] = [18, 20, 26, 255];
const GUIDE_COLOR: [u8; 3] = [120, 130, 150];

/// Color of an index. Successive hues differ by the golden ratio, so that neighbors are easy to distinguish.
fn index_color(index: usize) -> [u8; 3] {
    let hue = |shift: f32| {
        let turn = index as f32 * 0.618_034 + shift;
        let wave = ((turn - turn.floor()) * 6.0 - 3.0).abs() - 1.0;
        (90.0 + 160.0 * wave.clamp(0.0, 1.0)) as u8
    };
    [hue(0.0), hue(1.0 / 3.0), hue(2.0 / 3.0)]
}

fn blank_frame([width, height]: [u32; 2]) -> Frame {
    Frame { width, height, rgba: BACKGROUND_COLOR.repeat(width as usize * height as usize) }
}

fn set_pixel(frame: &mut Frame, x: i64, y: i64, color: [u8; 3]) {
    if (0..i64::from(frame.width)).contains(&x) && (0..i64::from(frame.height)).contains(&y) {
        let at = 4 * (y as usize * frame.width as usize + x as usize);
        frame.rgba[at..at + 3].copy_from_slice(&color);
    }
}

/// Draws a line: one pixel, or a square of pixels in large images, for each step along its longer axis. A line with an end that is
/// not finite or far outside the image is not drawn.
fn draw_line(frame: &mut Frame, a: Vec2, b: Vec2, color: [u8; 3]) {
    let limit = 4.0 * frame.width.max(frame.height) as f32;
    if !(a.abs().max_element() < limit && b.abs().max_element() < limit) {
        return;
    }
    let steps = (b - a).abs().max_element().ceil().max(1.0) as usize;
    let line_width = i64::from(frame.height.div_ceil(480));
    for i in 0..=steps {
        let p = a.lerp(b, i as f32 / steps as f32).floor();
        for (x, y) in (0..line_width).flat_map(|x| (0..line_width).map(move |y| (x, y))) {
            set_pixel(frame, p.x as i64 + x, p.y as i64 + y, color);
        }
    }
}

/// Transform that fits points into an image with a margin, with the same scale along both axes.
struct FitTransform {
    scale: f32,
    points_center: Vec2,
    image_center: Vec2,
}

impl FitTransform {
    fn new(points: impl Iterator<Item = Vec2>, size: [u32; 2]) -> FitTransform {
        let (mut low, mut high) = (Vec2::INFINITY, Vec2::NEG_INFINITY);
        points.filter(|p| p.is_finite()).for_each(|p| (low, high) = (low.min(p), high.max(p)));
        let (low, high) = if low.is_finite() { (low, high) } else { (Vec2::NEG_ONE, Vec2::ONE) };
        let image_size = Vec2::new(size[0] as f32, size[1] as f32);
        let scale = (image_size * 0.86 / (high - low).max(Vec2::splat(1e-6))).min_element();
        FitTransform { scale, points_center: (low + high) * 0.5, image_center: image_size * 0.5 }
    }

    /// Pixel position of a point whose y axis points up.
    fn pixel_position(&self, p: Vec2) -> Vec2 {
        let p = (p - self.points_center) * self.scale;
        self.image_center + Vec2::new(p.x, -p.y)
    }
}

/// Draws the edges of every triangle. `position`: pixel position of a vertex.
fn draw_edges(frame: &mut Frame, indices: &[u32], position: &dyn Fn(u32) -> Option<Vec2>, color: [u8; 3]) {
    for t in indices.chunks_exact(3) {
        for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
            if let (Some(a), Some(b)) = (position(a), position(b)) {
                draw_line(frame, a, b, color);
            }
        }
    }
}

/// The batch of an instance of a triangle mesh, and its primitive.
type Mesh<'a> = (&'a Batch<'a>, &'a Primitive);

fn triangle_mesh<'a>(batch: &'a Batch<'a>) -> Option<Mesh<'a>> {
    match &batch.shading {
        BatchShading::Surface(f) if f.primitive.topology == Topology::Triangles => Some((batch, f.primitive)),
        _ => None,
    }
}

impl CpuRenderer {
    /// Images of a frame's stages in the order of [`STAGE_IMAGE_NAMES`], each of the plan's size. Lines and points are left out: they have no
    /// edges.
    ///
    /// # Errors
    /// Fails as submitting the plan does.
    pub fn draw_stage_images(&mut self, plan: &Plan) -> Result<Vec<Frame>, RenderError> {
        self.submit(plan.clone())?;
        let shaded = self.collect(None)?;
        let overrides = self.override_materials(plan);
        let clip_from_relative = &plan.view.clip_from_relative;
        let batches = self.batches(
            plan,
            (&plan.draws, &DeformedMeshes::default()),
            clip_from_relative,
            plan.size,
            None,
            &overrides,
        );
        let meshes: Vec<Mesh> = batches.iter().filter_map(triangle_mesh).collect();
        let mut frames = vec![
            draw_model_stage(&meshes, plan.size),
            draw_view_stage(&meshes, plan),
            draw_clip_stage(&meshes, plan.size),
        ];
        frames.extend(draw_raster_and_depth_stages(&batches, plan.size));
        frames.push(shaded);
        Ok(frames)
    }
}

/// Image of the stage "model": each mesh in its own space, from the front.
fn draw_model_stage(meshes: &[Mesh], size: [u32; 2]) -> Frame {
    let mut frame = blank_frame(size);
    let all = meshes.iter().flat_map(|(_, primitive)| &primitive.positions);
    let fit = FitTransform::new(all.map(|p| p.truncate()), size);
    for (i, (_, primitive)) in meshes.iter().enumerate() {
        let position = |v: u32| primitive.positions.get(v as usize).map(|p| fit.pixel_position(p.truncate()));
        draw_edges(&mut frame, &primitive.indices, &position, index_color(i));
    }
    let (x, y) = (fit.pixel_position(Vec2::ZERO), fit.pixel_position(Vec2::ZERO));
    draw_line(&mut frame, x - Vec2::X * 12.0, x + Vec2::X * 12.0, GUIDE_COLOR);
    draw_line(&mut frame, y - Vec2::Y * 12.0, y + Vec2::Y * 12.0, GUIDE_COLOR);
    frame
}

/// Image of the stage "view": the scene from above, with the camera at the bottom. x points to the right, the camera's forward
/// direction up.
fn draw_view_stage(meshes: &[Mesh], plan: &Plan) -> Frame {
    let mut frame = blank_frame(plan.size);
    let top_view = |relative: Vec3| {
        let v = plan.view.view_from_relative.transform_point3(relative);
        Vec2::new(v.x, -v.z)
    };
    let all = meshes.iter().flat_map(|(batch, _)| &batch.vertices).map(|v| top_view(v.relative));
    let fit = FitTransform::new(all.chain([Vec2::ZERO]), plan.size);
    // Left and right edge of the view frustum.
    let far = plan.size[0].max(plan.size[1]) as f32 / fit.scale;
    let half = 1.0 / plan.view.clip_from_view.x_axis.x;
    for side in [-1.0, 1.0] {
        let (from, to) = match plan.view.eye.w > 0.5 {
            true => (Vec2::ZERO, Vec2::new(side * half * far, far)),
            false => (Vec2::new(side * half, 0.0), Vec2::new(side * half, far)),
        };
        draw_line(&mut frame, fit.pixel_position(from), fit.pixel_position(to), GUIDE_COLOR);
    }
    for (i, (batch, primitive)) in meshes.iter().enumerate() {
        let position =
            |v: u32| batch.vertices.get(v as usize).map(|v| fit.pixel_position(top_view(v.relative)));
        draw_edges(&mut frame, &primitive.indices, &position, index_color(i));
    }
    frame
}

/// Image of the stage "clip": the meshes after the division by w, with x and y ±1 at the frame's border. Vertices behind the
/// camera are left out.
fn draw_clip_stage(meshes: &[Mesh], size: [u32; 2]) -> Frame {
    let mut frame = blank_frame(size);
    let image_size = Vec2::new(size[0] as f32, size[1] as f32);
    // The scale leaves a margin around the border.
    let position = |ndc: Vec2| image_size * (0.5 + ndc * 0.36);
    let corners = [Vec2::new(-1.0, -1.0), Vec2::new(1.0, -1.0), Vec2::ONE, Vec2::new(-1.0, 1.0)];
    for (i, (batch, primitive)) in meshes.iter().enumerate() {
        let vertex_position = |v: u32| {
            let clip = batch.vertices.get(v as usize)?.clip;
            (clip.w > 0.0).then(|| position(Vec2::new(clip.x, clip.y) / clip.w))
        };
        draw_edges(&mut frame, &primitive.indices, &vertex_position, index_color(i));
    }
    for i in 0..4 {
        draw_line(&mut frame, position(corners[i]), position(corners[(i + 1) % 4]), [230, 230, 230]);
    }
    frame
}

/// Images of the stages "raster" (the nearest triangle of each pixel, every triangle in another color) and "depth" (the nearest
/// pixel is white).
fn draw_raster_and_depth_stages(batches: &[Batch], size: [u32; 2]) -> [Frame; 2] {
    let [mut covered, mut depths] = [blank_frame(size), blank_frame(size)];
    let width = size[0] as usize;
    let mut nearest = vec![(0.0f32, usize::MAX); width * size[1] as usize];
    for (number, triangle) in batches.iter().flat_map(|b| &b.triangles).enumerate() {
        let [x0, y0, x1, y1] = triangle.pixel_bounds();
        let last = |v: i32, limit: u32| v.min(limit as i32);
        for ty in (y0.max(0) / TILE_HEIGHT..).take_while(|t| t * TILE_HEIGHT < last(y1, size[1])) {
            for tx in (x0.max(0) / TILE_WIDTH..).take_while(|t| t * TILE_WIDTH < last(x1, size[0])) {
                let at = [tx * TILE_WIDTH, ty * TILE_HEIGHT];
                rasterize::<1>(triangle, at, |index, hit, z| {
                    for i in (0..4).filter(|i| hit[*i] && index + i < TILE_PIXELS) {
                        let x = at[0] as usize + (index + i) % TILE_WIDTH as usize;
                        let y = at[1] as usize + (index + i) / TILE_WIDTH as usize;
                        if x < width && y < size[1] as usize && z[i] > nearest[y * width + x].0 {
                            nearest[y * width + x] = (z[i], number);
                        }
                    }
                });
            }
        }
    }
    // Reversed Z is 1 / distance, up to a factor. Its square root makes differences at large distances visible.
    let roots = nearest.iter().filter(|(_, id)| *id != usize::MAX).map(|(z, _)| z.sqrt());
    let (low, high) = roots.fold((f32::INFINITY, 0.0f32), |(l, h), z| (l.min(z), h.max(z)));
    for (i, (z, id)) in nearest.iter().enumerate().filter(|(_, (_, id))| *id != usize::MAX) {
        let (x, y) = ((i % width) as i64, (i / width) as i64);
        set_pixel(&mut covered, x, y, index_color(*id));
        let share = if high > low { (z.sqrt() - low) / (high - low) } else { 1.0 };
        set_pixel(&mut depths, x, y, [(40.0 + 215.0 * share) as u8; 3]);
    }
    [covered, depths]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighboring_indices_get_distinct_colors() {
        for i in 0..200 {
            let (a, b) = (index_color(i), index_color(i + 1));
            let off: i32 = (0..3).map(|c| (i32::from(a[c]) - i32::from(b[c])).abs()).sum();
            assert!(off > 60, "{i}: {a:?} {b:?}");
        }
    }

    #[test]
    fn line_draws_its_end_points_and_skips_non_finite_ones() {
        let mut frame = blank_frame([8, 8]);
        draw_line(&mut frame, Vec2::new(1.5, 1.5), Vec2::new(6.5, 3.5), [255; 3]);
        let lit = |x: usize, y: usize| frame.rgba[4 * (y * 8 + x)] == 255;
        assert!(lit(1, 1) && lit(6, 3) && !lit(7, 3) && !lit(0, 1));
        // Neither NaN nor a distant point is drawn.
        let before = frame.rgba.clone();
        draw_line(&mut frame, Vec2::NAN, Vec2::ONE, [9; 3]);
        draw_line(&mut frame, Vec2::splat(1e30), Vec2::ONE, [9; 3]);
        assert_eq!(frame.rgba, before);
    }
}
