//! Instances as shaders read them.

use crate::affine::Affine3x4;
use glam::Vec4;

/// One drawn copy of a primitive. Laid out as the shader reads it.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Instance {
    /// relative-from-mesh; relative-from-model with dual-quaternion skinning and for models that a file places several times;
    /// unused by other skins.
    pub relative_from_mesh: Affine3x4,
    pub tint: Vec4,
    /// First entry in `Plan::joint_matrices`.
    pub first_joint: u32,
    pub first_morph: u32,
    pub morph_count: u32,
    /// Line width in pixels; negative: in metres. See `crate::scene_resources::thick_lines`.
    pub width: f32,
}

impl Instance {
    /// All fields that the positions of the instance's vertices depend on, as bits.
    pub(crate) fn deformation(&self) -> [u32; 15] {
        let rows = self.relative_from_mesh.0.map(|r| r.to_array().map(f32::to_bits));
        let numbers = [self.first_joint, self.first_morph, self.morph_count];
        std::array::from_fn(|i| if i < 12 { rows[i / 4][i % 4] } else { numbers[i - 12] })
    }
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct ActiveMorph {
    pub target: u32,
    pub weight: f32,
}
