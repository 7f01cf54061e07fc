//! `NAME.wgsl` as an [`Effect`].

use crate::head;
use crate::prepare::has_pointer_arguments;
use crate::program::{MOST_STEPS, Program};
use choreo_plugin::{Effect, Hook, Manifest, OptionKind, PluginFile, Seen, SurfaceNeeds};
use glam::{Vec2, Vec4};
use naga::valid::{Capabilities, ValidationFlags, Validator};
use naga::{Module, SourceLocation, TypeInner};
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
    hook: Hook,
    /// What of a surface its text reads.
    needs: SurfaceNeeds,
    background: bool,
    origin: Option<PluginFile>,
}

impl WgslEffect {
    /// Reads the head comment, compiles the text, and tries it. `file` is its name in messages.
    pub fn from_text(file: &str, text: &str) -> Result<WgslEffect, LookError> {
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
        let (hook, see_through) = head::hook(text).map_err(|(line, message)| at(line, 1, message))?;
        let background = head::background(text, hook).map_err(|(line, message)| at(line, 1, message))?;
        let mut wgsl = format!("{text}\n");
        for (i, option) in manifest.options.iter().enumerate() {
            wgsl.push_str(&format!("const {}: u32 = {i}u;\n", option.name));
        }
        // The shader that calls it declares what it sees; below the author's text, so that lines stay.
        let seen = if hook == Hook::Surface { SEEN } else { "" };
        let whole = format!("{wgsl}{seen}");
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
            return Err(at(1, 1, format!("there is no function effect; write {}", signature(hook))));
        };
        let span = |span: naga::Span| span.is_defined().then(|| span.location(&whole));
        if !has_signature(&module, function, hook) {
            let found = span(module.functions.get_span(entry));
            return Err(place(found, format!("effect must be {}", signature(hook))));
        }
        if let Some((handle, f)) = module.functions.iter().find(|(_, f)| has_pointer_arguments(&module, f)) {
            let name = f.name.clone().unwrap_or_default();
            let found = span(module.functions.get_span(handle));
            return Err(place(
                found,
                format!("{name}: pointers as parameters are not supported; return the value"),
            ));
        }
        let program = Program::new(module, &info, entry)
            .map_err(|e| place(span(e.span), format!("not supported: {}", e.what)))?;
        let reads = |field: &str| text.contains(&format!(".{field}"));
        let needs = SurfaceNeeds {
            normals: reads("normal") || reads("facing"),
            uvs: reads("uv"),
            joints: reads("joints"),
            shadow: reads("shadow"),
            see_through,
        };
        let effect = WgslEffect { manifest, wgsl, program, hook, needs, background, origin: None };
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
            let colors = [[0.0, 0.0, 0.0, 1.0], [1.0, 0.5, 0.25, 1.0], [8.0, 8.0, 8.0, 1.0]];
            // Of a surface: far and near, of every facing.
            let places = [
                [0.0; 20],
                [0.5; 20],
                [
                    0.99, 0.01, 7.0, 100.0, 0.0, 1.0, 0.0, -1.0, 0.2, 0.2, 0.2, 1.0, 0.0, 0.0, 3.5, -2.0,
                    0.5, 0.0, 1.6, 4.0,
                ],
            ];
            let size = if self.hook == Hook::Surface { 20 } else { 2 };
            colors.iter().all(|c| places.iter().all(|at| self.program.run(*c, &at[..size], &p).is_some()))
        })
    }
}

/// What a function of a surface sees; as in shaders/surface.wgsl, and [`Seen`] in this order.
const SEEN: &str = "struct Seen { world: vec3<f32>, distance: f32, normal: vec3<f32>, facing: f32, background: vec3<f32>, \
    joints: vec3<f32>, uv: vec2<f32>, shadow: f32, viewer: vec3<f32> }\n";

fn signature(hook: Hook) -> &'static str {
    match hook {
        Hook::Surface => "fn effect(color: vec4<f32>, seen: Seen, p: array<f32, 8>) -> vec4<f32>",
        _ => "fn effect(color: vec4<f32>, uv: vec2<f32>, p: array<f32, 8>) -> vec4<f32>",
    }
}

fn has_signature(module: &Module, function: &naga::Function, hook: Hook) -> bool {
    let vector = |inner: &TypeInner, n: naga::VectorSize| matches!(inner, TypeInner::Vector { size, scalar } if *size == n && *scalar == naga::Scalar::F32);
    let arguments: Vec<&TypeInner> = function.arguments.iter().map(|a| &module.types[a.ty].inner).collect();
    let [color, at, p] = arguments.as_slice() else { return false };
    let at_fits = match hook {
        Hook::Surface => module.types[function.arguments[1].ty].name.as_deref() == Some("Seen"),
        _ => vector(at, naga::VectorSize::Bi),
    };
    let eight = match p {
        TypeInner::Array { base, size: naga::ArraySize::Constant(n), .. } => {
            n.get() == 8 && module.types[*base].inner == TypeInner::Scalar(naga::Scalar::F32)
        }
        _ => false,
    };
    let out = function.result.as_ref().map(|r| &module.types[r.ty].inner);
    vector(color, naga::VectorSize::Quad)
        && at_fits
        && eight
        && out.is_some_and(|o| vector(o, naga::VectorSize::Quad))
}

impl Effect for WgslEffect {
    fn manifest(&self) -> &Manifest {
        &self.manifest
    }

    fn file(&self) -> Option<&PluginFile> {
        self.origin.as_ref()
    }

    fn hook(&self) -> Hook {
        self.hook
    }

    fn surface_needs(&self, _: &[f32; 8]) -> SurfaceNeeds {
        self.needs
    }

    fn of_background(&self, _: &[f32; 8]) -> bool {
        self.background
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
        let out = self.program.run(color.to_array(), &at, parameters);
        out.map_or(TOO_LONG, Vec4::from_array)
    }

    /// A pixel that takes more than its steps is magenta: it is seen, and no frame hangs.
    fn cpu(&self, color: Vec4, uv: Vec2, parameters: &[f32; 8]) -> Vec4 {
        let out = self.program.run(color.to_array(), &uv.to_array(), parameters);
        out.map_or(TOO_LONG, Vec4::from_array)
    }
}
