//! Compiles an author's text to a program: parses and validates it, compares it with the form of its hook, and tries it.

use crate::effect::EffectError;
use crate::environment::Host;
use crate::head::{self, Head};
use crate::lower::{has_pointer_arguments, lower};
use crate::program::Program;
use crate::signature::{EDGES, LATTICE, LINE, Signature, TRIANGLE, signature};
use crate::{nesting, parameters, suggestions, trial};
use choreo_plugin::{Hook, Manifest};
use naga::valid::{Capabilities, ModuleInfo, ValidationFlags, Validator};
use naga::{Function, Module, SourceLocation};

/// Longer texts are no effect of one pixel.
const MAX_BYTES: usize = 256 << 10;

/// The compiled function.
pub struct Code {
    pub program: Program,
    pub output: Output,
}

/// Type of the function's result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Output {
    /// Numbers, as its hook requires.
    Numbers,
    Strokes,
    Triangles,
    Lattices,
    Hull,
    Edges,
}

/// A function of the shader around the author's: its name, a text that stands for it, what runs in its place.
type Declared = (String, String, Host);

/// The author's text.
pub struct Text {
    /// Its name in messages.
    pub file: String,
    /// The text without a byte order mark.
    pub author: String,
    /// The text with a constant for each parameter below it.
    pub wgsl: String,
}

impl Text {
    /// Checks what can be checked without parsing, and reads the head comment.
    pub fn read(file: &str, text: &str) -> Result<(Text, Manifest, Head), EffectError> {
        let author = head::without_mark(text).to_string();
        let text = Text { file: file.into(), wgsl: String::new(), author };
        if text.author.len() > MAX_BYTES {
            let length = text.author.len();
            return Err(text.error(1, 1, format!("the text is {length} bytes long, at most {MAX_BYTES}")));
        }
        nesting::check(&text.author).map_err(|deep| text.error(deep.line, deep.column, deep.message))?;
        let at_line = |(line, message)| text.error(line, 1, message);
        let manifest = parameters::manifest(&text.author).map_err(at_line)?;
        let head = head::head(&text.author, &manifest).map_err(at_line)?;
        let constant = |(i, option): (usize, &choreo_plugin::OptionSpec)| {
            format!("const {}: u32 = {i}u;\n", option.name)
        };
        let constants: String = manifest.options.iter().enumerate().map(constant).collect();
        let wgsl = format!("{}\n{constants}", text.author);
        Ok((Text { wgsl, ..text }, manifest, head))
    }

    fn error(&self, line: usize, column: usize, message: String) -> EffectError {
        EffectError { file: self.file.clone(), line, column, message }
    }
}

/// The text that is parsed, and where its mistakes are.
struct Source<'a> {
    text: &'a Text,
    /// The text with all declarations below it.
    whole: String,
}

impl Source<'_> {
    fn error(&self, location: Option<SourceLocation>, message: String) -> EffectError {
        let (line, column) = location.map_or((1, 1), |l| (l.line_number as usize, l.line_position as usize));
        self.text.error(line, column, message)
    }

    fn error_at(&self, span: naga::Span, message: String) -> EffectError {
        self.error(span.is_defined().then(|| span.location(&self.whole)), message)
    }
}

/// The parser and the validator go down trees, whatever thread they are called on: as deep as [`depth`] lets pass, many times over.
const STACK: usize = 64 << 20;

/// Compiles the function of a text whose head was read, and tries it.
pub fn compile(text: &Text, head: &Head, manifest: &Manifest) -> Result<Code, EffectError> {
    std::thread::scope(|scope| {
        let thread = std::thread::Builder::new().name("effect".into()).stack_size(STACK);
        match thread.spawn_scoped(scope, || compile_here(text, head, manifest)).map(|thread| thread.join()) {
            Ok(Ok(compiled)) => compiled,
            Ok(Err(panic)) => std::panic::resume_unwind(panic),
            // The deepest text that `nesting` accepts needs a quarter of the smallest thread stack.
            Err(_) => compile_here(text, head, manifest),
        }
    })
}

fn compile_here(text: &Text, head: &Head, manifest: &Manifest) -> Result<Code, EffectError> {
    let signature = signature(head.hook);
    let declared = declared(signature, head);
    if let Some((line, message)) = taken(&text.author, signature, &declared) {
        return Err(text.error(line, 1, message));
    }
    // The shader that calls it declares what it sees; below the author's text, so that lines stay.
    let functions: String = declared.iter().map(|(_, text, _)| text.as_str()).collect();
    let source = Source { text, whole: format!("{}{}{functions}", text.wgsl, signature.declared) };
    let names =
        || manifest.options.iter().map(|o| o.name.as_str()).chain(declared.iter().map(|d| d.0.as_str()));
    let module = naga::front::wgsl::parse_str(&source.whole).map_err(|e| {
        let near = suggestions::near(e.message(), &text.author, signature.declared, &mut names());
        source.error(e.location(&source.whole), format!("{}{near}", e.message()))
    })?;
    let info = validated(&module, &source)?;
    let entry = module.functions.iter().find(|(_, f)| f.name.as_deref() == Some("effect"));
    let Some((entry, function)) = entry else {
        return Err(source.error(None, format!("there is no function effect; write {}", signature.text)));
    };
    let of_function = module.functions.get_span(entry);
    if !signature.fits(&module, function) {
        return Err(source.error_at(of_function, format!("effect must be {}", signature.text)));
    }
    let output = output(head.hook, &module, function);
    if let Some((handle, f)) = module.functions.iter().find(|(_, f)| has_pointer_arguments(&module, f)) {
        let name = f.name.clone().unwrap_or_default();
        let what = format!("{name}: pointers as parameters are not supported; return the value");
        return Err(source.error_at(module.functions.get_span(handle), what));
    }
    let host = |name: &str| declared.iter().find(|(n, ..)| n == name).map(|(.., host)| *host);
    let program = lower(&module, &info, entry, host)
        .map_err(|e| source.error_at(e.span, format!("not supported: {}", e.what)))?;
    trial::ends(&program, head, manifest)
        .map_err(|slow| source.error_at(slow.span.unwrap_or(of_function), slow.what))?;
    Ok(Code { program, output })
}

fn declared(signature: &Signature, head: &Head) -> Vec<Declared> {
    let history = if head.history > 0 { signature.with_history } else { &[] };
    let always = signature.functions.iter().chain(history);
    let mut all: Vec<Declared> =
        always.map(|(name, text, host)| (name.to_string(), text.to_string(), *host)).collect();
    all.extend(head.joints.iter().enumerate().map(|(i, joint)| {
        let text = format!("fn {}() -> u32 {{ return {i}u; }}\n", joint.name);
        (joint.name.clone(), text, Host::Named(i))
    }));
    all.extend(head.textures.iter().enumerate().map(|(i, t)| {
        let text = format!("fn {}(uv: vec2<f32>) -> vec4<f32> {{ return uv.xyxy; }}\n", t.name);
        (t.name.clone(), text, Host::Texture(i))
    }));
    all
}

/// The first line (from 1) that declares what the program does.
fn taken(text: &str, signature: &Signature, around: &[Declared]) -> Option<(usize, String)> {
    let declared = |line: &str| {
        let line = line.trim_start().trim_start_matches('/').trim_start();
        let (word, rest) = line.split_once(' ')?;
        let name: &str = rest.trim_start().split([' ', '(', '{', '=', ':']).next()?;
        let of_program = |of: &str| Some((name.to_string(), of.to_string()));
        let is_function = || around.iter().any(|(n, ..)| n == name);
        match word {
            "fn" if is_function() => of_program("a function"),
            "param" if signature.functions.iter().any(|(n, ..)| *n == name) => of_program("a function"),
            "struct" if signature.structs().any(|n| n == name) => of_program("a type"),
            _ => None,
        }
    };
    let found = text.lines().enumerate().find_map(|(i, line)| Some((i + 1, declared(line)?)));
    found.map(|(line, (name, what))| {
        (line, format!("{name} is {what} that the program declares; take another name"))
    })
}

fn validated(module: &Module, source: &Source) -> Result<ModuleInfo, EffectError> {
    Validator::new(ValidationFlags::all(), Capabilities::empty()).validate(module).map_err(|e| {
        let mut message = e.as_inner().to_string();
        let mut cause = std::error::Error::source(e.as_inner());
        while let Some(c) = cause {
            message.push_str(&format!("; {c}"));
            cause = c.source();
        }
        source.error(e.location(&source.whole), message)
    })
}

fn output(hook: Hook, module: &Module, function: &Function) -> Output {
    let name = function.result.as_ref().and_then(|r| module.types[r.ty].name.as_deref());
    match (hook, name) {
        (Hook::Overlay, Some(LINE)) => Output::Strokes,
        (Hook::Overlay, Some(TRIANGLE)) => Output::Triangles,
        (Hook::Overlay, Some(LATTICE)) => Output::Lattices,
        (Hook::Outline, Some(EDGES)) => Output::Edges,
        (Hook::Outline, _) => Output::Hull,
        _ => Output::Numbers,
    }
}
