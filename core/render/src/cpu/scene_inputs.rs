//! CPU reference of inputs.wgsl: depth, normals, motion vectors and actors of the pixels, for image effects.

use super::CpuRenderer;
use super::preskin::DeformedMeshes;
use super::raster::{TILE_HEIGHT, TILE_WIDTH, rasterize};
use super::setup::Triangle;
use super::shadow::kept_texels;
use super::tile::{Batch, BatchShading, TriangleId, triangles_by_band};
use super::vertex::VertexStage;
use crate::lanes::unit;
use crate::plan::{Draw, Features, InputPass, Plan};
use choreo_plugin::{EffectFrame, EffectImage, SceneImages};
use glam::{Vec2, Vec3, Vec4, Vec4Swizzles};
use rayon::prelude::*;

/// Images of the scene's inputs that image effects read; empty where no effect reads them.
#[derive(Default)]
pub(crate) struct InputImages {
    pub surface: Vec<Vec4>,
    pub motion: Vec<Vec4>,
}

impl InputImages {
    pub(crate) fn effect_inputs<'a>(&'a self, plan: &'a Plan) -> EffectInputs<'a> {
        EffectInputs { size: plan.size, frame: &plan.effect_frame, inputs: self }
    }
}

/// Inputs that image effects read: the frame's numbers, and images of this size.
#[derive(Clone, Copy)]
pub(crate) struct EffectInputs<'a> {
    pub size: [u32; 2],
    pub frame: &'a EffectFrame,
    inputs: &'a InputImages,
}

impl<'a> EffectInputs<'a> {
    pub(crate) fn images(self, rows: &'a [Vec4; EffectFrame::ROWS]) -> SceneImages<'a> {
        let image = |rgba: &'a [Vec4]| (!rgba.is_empty()).then_some(EffectImage { size: self.size, rgba });
        SceneImages { surface: image(&self.inputs.surface), motion: image(&self.inputs.motion), rows }
    }
}

/// One instance of a draw: its batch, the numbers of its actor and material, and the clip-space positions of its vertices in the
/// previous frame.
struct DrawnCopy<'a> {
    batch: Batch<'a>,
    ids: [f32; 2],
    previous_clip: Vec<Vec4>,
}

impl CpuRenderer {
    /// The inputs that the plan's effects read.
    pub(super) fn scene_inputs(&self, plan: &Plan) -> InputImages {
        let Some(pass) = &plan.scene_inputs else { return InputImages::default() };
        let overrides = self.override_materials(plan);
        let (deformed, clip) = (DeformedMeshes::default(), &plan.view.clip_from_relative);
        let batches = self.batches(plan, (&pass.draws, &deformed), clip, plan.size, None, &overrides);
        let instances = pass.draws.iter().flat_map(|draw| {
            (draw.first_instance..draw.first_instance + draw.instance_count).map(move |i| (draw, i as usize))
        });
        let copies: Vec<DrawnCopy> = batches
            .into_iter()
            .zip(instances)
            .map(|(batch, (draw, i))| {
                let tint = plan.instances[i].tint;
                let previous_clip = match pass.motion {
                    true => self.previous_clip_positions(plan, pass, draw, tint.y as usize),
                    false => Vec::new(),
                };
                DrawnCopy { batch, ids: [tint.x, tint.z], previous_clip }
            })
            .collect();
        draw_inputs(plan, pass.motion, &copies)
    }

    fn previous_clip_positions(
        &self,
        plan: &Plan,
        pass: &InputPass,
        draw: &Draw,
        previous_instance: usize,
    ) -> Vec<Vec4> {
        let entry = &self.resources.primitives[draw.primitive as usize];
        let features = draw.pipeline.features;
        let instance = &plan.instances[previous_instance];
        let stage = VertexStage {
            displacements: self.displacements(plan, draw.pipeline.displaced),
            camera: pass.camera_before,
            ..VertexStage::new(entry, features, plan, instance, &pass.clip_before)
        };
        stage.project(stage.skinned_vertices(None)).into_iter().map(|vertex| vertex.clip).collect()
    }
}

/// Marks a pixel without a triangle.
const NO_TRIANGLE: TriangleId = [u32::MAX; 2];

fn draw_inputs(plan: &Plan, motion: bool, copies: &[DrawnCopy]) -> InputImages {
    let [width, height] = plan.size.map(|s| s as usize);
    let mut surface = vec![SceneImages::NO_SURFACE; width * height];
    let mut motion_vectors = vec![Vec4::ZERO; if motion { width * height } else { 0 }];
    let lists = triangles_by_band(copies.iter().map(|copy| &copy.batch), plan.size);
    let band = width * TILE_HEIGHT as usize;
    // Each band gets an empty slice if there are no motion vectors.
    let mut motion_bands: Vec<&mut [Vec4]> = motion_vectors.chunks_mut(band).collect();
    motion_bands.resize_with(lists.len(), Default::default);
    let motion_bands = surface.par_chunks_mut(band).zip(motion_bands).zip(lists).enumerate();
    motion_bands.for_each(|(number, ((surface, motion), list))| {
        let first = number * TILE_HEIGHT as usize;
        let nearest = nearest_triangles(copies, &list, [width, surface.len() / width], first as i32);
        for (i, (_, [copy, triangle])) in nearest.iter().enumerate().filter(|(_, (_, id))| *id != NO_TRIANGLE)
        {
            let copy = &copies[*copy as usize];
            let triangle = &copy.batch.triangles[*triangle as usize];
            let at = Vec2::new((i % width) as f32, (first + i / width) as f32) + 0.5;
            let weights = barycentric_weights(triangle, at);
            surface[i] = copy.normal_and_depth(plan, triangle, weights);
            if let Some(out) = motion.get_mut(i) {
                let [actor, material] = copy.ids;
                *out = copy.motion_vector(plan.size, triangle, weights, at).extend(actor).extend(material);
            }
        }
    });
    InputImages { surface, motion: motion_vectors }
}

/// The nearest triangle of each pixel of a band, with its depth. `first`: its first row.
fn nearest_triangles(
    copies: &[DrawnCopy],
    list: &[TriangleId],
    [width, height]: [usize; 2],
    first: i32,
) -> Vec<(f32, TriangleId)> {
    let mut nearest = vec![(0.0f32, NO_TRIANGLE); width * height];
    for [copy, number] in list {
        let batch = &copies[*copy as usize].batch;
        let triangle = &batch.triangles[*number as usize];
        let [x0, _, x1, _] = triangle.pixel_bounds();
        let columns = x0.max(0) / TILE_WIDTH..(x1.min(width as i32) + TILE_WIDTH - 1) / TILE_WIDTH;
        for column in columns {
            let at = [column * TILE_WIDTH, first];
            rasterize::<1>(triangle, at, |index, covered, z| {
                let kept = kept_texels(batch, triangle, at, index);
                for i in (0..4).filter(|i| covered[*i] && kept[*i]) {
                    let x = at[0] as usize + (index + i) % TILE_WIDTH as usize;
                    let y = (index + i) / TILE_WIDTH as usize;
                    if x < width && y < height && z[i] > nearest[y * width + x].0 {
                        nearest[y * width + x] = (z[i], [*copy, *number]);
                    }
                }
            });
        }
    }
    nearest
}

/// Perspective-correct weights of a triangle's vertices at the middle of a pixel.
fn barycentric_weights(triangle: &Triangle, at: Vec2) -> [f32; 3] {
    let [x, y] = [at.x - triangle.origin[0] as f32, at.y - triangle.origin[1] as f32];
    let e = triangle.edges.map(|[a, b, c]| x * a + y * b + c);
    let scale = 1.0 / (e[0] + e[1] + e[2]);
    e.map(|e| e * scale)
}

impl DrawnCopy<'_> {
    /// World-space normal, and depth in metres in front of the camera.
    fn normal_and_depth(&self, plan: &Plan, triangle: &Triangle, weights: [f32; 3]) -> Vec4 {
        let vertices = triangle.vertices.map(|v| &self.batch.vertices[v as usize]);
        let interpolate = |of: [Vec3; 3]| of[0] * weights[0] + of[1] * weights[1] + of[2] * weights[2];
        let positions = vertices.map(|v| v.relative);
        let relative = interpolate(positions);
        let eye = plan.view.eye;
        let depth = match eye.w > 0.5 {
            true => (plan.view.clip_from_relative * relative.extend(1.0)).w,
            false => -relative.dot(eye.truncate()),
        };
        let (features, double_sided) = match &self.batch.shading {
            BatchShading::Surface(fragment) => (fragment.features, fragment.double_sided),
            BatchShading::Overlay { .. } => (Features::default(), false),
        };
        let normal = match features.has_normals() {
            true => {
                let n = unit(interpolate(vertices.map(|v| v.normal)));
                if double_sided && !triangle.front { -n } else { n }
            }
            // A mesh without normals gets the normals of its triangles, turned to the viewer.
            false => {
                let n = unit((positions[1] - positions[0]).cross(positions[2] - positions[0]));
                let viewer = eye.truncate() - relative * eye.w;
                if n.dot(viewer) < 0.0 { -n } else { n }
            }
        };
        normal.extend(depth)
    }

    /// Motion in pixels since the previous frame; zero for a point that was behind the camera then.
    fn motion_vector(&self, size: [u32; 2], triangle: &Triangle, weights: [f32; 3], at: Vec2) -> Vec2 {
        let [a, b, c] = triangle.vertices.map(|v| self.previous_clip[v as usize]);
        let before = a * weights[0] + b * weights[1] + c * weights[2];
        let size = Vec2::new(size[0] as f32, size[1] as f32);
        if before.w > 0.0 { at - (before.xy() / before.w * 0.5 + 0.5) * size } else { Vec2::ZERO }
    }
}
