//! Compiles an author's text to a program: parsed, validated, matched with its hook's form, and tried.

use crate::effect::LookError;
use crate::forms::{EDGES, Form, Host, LINE, TRIANGLE, form};
use crate::head::{self, Head};
use crate::prepare::has_pointer_arguments;
use crate::program::Program;
use crate::{depth, parameters, slips, trial};
use choreo_plugin::{Hook, Manifest};
use naga::valid::{Capabilities, ModuleInfo, ValidationFlags, Validator};
use naga::{Function, Module, SourceLocation};

/// Longer texts are no effect of one pixel.
const MOST_BYTES: usize = 256 << 10;

pub struct Compiled {
    pub manifest: Manifest,
    pub head: Head,
    /// The author's text, and below it a constant for each parameter.
    pub wgsl: String,
    pub program: Program,
    pub made: Made,
}

/// What the function gives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Made {
    /// Numbers, as its hook says.
    Numbers,
    Strokes,
    Triangles,
    Shell,
    Edges,
}

/// A function of the shader around the author's: its name, a text that stands for it, what runs in its place.
type Around = (String, String, Host);

/// The author's text, and where its mistakes are.
struct Text<'a> {
    /// Its name in messages.
    file: &'a str,
    /// The text with what is declared below it.
    whole: String,
}

impl Text<'_> {
    fn at(&self, line: usize, column: usize, message: String) -> LookError {
        LookError { file: self.file.into(), line, column, message }
    }

    fn place(&self, location: Option<SourceLocation>, message: String) -> LookError {
        match location {
            Some(l) => self.at(l.line_number as usize, l.line_position as usize, message),
            None => self.at(1, 1, message),
        }
    }

    fn of_span(&self, span: naga::Span, message: String) -> LookError {
        self.place(span.is_defined().then(|| span.location(&self.whole)), message)
    }
}

/// The parser and the validator go down trees, whatever thread they are called on: as deep as [`depth`] lets pass, many times over.
const STACK: usize = 64 << 20;

/// `file` is the text's name in messages. A byte order mark before the text is passed over.
pub fn compile(file: &str, text: &str) -> Result<Compiled, LookError> {
    let text = head::without_mark(text);
    let refuse = |line, column, message| LookError { file: file.into(), line, column, message };
    if text.len() > MOST_BYTES {
        return Err(refuse(1, 1, format!("the text is {} bytes long, at most {MOST_BYTES}", text.len())));
    }
    depth::check(text).map_err(|deep| refuse(deep.line, deep.column, deep.message))?;
    std::thread::scope(|scope| {
        let thread = std::thread::Builder::new().name("effect".into()).stack_size(STACK);
        match thread.spawn_scoped(scope, || compile_here(file, text)).map(|thread| thread.join()) {
            Ok(Ok(compiled)) => compiled,
            Ok(Err(panic)) => std::panic::resume_unwind(panic),
            // The deepest text that `depth` accepts needs a quarter of the smallest thread stack.
            Err(_) => compile_here(file, text),
        }
    })
}

fn compile_here(file: &str, text: &str) -> Result<Compiled, LookError> {
    let mut author = Text { file, whole: String::new() };
    let at_line = |author: &Text, (line, message)| author.at(line, 1, message);
    let manifest = parameters::manifest(text).map_err(|e| at_line(&author, e))?;
    let head = head::head(text, &manifest).map_err(|e| at_line(&author, e))?;
    let form = form(head.hook);
    let around = around(form, &head);
    if let Some(e) = taken(text, form, &around) {
        return Err(at_line(&author, e));
    }
    let mut wgsl = format!("{text}\n");
    for (i, option) in manifest.options.iter().enumerate() {
        wgsl.push_str(&format!("const {}: u32 = {i}u;\n", option.name));
    }
    // The shader that calls it declares what it sees; below the author's text, so that lines stay.
    let texts: String = around.iter().map(|(_, text, _)| text.as_str()).collect();
    author.whole = format!("{wgsl}{}{texts}", form.declared);
    let names =
        || manifest.options.iter().map(|o| o.name.as_str()).chain(around.iter().map(|a| a.0.as_str()));
    let module = naga::front::wgsl::parse_str(&author.whole).map_err(|e| {
        let near = slips::near(e.message(), text, form.declared, &mut names());
        author.place(e.location(&author.whole), format!("{}{near}", e.message()))
    })?;
    let info = validated(&module, &author)?;
    let entry = module.functions.iter().find(|(_, f)| f.name.as_deref() == Some("effect"));
    let Some((entry, function)) = entry else {
        return Err(author.at(1, 1, format!("there is no function effect; write {}", form.signature)));
    };
    let of_function = module.functions.get_span(entry);
    if !form.fits(&module, function) {
        return Err(author.of_span(of_function, format!("effect must be {}", form.signature)));
    }
    let made = made(head.hook, &module, function);
    if let Some((handle, f)) = module.functions.iter().find(|(_, f)| has_pointer_arguments(&module, f)) {
        let name = f.name.clone().unwrap_or_default();
        let what = format!("{name}: pointers as parameters are not supported; return the value");
        return Err(author.of_span(module.functions.get_span(handle), what));
    }
    let host = |name: &str| around.iter().find(|(n, ..)| n == name).map(|(.., host)| *host);
    let program = Program::new(module, &info, entry, host)
        .map_err(|e| author.of_span(e.span, format!("not supported: {}", e.what)))?;
    trial::ends(&program, &head, &manifest)
        .map_err(|slow| author.of_span(slow.span.unwrap_or(of_function), slow.what))?;
    Ok(Compiled { manifest, head, wgsl, program, made })
}

fn around(form: &Form, head: &Head) -> Vec<Around> {
    let history = if head.history > 0 { form.with_history } else { &[] };
    let always = form.functions.iter().chain(history);
    let mut all: Vec<Around> =
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
fn taken(text: &str, form: &Form, around: &[Around]) -> Option<(usize, String)> {
    let declared = |line: &str| {
        let line = line.trim_start().trim_start_matches('/').trim_start();
        let (word, rest) = line.split_once(' ')?;
        let name: &str = rest.trim_start().split([' ', '(', '{', '=', ':']).next()?;
        let of_program = |of: &str| Some((name.to_string(), of.to_string()));
        let is_function = || around.iter().any(|(n, ..)| n == name);
        match word {
            "fn" if is_function() => of_program("a function"),
            "param" if form.functions.iter().any(|(n, ..)| *n == name) => of_program("a function"),
            "struct" if form.structs().any(|n| n == name) => of_program("a type"),
            _ => None,
        }
    };
    let found = text.lines().enumerate().find_map(|(i, line)| Some((i + 1, declared(line)?)));
    found.map(|(line, (name, what))| {
        (line, format!("{name} is {what} that the program declares; take another name"))
    })
}

fn validated(module: &Module, author: &Text) -> Result<ModuleInfo, LookError> {
    Validator::new(ValidationFlags::all(), Capabilities::empty()).validate(module).map_err(|e| {
        let mut message = e.as_inner().to_string();
        let mut cause = std::error::Error::source(e.as_inner());
        while let Some(c) = cause {
            message.push_str(&format!("; {c}"));
            cause = c.source();
        }
        author.place(e.location(&author.whole), message)
    })
}

fn made(hook: Hook, module: &Module, function: &Function) -> Made {
    let gives = function.result.as_ref().and_then(|r| module.types[r.ty].name.as_deref());
    match (hook, gives) {
        (Hook::Overlay, Some(LINE)) => Made::Strokes,
        (Hook::Overlay, Some(TRIANGLE)) => Made::Triangles,
        (Hook::Shell, Some(EDGES)) => Made::Edges,
        (Hook::Shell, _) => Made::Shell,
        _ => Made::Numbers,
    }
}
