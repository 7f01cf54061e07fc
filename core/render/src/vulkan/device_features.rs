//! Optional device features that choreo uses, and the fallback without each.

use ash::vk;

/// A feature that a device may lack. Features of every Vulkan 1.3 device, such as four samples per pixel, are not listed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Ability {
    /// `alphaToOne`. Without it cut-outs keep or lose whole pixels.
    AlphaToOne,
    /// `samplerAnisotropy`. Without it textures are filtered alike in both directions.
    SamplerAnisotropy,
    /// `sampleRateShading`. Without it transparent surfaces are sorted if there are several samples per pixel.
    SampleRateShading,
    /// Color attachments in the G-buffer's formats. Without them surfaces are shaded forward. Vulkan guarantees them, so this is
    /// for drivers that break the guarantee.
    ColorAttachments,
    /// A queue with graphics and compute. Without it every pass skins its vertices.
    Compute,
    /// `fragmentStoresAndAtomics` and `vertexPipelineStoresAndAtomics`. Without them no warning names a faulty effect.
    ShaderStores,
}

impl Ability {
    pub const ALL: [Ability; 6] = [
        Ability::AlphaToOne,
        Ability::SamplerAnisotropy,
        Ability::SampleRateShading,
        Ability::ColorAttachments,
        Ability::Compute,
        Ability::ShaderStores,
    ];

    /// Vulkan's name of the feature.
    pub fn name(self) -> &'static str {
        match self {
            Ability::AlphaToOne => "alphaToOne",
            Ability::SamplerAnisotropy => "samplerAnisotropy",
            Ability::SampleRateShading => "sampleRateShading",
            Ability::ColorAttachments => "maxColorAttachments",
            Ability::Compute => "VK_QUEUE_COMPUTE_BIT",
            Ability::ShaderStores => "fragmentStoresAndAtomics, vertexPipelineStoresAndAtomics",
        }
    }

    /// Fallback of a frame without the feature, in words.
    pub fn fallback(self) -> &'static str {
        match self {
            Ability::AlphaToOne => "cutouts have hard edges",
            Ability::SamplerAnisotropy => "textures have no anisotropic filtering",
            Ability::SampleRateShading => "with several samples per pixel, transparent surfaces are sorted",
            Ability::ColorAttachments => "surfaces are drawn with forward instead of deferred shading",
            Ability::Compute => "every pass skins its vertices: no pre-skinning",
            Ability::ShaderStores => "pixels of faulty effects are magenta without a warning",
        }
    }

    fn is_in(
        self,
        features: &vk::PhysicalDeviceFeatures,
        color_attachments: bool,
        queue: vk::QueueFlags,
    ) -> bool {
        vk::TRUE
            == match self {
                Ability::AlphaToOne => features.alpha_to_one,
                Ability::SamplerAnisotropy => features.sampler_anisotropy,
                Ability::SampleRateShading => features.sample_rate_shading,
                Ability::ColorAttachments => vk::Bool32::from(color_attachments),
                Ability::Compute => u32::from(queue.contains(vk::QueueFlags::COMPUTE)),
                Ability::ShaderStores => {
                    features.fragment_stores_and_atomics & features.vertex_pipeline_stores_and_atomics
                }
            }
    }
}

/// The optional features of a device, one bit each.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Abilities(u8);

impl Abilities {
    /// `color_attachments`: the result of [`super::deferred::color_attachments`]. `queue`: capabilities of the queue.
    pub(crate) fn of(
        features: &vk::PhysicalDeviceFeatures,
        color_attachments: bool,
        queue: vk::QueueFlags,
        without: &[Ability],
    ) -> Abilities {
        let there = |a: &&Ability| a.is_in(features, color_attachments, queue) && !without.contains(a);
        Abilities(Ability::ALL.iter().filter(there).map(|a| 1 << *a as u8).sum())
    }

    pub(crate) fn has(self, ability: Ability) -> bool {
        self.0 & (1 << ability as u8) != 0
    }

    /// The features to create a device with.
    pub(crate) fn features(self) -> vk::PhysicalDeviceFeatures {
        vk::PhysicalDeviceFeatures::default()
            .alpha_to_one(self.has(Ability::AlphaToOne))
            .sampler_anisotropy(self.has(Ability::SamplerAnisotropy))
            .sample_rate_shading(self.has(Ability::SampleRateShading))
            .fragment_stores_and_atomics(self.has(Ability::ShaderStores))
            .vertex_pipeline_stores_and_atomics(self.has(Ability::ShaderStores))
    }
}
