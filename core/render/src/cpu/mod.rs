//! The CPU renderer: the reference of each shader, and the renderer where there is no Vulkan driver.
//!
//! vertex.rs, brdf.rs and shade.rs are the references of vertex.wgsl, brdf.wgsl and scene.wgsl; setup.rs and raster.rs
//! implement what Vulkan leaves to the device. Tiles are independent of each other: any number of threads gives the same bits.

mod anisotropy;
mod background_effects;
mod brdf;
mod coverage;
mod displace;
pub(crate) mod float_frames;
mod id_mattes;
pub mod image_passes;
mod layer_shading;
mod layers;
mod lighting;
mod material_overrides;
mod overlay;
mod parallax;
mod peel;
mod preskin;
mod raster;
mod reflection;
mod refraction;
pub(crate) mod scene_inputs;
mod setup;
mod shade;
mod shadow;
mod sky;
mod stage_times;
mod stages;
mod streams;
mod surface;
mod target;
mod texture;
mod thick_lines;
pub mod thin_film;
mod tile;
mod toon;
mod triplanar;
mod uv;
mod vertex;
mod view_transform;

use crate::effect_faults::EffectFaults;
use crate::error::RenderError;
use crate::plan::dissolve::dissolved;
use crate::plan::map_key::map_keys;
use crate::plan::motion_blur::Accumulated;
use crate::plan::{self, Draw, Features, Glass, OverlayPart, PipelineKey, Plan};
use crate::renderer::{DeviceInfo, DeviceKind, Renderer};
use crate::scene_resources::SceneResources;
use crate::sky::{SkyBackground, SkyMaps};
use background_effects::PixelBackground;
use choreo_plugin::{Effect, FloatFrame, Frame, Hook};
use choreo_stage::Background;
use float_frames::{FloatFrameRenderer, float_frame};
use glam::{Mat4, Vec4};
use preskin::DeformedMeshes;
use raster::{TILE_HEIGHT, TILE_WIDTH};
use rayon::prelude::*;
use refraction::SceneColorCopy;
use scene_inputs::InputImages;
use setup::PrimitiveAssembly;
use shade::{Fragment, ShadeMaterial};
use shadow::ShadowMaps;
use stage_times::Stage;
use std::collections::{HashMap, VecDeque};
use std::sync::{Arc, Mutex, PoisonError};
use target::{LinearFloat, OutputPixel, Srgb8, Target};
use texture::Texture;
use tile::{Batch, BatchShading, DrawPhase, Tile, TileBuffers, TriangleId, tile_bounds};
use vertex::{OutlineHull, VertexStage};

pub use stage_times::StageTimes;
pub use stages::STAGE_IMAGE_NAMES;

/// Largest width and height, in pixels.
pub(crate) const MAX_IMAGE_SIDE: u32 = 16384;

/// CPU renderer. A frame is drawn when it is collected, by all threads of the current rayon pool.
pub struct CpuRenderer {
    device: DeviceInfo,
    effects: Vec<Effect>,
    resources: Arc<SceneResources>,
    materials: Vec<ShadeMaterial>,
    textures: HashMap<TextureKey, Arc<Texture>>,
    /// The scene's sky, computed when a plan first shows it.
    sky: Option<Sky>,
    submitted: VecDeque<Plan>,
    /// Shadow maps of the previous frame. The next frame reuses the maps that have not changed.
    shadow_maps: Mutex<ShadowMaps>,
    times: Arc<StageTimes>,
    faults: Arc<EffectFaults>,
}

#[derive(Default)]
struct Sky {
    maps: Option<Arc<SkyMaps>>,
    background: Option<SkyBackground>,
}

/// Content hash, whether sRGB, whether with mipmaps.
type TextureKey = ([u8; 16], bool, bool);

impl CpuRenderer {
    pub fn new(effects: &[Effect]) -> CpuRenderer {
        CpuRenderer {
            device: DeviceInfo {
                kind: DeviceKind::CpuReference,
                name: "choreo CPU renderer".into(),
                driver: format!("choreo {}", env!("CARGO_PKG_VERSION")),
            },
            effects: effects.to_vec(),
            resources: Arc::default(),
            materials: Vec::new(),
            textures: HashMap::new(),
            sky: None,
            submitted: VecDeque::new(),
            shadow_maps: Mutex::default(),
            times: Arc::default(),
            faults: Arc::default(),
        }
    }

    /// Times of the stages, summed over all frames so far. Later frames are added.
    pub fn stage_times(&self) -> Arc<StageTimes> {
        self.times.clone()
    }

    fn check_plan(&self, plan: &Plan) -> Result<(), RenderError> {
        for (what, value) in [("image width", plan.size[0]), ("image height", plan.size[1])] {
            if value == 0 || value > MAX_IMAGE_SIDE {
                let (value, limit) = (u64::from(value), u64::from(MAX_IMAGE_SIDE));
                return Err(RenderError::Limit { what: what.into(), value, limit });
            }
        }
        if !matches!(plan.samples, 1 | 4) {
            let value = u64::from(plan.samples);
            return Err(RenderError::Limit { what: "number of samples (1 or 4)".into(), value, limit: 4 });
        }
        let c = &self.resources;
        let out_of_range = plan.draws.iter().chain(plan.shadow_draws()).any(|d| {
            d.primitive as usize >= c.primitives.len()
                || d.material as usize >= c.materials.len()
                || d.material_override.is_some_and(|material_override| {
                    material_override as usize >= plan.material_overrides.len()
                })
                || (d.first_instance as usize + d.instance_count as usize) > plan.instances.len()
        });
        if out_of_range {
            return Err(RenderError::Usage(
                "the plan belongs to scene resources that are not loaded: load them before you submit it"
                    .into(),
            ));
        }
        for pass in plan.post.iter().chain(&plan.scene_effects) {
            self.find_effect(&pass.effect)?;
        }
        plan.sub_plans().try_for_each(|part| self.check_plan(part))
    }

    fn find_effect(&self, name: &str) -> Result<&Effect, RenderError> {
        image_passes::find_effect(&self.effects, name)
    }

    /// Computes the maps and the background of the sky that the plan shows, unless they exist.
    fn prepare_sky(&mut self, plan: &Plan) {
        let (Some(shown), Some(panorama)) = (&plan.sky, &self.resources.sky) else { return };
        let sky = self.sky.get_or_insert_default();
        let all = || std::iter::once(plan).chain(plan.sub_plans()).flat_map(|p| &p.draws);
        if sky.maps.is_none() && all().any(|d| d.pipeline.features.has(Features::SKY)) {
            sky.maps = Some(SkyMaps::of(panorama));
        }
        if sky.background.is_none() && shown.background {
            sky.background = Some(SkyBackground::new(panorama, MAX_IMAGE_SIDE));
        }
    }

    /// The scene effects with these bits, in order, each with its parameters.
    fn surface_effects(&self, plan: &Plan, effect_bits: u8) -> Vec<(Effect, Vec<f32>)> {
        let on = (0..8).zip(&plan.scene_effects).filter(|(bit, _)| effect_bits >> bit & 1 == 1);
        on.filter_map(|(_, used)| {
            Some((self.find_effect(&used.effect).ok()?.clone(), used.parameters.clone()))
        })
        .collect()
    }

    /// One batch for each instance of the draws, projected by the matrix onto an image of this size.
    fn batches<'a>(
        &'a self,
        plan: &'a Plan,
        (draws, deformed): (&[Draw], &DeformedMeshes),
        clip_from_relative: &Mat4,
        size: [u32; 2],
        shadows: Option<&'a ShadowMaps>,
        override_materials: &'a [ShadeMaterial],
    ) -> Vec<Batch<'a>> {
        let copies: Vec<(usize, usize)> = draws
            .iter()
            .enumerate()
            .flat_map(|(d, draw)| {
                (0..draw.instance_count).map(move |i| (d, (draw.first_instance + i) as usize))
            })
            .collect();
        copies
            .par_iter()
            .map(|&(draw, instance)| {
                let draw = &draws[draw];
                let entry = &self.resources.primitives[draw.primitive as usize];
                let primitive = entry.primitive();
                let features = draw.pipeline.features;
                let instance = &plan.instances[instance];
                let material = match draw.material_override {
                    Some(material_override) => &override_materials[material_override as usize],
                    None => &self.materials[draw.material as usize],
                };
                let hull = features.has(Features::OUTLINE).then(|| OutlineHull {
                    material,
                    normals: crate::scene_resources::vertex_layout::welded_normals(primitive),
                });
                let stage = VertexStage {
                    size,
                    hull,
                    displacements: self.displacements(plan, draw.pipeline.displaced),
                    ..VertexStage::new(entry, features, plan, instance, clip_from_relative)
                };
                let vertices = deformed.vertices(draw, &stage);
                let pipeline = draw.pipeline;
                let triangles = if features.has(Features::THICK_LINES) {
                    let (width, clip) = (instance.width, clip_from_relative);
                    thick_lines::thick_line_triangles(primitive, &vertices, pipeline, width, clip, size)
                } else {
                    let edges = features.has(Features::WIREFRAME);
                    let edges = edges
                        .then(|| crate::scene_resources::vertex_layout::unique_edges(&primitive.indices));
                    let indices = edges.as_ref().unwrap_or(&primitive.indices);
                    PrimitiveAssembly { vertices: &vertices, indices, pipeline, size }.run()
                };
                Batch {
                    shading: BatchShading::Surface(Fragment {
                        plan,
                        sky: self.sky.as_ref().and_then(|sky| sky.maps.as_deref()),
                        surface: self.surface_effects(plan, draw.pipeline.surface),
                        lighting: self.surface_effects(plan, draw.pipeline.lighting),
                        shadows,
                        scene_color: None,
                        features,
                        blend: draw.pipeline.blend,
                        coverage: draw.pipeline.coverage,
                        glass: draw.pipeline.glass,
                        double_sided: draw.pipeline.double_sided,
                        tint: instance.tint,
                        primitive,
                        material,
                    }),
                    peeled: draw.pipeline.peeled,
                    phase: match draw.pipeline {
                        k if !k.writes_depth() => DrawPhase::Blend,
                        k if k.is_transparent() || k.features.has(Features::ALPHA_MASK) => DrawPhase::Mask,
                        _ => DrawPhase::Opaque,
                    },
                    vertices,
                    triangles,
                }
            })
            .collect()
    }

    /// Overlays of effects: triangles, lines, points and lattices.
    fn overlays<'a>(&self, plan: &'a Plan) -> Vec<Batch<'a>> {
        let pipeline =
            PipelineKey { double_sided: true, blend: true, ..PipelineKey::of(Features::default()) };
        let batch = |part: &OverlayPart| {
            let (first, count) = (part.first as usize, part.count as usize);
            let drawn = &plan.overlay.vertices[first..first + count];
            let (vertices, indices) = (overlay::overlay_vertices(drawn), Vec::from_iter(0..part.count));
            let assembly =
                PrimitiveAssembly { vertices: &vertices, indices: &indices, pipeline, size: plan.size };
            let triangles = assembly.run();
            let shading = BatchShading::Overlay { vertices: drawn, over: part.over };
            Batch { shading, phase: DrawPhase::Blend, peeled: false, vertices, triangles }
        };
        plan.overlay.parts.iter().map(batch).collect()
    }

    /// Draws the mean of the sub-frames, then the full-screen passes over it.
    fn accumulate_sub_frames<const S: usize>(
        &self,
        plan: &Plan,
        frame: &mut Frame,
    ) -> Result<(), RenderError> {
        let count = plan.size[0] as usize * plan.size[1] as usize;
        let mut sum = Accumulated::new(count);
        let mut pixels = vec![Vec4::ZERO; count];
        for part in &plan.subframes {
            self.draw_tiles::<LinearFloat, Vec4, S>(part, &[], &mut pixels)?;
            sum.add(pixels.iter().copied());
        }
        let mut before = vec![vec![Vec4::ZERO; count]; plan.history.len()];
        for (part, pixels) in plan.history.iter().zip(&mut before) {
            self.draw_tiles::<LinearFloat, Vec4, S>(part, &[], pixels)?;
        }
        let passes = self.image_passes(plan)?;
        let inputs = self.times.measure(Stage::Pixels, || self.scene_inputs(plan));
        let scene = inputs.effect_inputs(plan);
        let run =
            || image_passes::run_to_bytes(&passes, scene, sum.mean(), &before, &self.faults, &mut frame.rgba);
        self.times.measure(Stage::ImageEffects, run);
        Ok(())
    }

    fn image_passes(&self, plan: &Plan) -> Result<Vec<image_passes::ImagePass>, RenderError> {
        image_passes::resolve_passes(&plan.post, plan.size, &self.effects)
    }

    fn draw_frame<T: Target, const S: usize>(
        &self,
        plan: &Plan,
        frame: &mut Frame,
    ) -> Result<(), RenderError> {
        let post = self.image_passes(plan)?;
        if post.iter().any(|p| p.effect.hook() == Hook::Image) {
            let mut pixels = vec![Vec4::ZERO; plan.size[0] as usize * plan.size[1] as usize];
            self.draw_tiles::<T, Vec4, S>(plan, &[], &mut pixels)?;
            let inputs = self.times.measure(Stage::Pixels, || self.scene_inputs(plan));
            let scene = inputs.effect_inputs(plan);
            let run = || image_passes::run_to_bytes(&post, scene, pixels, &[], &self.faults, &mut frame.rgba);
            self.times.measure(Stage::ImageEffects, run);
            return Ok(());
        }
        let (pixels, _) = frame.rgba.as_chunks_mut::<4>();
        self.draw_tiles::<T, [u8; 4], S>(plan, &post, pixels)
    }

    fn draw_tiles<T: Target, P: OutputPixel, const S: usize>(
        &self,
        plan: &Plan,
        post: &[image_passes::ImagePass],
        out: &mut [P],
    ) -> Result<(), RenderError> {
        let overrides = self.override_materials(plan);
        let deformed = self.times.measure(Stage::Vertices, || DeformedMeshes::of(self, plan));
        let kept_maps = || self.shadow_maps.lock().unwrap_or_else(PoisonError::into_inner);
        let draw_maps = |shadows: &plan::ShadowMaps| {
            let keys = map_keys(shadows, plan, &self.resources);
            ShadowMaps::draw(shadows, keys, std::mem::take(&mut kept_maps()), |view| {
                self.times.count_shadow_map();
                self.batches(
                    plan,
                    (&view.draws, &deformed),
                    &view.clip_from_relative,
                    view.size,
                    None,
                    &overrides,
                )
            })
        };
        let maps = self.times.measure(Stage::ShadowMaps, || plan.shadow_maps.as_ref().map(draw_maps));
        let clip_from_relative = &plan.view.clip_from_relative;
        let mut batches = self.times.measure(Stage::Vertices, || {
            self.batches(
                plan,
                (&plan.draws, &deformed),
                clip_from_relative,
                plan.size,
                maps.as_ref(),
                &overrides,
            )
        });
        let shown_sky = plan.sky.as_ref().filter(|sky| sky.background);
        let sky_background = self.sky.as_ref().and_then(|sky| sky.background.as_ref());
        let sky = shown_sky.zip(sky_background).map(|(sky, p)| sky::SkyBackdrop::new(p, sky, plan));
        let effects = self.surface_effects(plan, plan.background_effects);
        let needed = sky.is_some() || !effects.is_empty();
        let background = needed.then_some(PixelBackground { plan, sky, effects, faults: &self.faults });
        let glass_of = |b: &Batch| match &b.shading {
            BatchShading::Surface(fragment) => Some(fragment.glass),
            BatchShading::Overlay { .. } => None,
        };
        let refracting = |b: &Batch| glass_of(b) == Some(Glass::Refract);
        if let (Some(copy), Some(first)) = (plan.scene_color_copy, batches.iter().position(refracting)) {
            // The scene color copy shows the batches before the first refracting batch. Below, the image is drawn again from the
            // beginning.
            let mut pixels = vec![Vec4::ZERO; out.len()];
            let draw_before_glass = || {
                let (background, faults) = (background.as_ref(), &*self.faults);
                draw_bands::<T, Vec4, S>(plan, &batches[..first], background, &[], faults, &mut pixels);
            };
            self.times.measure(Stage::Pixels, draw_before_glass);
            let copy = Arc::new(SceneColorCopy::new(pixels, plan.size, copy.levels));
            let glass = batches[first..].iter_mut().filter(|b| refracting(b));
            glass.for_each(|b| b.shading.set_scene_color_copy(&copy));
        }
        // Overlays lie over all glass and are not part of the scene color copy.
        batches.extend(self.overlays(plan));
        self.times.measure(Stage::Pixels, || {
            draw_bands::<T, P, S>(plan, &batches, background.as_ref(), post, &self.faults, out);
        });
        drop(batches);
        if let Some(maps) = maps {
            *kept_maps() = maps;
        }
        Ok(())
    }
}

/// Draws all batches into the tiles of the image, band by band.
fn draw_bands<T: Target, P: OutputPixel, const S: usize>(
    plan: &Plan,
    batches: &[Batch],
    pixel_background: Option<&PixelBackground>,
    post: &[image_passes::ImagePass],
    faults: &EffectFaults,
    out: &mut [P],
) {
    let tile_spans: Vec<Vec<[u16; 4]>> =
        batches.par_iter().map(|b| b.triangles.iter().map(|t| tile_bounds(t, plan.size)).collect()).collect();
    // Range of tile bands that each batch touches: a band skips the batches outside it, which are most of a crowd.
    let batch_bands: Vec<[u16; 2]> = tile_spans
        .iter()
        .map(|s| s.iter().fold([u16::MAX, 0], |[low, high], s| [low.min(s[1]), high.max(s[3])]))
        .collect();

    let width = plan.size[0] as usize;
    let columns = width.div_ceil(TILE_WIDTH as usize);
    out.par_chunks_mut(width * TILE_HEIGHT as usize).enumerate().for_each_init(
        || (TileBuffers::<T>::new(S), vec![Vec::<TriangleId>::new(); columns]),
        |(buffers, lists), (band, pixels)| {
            for list in lists.iter_mut() {
                list.clear();
            }
            for (b, tile_spans) in tile_spans.iter().enumerate() {
                if !(batch_bands[b][0]..batch_bands[b][1]).contains(&(band as u16)) {
                    continue;
                }
                for (i, [x0, y0, x1, y1]) in tile_spans.iter().enumerate() {
                    if (*y0..*y1).contains(&(band as u16)) {
                        for list in &mut lists[*x0 as usize..*x1 as usize] {
                            list.push([b as u32, i as u32]);
                        }
                    }
                }
            }
            let y = band * TILE_HEIGHT as usize;
            let background = std::array::from_fn(|row| background_row_color(plan, y + row));
            for (column, list) in lists.iter().enumerate() {
                let x = column * TILE_WIDTH as usize;
                let tile = Tile {
                    batches,
                    list,
                    at: [x as i32, y as i32],
                    size: [(width - x).min(TILE_WIDTH as usize), pixels.len() / width],
                    image_size: plan.size,
                    background,
                    gradient: matches!(plan.background, Background::Gradient { .. }),
                    pixel_background,
                    layers_behind: plan.layers_behind.as_deref(),
                    layers: plan.depth_peeling.map_or(0, |peel| peel.layers),
                    post,
                    faults,
                };
                tile.draw::<T, P, S>(buffers, &mut pixels[x..], width);
            }
        },
    );
}

/// CPU reference of background.wgsl: mix(top, bottom, (y + ½) / height), linear.
fn background_row_color(plan: &Plan, y: usize) -> Vec4 {
    match plan.background {
        Background::Color(c) => c,
        Background::Gradient { top, bottom } => {
            let t = (y as f32 + 0.5) / plan.size[1] as f32;
            (top * (1.0 - t) + bottom * t).extend(1.0)
        }
    }
}

fn nothing_submitted() -> RenderError {
    RenderError::Usage("no frame is submitted: submit a plan before you collect a frame".into())
}

impl Renderer for CpuRenderer {
    fn set_effects(&mut self, effects: &[Effect]) -> Result<(), RenderError> {
        self.effects = effects.to_vec();
        self.faults.clear();
        Ok(())
    }

    fn take_notes(&mut self) -> Vec<String> {
        self.faults.take_warnings(&self.effects)
    }

    fn device(&self) -> &DeviceInfo {
        &self.device
    }

    fn frames_in_flight(&self) -> usize {
        2
    }

    fn load(&mut self, resources: Arc<SceneResources>) -> Result<(), RenderError> {
        let old_textures = std::mem::take(&mut self.textures);
        let keys: Vec<TextureKey> = resources.textures.iter().map(|t| (t.hash, t.srgb, t.mipmaps)).collect();
        let textures: Vec<Option<Arc<Texture>>> = keys
            .par_iter()
            .zip(&resources.textures)
            .map(|(key, t)| match t.streamed {
                Some(_) => None,
                None => Some(old_textures.get(key).cloned().unwrap_or_else(|| Arc::new(Texture::new(t)))),
            })
            .collect();
        self.materials = resources
            .materials
            .iter()
            .map(|m| ShadeMaterial {
                factors: m.clone(),
                textures: m.textures.map(|t| textures[t?.texture as usize].clone()),
            })
            .collect();
        self.textures = keys.into_iter().zip(textures).filter_map(|(key, t)| Some((key, t?))).collect();
        if resources.sky.as_ref().map(|s| s.hash()) != self.resources.sky.as_ref().map(|s| s.hash()) {
            self.sky = None;
        }
        self.resources = resources;
        Ok(())
    }

    fn submit(&mut self, plan: Plan) -> Result<(), RenderError> {
        if self.submitted.len() >= self.frames_in_flight() {
            return Err(RenderError::Usage("two frames are already submitted: collect one first".into()));
        }
        self.check_plan(&plan).and_then(|()| crate::plan::light_clusters::check(&plan))?;
        plan.record_faults(&self.faults);
        self.submitted.push_back(plan);
        Ok(())
    }

    fn collect(&mut self, reuse: Option<Frame>) -> Result<Frame, RenderError> {
        let plan = self.submitted.pop_front().ok_or_else(nothing_submitted)?;
        let frame = dissolved(plan, reuse, |plan, reuse| self.render_frame(&plan, reuse))?;
        self.times.count_frame();
        Ok(frame)
    }

    fn collect_floats(&mut self) -> Result<FloatFrame, RenderError> {
        let plan = self.submitted.pop_front().ok_or_else(nothing_submitted)?;
        let frame = float_frame(&plan, self)?;
        self.times.count_frame();
        Ok(frame)
    }
}

impl FloatFrameRenderer for CpuRenderer {
    fn render_linear(&mut self, plan: &Plan) -> Result<Vec<Vec4>, RenderError> {
        self.prepare_sky(plan);
        self.load_streamed_textures(plan)?;
        let mut pixels = vec![Vec4::ZERO; plan.size[0] as usize * plan.size[1] as usize];
        match plan.samples {
            1 => self.draw_tiles::<LinearFloat, Vec4, 1>(plan, &[], &mut pixels)?,
            _ => self.draw_tiles::<LinearFloat, Vec4, 4>(plan, &[], &mut pixels)?,
        }
        Ok(pixels)
    }

    fn render_inputs(&mut self, plan: &Plan) -> Result<InputImages, RenderError> {
        self.load_streamed_textures(plan)?;
        Ok(self.times.measure(Stage::Pixels, || self.scene_inputs(plan)))
    }

    fn effects(&self) -> &[Effect] {
        &self.effects
    }

    fn faults(&self) -> &EffectFaults {
        &self.faults
    }
}

impl CpuRenderer {
    fn render_frame(&mut self, plan: &Plan, reuse: Option<Frame>) -> Result<Frame, RenderError> {
        let mut frame = reuse.unwrap_or(Frame { width: 0, height: 0, rgba: Vec::new() });
        self.prepare_sky(plan);
        self.load_streamed_textures(plan)?;
        [frame.width, frame.height] = plan.size;
        frame.rgba.resize(plan.size[0] as usize * plan.size[1] as usize * 4, 0);
        match (plan.samples, plan.post.is_empty()) {
            (1, _) if !plan.subframes.is_empty() => self.accumulate_sub_frames::<1>(plan, &mut frame)?,
            _ if !plan.subframes.is_empty() => self.accumulate_sub_frames::<4>(plan, &mut frame)?,
            (1, true) => self.draw_frame::<Srgb8, 1>(plan, &mut frame)?,
            (1, false) => self.draw_frame::<LinearFloat, 1>(plan, &mut frame)?,
            (_, true) => self.draw_frame::<Srgb8, 4>(plan, &mut frame)?,
            (_, false) => self.draw_frame::<LinearFloat, 4>(plan, &mut frame)?,
        }
        if let Some(layers) = &plan.layers_in_front {
            self.times.measure(Stage::Layers2d, || layers.blend_over(&mut frame));
        }
        Ok(frame)
    }
}
