//! Compiles an author's text to a program: parses and validates the text, compares it with the signature of its hook, and tries it.

use crate::environment::HostFunction;
use crate::error::EffectError;
use crate::header::{self, Header};
use crate::header_error::HeaderError;
use crate::lower::{has_pointer_arguments, lower};
use crate::mistakes::Mistake;
use crate::program::{Program, Unsupported};
use crate::scene_inputs::{self, SceneCalls};
use crate::signature::{
    LATTICE_STRUCT, LINE_STRUCT, PARAMETERS, Signature, TRIANGLE_STRUCT, WIREFRAME, signature,
};
use crate::tokens::{Tokens, line_and_column};
use crate::{loops, mistakes, nesting, parameters, passes, suggestions, trial, typed_parameters};
use choreo_plugin::{Hook, ImagePass, Manifest};
use naga::valid::{Capabilities, ModuleInfo, ValidationFlags, Validator};
use naga::{Function, Handle, Module};
use std::ops::Range;

/// Largest length of a text in bytes.
const MAX_BYTES: usize = 256 << 10;

/// Length of the array in which a function may take its parameters instead of the struct.
const MAX_ARRAY_PARAMETERS: usize = 8;

/// A compiled effect.
pub(crate) struct Code {
    pub program: Program,
    /// The functions of the passes before the last, if the passes have textures.
    pub passes: Vec<Program>,
    pub output: Output,
}

/// Type of the result of an effect's function.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Output {
    /// Numbers, as the hook requires.
    Numbers,
    Strokes,
    Triangles,
    Lattices,
    Hull,
    Wireframe,
}

/// A function that the shader around the author's text supplies: its name, a WGSL declaration that stands for it, and the code that runs on
/// the CPU.
pub(crate) type Declared = (String, String, HostFunction);

/// The author's text, and the texts that are made from it.
pub(crate) struct Text {
    /// Name of the text in messages.
    pub file: String,
    /// The text without a byte order mark.
    pub author: String,
    /// The text as the CPU runs it: with counted loops, and with the declarations of the parameters below it.
    cpu_text: String,
    /// The text as shaders use it: its function `effect` takes the parameters as an array of numbers.
    pub wgsl: String,
    /// Places of the counted loops, by number from 1.
    pub loops: Vec<(usize, usize)>,
    /// The struct of the parameters, or a constant for the index of each number; and the functions of the scene that the text calls.
    appended: String,
    /// The function takes its parameters as a struct.
    is_typed: bool,
    pub scene: SceneCalls,
    /// The passes that have textures, and the textures that they read.
    pub passes: Vec<ImagePass>,
}

impl Text {
    /// Checks what can be checked without parsing, and reads the header comment.
    pub(crate) fn read(file: &str, text: &str) -> Result<(Text, Manifest, Header), EffectError> {
        let author = header::without_byte_order_mark(text).to_string();
        let is_typed = typed_parameters::is_typed(&author);
        let mut text = Text {
            file: file.into(),
            author,
            is_typed,
            cpu_text: String::new(),
            wgsl: String::new(),
            loops: Vec::new(),
            appended: String::new(),
            scene: SceneCalls::default(),
            passes: Vec::new(),
        };
        if text.author.len() > MAX_BYTES {
            let length = text.author.len();
            return Err(text.error((1, 1), format!("the text is {length} bytes long, at most {MAX_BYTES}")));
        }
        nesting::check(&text.author)
            .map_err(|deep| text.error(line_and_column(&text.author, deep.at), deep.message))?;
        let at_line = |error: HeaderError| text.error((error.line, 1), error.mistake.to_string());
        let manifest = parameters::parse_manifest(&text.author).map_err(at_line)?;
        let header = header::read(&text.author, &manifest).map_err(at_line)?;
        text.appended = if is_typed {
            typed_parameters::declarations(&manifest)
        } else {
            let names = manifest.options.iter().flat_map(|o| o.number_names());
            names.zip(0..).map(|(name, i)| format!("const {name}: u32 = {i}u;\n")).collect()
        };
        text.scene = SceneCalls::of(&text.author, header.hook);
        text.appended += &text.scene.wgsl;
        text.passes = passes::passes(&text.author, &header.pass_lines);
        if !text.passes.is_empty() {
            text.appended += &passes::helpers_called(&text.author);
        }
        let bounded = loops::bounded(&text.author);
        text.cpu_text = format!("{}\n{}", bounded.text, text.appended);
        text.wgsl = match is_typed && header.hook.has_function() {
            true if !text.passes.is_empty() => {
                typed_parameters::adapt_text_with_passes(&text.cpu_text, &manifest, &text.passes)
            }
            true => typed_parameters::adapt_text(&text.cpu_text, &manifest, signature(header.hook)),
            false => text.cpu_text.clone(),
        };
        text.loops = bounded.loops;
        Ok((text, manifest, header))
    }

    fn error(&self, at: (usize, usize), message: String) -> EffectError {
        EffectError::new(&self.file, &self.author, at, message)
    }
}

/// The text that is parsed. It places mistakes in the author's part.
struct Source<'a> {
    text: &'a Text,
    /// The text with all declarations below it.
    full_text: String,
}

impl Source<'_> {
    /// `span` is a range of bytes of `full_text`. Without a span, or outside of the author's text, the error is at the first line.
    fn error(&self, span: Option<Range<usize>>, message: String) -> EffectError {
        let own = span.filter(|span| span.start < self.text.author.len());
        self.text.error(own.map_or((1, 1), |span| line_and_column(&self.text.author, span.start)), message)
    }

    /// The error of a text that ends within braces, where the parser continues into the declarations below the text.
    fn unclosed_brace(&self, mistake: &Mistake) -> Option<EffectError> {
        let author = &self.text.author;
        if mistake.span.as_ref().is_some_and(|span| span.start < author.len()) {
            return None;
        }
        let mut open = Vec::new();
        for (at, token) in Tokens::of(author) {
            match token {
                "{" => open.push(at),
                "}" => drop(open.pop()),
                _ => {}
            }
        }
        let (line, _) = line_and_column(author, open.pop()?);
        let message = format!("missing `}}`: the text ends within the braces that line {line} opens");
        Some(self.text.error(line_and_column(author, author.trim_end().len()), message))
    }

    fn error_at(&self, span: naga::Span, message: String) -> EffectError {
        self.error(span.to_range(), message)
    }

    fn parse(&self) -> Result<Module, Mistake> {
        let of_parser = |e| mistakes::of_parser(&e, self.text.author.len());
        let parsed = naga::front::wgsl::parse_str(&self.full_text).map_err(of_parser);
        parsed.map_err(|mistake| match mistake.span {
            Some(_) => mistake,
            None => Mistake { span: self.faulty_statement(), ..mistake },
        })
    }

    /// The statement of a mistake for which the parser gives no place. Leaves out the end of each function, and then the end of the faulty
    /// function from statement to statement, until the mistake is gone.
    fn faulty_statement(&self) -> Option<Range<usize>> {
        let fails = |text: &str| {
            naga::front::wgsl::parse_str(text).is_err_and(|e| e.labels().all(|(span, _)| !span.is_defined()))
        };
        // The search takes long in a text of many functions, so it is limited to this number of them.
        const MAX_BODIES: usize = 200;
        let without = |body: &FunctionBody, at: usize, open: usize| {
            let (head, tail) = (&self.full_text[..at], &self.full_text[body.end..]);
            format!("{head}{}{tail}", "}".repeat(open))
        };
        let bodies = function_bodies(&self.text.author);
        let body = bodies.iter().take(MAX_BODIES).find(|body| !fails(&without(body, body.start, 1)))?;
        // The mistake is in the first statement after which the truncated text fails.
        let ends = &body.statement_ends;
        let first = ends.partition_point(|end| !fails(&without(body, end.offset, end.brace_depth)));
        let start = first.checked_sub(1).map_or(body.start, |before| ends[before].offset);
        let (token, _) = Tokens::of(&self.full_text[start..]).next()?;
        Some(start + token..ends.get(first).map_or(body.end, |end| end.offset))
    }
}

/// The body of a function.
struct FunctionBody {
    /// Byte offsets behind the opening and behind the closing brace.
    start: usize,
    end: usize,
    statement_ends: Vec<StatementEnd>,
}

/// The end of a statement, or a brace.
struct StatementEnd {
    /// Byte offset behind it.
    offset: usize,
    /// Number of braces that are open there.
    brace_depth: usize,
}

fn function_bodies(text: &str) -> Vec<FunctionBody> {
    let mut all: Vec<FunctionBody> = Vec::new();
    let (mut braces, mut parentheses, mut is_function) = (0usize, 0usize, false);
    for (at, token) in Tokens::of(text) {
        match token {
            "fn" if braces == 0 => is_function = true,
            "(" => parentheses += 1,
            ")" => parentheses = parentheses.saturating_sub(1),
            "{" => {
                braces += 1;
                if braces == 1 && is_function {
                    all.push(FunctionBody { start: at + 1, end: text.len(), statement_ends: Vec::new() });
                }
            }
            "}" => {
                braces = braces.saturating_sub(1);
                if let Some(body) = all.last_mut().filter(|_| braces == 0 && is_function) {
                    (body.end, is_function) = (at + 1, false);
                }
            }
            _ => {}
        }
        if let Some(body) = all.last_mut().filter(|_| is_function && braces > 0 && parentheses == 0)
            && matches!(token, ";" | "{" | "}")
        {
            body.statement_ends.push(StatementEnd { offset: at + 1, brace_depth: braces });
        }
    }
    all
}

/// Stack size in bytes. The parser and the validator recurse through trees; this is many times what the deepest text that
/// [`nesting::check`] accepts needs.
const STACK_BYTES: usize = 64 << 20;

/// Compiles the function of a text whose header is read, and tries it.
pub(crate) fn compile(text: &Text, header: &Header, manifest: &Manifest) -> Result<Code, EffectError> {
    std::thread::scope(|scope| {
        let thread = std::thread::Builder::new().name("effect".into()).stack_size(STACK_BYTES);
        match thread
            .spawn_scoped(scope, || compile_on_current_stack(text, header, manifest))
            .map(|thread| thread.join())
        {
            Ok(Ok(compiled)) => compiled,
            Ok(Err(panic)) => std::panic::resume_unwind(panic),
            // The deepest text that `nesting` accepts needs a quarter of the smallest thread stack.
            Err(_) => compile_on_current_stack(text, header, manifest),
        }
    })
}

fn compile_on_current_stack(text: &Text, header: &Header, manifest: &Manifest) -> Result<Code, EffectError> {
    let signature = header.signature();
    let declared = declared_functions(signature, header, &text.scene);
    if let Some((line, message)) = reserved_name(text, signature, &declared, manifest) {
        return Err(text.error((line, 1), message));
    }
    // The shader that calls the function declares these types and functions. They are below the author's text, so that its line numbers
    // stay.
    let functions: String = declared.iter().map(|(_, text, _)| text.as_str()).collect();
    let below = format!("{}{}{functions}", text.appended, signature.declared);
    let source = Source { text, full_text: format!("{}\n{below}", text.author) };
    let choices: Vec<String> = typed_parameters::choice_constants(manifest).map(|(name, _)| name).collect();
    let fields = format!("{}{}", signature.declared, if text.is_typed { &text.appended } else { "" });
    let names = || {
        let own = manifest.options.iter().map(|o| o.name.as_str());
        let helpers = passes::helpers().filter(|_| !header.pass_lines.is_empty());
        let of_scene: Vec<&str> = scene_inputs::names(header.hook).chain(helpers).collect();
        let own = own.chain(choices.iter().map(String::as_str));
        own.chain(declared.iter().map(|d| d.0.as_str())).chain(of_scene)
    };
    let module = source.parse().map_err(|mistake| {
        if let Some(open) = source.unclosed_brace(&mistake) {
            return open;
        }
        let near = suggestions::suggest_hook_line(&mistake.text, header, &declared)
            .or_else(|| suggestions::suggest_parameter_index(&mistake.text, manifest))
            .unwrap_or_else(|| suggestions::suggest_name(&mistake.text, &text.author, &fields, &mut names()));
        let near = if near.is_empty() { suggestions::suggest_pass_line(&mistake.text, header) } else { near };
        source.error(mistake.span, format!("{}{near}", mistake.text))
    })?;
    let info = validate(&module, &source)?;
    if let Some((at, what)) = passes::find_mistake(&text.author, &header.pass_lines) {
        return Err(text.error(at, what));
    }
    let numbers: usize = manifest.options.iter().map(|o| o.number_count()).sum();
    let fits_array = text.is_typed || numbers <= MAX_ARRAY_PARAMETERS && header.pass_lines.is_empty();
    for name in header.functions() {
        let found = module.functions.iter().find(|(_, f)| f.name.as_deref() == Some(name));
        let form = signature.text.replacen("effect", name, 1);
        let Some((function, of)) = found else {
            return Err(source.error(None, format!("there is no function {name}; write {form}")));
        };
        if !signature.fits(&module, of) || !fits_array {
            let place = module.functions.get_span(function);
            return Err(source.error_at(place, format!("{name} must be {form}")));
        }
    }
    if let Some((handle, f)) = module.functions.iter().find(|(_, f)| has_pointer_arguments(&module, f)) {
        let name = f.name.clone().unwrap_or_default();
        let what = format!("{name}: pointers as parameters are not supported; return the value");
        return Err(source.error_at(module.functions.get_span(handle), what));
    }
    let cpu_text = format!("{}{}{functions}", text.cpu_text, signature.declared);
    let mut programs = lower_programs(&source, (&module, &info), &cpu_text, &declared, header)?;
    for (name, program) in header.functions().zip(&programs) {
        trial::run_trials(program, header, manifest).map_err(|slow| {
            match slow.in_loop.and_then(|number| text.loops.get(number as usize - 1)) {
                Some(at) => text.error(*at, slow.what),
                None => {
                    source.error_at(function(&module, name).map_or_else(Default::default, |f| f.1), slow.what)
                }
            }
        })?;
    }
    let Some(program) = programs.pop() else {
        return Err(source.error(None, "there is no function effect".into()));
    };
    let output = function(&module, "effect")
        .map(|(entry, _)| output_of(header.hook, &module, &module.functions[entry]));
    Ok(Code { program, passes: programs, output: output.unwrap_or(Output::Numbers) })
}

/// A function of a module, and its span.
fn function(module: &Module, name: &str) -> Option<(Handle<Function>, naga::Span)> {
    let (found, _) = module.functions.iter().find(|(_, f)| f.name.as_deref() == Some(name))?;
    Some((found, module.functions.get_span(found)))
}

/// The programs of an effect's functions, that of `effect` last. `cpu_text` is the text with counted loops, as the CPU runs it.
fn lower_programs(
    source: &Source,
    valid: (&Module, &ModuleInfo),
    cpu_text: &str,
    declared: &[Declared],
    header: &Header,
) -> Result<Vec<Program>, EffectError> {
    let host = |name: &str| declared.iter().find(|(n, ..)| n == name).map(|(.., host)| *host);
    let lowered = |(module, info): (&Module, &ModuleInfo)| {
        let entries = header.functions().filter_map(|name| Some(function(module, name)?.0));
        entries.map(|entry| lower(module, info, entry, host)).collect::<Result<Vec<Program>, Unsupported>>()
    };
    let unsupported = |e: Unsupported| source.error_at(e.span, format!("not supported: {}", e.what));
    let programs = lowered(valid).map_err(unsupported)?;
    if source.text.loops.is_empty() {
        return Ok(programs);
    }
    // The text that runs counts the rounds of loops; mistakes are placed in the author's text.
    let (module, info) = validate_counted(cpu_text, source)?;
    lowered((&module, &info)).map_err(|e| source.error(None, format!("a loop cannot be counted: {}", e.what)))
}

/// The module of a text with counted loops, whose author's part is valid.
fn validate_counted(text: &str, source: &Source) -> Result<(Module, ModuleInfo), EffectError> {
    let faulty = |what: String| source.error(None, format!("a loop cannot be counted: {what}"));
    let module = naga::front::wgsl::parse_str(text).map_err(|e| faulty(e.message().into()))?;
    let info = Validator::new(ValidationFlags::all(), Capabilities::empty()).validate(&module);
    let info = info.map_err(|e| faulty(mistakes::of_validator(&e, &module).text))?;
    Ok((module, info))
}

fn declared_functions(signature: &Signature, header: &Header, scene: &SceneCalls) -> Vec<Declared> {
    const ROUND_COUNTER: (&str, &str, HostFunction) = (
        "effect_round",
        "fn effect_round(cost: u32, loop_number: u32) -> bool { return cost == loop_number; }\n",
        HostFunction::CountRound,
    );
    let history = if header.history > 0 { signature.with_history } else { &[] };
    let always = signature.functions.iter().chain(history).chain([&ROUND_COUNTER]);
    let mut all: Vec<Declared> =
        always.map(|(name, text, host)| (name.to_string(), text.to_string(), *host)).collect();
    all.extend(scene.supplied_functions());
    all.extend(passes::supplied_functions(&header.pass_lines));
    all.extend(header.joints.iter().enumerate().map(|(i, joint)| {
        let text = format!("fn {}() -> u32 {{ return {i}u; }}\n", joint.name);
        (joint.name.clone(), text, HostFunction::NamedJoint(i))
    }));
    all.extend(header.textures.iter().enumerate().map(|(i, t)| {
        let text = format!("fn {}(uv: vec2<f32>) -> vec4<f32> {{ return uv.xyxy; }}\n", t.name);
        (t.name.clone(), text, HostFunction::Texture(i))
    }));
    all
}

/// The first line (from 1) that declares a name which the program declares, and the message about it.
fn reserved_name(
    text: &Text,
    signature: &Signature,
    around: &[Declared],
    manifest: &Manifest,
) -> Option<(usize, String)> {
    let declared = |line: &str| {
        let line = line.trim_start().trim_start_matches('/').trim_start();
        let (word, rest) = line.split_once(' ')?;
        let name: &str = rest.trim_start().split([' ', '(', '{', '=', ':']).next()?;
        let of_program = |of: &str| Some((name.to_string(), of.to_string()));
        let is_function = || around.iter().any(|(n, ..)| n == name);
        let is_declaration = matches!(word, "fn" | "const" | "struct" | "alias");
        match word {
            "fn" if is_function() => of_program("a function"),
            "param" if signature.functions.iter().any(|(n, ..)| *n == name) => of_program("a function"),
            "struct" if signature.structs().any(|n| n == name) => of_program("a type"),
            // Shaders rename everything that they declare, but not the members of `Parameters`.
            _ if is_declaration && text.is_typed && manifest.options.iter().any(|o| o.name == name) => {
                of_program("a parameter")
            }
            _ if is_declaration && text.is_typed && typed_parameters::DECLARED_NAMES.contains(&name) => {
                of_program(if name == PARAMETERS { "a type" } else { "a function" })
            }
            _ => None,
        }
    };
    let found = text.author.lines().enumerate().find_map(|(i, line)| Some((i + 1, declared(line)?)));
    found.map(|(line, (name, what))| {
        (line, format!("{name} is {what} that the program declares; use another name"))
    })
}

fn validate(module: &Module, source: &Source) -> Result<ModuleInfo, EffectError> {
    if let Some(entry) = module.entry_points.first() {
        let first = entry.function.body.span_iter().next().map(|(_, span)| *span);
        let what = format!("{}: an effect has no entry points; leave out its attribute", entry.name);
        return Err(source.error_at(first.unwrap_or_default(), what));
    }
    Validator::new(ValidationFlags::all(), Capabilities::empty()).validate(module).map_err(|e| {
        let Mistake { span, text } = mistakes::of_validator(&e, module);
        source.error(span, text)
    })
}

fn output_of(hook: Hook, module: &Module, function: &Function) -> Output {
    let name = function.result.as_ref().and_then(|r| module.types[r.ty].name.as_deref());
    match (hook, name) {
        (Hook::Overlay, Some(LINE_STRUCT)) => Output::Strokes,
        (Hook::Overlay, Some(TRIANGLE_STRUCT)) => Output::Triangles,
        (Hook::Overlay, Some(LATTICE_STRUCT)) => Output::Lattices,
        (Hook::Outline, Some(WIREFRAME)) => Output::Wireframe,
        (Hook::Outline, _) => Output::Hull,
        _ => Output::Numbers,
    }
}
