//! `NAME.wgsl` as an [`Effect`].

use crate::around::{Plain, Seeing, Textured};
use crate::forms::{Host, PREVIOUS, form};
use crate::head::{self, Head, Reach};
use crate::prepare::has_pointer_arguments;
use crate::program::{Around, MOST_STEPS, Program};
use crate::shape::Value;
use choreo_plugin::{
    Effect, EffectTexture, Falling, Hook, Manifest, OptionKind, Pictures, Place, PluginFile, Seen,
    SurfaceNeeds,
};
use glam::{Vec2, Vec3, Vec4};
use naga::SourceLocation;
use naga::valid::{Capabilities, ValidationFlags, Validator};
use thiserror::Error;

/// Names of effect files end so.
pub const ENDING: &str = ".wgsl";

/// Longer texts are no effect of one pixel.
const MOST_BYTES: usize = 256 << 10;

/// What is wrong with an effect's text, and where.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{file}:{line}:{column}: {message}")]
pub struct LookError {
    pub file: String,
    /// From 1.
    pub line: usize,
    pub column: usize,
    pub message: String,
}

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
        let at = |line: usize, column: usize, message: String| LookError {
            file: file.into(),
            line,
            column,
            message,
        };
        let place = |location: Option<SourceLocation>, message: String| match location {
            Some(l) => at(l.line_number as usize, l.line_position as usize, message),
            None => at(1, 1, message),
        };
        if text.len() > MOST_BYTES {
            return Err(at(1, 1, format!("the text is {} bytes long, at most {MOST_BYTES}", text.len())));
        }
        let manifest = head::manifest(text).map_err(|(line, message)| at(line, 1, message))?;
        let head = head::head(text, &manifest).map_err(|(line, message)| at(line, 1, message))?;
        let form = form(head.hook);
        let mut wgsl = format!("{text}\n");
        for (i, option) in manifest.options.iter().enumerate() {
            wgsl.push_str(&format!("const {}: u32 = {i}u;\n", option.name));
        }
        // The shader that calls it declares what it sees; below the author's text, so that lines stay.
        let mut functions: Vec<(String, String, Host)> = form
            .functions
            .iter()
            .chain((head.history > 0).then_some(&PREVIOUS))
            .map(|(name, text, host)| (name.to_string(), text.to_string(), *host))
            .collect();
        functions.extend(head.textures.iter().enumerate().map(|(i, t)| {
            let text = format!("fn {}(uv: vec2<f32>) -> vec4<f32> {{ return uv.xyxy; }}\n", t.name);
            (t.name.clone(), text, Host::Texture(i))
        }));
        if let Some((line, name)) = declared_twice(text, functions.iter().map(|(name, ..)| name.as_str())) {
            return Err(at(
                line,
                1,
                format!("{name} is a function that the program declares; take another name"),
            ));
        }
        let around: String = functions.iter().map(|(_, text, _)| text.as_str()).collect();
        let whole = format!("{wgsl}{}{around}", form.declared);
        let module = naga::front::wgsl::parse_str(&whole)
            .map_err(|e| place(e.location(&whole), e.message().to_string()))?;
        let info =
            Validator::new(ValidationFlags::all(), Capabilities::empty()).validate(&module).map_err(|e| {
                let mut message = e.as_inner().to_string();
                let mut cause = std::error::Error::source(e.as_inner());
                while let Some(c) = cause {
                    message.push_str(&format!("; {c}"));
                    cause = c.source();
                }
                place(e.location(&whole), message)
            })?;
        let entry = module.functions.iter().find(|(_, f)| f.name.as_deref() == Some("effect"));
        let Some((entry, function)) = entry else {
            return Err(at(1, 1, format!("there is no function effect; write {}", form.signature)));
        };
        let span = |span: naga::Span| span.is_defined().then(|| span.location(&whole));
        if !form.fits(&module, function) {
            let found = span(module.functions.get_span(entry));
            return Err(place(found, format!("effect must be {}", form.signature)));
        }
        if let Some((handle, f)) = module.functions.iter().find(|(_, f)| has_pointer_arguments(&module, f)) {
            let name = f.name.clone().unwrap_or_default();
            let found = span(module.functions.get_span(handle));
            return Err(place(
                found,
                format!("{name}: pointers as parameters are not supported; return the value"),
            ));
        }
        let host = |name: &str| functions.iter().find(|(n, ..)| n == name).map(|(.., host)| *host);
        let program = Program::new(module, &info, entry, host)
            .map_err(|e| place(span(e.span), format!("not supported: {}", e.what)))?;
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
            textures.push(
                made.map_err(|e| at(line.line, 1, format!("texture {}: \"{}\": {e}", line.name, line.file)))?,
            );
        }
        let effect = WgslEffect { manifest, wgsl, program, head, textures, needs, origin: None };
        if !effect.ends() {
            return Err(at(
                1,
                1,
                format!("a pixel takes more than {MOST_STEPS} steps; does a loop never end?"),
            ));
        }
        Ok(effect)
    }

    /// Where the text came from.
    pub fn with_file(mut self, file: PluginFile) -> WgslEffect {
        self.origin = Some(file);
        self
    }

    /// Tries a few pixels at the least, the usual and the largest parameters: an endless loop would hang the GPU.
    fn ends(&self) -> bool {
        let sets: [fn(&OptionKind) -> f32; 3] = [
            |kind| match kind {
                OptionKind::Number { min, .. } => *min as f32,
                _ => 0.0,
            },
            |kind| match kind {
                OptionKind::Number { default, .. } => *default as f32,
                OptionKind::Bool { default } => f32::from(u8::from(*default)),
                OptionKind::Text { default, one_of } => {
                    one_of.iter().position(|o| o == default).unwrap_or(0) as f32
                }
            },
            |kind| match kind {
                OptionKind::Number { max, .. } => *max as f32,
                OptionKind::Bool { .. } => 1.0,
                OptionKind::Text { one_of, .. } => one_of.len().saturating_sub(1) as f32,
            },
        ];
        sets.iter().all(|set| {
            let mut p = [0.0; 8];
            for (slot, option) in p.iter_mut().zip(&self.manifest.options) {
                *slot = set(&option.kind);
            }
            self.trials().into_iter().all(|mut arguments| {
                arguments.push(Value::floats(&p));
                self.program.run(arguments, &Plain).is_some()
            })
        })
    }

    /// What its function is given but for the parameters: dark and bright, near and far, of every facing.
    fn trials(&self) -> Vec<Vec<Value>> {
        let colors = [[0.0, 0.0, 0.0, 1.0], [1.0, 0.5, 0.25, 1.0], [8.0, 8.0, 8.0, 1.0]];
        let places = [
            [0.0; 20],
            [0.5; 20],
            [
                0.99, 0.01, 7.0, 100.0, 0.0, 1.0, 0.0, -1.0, 0.2, 0.2, 0.2, 1.0, 0.0, 0.0, 3.5, -2.0, 0.5,
                0.0, 1.6, 4.0,
            ],
        ];
        let with_color = |n: usize| -> Vec<Vec<Value>> {
            let pairs = colors.iter().flat_map(|c| places.iter().map(move |p| (c, p)));
            pairs.map(|(c, p)| vec![Value::floats(c), Value::floats(&p[..n])]).collect()
        };
        match self.head.hook {
            Hook::Surface => with_color(20),
            Hook::Vertex => places.iter().map(|p| vec![Value::floats(&p[..11])]).collect(),
            Hook::Lighting => places.iter().map(|p| vec![Value::floats(p)]).collect(),
            Hook::Picture => {
                let pass =
                    |n: u32| [[0, 0], [63, 40], [10_000, 1]].map(|at| vec![Value::ints(at), Value::uint(n)]);
                (0..self.head.passes).flat_map(pass).collect()
            }
            _ => with_color(2),
        }
    }

    /// Of the values of its function, parameters last.
    fn run(&self, mut arguments: Vec<Value>, around: &dyn Around, p: &[f32; 8]) -> Option<[f32; 4]> {
        arguments.push(Value::floats(p));
        self.program.run(arguments, around)
    }
}

/// The first line (from 1) that declares a function of one of the names.
fn declared_twice<'a>(text: &str, names: impl Iterator<Item = &'a str>) -> Option<(usize, &'a str)> {
    let declares = |line: &str, name: &str| {
        let after = line.trim_start().strip_prefix("fn ").map(str::trim_start);
        after.and_then(|a| a.strip_prefix(name)).is_some_and(|a| a.trim_start().starts_with('('))
    };
    let found = names.filter_map(|name| {
        let line = text.lines().position(|line| declares(line, name))?;
        Some((line + 1, name))
    });
    found.min()
}

/// A picture that a head names, as bytes of RGBA.
pub struct Picture {
    pub size: [u32; 2],
    pub rgba: Vec<u8>,
    /// Where it was read.
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
        match self.head.reach {
            Reach::Metres(metres) => metres,
            Reach::Parameter(place) => parameters.get(place).copied().unwrap_or(0.0).abs(),
        }
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
}
