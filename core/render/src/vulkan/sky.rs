//! Images of 16-bit floats on the device: the maps and the panorama of a sky, and 2D layers behind the scene.

use super::context::Context;
use super::error::Named;
use super::memory::{Image, ImageDesc};
use super::upload::Uploads;
use crate::error::RenderError;
use crate::layers_2d::LayerImage;
use crate::sky::{SkyBackground, SkyMaps};
use ash::vk;
use choreo_asset::Panorama;
use half::f16;
use std::sync::Arc;

pub(crate) struct SkyImages {
    /// Hash of the panorama.
    hash: [u8; 32],
    pub sampler: vk::Sampler,
    /// The maps, uploaded once a pipeline reads them.
    pub maps: Option<(Arc<SkyMaps>, Image)>,
    pub background: Option<Image>,
}

impl SkyImages {
    pub(crate) fn new(gpu: &Context, panorama: &Panorama) -> Result<SkyImages, RenderError> {
        let info = vk::SamplerCreateInfo::default()
            .mag_filter(vk::Filter::LINEAR)
            .min_filter(vk::Filter::LINEAR)
            .address_mode_u(vk::SamplerAddressMode::CLAMP_TO_EDGE)
            .address_mode_v(vk::SamplerAddressMode::CLAMP_TO_EDGE);
        // SAFETY: the device is alive; destroyed by `destroy`.
        let sampler = unsafe { gpu.device.create_sampler(&info, None) }.named("sky sampler")?;
        Ok(SkyImages { hash: panorama.hash(), sampler, maps: None, background: None })
    }

    pub(crate) fn shows_panorama(&self, panorama: Option<&Panorama>) -> bool {
        panorama.is_some_and(|p| p.hash() == self.hash)
    }

    /// Uploads those images of the sky that the plan reads and that are not on the device yet.
    pub(crate) fn prepare(
        &mut self,
        gpu: &Context,
        panorama: &Panorama,
        [maps, background]: [bool; 2],
        uploads: &mut Uploads,
    ) -> Result<(), RenderError> {
        if maps && self.maps.is_none() {
            let made = SkyMaps::of(panorama);
            let image = upload(gpu, "maps of the sky", made.size, &made.texels, uploads)?;
            self.maps = Some((made, image));
        }
        if background && self.background.is_none() {
            let made = SkyBackground::new(panorama, gpu.limits().max_image_dimension2_d);
            self.background = Some(upload(gpu, "image of the sky", made.size, &made.texels, uploads)?);
        }
        Ok(())
    }

    /// The views of maps and panorama. If only one exists it takes both places, so that no binding stays empty.
    pub(crate) fn views(&self) -> Option<[vk::ImageView; 2]> {
        let maps = self.maps.as_ref().map(|(_, image)| image.view);
        let background = self.background.as_ref().map(|image| image.view);
        Some([maps.or(background)?, background.or(maps)?])
    }

    /// Destroys the images. No frame may be in flight.
    pub(crate) fn destroy(&mut self, gpu: &Context) {
        for mut image in self.maps.take().map(|(_, image)| image).into_iter().chain(self.background.take()) {
            image.destroy(gpu);
        }
        // SAFETY: made from this device, no longer used.
        unsafe { gpu.device.destroy_sampler(self.sampler, None) };
        self.sampler = vk::Sampler::null();
    }
}

fn upload(
    gpu: &Context,
    name: &str,
    [width, height]: [u32; 2],
    texels: &[[f16; 4]],
    uploads: &mut Uploads,
) -> Result<Image, RenderError> {
    let image = Image::new(
        gpu,
        &ImageDesc {
            name,
            width,
            height,
            levels: 1,
            samples: 1,
            format: vk::Format::R16G16B16A16_SFLOAT,
            usage: vk::ImageUsageFlags::SAMPLED | vk::ImageUsageFlags::TRANSFER_DST,
            aspect: vk::ImageAspectFlags::COLOR,
        },
    )?;
    let bytes: Vec<u8> = texels.iter().flatten().flat_map(|v| v.to_bits().to_ne_bytes()).collect();
    uploads.add_image(image.raw, std::iter::once((width, height, &bytes[..])));
    Ok(image)
}

/// Image of all 2D layers behind the scene, at the size of the frame, with straight alpha.
pub(crate) fn layer_image(
    gpu: &Context,
    flat: &LayerImage,
    uploads: &mut Uploads,
) -> Result<Image, RenderError> {
    let [width, height] = flat.size;
    let texel = |x: u32, y: u32| {
        let pixel = flat.pixel(x, y);
        let straight = pixel.truncate() / pixel.w.max(1e-6);
        straight.extend(pixel.w).to_array().map(f16::from_f32)
    };
    let texels: Vec<[f16; 4]> = (0..height).flat_map(|y| (0..width).map(move |x| texel(x, y))).collect();
    upload(gpu, "layers behind the scene", flat.size, &texels, uploads)
}
