//! What a pipeline is made with beside its shaders.

use super::targets::format;
use crate::commands::Target;
use crate::scene_resources::vertex_layout::{Format, VertexLayout};
use ash::vk;

pub struct State {
    pub name: String,
    pub layout: vk::PipelineLayout,
    pub vertices: Option<VertexLayout>,
    pub topology: vk::PrimitiveTopology,
    pub clockwise: bool,
    pub samples: u32,
    /// `None`: depth alone.
    pub color: Option<vk::Format>,
    /// Renders to the G-buffer.
    pub kept: bool,
    /// Comparison and whether it writes; `None` without a depth image.
    pub depth: Option<(vk::CompareOp, bool)>,
    pub mix: Mix,
    /// The fragment's alpha says how many samples it keeps.
    pub coverage: bool,
    /// The comparison of depths is set when the pass begins.
    pub any_compare: bool,
}

/// How a fragment meets what is in the picture.
#[derive(Clone, Copy)]
pub enum Mix {
    Replace,
    /// Source over, straight alpha.
    Over,
    /// The picture times the fragment's colour.
    Multiply,
    /// The picture plus the fragment's colour.
    Add,
}

impl Mix {
    /// Factors of source and destination color, of source and destination alpha.
    pub fn factors(self) -> Option<[vk::BlendFactor; 4]> {
        use vk::BlendFactor as F;
        match self {
            Mix::Replace => None,
            Mix::Over => Some([F::SRC_ALPHA, F::ONE_MINUS_SRC_ALPHA, F::ONE, F::ONE_MINUS_SRC_ALPHA]),
            Mix::Multiply => Some([F::ZERO, F::SRC_COLOR, F::ZERO, F::ONE]),
            Mix::Add => Some([F::ONE, F::ONE, F::ONE, F::ONE_MINUS_SRC_ALPHA]),
        }
    }
}

impl State {
    pub fn full_screen(layout: vk::PipelineLayout) -> State {
        State {
            name: String::new(),
            layout,
            vertices: None,
            topology: vk::PrimitiveTopology::TRIANGLE_LIST,
            clockwise: false,
            samples: 1,
            color: Some(format(Target::Picture)),
            kept: false,
            depth: None,
            mix: Mix::Replace,
            coverage: false,
            any_compare: false,
        }
    }
}

pub fn format_of(float: bool) -> vk::Format {
    format(if float { Target::Float(0) } else { Target::Picture })
}

pub fn vertex_format(format: Format) -> vk::Format {
    match format {
        Format::F32x2 => vk::Format::R32G32_SFLOAT,
        Format::F32x3 => vk::Format::R32G32B32_SFLOAT,
        Format::Snorm16x4 => vk::Format::R16G16B16A16_SNORM,
        Format::Unorm16x4 => vk::Format::R16G16B16A16_UNORM,
        Format::Uint16x4 => vk::Format::R16G16B16A16_UINT,
    }
}
