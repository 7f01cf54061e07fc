//! Color, depth and float images of one size, created again when size, samples or needs change.

use super::context::Context;
use super::error::Named;
use super::memory::{Buffer, Image, ImageDesc};
use super::sampled_image::SampledImage;
use super::scene_color_copy::scene_color_image;
use super::shadow::{HeldMap, shadow_maps};
use super::sky::SkyImages;
use crate::commands::{Command, Recording, Target};
use crate::dither::{self, dither_to_codes};
use crate::error::RenderError;
use crate::scene_resources::mipmap::linear_to_srgb8;
use ash::vk;
use glam::Vec4;
use gpu_allocator::MemoryLocation;

pub(super) const IMAGE_FORMAT: vk::Format = vk::Format::R8G8B8A8_SRGB;
pub(crate) const FLOAT_FORMAT: vk::Format = vk::Format::R16G16B16A16_SFLOAT;
pub(super) const DEPTH_FORMAT: vk::Format = vk::Format::D32_SFLOAT;

pub(super) fn format(target: Target) -> vk::Format {
    match target {
        Target::Image => IMAGE_FORMAT,
        Target::Float(_) | Target::Texture(_) => FLOAT_FORMAT,
    }
}

/// Images that a recording needs; recordings with equal needs share them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct TargetNeeds {
    pub size: [u32; 2],
    pub samples: u32,
    pub scene: Target,
    pub depth: bool,
    /// Number of float targets, 0 to 3.
    pub floats: usize,
    /// Sizes of the textures of effect passes.
    pub textures: Vec<[u32; 2]>,
    /// Size in texels of the image of shadow maps.
    pub shadow: Option<[u32; 2]>,
    /// Mip levels of the scene color copy.
    pub scene_color_copy: Option<u32>,
    /// Whether depths of peeled layers are needed.
    pub layers: bool,
    /// Whether a G-buffer is needed.
    pub gbuffer: bool,
    /// Number of color targets of effect inputs, 0 to 2.
    pub inputs: usize,
}

impl TargetNeeds {
    pub(super) fn of(recording: &Recording) -> TargetNeeds {
        let mut needs = TargetNeeds {
            size: recording.size,
            samples: 1,
            scene: Target::Image,
            depth: false,
            floats: 0,
            textures: Vec::new(),
            shadow: None,
            scene_color_copy: None,
            layers: false,
            gbuffer: false,
            inputs: 0,
        };
        for command in &recording.commands {
            let float = |t: &Target| match t {
                Target::Float(i) => *i as usize + 1,
                Target::Image | Target::Texture(_) => 0,
            };
            match command {
                Command::BeginShadows { image, .. } | Command::KeepShadows { image } => {
                    needs.shadow = Some(*image)
                }
                Command::BeginPeel { .. } => needs.layers = true,
                Command::BeginGBuffer => needs.gbuffer = true,
                Command::BeginInputs { motion } => needs.inputs = 1 + usize::from(*motion),
                Command::CopySceneColor { levels, .. } => needs.scene_color_copy = Some(*levels),
                Command::BeginPass { target, samples, depth, .. } => {
                    (needs.scene, needs.samples, needs.depth) = (*target, *samples, *depth);
                    needs.floats = needs.floats.max(float(target));
                }
                Command::PostPass { from, to, size, .. } => {
                    needs.floats = needs.floats.max(float(from)).max(float(to));
                    // Texture numbers begin with 0, and each texture is written before it is read.
                    if matches!(to, Target::Texture(slot) if usize::from(*slot) == needs.textures.len()) {
                        needs.textures.push(*size);
                    }
                }
                _ => {}
            }
        }
        needs
    }
}

pub(super) struct Targets {
    pub needs: TargetNeeds,
    pub frame_image: Image,
    pub floats: Vec<Image>,
    /// Textures of passes of effects.
    pub textures: Vec<Image>,
    pub depth: Option<Image>,
    /// Depths of two peeled layers, used alternately.
    pub layers: Vec<Image>,
    /// Images of the G-buffer.
    pub gbuffer: Vec<Image>,
    /// Targets of effect inputs, and the depth image of their pass.
    pub inputs: Vec<Image>,
    pub input_depth: Option<Image>,
    /// Sampler that no shader uses: lavapipe (22.3) dereferences every binding of a bound set.
    sampler: vk::Sampler,
    /// Multisampled target, resolved into the scene's target; `None` with one sample per pixel.
    pub multisampled: Option<Image>,
    pub shadow: Option<SampledImage>,
    /// The shadow maps that the image holds.
    pub shadow_maps: Vec<HeldMap>,
    pub scene_color_copy: Option<SampledImage>,
    /// Rows of the background as encoded bytes, and the two colors that they were made from.
    background: Option<(Buffer, [Vec4; 2])>,
}

/// Images of a frame that scene shaders read.
#[derive(Clone, Copy, Default)]
pub(crate) struct FrameImages<'a> {
    pub shadow: Option<&'a SampledImage>,
    pub scene_color_copy: Option<&'a SampledImage>,
    pub sky: Option<&'a SkyImages>,
    /// Depth images of the scene, of even peeled layers and of odd ones.
    pub layers: Option<([vk::ImageView; 3], vk::Sampler)>,
    /// The G-buffer.
    pub gbuffer: Option<[vk::ImageView; 3]>,
    /// Textures of effects.
    pub texels: Option<&'a Buffer>,
    /// Size of the fault records of effects in bytes.
    pub faults: usize,
}

/// An image without mipmaps, with the aspect of its format.
fn new_image(
    gpu: &Context,
    [width, height]: [u32; 2],
    name: &str,
    format: vk::Format,
    usage: vk::ImageUsageFlags,
    samples: u32,
) -> Result<Image, RenderError> {
    let aspect =
        if format == DEPTH_FORMAT { vk::ImageAspectFlags::DEPTH } else { vk::ImageAspectFlags::COLOR };
    Image::new(gpu, &ImageDesc { name, width, height, levels: 1, samples, format, usage, aspect })
}

impl Targets {
    pub(super) fn new(gpu: &Context, needs: TargetNeeds) -> Result<Targets, RenderError> {
        let usage = vk::ImageUsageFlags::COLOR_ATTACHMENT
            | vk::ImageUsageFlags::TRANSFER_SRC
            | vk::ImageUsageFlags::TRANSFER_DST;
        let frame_image = new_image(gpu, needs.size, "frame image", IMAGE_FORMAT, usage, 1)?;
        let mut targets = Targets {
            needs,
            frame_image,
            floats: Vec::new(),
            textures: Vec::new(),
            depth: None,
            layers: Vec::new(),
            gbuffer: Vec::new(),
            inputs: Vec::new(),
            input_depth: None,
            sampler: vk::Sampler::null(),
            multisampled: None,
            shadow: None,
            shadow_maps: Vec::new(),
            scene_color_copy: None,
            background: None,
        };
        match targets.create_images(gpu) {
            Ok(()) => Ok(targets),
            Err(e) => {
                targets.destroy(gpu);
                Err(e)
            }
        }
    }

    /// Creates the images that the frame needs besides its own. After an error, those created so far are in the targets.
    fn create_images(&mut self, gpu: &Context) -> Result<(), RenderError> {
        use vk::ImageUsageFlags as U;
        let needs = self.needs.clone();
        let image =
            |name: &str, format, usage, samples| new_image(gpu, needs.size, name, format, usage, samples);
        let usage = U::COLOR_ATTACHMENT | U::SAMPLED | U::TRANSFER_SRC;
        for i in 0..needs.floats {
            let name = format!("float target {i}");
            self.floats.push(image(&name, FLOAT_FORMAT, usage, 1)?);
        }
        for (i, size) in needs.textures.iter().enumerate() {
            let name = format!("texture {i} of passes");
            self.textures.push(new_image(gpu, *size, &name, FLOAT_FORMAT, usage, 1)?);
        }
        if needs.depth {
            let read = if needs.layers { U::SAMPLED } else { U::empty() };
            let usage = U::DEPTH_STENCIL_ATTACHMENT | read;
            self.depth = Some(image("depth", DEPTH_FORMAT, usage, needs.samples)?);
        }
        if needs.layers {
            // SAFETY: the device is alive; destroyed by `destroy`.
            let made = unsafe { gpu.device.create_sampler(&vk::SamplerCreateInfo::default(), None) };
            self.sampler = made.named("sampler of layers")?;
        }
        for name in ["even layers", "odd layers"].into_iter().filter(|_| needs.layers) {
            let usage = U::DEPTH_STENCIL_ATTACHMENT | U::SAMPLED;
            self.layers.push(image(name, DEPTH_FORMAT, usage, needs.samples)?);
        }
        for format in super::deferred::FORMATS.into_iter().filter(|_| needs.gbuffer) {
            let usage = U::COLOR_ATTACHMENT | U::SAMPLED;
            self.gbuffer.push(image("G-buffer", format, usage, 1)?);
        }
        for name in ["normals and depth", "motion and actors"].into_iter().take(needs.inputs) {
            self.inputs.push(image(name, super::scene_inputs::FORMAT, usage, 1)?);
        }
        if needs.inputs > 0 {
            self.input_depth = Some(image("depth of inputs", DEPTH_FORMAT, U::DEPTH_STENCIL_ATTACHMENT, 1)?);
        }
        if needs.samples > 1 {
            let format = format(needs.scene);
            let made = image("multisampled image", format, U::COLOR_ATTACHMENT, needs.samples)?;
            self.multisampled = Some(made);
        }
        self.shadow = needs.shadow.map(|size| shadow_maps(gpu, size)).transpose()?;
        let copy = needs.scene_color_copy.map(|levels| scene_color_image(gpu, needs.size, levels));
        self.scene_color_copy = copy.transpose()?;
        Ok(())
    }

    /// Images that scene shaders read, except those of materials and of the sky, which are resources.
    pub(super) fn shader_images(&self) -> FrameImages<'_> {
        let layers = match (&self.depth, &self.layers[..]) {
            (Some(depth), [even, odd]) => Some(([depth.view, even.view, odd.view], self.sampler)),
            _ => None,
        };
        let gbuffer = match &self.gbuffer[..] {
            [a, b, c] => Some([a.view, b.view, c.view]),
            _ => None,
        };
        let (shadow, scene_color_copy) = (self.shadow.as_ref(), self.scene_color_copy.as_ref());
        FrameImages { layers, gbuffer, shadow, scene_color_copy, sky: None, texels: None, faults: 0 }
    }

    pub(super) fn image(&self, target: Target) -> &Image {
        match target {
            Target::Image => &self.frame_image,
            // `TargetNeeds::of` counted them from the same recording.
            Target::Float(i) => &self.floats[i as usize],
            Target::Texture(i) => &self.textures[i as usize],
        }
    }

    /// Whether the background's rows exist and have these colors.
    pub(crate) fn has_background(&self, top: Vec4, bottom: Vec4) -> bool {
        self.background.as_ref().is_some_and(|(_, colors)| *colors == [top, bottom])
    }

    /// Computes the background's rows as background.wgsl draws them, encoded: mix(top, bottom, (y + ½) / height). No frame may be
    /// in flight.
    pub(crate) fn set_background(
        &mut self,
        gpu: &Context,
        top: Vec4,
        bottom: Vec4,
    ) -> Result<(), RenderError> {
        let [width, height] = self.needs.size;
        let row_bytes = width as usize * 4;
        let mut buffer = match self.background.take() {
            Some((buffer, _)) => buffer,
            None => {
                let bytes = row_bytes as u64 * height as u64;
                let usage = vk::BufferUsageFlags::TRANSFER_SRC;
                Buffer::new(gpu, "background rows", bytes, usage, MemoryLocation::CpuToGpu)?
            }
        };
        let rows = buffer.mapped_mut().chunks_exact_mut(row_bytes).take(height as usize);
        for (y, row) in rows.enumerate() {
            let t = (y as f32 + 0.5) / height as f32;
            let color = top * (1.0 - t) + bottom * t;
            // Gradients are dithered, with a pattern that repeats along a row.
            let pixels: [[u8; 4]; dither::TABLE_SIDE] = std::array::from_fn(|x| {
                let shown = if top == bottom { color } else { dither_to_codes(color, x, y) };
                let [r, g, b] = shown.truncate().to_array().map(linear_to_srgb8);
                [r, g, b, (color.w.clamp(0.0, 1.0) * 255.0 + 0.5) as u8]
            });
            row.as_chunks_mut::<4>()
                .0
                .iter_mut()
                .zip(pixels.iter().cycle())
                .for_each(|(to, from)| *to = *from);
        }
        self.background = Some((buffer, [top, bottom]));
        Ok(())
    }

    pub(super) fn background(&self) -> Option<vk::Buffer> {
        self.background.as_ref().map(|(buffer, _)| buffer.raw)
    }

    /// Destroys the images. No frame may be in flight.
    pub(super) fn destroy(&mut self, gpu: &Context) {
        self.frame_image.destroy(gpu);
        if let Some((mut buffer, _)) = self.background.take() {
            buffer.destroy(gpu);
        }
        for image in self
            .floats
            .iter_mut()
            .chain(&mut self.textures)
            .chain(&mut self.layers)
            .chain(&mut self.gbuffer)
            .chain(&mut self.inputs)
            .chain(&mut self.input_depth)
            .chain(&mut self.depth)
            .chain(&mut self.multisampled)
        {
            image.destroy(gpu);
        }
        // SAFETY: made from this device (or null), no longer used.
        unsafe { gpu.device.destroy_sampler(self.sampler, None) };
        for mut image in self.shadow.take().into_iter().chain(self.scene_color_copy.take()) {
            image.destroy(gpu);
        }
    }
}
