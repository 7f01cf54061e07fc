//! `NAME.wgsl` as an [`Effect`].

use crate::around::{Seeing, Textured};
use crate::compile::{self, Compiled, Made};
use crate::head::Head;
use crate::overlay::Drawing;
use crate::program::{Around, Program};
use crate::shape::Value;
use choreo_plugin::{
    Effect, EffectTexture, Falling, Hook, Manifest, Overlay, Pictures, Place, PluginFile, Scene, Seen, Shell,
    SurfaceNeeds,
};
use glam::{Vec2, Vec3, Vec4};
use thiserror::Error;

/// Names of effect files end so.
pub const ENDING: &str = ".wgsl";

/// What is wrong with an effect's text, and where.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{file}:{line}:{column}: {message}")]
pub struct LookError {
    pub file: String,
    /// Line number from 1.
    pub line: usize,
    pub column: usize,
    pub message: String,
}

/// Pixels of a hull.
const MOST_WIDTH: f32 = 256.0;

/// Magenta: it is seen, and no frame hangs.
const TOO_LONG: Vec4 = Vec4::new(1.0, 0.0, 1.0, 1.0);

pub struct WgslEffect {
    manifest: Manifest,
    /// The author's text, and below it a constant for each parameter.
    wgsl: String,
    program: Program,
    head: Head,
    textures: Vec<EffectTexture>,
    /// What of a surface its text reads.
    needs: SurfaceNeeds,
    made: Made,
    /// Its text reads the boxes around actors.
    boxes: bool,
    origin: Option<PluginFile>,
}

impl WgslEffect {
    /// An effect without textures; see [`WgslEffect::with_pictures`].
    pub fn from_text(file: &str, text: &str) -> Result<WgslEffect, LookError> {
        Self::with_pictures(file, text, |_| Err("a text alone has no files beside it".into()))
    }

    /// Reads the head comment, compiles the text, and tries it. `file` is its name in messages; `picture` reads the files that
    /// the head names, or says why it cannot.
    pub fn with_pictures(
        file: &str,
        text: &str,
        picture: impl Fn(&str) -> Result<Picture, String>,
    ) -> Result<WgslEffect, LookError> {
        let Compiled { manifest, head, wgsl, program, made } = compile::compile(file, text)?;
        let reads = |field: &str| text.contains(&format!(".{field}"));
        let needs = SurfaceNeeds {
            normals: reads("normal") || reads("facing"),
            uvs: reads("uv"),
            joints: reads("joints"),
            shadow: reads("shadow"),
            see_through: head.see_through,
        };
        let mut textures = Vec::new();
        for line in &head.textures {
            let made = picture(&line.file).and_then(|p| {
                let most = EffectTexture::MOST;
                let [w, h] = p.size;
                let made = EffectTexture::new(&line.name, p.size, &p.rgba, line.srgb);
                made.map(|made| made.of_file(p.file))
                    .ok_or_else(|| format!("a picture of {w} × {h}, at most {most} × {most} for an effect"))
            });
            textures.push(made.map_err(|e| LookError {
                file: file.into(),
                line: line.line,
                column: 1,
                message: format!("texture {}: \"{}\": {e}", line.name, line.file),
            })?);
        }
        Ok(WgslEffect {
            manifest,
            wgsl,
            program,
            head,
            textures,
            needs,
            made,
            boxes: reads("low") || reads("high"),
            origin: None,
        })
    }

    /// Sets the file that the text was read from.
    pub fn with_file(mut self, file: PluginFile) -> WgslEffect {
        self.origin = Some(file);
        self
    }

    /// Runs its function on values, parameters last. `None`: more than its steps.
    fn run(&self, mut arguments: Vec<Value>, around: &dyn Around, p: &[f32; 8]) -> Option<[f32; 4]> {
        arguments.push(Value::floats(p));
        let done = self.program.run(arguments, around).ok()?;
        Some(std::array::from_fn(|i| done.value.f(i)))
    }
}

/// A picture that a head names, as bytes of RGBA.
pub struct Picture {
    pub size: [u32; 2],
    pub rgba: Vec<u8>,
    /// File from which it was read.
    pub file: Option<std::path::PathBuf>,
}

impl Effect for WgslEffect {
    fn manifest(&self) -> &Manifest {
        &self.manifest
    }

    fn file(&self) -> Option<&PluginFile> {
        self.origin.as_ref()
    }

    fn hook(&self) -> Hook {
        self.head.hook
    }

    /// What is drawn once for the scene belongs to no actor.
    fn of_actors(&self) -> bool {
        self.head.hook.of_actors() && !self.head.of_scene
    }

    fn surface_needs(&self, _: &[f32; 8]) -> SurfaceNeeds {
        self.needs
    }

    fn of_background(&self, _: &[f32; 8]) -> bool {
        self.head.background
    }

    fn along_model(&self) -> bool {
        self.head.along_model
    }

    fn reach(&self, parameters: &[f32; 8]) -> f32 {
        self.head.reach.of(parameters).abs()
    }

    fn passes(&self) -> u32 {
        self.head.passes
    }

    fn history(&self, _: &[f32; 8]) -> u32 {
        self.head.history
    }

    fn textures(&self) -> &[EffectTexture] {
        &self.textures
    }

    fn wgsl(&self) -> &str {
        &self.wgsl
    }

    fn cpu_surface(&self, color: Vec4, seen: &Seen, parameters: &[f32; 8]) -> Vec4 {
        let (w, n, b, j) = (seen.world, seen.normal, seen.background, seen.joints);
        let at = [
            w.x,
            w.y,
            w.z,
            seen.distance,
            n.x,
            n.y,
            n.z,
            seen.facing,
            b.x,
            b.y,
            b.z,
            j.x,
            j.y,
            j.z,
            seen.uv.x,
            seen.uv.y,
            seen.shadow,
            seen.viewer.x,
            seen.viewer.y,
            seen.viewer.z,
        ];
        let arguments = vec![Value::floats(&color.to_array()), Value::floats(&at)];
        let out = self.run(arguments, &Textured(&self.textures), parameters);
        out.map_or(TOO_LONG, Vec4::from_array)
    }

    fn cpu_vertex(&self, place: &Place, parameters: &[f32; 8]) -> Vec3 {
        let (w, n, uv, m) = (place.world, place.normal, place.uv, place.model);
        let at = [w.x, w.y, w.z, n.x, n.y, n.z, uv.x, uv.y, m.x, m.y, m.z];
        let out = self.run(vec![Value::floats(&at)], &Textured(&self.textures), parameters);
        // One that takes more than its steps stays where it is.
        out.map_or(Vec3::ZERO, |[x, y, z, _]| Vec3::new(x, y, z))
    }

    fn cpu_lighting(&self, falling: &Falling, parameters: &[f32; 8]) -> Vec3 {
        let mut at = [falling.cosine, falling.share].to_vec();
        let vectors =
            [falling.color, falling.base, falling.normal, falling.viewer, falling.light, falling.lit];
        vectors.iter().for_each(|v| at.extend(v.to_array()));
        let out = self.run(vec![Value::floats(&at)], &Textured(&self.textures), parameters);
        out.map_or(TOO_LONG.truncate(), |[x, y, z, _]| Vec3::new(x, y, z))
    }

    fn cpu_picture(&self, pictures: &Pictures, at: [i32; 2], pass: u32, parameters: &[f32; 8]) -> Vec4 {
        let around = Seeing { pictures, textures: &self.textures, history: self.head.history };
        let out = self.run(vec![Value::ints(at), Value::uint(pass)], &around, parameters);
        out.map_or(TOO_LONG, Vec4::from_array)
    }

    /// A pixel that takes more than its steps is magenta: it is seen, and no frame hangs.
    fn cpu(&self, color: Vec4, uv: Vec2, parameters: &[f32; 8]) -> Vec4 {
        let arguments = vec![Value::floats(&color.to_array()), Value::floats(&uv.to_array())];
        let out = self.run(arguments, &Textured(&self.textures), parameters);
        out.map_or(TOO_LONG, Vec4::from_array)
    }

    fn overlay(&self, scene: &Scene, parameters: &[f32; 8]) -> Overlay {
        let triangles = match self.made {
            Made::Strokes => false,
            Made::Triangles => true,
            _ => return Overlay::default(),
        };
        let (program, head, textures) = (&self.program, &self.head, &self.textures[..]);
        Drawing { program, head, textures, triangles, boxes: self.boxes, parameters }.run(scene)
    }

    /// One whose numbers are not finite draws nothing, as one that takes more than its steps.
    fn shell(&self, parameters: &[f32; 8]) -> Option<Shell> {
        let Made::Shell = self.made else { return None };
        let done = self.program.run(vec![Value::floats(parameters)], &Textured(&self.textures)).ok()?;
        let [width, r, g, b, lighting_mix] = [0, 1, 2, 3, 4].map(|i| done.value.f(i));
        let shell = Shell {
            width: width.min(MOST_WIDTH),
            color: Vec3::new(r, g, b),
            lighting_mix: lighting_mix.clamp(0.0, 1.0),
        };
        (width > 0.0 && shell.color.is_finite() && lighting_mix.is_finite()).then_some(shell)
    }

    fn edges(&self, parameters: &[f32; 8]) -> Option<Vec3> {
        let Made::Edges = self.made else { return None };
        let done = self.program.run(vec![Value::floats(parameters)], &Textured(&self.textures)).ok()?;
        Some(Vec3::from([0, 1, 2].map(|i| done.value.f(i)))).filter(|color| color.is_finite())
    }
}
