//! The image of all shadow maps, its comparison sampler, and the maps in it that the next frame keeps.

use super::context::Context;
use super::memory::ImageDesc;
use super::sampled_image::SampledImage;
use super::targets::DEPTH_FORMAT;
use super::{VulkanRenderer, targets::Targets};
use crate::error::RenderError;
use crate::plan::Plan;
use crate::plan::map_key::{MapKey, map_keys};
use crate::scene_resources::SceneResources;
use ash::vk;

pub(crate) fn shadow_maps(gpu: &Context, [width, height]: [u32; 2]) -> Result<SampledImage, RenderError> {
    let desc = ImageDesc {
        name: "shadow maps",
        width,
        height,
        levels: 1,
        samples: 1,
        format: DEPTH_FORMAT,
        usage: vk::ImageUsageFlags::DEPTH_STENCIL_ATTACHMENT | vk::ImageUsageFlags::SAMPLED,
        aspect: vk::ImageAspectFlags::DEPTH,
    };
    // Comparisons are per texel: a point is lit if it is as near to the light as the stored depth, or nearer.
    let sampler =
        vk::SamplerCreateInfo::default().compare_enable(true).compare_op(vk::CompareOp::GREATER_OR_EQUAL);
    SampledImage::new(gpu, &desc, sampler)
}

/// A map in the image: key of its content, position and size in texels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct HeldMap {
    key: Option<MapKey>,
    at: [u32; 2],
    size: [u32; 2],
}

/// The shadow maps that a plan requests.
pub(super) fn maps_of(plan: &Plan, resources: &SceneResources) -> Vec<HeldMap> {
    let Some(shadows) = plan.shadow_maps.as_ref().filter(|_| !plan.inputs_only) else { return Vec::new() };
    let keys = map_keys(shadows, plan, resources).into_iter();
    keys.zip(&shadows.views).map(|(key, view)| HeldMap { key, at: view.at, size: view.size }).collect()
}

impl VulkanRenderer {
    /// Marks all maps to be drawn again, because new shaders may draw different ones.
    pub(super) fn forget_maps(&mut self) {
        if let Some(targets) = &mut self.targets {
            targets.shadow_maps.clear();
        }
    }

    /// One bit for each of these maps that the image already holds at the same position.
    pub(super) fn kept_maps(&self, plan: &Plan, maps: &[HeldMap]) -> u32 {
        let image = plan.shadow_maps.as_ref().map(|shadows| shadows.image);
        let same_image = |targets: &&Targets| targets.needs.shadow == image;
        let Some(targets) = self.targets.as_ref().filter(same_image) else { return 0 };
        let is_held = |map: &HeldMap| map.key.is_some() && targets.shadow_maps.contains(map);
        maps.iter().enumerate().map(|(index, map)| u32::from(is_held(map)) << index).sum()
    }
}
