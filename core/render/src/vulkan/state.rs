//! Fixed-function state of a pipeline.

use super::descriptors::Layouts;
use super::targets::format;
use crate::commands::Target;
use crate::error::RenderError;
use crate::plan::shader_features::texture_slots;
use crate::plan::{Features, Glass, TopologyKey};
use crate::scene_resources::vertex_layout::{Format, VertexLayout};
use crate::shader::{DeferredPass, InputTargets, PeelPass, SceneVariant, switches};
use ash::vk;

pub(super) struct PipelineState {
    pub name: String,
    pub layout: vk::PipelineLayout,
    pub vertices: Option<VertexLayout>,
    pub topology: vk::PrimitiveTopology,
    pub clockwise: bool,
    pub samples: u32,
    /// Format of the color target; `None`: depth only.
    pub color: Option<vk::Format>,
    /// Whether the pipeline renders to the G-buffer instead.
    pub gbuffer: bool,
    /// Number of targets of effect inputs that it renders to instead.
    pub inputs: usize,
    /// Depth comparison, and whether depth is written; `None` without a depth image.
    pub depth: Option<(vk::CompareOp, bool)>,
    pub blend_mode: BlendMode,
    /// Alpha to coverage: the fragment's alpha gives the number of samples that it keeps.
    pub coverage: bool,
    /// Whether the depth comparison is dynamic, set when the pass begins.
    pub dynamic_compare: bool,
}

/// How a fragment is blended with the image.
#[derive(Clone, Copy)]
pub(super) enum BlendMode {
    Replace,
    /// Source over, straight alpha.
    Over,
    /// The image times the fragment's color.
    Multiply,
    /// The image plus the fragment's color.
    Add,
}

impl BlendMode {
    /// Factors of source and destination color, then of source and destination alpha.
    pub(super) fn factors(self) -> Option<[vk::BlendFactor; 4]> {
        use vk::BlendFactor as F;
        match self {
            BlendMode::Replace => None,
            BlendMode::Over => Some([F::SRC_ALPHA, F::ONE_MINUS_SRC_ALPHA, F::ONE, F::ONE_MINUS_SRC_ALPHA]),
            BlendMode::Multiply => Some([F::ZERO, F::SRC_COLOR, F::ZERO, F::ONE]),
            BlendMode::Add => Some([F::ONE, F::ONE, F::ONE, F::ONE_MINUS_SRC_ALPHA]),
        }
    }
}

impl PipelineState {
    /// The state of a scene pipeline with one sample per pixel.
    pub(super) fn scene(
        variant: &SceneVariant,
        float: bool,
        layouts: &Layouts,
    ) -> Result<PipelineState, RenderError> {
        let key = &variant.key;
        let thick = key.features.has(Features::THICK_LINES);
        let peel = variant.peel != PeelPass::No;
        let light = variant.deferred == DeferredPass::Light;
        let gbuffer = variant.deferred == DeferredPass::Geometry;
        let inputs = match variant.inputs {
            InputTargets::No => 0,
            InputTargets::Surface => 1,
            InputTargets::Motion => 2,
        };
        let layout = match light {
            true => layouts.light()?.pipeline,
            false => layouts.material(texture_slots(key.features))?.pipeline,
        };
        Ok(PipelineState {
            name: format!("scene pipeline {}", switches(variant).join(" ")),
            vertices: (!light).then(|| VertexLayout::of(key.features)),
            topology: match key.topology {
                TopologyKey::Lines if !thick => vk::PrimitiveTopology::LINE_LIST,
                TopologyKey::Points if !thick => vk::PrimitiveTopology::POINT_LIST,
                _ => vk::PrimitiveTopology::TRIANGLE_LIST,
            },
            clockwise: key.mirrored,
            color: (!variant.shadow_pass && !peel && !gbuffer && inputs == 0).then(|| format_of(float)),
            gbuffer,
            inputs,
            // Reversed Z: nearer is greater. A peeling pass keeps the farthest surface.
            depth: Some(match peel {
                // The lighting pass draws a triangle at depth 0, which passes the test where a surface was drawn.
                _ if light => (vk::CompareOp::LESS, false),
                true => (vk::CompareOp::LESS, true),
                false => (vk::CompareOp::GREATER, key.writes_depth()),
            }),
            blend_mode: match (key.glass, key.blend) {
                (Glass::No | Glass::Refract, false) => BlendMode::Replace,
                (Glass::No | Glass::Refract, true) => BlendMode::Over,
                (Glass::Filter, _) => BlendMode::Multiply,
                (Glass::Light, _) => BlendMode::Add,
            },
            coverage: key.coverage,
            dynamic_compare: key.peeled && !peel,
            ..PipelineState::full_screen(layout)
        })
    }

    /// Vertex attributes and their binding; empty without a vertex buffer.
    pub(crate) fn vertex_input(
        &self,
    ) -> (Vec<vk::VertexInputAttributeDescription>, Vec<vk::VertexInputBindingDescription>) {
        let Some((attributes, stride)) = self.vertices.map(VertexLayout::attributes) else {
            return (Vec::new(), Vec::new());
        };
        let attribute = |&(location, offset, format): &_| vk::VertexInputAttributeDescription {
            location,
            binding: 0,
            format: vertex_format(format),
            offset,
        };
        let input_rate = vk::VertexInputRate::VERTEX;
        let binding = vk::VertexInputBindingDescription { binding: 0, stride, input_rate };
        (attributes.iter().map(attribute).collect(), vec![binding])
    }

    pub(crate) fn rasterization(&self) -> vk::PipelineRasterizationStateCreateInfo<'static> {
        let front = match self.clockwise {
            true => vk::FrontFace::CLOCKWISE,
            false => vk::FrontFace::COUNTER_CLOCKWISE,
        };
        vk::PipelineRasterizationStateCreateInfo::default().front_face(front).line_width(1.0)
    }

    pub(super) fn multisample(&self) -> vk::PipelineMultisampleStateCreateInfo<'static> {
        vk::PipelineMultisampleStateCreateInfo::default()
            .rasterization_samples(vk::SampleCountFlags::from_raw(self.samples))
            .alpha_to_coverage_enable(self.coverage)
            .alpha_to_one_enable(self.coverage)
    }

    pub(crate) fn depth_test(&self) -> vk::PipelineDepthStencilStateCreateInfo<'static> {
        let (compare, write) = self.depth.unwrap_or((vk::CompareOp::ALWAYS, false));
        vk::PipelineDepthStencilStateCreateInfo::default()
            .depth_test_enable(self.depth.is_some())
            .depth_write_enable(write)
            .depth_compare_op(compare)
    }

    pub(super) fn attachment(&self) -> vk::PipelineColorBlendAttachmentState {
        let attachment =
            vk::PipelineColorBlendAttachmentState::default().color_write_mask(vk::ColorComponentFlags::RGBA);
        let Some([from, to, alpha_from, alpha_to]) = self.blend_mode.factors() else { return attachment };
        attachment
            .blend_enable(true)
            .src_color_blend_factor(from)
            .dst_color_blend_factor(to)
            .src_alpha_blend_factor(alpha_from)
            .dst_alpha_blend_factor(alpha_to)
    }

    pub(crate) fn color_formats(&self) -> Vec<vk::Format> {
        let gbuffer = self.gbuffer.then_some(super::deferred::FORMATS).into_iter().flatten();
        let inputs = std::iter::repeat_n(super::scene_inputs::FORMAT, self.inputs);
        self.color.into_iter().chain(gbuffer).chain(inputs).collect()
    }

    pub(crate) fn full_screen(layout: vk::PipelineLayout) -> PipelineState {
        PipelineState {
            name: String::new(),
            layout,
            vertices: None,
            topology: vk::PrimitiveTopology::TRIANGLE_LIST,
            clockwise: false,
            samples: 1,
            color: Some(format(Target::Image)),
            gbuffer: false,
            inputs: 0,
            depth: None,
            blend_mode: BlendMode::Replace,
            coverage: false,
            dynamic_compare: false,
        }
    }
}

pub(crate) fn format_of(float: bool) -> vk::Format {
    format(if float { Target::Float(0) } else { Target::Image })
}

fn vertex_format(format: Format) -> vk::Format {
    match format {
        Format::F32x2 => vk::Format::R32G32_SFLOAT,
        Format::F32x3 => vk::Format::R32G32B32_SFLOAT,
        Format::Snorm16x4 => vk::Format::R16G16B16A16_SNORM,
        Format::Unorm16x4 => vk::Format::R16G16B16A16_UNORM,
        Format::Uint16x4 => vk::Format::R16G16B16A16_UINT,
    }
}
