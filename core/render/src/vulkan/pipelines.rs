//! Pipelines by key, compiled when a frame first requests them, several in parallel.

use super::cache::PipelineCache;
use super::context::Context;
use super::descriptors::Layouts;
use super::device_features::Ability;
use super::error::Named;
use super::faults::FaultPlace;
use super::pipeline_ids::Backdrop;
pub(super) use super::pipeline_ids::{PipelineId, ids};
use super::preskin;
use super::state::{BlendMode, PipelineState, format_of};
use super::targets::DEPTH_FORMAT;
use crate::commands::EffectOnSurfaces;
use crate::effect_faults::RECORDS_PER_EFFECT;
use crate::error::RenderError;
use crate::plan::shader_features::names;
use crate::plan::{Features, TopologyKey};
use crate::shader::{
    BACKGROUND, Entry, LAYERS_BEHIND, OVERLAY, ParameterRows, SCENE, SKY, SceneEffect, SceneVariant,
    ShaderSources, SourceFile, compile, entry_points, pass_functions, surface_files, switches,
    texture_functions,
};
use ash::vk;
use choreo_plugin::{Effect, Hook};
use naga::ShaderStage;
use rayon::prelude::*;
use std::collections::{BTreeSet, HashMap};
use std::path::Path;

pub(super) struct Pipelines {
    cache: PipelineCache,
    /// Layout of the sets that all scene pipelines share.
    pub layout: vk::PipelineLayout,
    pub post_layout: vk::PipelineLayout,
    sources: ShaderSources,
    effects: Vec<Effect>,
    /// Whether shaders record faults of effects.
    records_faults: bool,
    by_id: HashMap<PipelineId, vk::Pipeline>,
    /// Number of pipelines created so far.
    created: u64,
}

impl Pipelines {
    pub(super) fn new(
        gpu: &Context,
        layouts: &Layouts,
        cache_dir: Option<&Path>,
        sources: ShaderSources,
        effects: Vec<Effect>,
    ) -> Result<Pipelines, RenderError> {
        let mut pipelines = Pipelines {
            cache: PipelineCache::new(gpu, cache_dir)?,
            layout: vk::PipelineLayout::null(),
            post_layout: vk::PipelineLayout::null(),
            sources,
            effects,
            records_faults: gpu.abilities.has(Ability::ShaderStores),
            by_id: HashMap::new(),
            created: 0,
        };
        let create = |name: &str, sets: &[vk::DescriptorSetLayout]| {
            let info = vk::PipelineLayoutCreateInfo::default().set_layouts(sets);
            // SAFETY: the set layouts belong to this device; destroyed by `destroy`.
            let layout = unsafe { gpu.device.create_pipeline_layout(&info, None) }.named(name)?;
            gpu.set_name(layout, name);
            Ok(layout)
        };
        let made = (|| {
            let sets = [layouts.frame, layouts.morphs, layouts.shadow];
            pipelines.layout = create("scene pipeline layout", &sets)?;
            pipelines.post_layout = create("post pipeline layout", &[layouts.post])?;
            Ok(())
        })();
        match made {
            Ok(()) => Ok(pipelines),
            Err(e) => {
                pipelines.destroy(gpu);
                Err(e)
            }
        }
    }

    pub(super) fn get(&self, id: &PipelineId) -> Option<vk::Pipeline> {
        self.by_id.get(id).copied()
    }

    pub(super) fn count(&self) -> usize {
        self.by_id.len()
    }

    /// Compiles the missing pipelines on all cores.
    pub(super) fn prepare(
        &mut self,
        gpu: &Context,
        layouts: &Layouts,
        ids: &[Option<PipelineId>],
    ) -> Result<(), RenderError> {
        let missing: BTreeSet<&PipelineId> =
            ids.iter().flatten().filter(|id| !self.by_id.contains_key(id)).collect();
        let missing: Vec<&PipelineId> = missing.into_iter().collect();
        let made = self.create_all(gpu, layouts, &missing)?;
        self.created += made.len() as u64;
        self.by_id.extend(missing.into_iter().cloned().zip(made));
        Ok(())
    }

    /// Compiles all pipelines or none: if one fails the others are destroyed again.
    fn create_all(
        &self,
        gpu: &Context,
        layouts: &Layouts,
        ids: &[&PipelineId],
    ) -> Result<Vec<vk::Pipeline>, RenderError> {
        let results: Vec<_> = ids.par_iter().map(|id| self.create(gpu, layouts, id)).collect();
        let mut error = None;
        let mut made = Vec::with_capacity(results.len());
        for result in results {
            match result {
                Ok(pipeline) => made.push(pipeline),
                Err(e) => error = Some(error.unwrap_or(e)),
            }
        }
        match error {
            None => Ok(made),
            Some(e) => {
                for pipeline in made {
                    // SAFETY: just made, never bound.
                    unsafe { gpu.device.destroy_pipeline(pipeline, None) };
                }
                Err(e)
            }
        }
    }

    /// Number of pipelines created so far.
    pub(super) fn created(&self) -> u64 {
        self.created
    }

    /// Replaces the effects. Pipelines of effects whose text has changed are dropped, and compiled again when a frame needs them.
    /// No frame may be in flight.
    pub(super) fn set_effects(&mut self, gpu: &Context, effects: &[Effect]) {
        let old = std::mem::replace(&mut self.effects, effects.to_vec());
        let text = |all: &[Effect], name: &str| {
            let effect = all.iter().find(|e| e.manifest().name == name)?;
            // The generated functions contain the positions of the effect's textures in the buffer.
            let textures = texture_functions(all, effect);
            let wgsl = effect.shader().map(|shader| shader.wgsl().to_string());
            let textures = (textures, effect.named_passes().to_vec());
            Some((wgsl, textures, first_fault_record(all, name), effect.hook(), effect.in_model_space()))
        };
        self.by_id.retain(|id, pipeline| {
            let names: Vec<&String> = match id {
                PipelineId::Post { effect, .. } => vec![effect],
                PipelineId::Scene { surface, .. } | PipelineId::Background { surface, .. } => {
                    surface.iter().map(|effect| &effect.name).collect()
                }
                PipelineId::Overlay { .. } | PipelineId::Pose(_) => return true,
            };
            let same = names.iter().all(|name| text(&old, name) == text(effects, name));
            if !same {
                // SAFETY: no frame in flight uses it.
                unsafe { gpu.device.destroy_pipeline(*pipeline, None) };
            }
            same
        });
    }

    /// Compiles all existing pipelines again from the shader folder. After an error the last good ones stay. No frame may be in
    /// flight.
    pub(super) fn reload(&mut self, gpu: &Context, layouts: &Layouts) -> Result<(), RenderError> {
        let before = self.sources.clone();
        self.sources = ShaderSources::read(before.folder.clone())?;
        let ids: Vec<PipelineId> = self.by_id.keys().cloned().collect();
        let made = match self.create_all(gpu, layouts, &ids.iter().collect::<Vec<_>>()) {
            Ok(made) => made,
            Err(error) => {
                // Pipelines that later frames request are also compiled from the last good sources.
                self.sources = before;
                return Err(error);
            }
        };
        self.created += made.len() as u64;
        for (id, pipeline) in ids.into_iter().zip(made) {
            if let Some(old) = self.by_id.insert(id, pipeline) {
                // SAFETY: no frame in flight uses it.
                unsafe { gpu.device.destroy_pipeline(old, None) };
            }
        }
        Ok(())
    }

    fn create(&self, gpu: &Context, layouts: &Layouts, id: &PipelineId) -> Result<vk::Pipeline, RenderError> {
        let (code, state) = match id {
            PipelineId::Pose(variant) => {
                return preskin::create_pipeline(gpu, layouts, &self.sources, self.cache.raw, variant);
            }
            PipelineId::Scene { variant, samples, float, surface } => (
                self.scene_code(variant, surface)?,
                PipelineState { samples: *samples, ..PipelineState::scene(variant, *float, layouts)? },
            ),
            PipelineId::Background { samples, float, depth, what, surface } => (
                self.background_code(*what, *float, surface)?,
                PipelineState {
                    name: "background pipeline".into(),
                    samples: *samples,
                    color: Some(format_of(*float)),
                    // Drawn only where the depth is still the cleared 0.
                    depth: depth.then_some((vk::CompareOp::EQUAL, false)),
                    blend_mode: if *what == Backdrop::LayersBehind {
                        BlendMode::Over
                    } else {
                        BlendMode::Replace
                    },
                    ..PipelineState::full_screen(self.layout)
                },
            ),
            PipelineId::Overlay { samples, float, over } => {
                let compare = if *over { vk::CompareOp::ALWAYS } else { vk::CompareOp::GREATER };
                let files = self.sources.files(&OVERLAY)?;
                (
                    compile(&files, &[], &entry_stages("overlay_vs", "overlay_fs"), false)?,
                    PipelineState {
                        name: "overlay pipeline".into(),
                        samples: *samples,
                        color: Some(format_of(*float)),
                        depth: Some((compare, false)),
                        blend_mode: BlendMode::Over,
                        ..PipelineState::full_screen(self.layout)
                    },
                )
            }
            PipelineId::Post { effect, number, float } => (
                self.post_code(effect, *number, *float)?,
                PipelineState {
                    name: format!("post pipeline {effect}"),
                    color: Some(format_of(*float)),
                    ..PipelineState::full_screen(self.post_layout)
                },
            ),
        };
        self.build(gpu, &code, &state)
    }

    fn scene_code(
        &self,
        variant: &SceneVariant,
        surface: &[EffectOnSurfaces],
    ) -> Result<Vec<Entry>, RenderError> {
        let mut files = self.sources.files(&SCENE)?;
        files.extend(self.surface_texts(surface)?);
        let mut on = switches(variant);
        let stages = entry_points(&on);
        on.extend(self.reads_textures(surface).then_some("TEXTURES"));
        on.extend((self.records_faults && !surface.is_empty()).then_some("FAULT_RECORDS"));
        let thick = variant.key.features.has(Features::THICK_LINES);
        compile(&files, &on, &stages, variant.key.topology == TopologyKey::Points && !thick)
    }

    fn background_code(
        &self,
        what: Backdrop,
        float: bool,
        surface: &[EffectOnSurfaces],
    ) -> Result<Vec<Entry>, RenderError> {
        let (files, switch, fs): (&[&str], _, _) = match what {
            Backdrop::Gradient => (&BACKGROUND, None, "background_fs"),
            Backdrop::Sky(_) => (&SKY, Some("SKY_BACKGROUND"), "sky_fs"),
            Backdrop::LayersBehind => (&LAYERS_BEHIND, None, "layers_behind_fs"),
        };
        let mut files = self.sources.files(files)?;
        files.extend(self.surface_texts(surface)?);
        let mut on = Vec::from_iter(switch);
        if let Backdrop::Sky(display) = what {
            on.extend(names(display));
        }
        on.extend((!float && what != Backdrop::LayersBehind).then_some("DITHER"));
        on.extend(if surface.is_empty() { &[][..] } else { &["SURFACE", "EFFECTS"] });
        on.extend(self.reads_textures(surface).then_some("TEXTURES"));
        on.extend((self.records_faults && !surface.is_empty()).then_some("FAULT_RECORDS"));
        compile(&files, &on, &entry_stages("background_vs", fs), false)
    }

    fn post_code(&self, effect: &str, number: u32, float: bool) -> Result<Vec<Entry>, RenderError> {
        let plugin = self.effect(effect)?;
        let text = self.wgsl(plugin)? + &pass_functions(plugin.named_passes(), number);
        let textures = !plugin.textures().is_empty();
        let parameters = ParameterRows::of(plugin, 0);
        let numbers = [number, first_fault_record(&self.effects, effect)];
        let files = self.sources.post(effect, &text, numbers, parameters, textures)?;
        let mut on = vec!["EFFECTS"];
        on.extend((plugin.hook() == Hook::Image).then_some("PICTURE"));
        on.extend(self.records_faults.then_some("FAULT_RECORDS"));
        on.extend(textures.then_some("TEXTURES"));
        let inputs = plugin.scene_inputs();
        on.extend(inputs.surface.then_some("SURFACE_INPUT"));
        on.extend(inputs.motion.then_some("MOTION_INPUT"));
        on.extend((!float).then_some("DITHER"));
        compile(&files, &on, &entry_stages("post_vs", "post_fs"), false)
    }

    /// WGSL texts with the functions of effects on surfaces, and the calls of them.
    fn surface_texts(&self, surface: &[EffectOnSurfaces]) -> Result<Vec<SourceFile>, RenderError> {
        if surface.is_empty() {
            return Ok(Vec::new());
        }
        let used = |EffectOnSurfaces { bit, first_row, name }: &EffectOnSurfaces| {
            let effect = self.effect(name)?;
            Ok(SceneEffect {
                bit: *bit,
                parameters: ParameterRows::of(effect, *first_row),
                name: name.clone(),
                wgsl: self.wgsl(effect)?,
                hook: effect.hook(),
                in_model_space: effect.in_model_space(),
                faults: first_fault_record(&self.effects, name),
            })
        };
        let all: Result<Vec<_>, RenderError> = surface.iter().map(used).collect();
        let mut files = Vec::new();
        if self.reads_textures(surface) {
            files.push(self.sources.file("textures.wgsl")?);
        }
        files.extend(surface_files(&all?));
        Ok(files)
    }

    fn reads_textures(&self, surface: &[EffectOnSurfaces]) -> bool {
        let reads = |name: &String| self.effect(name).is_ok_and(|e| !e.textures().is_empty());
        surface.iter().any(|effect| reads(&effect.name))
    }

    /// The WGSL of an effect, followed by the functions of its textures.
    fn wgsl(&self, effect: &Effect) -> Result<String, RenderError> {
        let name = &effect.manifest().name;
        let shader = effect.shader();
        let shader =
            shader.ok_or_else(|| RenderError::Usage(format!("the effect \"{name}\" has no function")))?;
        Ok(format!("{}{}", shader.wgsl(), texture_functions(&self.effects, effect)))
    }

    /// Size in bytes of the buffer in which effects record shader faults.
    pub(crate) fn fault_buffer_bytes(&self) -> usize {
        if self.records_faults {
            self.effects.len() * RECORDS_PER_EFFECT as usize * size_of::<u32>()
        } else {
            0
        }
    }

    /// Effects that plans may name.
    pub(super) fn effects(&self) -> &[Effect] {
        &self.effects
    }

    fn effect(&self, name: &str) -> Result<&Effect, RenderError> {
        self.effects.iter().find(|e| e.manifest().name == name).ok_or_else(|| {
            let known: Vec<_> = self.effects.iter().map(|e| e.manifest().name.as_str()).collect();
            RenderError::Usage(format!(
                "the plan uses the effect \"{name}\", which the renderer was not given; known: {}",
                if known.is_empty() { "none".into() } else { known.join(", ") }
            ))
        })
    }

    fn build(
        &self,
        gpu: &Context,
        code: &[Entry],
        state: &PipelineState,
    ) -> Result<vk::Pipeline, RenderError> {
        let name = &state.name;
        let mut modules = Vec::with_capacity(2);
        let result = (|| {
            for entry in code {
                let info = vk::ShaderModuleCreateInfo::default().code(&entry.words);
                // SAFETY: naga validated the module and wrote the SPIR-V; destroyed below.
                modules.push(unsafe { gpu.device.create_shader_module(&info, None) }.named(name)?);
            }
            self.build_from(gpu, code, &modules, state)
        })();
        for module in modules {
            // SAFETY: a pipeline does not need its modules once it is made.
            unsafe { gpu.device.destroy_shader_module(module, None) };
        }
        result
    }

    fn build_from(
        &self,
        gpu: &Context,
        code: &[Entry],
        modules: &[vk::ShaderModule],
        state: &PipelineState,
    ) -> Result<vk::Pipeline, RenderError> {
        let names: Vec<_> = code
            .iter()
            .map(|e| std::ffi::CString::new(e.name))
            .collect::<Result<_, _>>()
            .map_err(|e| RenderError::Usage(format!("{}: {e}", state.name)))?;
        let kinds = [vk::ShaderStageFlags::VERTEX, vk::ShaderStageFlags::FRAGMENT];
        let stages: Vec<_> = kinds
            .iter()
            .zip(modules)
            .zip(&names)
            .map(|((stage, module), name)| {
                vk::PipelineShaderStageCreateInfo::default().stage(*stage).module(*module).name(name)
            })
            .collect();
        let (attributes, bindings) = state.vertex_input();
        let input = vk::PipelineVertexInputStateCreateInfo::default()
            .vertex_attribute_descriptions(&attributes)
            .vertex_binding_descriptions(&bindings);
        let assembly = vk::PipelineInputAssemblyStateCreateInfo::default().topology(state.topology);
        let viewport = vk::PipelineViewportStateCreateInfo::default().viewport_count(1).scissor_count(1);
        let (raster, multisample, depth) = (state.rasterization(), state.multisample(), state.depth_test());
        let colors = state.color_formats();
        let attachments = vec![state.attachment(); colors.len()];
        let blend = vk::PipelineColorBlendStateCreateInfo::default().attachments(&attachments);
        let mut dynamic =
            vec![vk::DynamicState::VIEWPORT, vk::DynamicState::SCISSOR, vk::DynamicState::CULL_MODE];
        dynamic.extend(state.dynamic_compare.then_some(vk::DynamicState::DEPTH_COMPARE_OP));
        let dynamic = vk::PipelineDynamicStateCreateInfo::default().dynamic_states(&dynamic);
        let mut rendering = vk::PipelineRenderingCreateInfo::default().color_attachment_formats(&colors);
        if state.depth.is_some() {
            rendering = rendering.depth_attachment_format(DEPTH_FORMAT);
        }
        let info = [vk::GraphicsPipelineCreateInfo::default()
            .stages(&stages)
            .vertex_input_state(&input)
            .input_assembly_state(&assembly)
            .viewport_state(&viewport)
            .rasterization_state(&raster)
            .multisample_state(&multisample)
            .depth_stencil_state(&depth)
            .color_blend_state(&blend)
            .dynamic_state(&dynamic)
            .layout(state.layout)
            .push_next(&mut rendering)];
        gpu.inject_fault(FaultPlace::Pipeline).named(&state.name)?;
        // SAFETY: modules, layout and cache belong to this device; the cache is synchronized by the driver.
        let made = unsafe { gpu.device.create_graphics_pipelines(self.cache.raw, &info, None) };
        let pipeline = made.map_err(|(_, r)| r).named(&state.name)?[0];
        gpu.set_name(pipeline, &state.name);
        Ok(pipeline)
    }

    /// Saves the cache and destroys all pipelines. No frame may be in flight.
    pub(super) fn destroy(&mut self, gpu: &Context) {
        if !self.by_id.is_empty() {
            self.cache.save(gpu);
        }
        // SAFETY: made from this device, no longer used.
        unsafe {
            for (_, pipeline) in self.by_id.drain() {
                gpu.device.destroy_pipeline(pipeline, None);
            }
            gpu.device.destroy_pipeline_layout(self.layout, None);
            gpu.device.destroy_pipeline_layout(self.post_layout, None);
        }
        self.cache.destroy(gpu);
    }
}

/// Index of an effect's first fault record.
fn first_fault_record(effects: &[Effect], name: &str) -> u32 {
    effects.iter().take_while(|e| e.manifest().name != name).count() as u32 * RECORDS_PER_EFFECT
}

fn entry_stages(vertex: &'static str, fragment: &'static str) -> [(&'static str, ShaderStage); 2] {
    [(vertex, ShaderStage::Vertex), (fragment, ShaderStage::Fragment)]
}
