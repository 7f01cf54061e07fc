//! An [`Effect`] from a file `NAME.wgsl`.

use crate::compile::{self, Code, Output, Text};
use crate::environment::{Environment, FrameEnvironment, PassImages, Textures};
use crate::error::EffectError;
use crate::header::Header;
use crate::machine::{Lanes, Machine, Width};
use crate::overlay::OverlayInputs;
use crate::pool;
use crate::program::Program;
use choreo_plugin::effect::endless;
use choreo_plugin::{
    Effect, EffectImages, EffectPlugin, EffectScene, EffectShader, EffectTexture, Hook, ImageEffect,
    ImagePass, InvertedHull, LightSample, LightingEffect, Manifest, OutlineEffect, Overlay, OverlayEffect,
    PixelEffect, PluginFile, SceneInputs, Shutter, ShutterEffect, SurfaceEffect, SurfaceInputs,
    SurfaceSample, VertexEffect, VertexSample, ViewOrder,
};
use glam::{Vec2, Vec3, Vec4};
use std::sync::{Arc, OnceLock};

/// Ending of the names of effect files.
pub const FILE_ENDING: &str = ".wgsl";

/// Largest width of an outline in pixels.
const MAX_WIDTH: f32 = 256.0;

/// An effect in one WGSL file. It implements the traits of all hooks, but only the methods of its own hook may be called; [`Effect::from`]
/// makes the effect of that hook.
#[derive(Clone)]
pub struct WgslEffect {
    text: Arc<Text>,
    manifest: Manifest,
    /// Count of the parameter numbers; the numbers of the frame follow them.
    number_count: usize,
    header: Arc<Header>,
    /// Compiled code, shared by effects that differ only in their images.
    code: Arc<OnceLock<Code>>,
    textures: Vec<EffectTexture>,
    inputs: SurfaceInputs,
    /// Places of the counted loops.
    loops: Vec<String>,
    /// The text reads the bounding boxes of actors.
    reads_boxes: bool,
    file: Option<PluginFile>,
}

impl WgslEffect {
    /// An effect without textures; see [`WgslEffect::with_textures`].
    ///
    /// ```
    /// use choreo_plugin::{EffectPlugin, PixelEffect};
    /// use choreo_wgsl_effect::WgslEffect;
    /// use glam::{Vec2, Vec4};
    ///
    /// let half = WgslEffect::from_text("half.wgsl", "// effect: half
    /// fn effect(color: vec4<f32>, uv: vec2<f32>, p: Parameters) -> vec4<f32> { return 0.5 * color; }")?;
    /// let mut colors = [Vec4::ONE];
    /// half.pixels(&mut colors, &[Vec2::ZERO], &[0.0; 8]);
    /// assert_eq!((half.manifest().name.as_str(), colors), ("half", [Vec4::splat(0.5)]));
    /// # Ok::<(), choreo_wgsl_effect::EffectError>(())
    /// ```
    pub fn from_text(file: &str, text: &str) -> Result<WgslEffect, EffectError> {
        Self::with_textures(file, text, |_| Err("an effect without a file cannot read other files".into()))
    }

    /// Reads the header comment, compiles the text, and tries it. `file` is the name of the text in messages. `read_image` reads the image files
    /// that the header names, or returns the reason why it cannot.
    pub fn with_textures(
        file: &str,
        text: &str,
        read_image: impl Fn(&str) -> Result<TextureImage, String>,
    ) -> Result<WgslEffect, EffectError> {
        let mut effect = Self::read(file, text)?;
        effect.code =
            Arc::new(OnceLock::from(compile::compile(&effect.text, &effect.header, &effect.manifest)?));
        for line in &effect.header.textures {
            let white = || Ok(TextureImage { size: [1, 1], rgba: vec![255; 4], file: None });
            let made = if line.file.is_empty() { white() } else { read_image(&line.file) };
            let made = made.and_then(|p| {
                let most = EffectTexture::MOST;
                let [w, h] = p.size;
                let made = EffectTexture::new(&line.name, p.size, &p.rgba, line.srgb);
                made.map(|made| made.of_file(p.file))
                    .ok_or_else(|| format!("an image of {w} × {h}, at most {most} × {most} for an effect"))
            });
            effect.textures.push(made.map_err(|e| {
                let message = format!("texture {}: \"{}\": {e}", line.name, line.file);
                EffectError::new(file, &effect.text.author, (line.line, 1), message)
            })?);
        }
        Ok(effect)
    }

    /// A built-in effect without textures. Its function is compiled when the CPU first runs it; the program's tests compile all built-in
    /// effects.
    ///
    /// # Panics
    /// The header comment has a mistake; later, when the function is compiled, the function has one. The message has the place.
    pub fn built_in(file: &str, text: &str, version: &str) -> WgslEffect {
        let mut effect = Self::read(file, text).unwrap_or_else(|e| panic!("{e}"));
        effect.manifest.version = version.into();
        effect
    }

    fn read(file: &str, text: &str) -> Result<WgslEffect, EffectError> {
        let (text, manifest, header) = Text::read(file, text)?;
        let reads = |field: &str| text.author.contains(&format!(".{field}"));
        let inputs = SurfaceInputs {
            normals: reads("normal") || reads("facing"),
            uvs: reads("uv"),
            joints: reads("joints"),
            shadow: reads("shadow"),
            see_through: header.see_through,
        };
        let reads_boxes = reads("low") || reads("high");
        let (code, textures) = (Arc::default(), Vec::new());
        let (text, header) = (Arc::new(text), Arc::new(header));
        let loops = text.loops.iter().map(|(line, column)| format!("{file}:{line}:{column}")).collect();
        let number_count = manifest.parameter_length();
        Ok(WgslEffect {
            text,
            manifest,
            number_count,
            header,
            code,
            textures,
            inputs,
            loops,
            reads_boxes,
            file: None,
        })
    }

    /// The hook that the header names.
    pub fn hook(&self) -> Hook {
        self.header.hook
    }

    /// Sets the file from which the text was read.
    pub fn with_file(mut self, file: PluginFile) -> WgslEffect {
        self.file = Some(file);
        self
    }

    fn code(&self) -> &Code {
        self.code.get_or_init(|| {
            let code = compile::compile(&self.text, &self.header, &self.manifest);
            code.unwrap_or_else(|e| panic!("{e}"))
        })
    }

    /// Calls a function without arguments other than the parameters. The result is [`endless`] if it takes too many steps.
    fn call(&self, parameters: &[f32]) -> [f32; 5] {
        let program = &self.code().program;
        let mut machine = Machine::<1>::new(program, parameters);
        let ran = machine.run(program, 1, &Textures(&self.textures));
        match ran.is_ok() && machine.endless == [0] {
            true => [0, 1, 2, 3, 4].map(|i| machine.float(program, 0, i)),
            false => [endless(machine.endless[0]); 5],
        }
    }

    /// The environment of hooks whose parameters the numbers of the frame may follow.
    fn frame_environment<'a>(&'a self, parameters: &'a [f32]) -> FrameEnvironment<'a> {
        let numbers = if self.text.scene.reads_frame { parameters.get(self.number_count..) } else { None };
        FrameEnvironment { textures: &self.textures, numbers: numbers.unwrap_or_default() }
    }

    /// Runs the function for each color and its sample, `N` at a time; `component` returns one number of a sample.
    fn color_batches<const N: usize, S>(
        &self,
        colors: &mut [Vec4],
        samples: &[S],
        component: impl Fn(&S, usize) -> f32 + Copy,
        parameters: &[f32],
    ) where
        Machine<N>: pool::Pooled,
        Lanes: Width<N>,
    {
        self.batches::<N, _>(
            &self.code().program,
            parameters,
            &self.frame_environment(parameters),
            colors,
            |machine, program, first, part| {
                machine.fill(program, 0, part, |color, i| color[i]);
                machine.fill(program, 1, &samples[first..first + part.len()], component);
            },
            |color, out| *color = Vec4::from_array(out),
        );
    }

    /// Runs the function for each item, `N` at a time. `set` writes the arguments of a part of the items, given the index of its first
    /// item; `get` stores the result of an item.
    fn batches<const N: usize, T>(
        &self,
        program: &Program,
        parameters: &[f32],
        environment: &dyn Environment,
        items: &mut [T],
        set: impl Fn(&mut Machine<N>, &Program, usize, &[T]),
        get: impl Fn(&mut T, [f32; 4]) + Copy,
    ) where
        Machine<N>: pool::Pooled,
        Lanes: Width<N>,
    {
        pool::with_machine(program, parameters, |machine: &mut Machine<N>| {
            for (number, part) in items.chunks_mut(N).enumerate() {
                set(machine, program, number * N, part);
                if machine.run(program, part.len(), environment).is_ok() {
                    machine.read(program, part, get);
                    for (item, number) in part.iter_mut().zip(machine.endless).filter(|(_, n)| *n > 0) {
                        get(item, [endless(number); 4]);
                    }
                    continue;
                }
                // Together, the branches of all lanes took too many steps; each lane alone may not.
                for (lane, item) in part.iter_mut().enumerate() {
                    let mut alone = machine.lane(program, lane);
                    match alone.run(program, 1, environment) {
                        Ok(()) if alone.endless == [0] => {
                            alone.read(program, std::slice::from_mut(item), get);
                        }
                        _ => get(item, [endless(alone.endless[0]); 4]),
                    }
                }
            }
        });
    }
}

/// An image that a header names, as 8-bit RGBA.
pub struct TextureImage {
    /// Width and height.
    pub size: [u32; 2],
    /// Pixels, row by row from the top.
    pub rgba: Vec<u8>,
    /// The file that it was read from.
    pub file: Option<std::path::PathBuf>,
}

/// Number of items that run at once: `ROW` where there are many, else `QUAD`, such as a quad of a transparent surface.
const ROW: usize = 32;
const QUAD: usize = 4;

/// A component of a sample, in the order of the struct `SurfaceSample`.
#[inline(always)]
fn surface_component(s: &SurfaceSample, i: usize) -> f32 {
    match i {
        0..3 => s.world[i],
        3 => s.distance,
        4..7 => s.normal[i - 4],
        7 => s.facing,
        8..11 => s.background[i - 8],
        11..14 => s.joints[i - 11],
        14..16 => s.uv[i - 14],
        16 => s.shadow,
        _ => s.viewer[i - 17],
    }
}

impl EffectPlugin for WgslEffect {
    fn manifest(&self) -> &Manifest {
        &self.manifest
    }

    fn file(&self) -> Option<&PluginFile> {
        self.file.as_ref()
    }

    fn off(&self, parameters: &[f32]) -> Option<String> {
        let off = self.header.off.as_ref().filter(|off| parameters.get(off.index) == Some(&off.value))?;
        Some(format!("{} is {}", off.name, off.value))
    }

    fn loops(&self) -> &[String] {
        &self.loops
    }
}

impl EffectShader for WgslEffect {
    fn wgsl(&self) -> &str {
        &self.text.wgsl
    }

    fn reads_frame(&self) -> bool {
        self.text.scene.reads_frame
    }

    fn textures(&self) -> &[EffectTexture] {
        &self.textures
    }

    fn with_images(&self, name: &str, images: &[EffectTexture]) -> Option<Effect> {
        let mut other = self.clone();
        other.manifest.name = name.into();
        for image in images {
            *other.textures.iter_mut().find(|own| own.name == image.name)? = image.clone();
        }
        Some(other.into())
    }
}

impl PixelEffect for WgslEffect {
    fn view_order(&self) -> ViewOrder {
        self.header.view
    }

    fn pixels(&self, colors: &mut [Vec4], uv: &[Vec2], parameters: &[f32]) {
        self.color_batches::<ROW, _>(colors, uv, |uv, i| uv[i], parameters);
    }
}

impl ImageEffect for WgslEffect {
    fn view_order(&self) -> ViewOrder {
        self.header.view
    }

    fn passes(&self) -> u32 {
        self.header.passes
    }

    fn shrink(&self, pass_number: u32, size: [u32; 2], parameters: &[f32]) -> u32 {
        let scale = match self.header.pass_lines.is_empty() {
            true => self.header.shrink,
            false => self.header.pass_lines.get(pass_number as usize).map(|line| line.scale),
        };
        scale.map_or(1, |scale| scale.factor(size, parameters))
    }

    fn named_passes(&self) -> &[ImagePass] {
        &self.text.passes
    }

    fn history(&self, _: &[f32]) -> u32 {
        self.header.history
    }

    fn scene_inputs(&self) -> SceneInputs {
        self.text.scene.inputs
    }

    fn image_row(
        &self,
        images: &EffectImages,
        y: u32,
        pass_number: u32,
        parameters: &[f32],
        row: &mut [Vec4],
    ) {
        let named = self.header.pass_lines.len() as u32;
        // Passes without textures of their own have one scale, and the last one reads the texture of that scale.
        let shrinks: Vec<u32> = (0..=named)
            .map(|pass| ImageEffect::shrink(self, pass, images.original.size, parameters))
            .collect();
        let (textures, history) = (&self.textures[..], self.header.history);
        let environment = PassImages { images, textures, history, shrinks: &shrinks, pass_number };
        let code = self.code();
        self.batches::<ROW, _>(
            code.passes.get(pass_number as usize).unwrap_or(&code.program),
            parameters,
            &environment,
            row,
            |machine, program, first, part| {
                for lane in 0..part.len() {
                    machine.set(program, 0, lane, &[(first + lane) as u32, y]);
                    if named == 0 {
                        machine.set(program, 1, lane, &[pass_number]);
                    }
                }
            },
            |color, out| *color = Vec4::from_array(out),
        );
    }
}

impl SurfaceEffect for WgslEffect {
    fn surface_inputs(&self, parameters: &[f32]) -> SurfaceInputs {
        self.header.inputs(self.inputs, parameters)
    }

    fn changes_background(&self, parameters: &[f32]) -> bool {
        self.header.background.of(parameters) > 0.5
    }

    fn surfaces(&self, colors: &mut [Vec4], samples: &[SurfaceSample], parameters: &[f32]) {
        if colors.len() > QUAD {
            self.color_batches::<ROW, _>(colors, samples, surface_component, parameters);
        } else {
            self.color_batches::<QUAD, _>(colors, samples, surface_component, parameters);
        }
    }
}

impl VertexEffect for WgslEffect {
    fn surface_inputs(&self, parameters: &[f32]) -> SurfaceInputs {
        self.header.inputs(self.inputs, parameters)
    }

    fn reach(&self, parameters: &[f32]) -> f32 {
        self.header.reach.of(parameters).abs()
    }

    fn in_model_space(&self) -> bool {
        self.header.in_model_space
    }

    fn vertex(&self, sample: &VertexSample, parameters: &[f32]) -> Vec3 {
        let mut offset = [Vec3::ZERO];
        let (w, n, uv, m) = (sample.world, sample.normal, sample.uv, sample.model);
        let components = [w.x, w.y, w.z, n.x, n.y, n.z, uv.x, uv.y, m.x, m.y, m.z];
        self.batches::<QUAD, _>(
            &self.code().program,
            parameters,
            &self.frame_environment(parameters),
            &mut offset,
            |machine, program, _, _| machine.fill(program, 0, &[components], |vertex, i| vertex[i]),
            |offset, out| *offset = Vec4::from_array(out).truncate(),
        );
        offset[0]
    }
}

impl LightingEffect for WgslEffect {
    fn surface_inputs(&self, parameters: &[f32]) -> SurfaceInputs {
        self.header.inputs(self.inputs, parameters)
    }

    fn lights(&self, samples: &mut [LightSample], parameters: &[f32]) {
        self.batches::<QUAD, _>(
            &self.code().program,
            parameters,
            &self.frame_environment(parameters),
            samples,
            |machine, program, _, part| {
                machine.fill(program, 0, part, |s, i| {
                    let vectors = [s.color, s.base, s.normal, s.viewer, s.light, s.lit];
                    match i {
                        0 => s.cosine,
                        1 => s.share,
                        _ => vectors[(i - 2) / 3][(i - 2) % 3],
                    }
                });
            },
            |sample, out| sample.lit = Vec4::from_array(out).truncate(),
        );
    }
}

impl OutlineEffect for WgslEffect {
    /// The hull. Values that are not finite are kept: the caller reports them.
    fn inverted_hull(&self, parameters: &[f32]) -> Option<InvertedHull> {
        if self.code().output != Output::Hull {
            return None;
        }
        let [width, r, g, b, lighting_mix] = self.call(parameters);
        let hull = InvertedHull {
            // `min` would turn NaN into a number.
            width: if width > MAX_WIDTH { MAX_WIDTH } else { width },
            color: Vec3::new(r, g, b),
            lighting_mix: lighting_mix.clamp(0.0, 1.0),
        };
        (width.is_nan() || width > 0.0).then_some(hull)
    }

    fn wireframe(&self, parameters: &[f32]) -> Option<Vec3> {
        if self.code().output != Output::Wireframe {
            return None;
        }
        let [r, g, b, ..] = self.call(parameters);
        Some(Vec3::new(r, g, b))
    }
}

impl OverlayEffect for WgslEffect {
    /// An overlay that is drawn once for the scene cannot be put on actors.
    fn applies_to_actors(&self) -> bool {
        !self.header.of_scene
    }

    fn history(&self, _: &[f32]) -> u32 {
        self.header.history
    }

    fn overlay(&self, scene: &EffectScene, parameters: &[f32]) -> Overlay {
        let Code { program, output, .. } = self.code();
        let (header, textures) = (&self.header, &self.textures[..]);
        OverlayInputs {
            program,
            header,
            textures,
            output: *output,
            reads_boxes: self.reads_boxes,
            parameters,
        }
        .run(scene)
    }
}

impl ShutterEffect for WgslEffect {
    fn shutter(&self, parameters: &[f32]) -> Option<Shutter> {
        let [samples, degrees, before, ..] = self.call(parameters);
        Some(Shutter { samples: samples.to_bits(), open: f64::from(degrees) / 360.0, before: before.into() })
    }
}

/// Makes the effect of the hook that the header names.
impl From<WgslEffect> for Effect {
    fn from(effect: WgslEffect) -> Effect {
        match effect.hook() {
            Hook::Pixel => Effect::pixel(effect),
            Hook::Image => Effect::image(effect),
            Hook::Surface => Effect::surface(effect),
            Hook::Vertex => Effect::vertex(effect),
            Hook::Lighting => Effect::lighting(effect),
            Hook::Outline => Effect::outline(effect),
            Hook::Overlay => Effect::overlay(effect),
            // `Hook` is non-exhaustive; here only the shutter is left.
            _ => Effect::shutter(effect),
        }
    }
}
