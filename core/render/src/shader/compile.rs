//! WGSL files → one module → SPIR-V. Errors name the file and line that the user wrote.

use super::{SourceFile, preprocess};
use crate::error::RenderError;
use choreo_wgsl_effect::mistakes::{self, Mistake};
use naga::back::spv;
use naga::valid::{Capabilities, ModuleInfo, ValidationFlags, Validator};

/// One entry point's SPIR-V.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    pub name: &'static str,
    pub words: Vec<u32>,
}

/// Maps lines of the joined text to their source files.
struct LineMap<'a> {
    files: &'a [SourceFile],
    /// First line (from 0) of each file in the joined text.
    starts: Vec<usize>,
}

impl LineMap<'_> {
    /// (file name, line from 1, the line as its author wrote it) of a line (from 1) of the joined text.
    fn place(&self, joined_line: u32) -> (&str, usize, &str) {
        let line = (joined_line as usize).saturating_sub(1);
        let file = self.starts.partition_point(|s| *s <= line).saturating_sub(1);
        let local = line - self.starts[file];
        (&self.files[file].name, local + 1, self.files[file].text.lines().nth(local).unwrap_or(""))
    }
}

/// Preprocesses, joins, parses and validates the files.
pub fn parse(files: &[SourceFile], on: &[&str]) -> Result<(naga::Module, ModuleInfo), RenderError> {
    let mut joined = String::new();
    let mut starts = Vec::new();
    let mut count = 0;
    for file in files {
        let text = preprocess(&file.text, on)
            .map_err(|e| RenderError::Shader { file: format!("{}:{}", file.name, e.line), text: e.what })?;
        starts.push(count);
        count += text.lines().count();
        joined.push_str(&text);
    }
    let lines = LineMap { files, starts };
    let module = naga::front::wgsl::parse_str(&joined)
        .map_err(|e| shader_error(&lines, &joined, &mistakes::of_parser(&e, joined.len())))?;
    // Naga's own limits of array sizes and nesting stay on. The capabilities beyond plain WGSL are unpack2x16float, an
    // instruction of every SPIR-V version; the sample index, used on devices with sample-rate shading; early depth tests; and
    // push constants, which every device has.
    let allowed = Capabilities::SHADER_FLOAT16_IN_FLOAT32
        | Capabilities::MULTISAMPLED_SHADING
        | Capabilities::EARLY_DEPTH_TEST
        | Capabilities::IMMEDIATES;
    let info = Validator::new(ValidationFlags::all(), allowed)
        .validate(&module)
        .map_err(|e| shader_error(&lines, &joined, &mistakes::of_validator(&e, &module)))?;
    Ok((module, info))
}

/// SPIR-V of the named entry points.
pub fn compile(
    files: &[SourceFile],
    on: &[&str],
    entries: &[(&'static str, naga::ShaderStage)],
    point_size: bool,
) -> Result<Vec<Entry>, RenderError> {
    /// Stack size: naga recurses deeply, whatever stack the calling thread has.
    const STACK: usize = 64 << 20;
    std::thread::scope(|scope| {
        let thread = std::thread::Builder::new().name("shader".into()).stack_size(STACK);
        match thread.spawn_scoped(scope, || compile_on_current_stack(files, on, entries, point_size)) {
            Ok(thread) => thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)),
            // The built-in shaders do not nest deeply, and those of users are checked before.
            Err(_) => compile_on_current_stack(files, on, entries, point_size),
        }
    })
}

fn compile_on_current_stack(
    files: &[SourceFile],
    on: &[&str],
    entries: &[(&'static str, naga::ShaderStage)],
    point_size: bool,
) -> Result<Vec<Entry>, RenderError> {
    let (module, info) = parse(files, on)?;
    let mut flags = spv::WriterFlags::empty();
    if point_size {
        flags |= spv::WriterFlags::FORCE_POINT_SIZE;
    }
    let options = spv::Options {
        lang_version: (1, 3),
        flags,
        // A binding without an entry in the map keeps its own group and number.
        fake_missing_bindings: true,
        // Loops of the built-in shaders are bounded by counts that the program writes; loops of effects have counters in their
        // text.
        force_loop_bounding: false,
        ..Default::default()
    };
    entries
        .iter()
        .map(|(name, stage)| {
            let pipeline = spv::PipelineOptions { shader_stage: *stage, entry_point: (*name).into() };
            let words = spv::write_vec(&module, &info, &options, Some(&pipeline)).map_err(|e| {
                RenderError::Shader { file: lines_name(files), text: format!("entry point {name}: {e}") }
            })?;
            Ok(Entry { name, words })
        })
        .collect()
}

fn lines_name(files: &[SourceFile]) -> String {
    files.iter().map(|f| f.name.as_str()).collect::<Vec<_>>().join(" + ")
}

fn shader_error(lines: &LineMap<'_>, joined: &str, Mistake { span, text }: &Mistake) -> RenderError {
    let Some(span) = span else {
        return RenderError::Shader { file: lines_name(lines.files), text: text.clone() };
    };
    let before = &joined[..span.start];
    let line_start = before.rfind('\n').map_or(0, |at| at + 1);
    let (file, line, code) = lines.place(before.matches('\n').count() as u32 + 1);
    let column = before[line_start..].chars().count() + 1;
    RenderError::Shader {
        file: format!("{file}:{line}:{column}"),
        text: format!("{text}\n  {code}\n  {}^", " ".repeat(code.chars().count().min(column - 1))),
    }
}
