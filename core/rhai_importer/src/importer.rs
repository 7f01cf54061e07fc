//! `NAME.importer.rhai`: a script with `fn manifest()`, `fn load(file)` and optionally `fn claim(file)`.

use crate::budget::{Budget, native_error};
use crate::bytes::Bytes;
use crate::engine::{build_engine, build_manifest_engine};
use crate::manifest;
use crate::scene::{self, BuildInProgress, FileRequest};
use crate::script_error::{KnownNames, ScriptError, ScriptSource, script_error};
use choreo_asset::Asset;
use choreo_plugin::{
    AssetBuilder, Claim, Files, ImportError, ImportOptions, ImportScope, Importer, Manifest, OptionValue,
    PluginFile, Source,
};
use rhai::{AST, Dynamic, Engine, EvalAltResult, Map, Scope};
use std::sync::{Arc, Mutex, PoisonError, mpsc};

/// File name ending of importer scripts.
pub const IMPORTER_ENDING: &str = ".importer.rhai";

/// Stack size in bytes: enough for the nesting of calls and expressions that the engine allows, also in unoptimized builds.
pub(crate) const STACK_BYTES: usize = 64 << 20;

/// Interpreter steps that `claim` may take: few, because it also runs for files of other formats.
const MAX_CLAIM_STEPS: u64 = 100_000;

/// An importer read from a script. Every import runs in an interpreter of its own.
pub struct RhaiImporter {
    /// The name in messages.
    file: String,
    text: String,
    ast: AST,
    manifest: Manifest,
    has_claim: bool,
    origin: Option<PluginFile>,
    /// Line of `fn load`, from 1.
    load_line: usize,
    /// Step limit of one import; `None`: the limit that the README states.
    steps: Option<u64>,
}

impl RhaiImporter {
    /// Compiles the script and asks it for its manifest. `file` is its name in messages.
    pub fn from_text(file: &str, text: &str) -> Result<RhaiImporter, ScriptError> {
        let script = ScriptSource { file, text: strip_byte_order_mark(text) };
        let needed = [("manifest", 0, "fn manifest()"), ("load", 1, "fn load(file)")];
        let ast = compile_functions(&script, "an importer", &needed)?;
        let has_claim = has_function(&ast, "claim", 1);
        let manifest = call_manifest(&ast, &script)?;
        Ok(RhaiImporter {
            file: file.into(),
            text: script.text.into(),
            ast,
            manifest,
            has_claim,
            origin: None,
            load_line: line_of_function(script.text, "load"),
            steps: None,
        })
    }

    /// Sets the file that the text was read from.
    pub fn with_file(mut self, file: PluginFile) -> RhaiImporter {
        self.origin = Some(file);
        self
    }

    /// Sets a step limit for one import in place of the one that the README states.
    pub fn with_steps(mut self, steps: u64) -> RhaiImporter {
        self.steps = Some(steps);
        self
    }

    fn run_load(
        &self,
        source: &Source,
        needs: ImportScope,
        options: &ImportOptions,
        budget: &Budget,
        file_requests: mpsc::Sender<FileRequest>,
    ) -> Result<AssetBuilder, ScriptError> {
        let scene =
            Arc::new(Mutex::new(BuildInProgress { builder: AssetBuilder::default(), needs, file_requests }));
        let mut engine = build_engine(budget, self.steps);
        scene::register_builders(&mut engine, &scene, budget);
        let file = self.file_map(source, needs, options, budget);
        let loaded = engine.call_fn(&mut Scope::new(), &self.ast, "load", (file,));
        let _: Dynamic = loaded.map_err(|e| self.load_error(e, &KnownNames::of(&engine)))?;
        let mut scene = scene.lock().unwrap_or_else(PoisonError::into_inner);
        Ok(std::mem::take(&mut scene.builder))
    }

    fn load_error(&self, error: Box<EvalAltResult>, known: &KnownNames) -> ScriptError {
        script_error(&ScriptSource { file: &self.file, text: &self.text }, error, known, self.load_line)
    }

    fn file_map(&self, source: &Source, needs: ImportScope, options: &ImportOptions, budget: &Budget) -> Map {
        let options: Map =
            options.0.iter().map(|(k, v)| (k.as_str().into(), option_to_script_value(v))).collect();
        [
            ("name".into(), Dynamic::from(source.name.clone())),
            ("bytes".into(), Dynamic::from(Bytes::new(source.bytes.clone(), budget))),
            ("options".into(), options.into()),
            ("needs".into(), scene::needs_map(needs).into()),
        ]
        .into()
    }
}

/// An option as a value of a script.
pub(crate) fn option_to_script_value(option: &OptionValue) -> Dynamic {
    match option {
        OptionValue::Number(v) => Dynamic::from_float(*v),
        OptionValue::Bool(v) => Dynamic::from_bool(*v),
        OptionValue::Text(v) => v.clone().into(),
        OptionValue::Numbers(v) => v.iter().map(|v| Dynamic::from_float(*v)).collect::<rhai::Array>().into(),
    }
}

impl Importer for RhaiImporter {
    fn manifest(&self) -> &Manifest {
        &self.manifest
    }

    fn file(&self) -> Option<&PluginFile> {
        self.origin.as_ref()
    }

    /// Calls `fn claim(file)`, which returns true, false or a score from 1 to 100; any other value claims nothing. If the call
    /// fails, the manifest decides, and claims by extension at most.
    fn claim(&self, source: &Source) -> Claim {
        let plain = self.manifest.claim(source);
        if !self.has_claim {
            return plain;
        }
        let budget = Budget::for_file(0);
        let engine = build_engine(&budget, Some(MAX_CLAIM_STEPS));
        let file = self.file_map(source, ImportScope::ALL, &ImportOptions::default(), &budget);
        let answer: Result<Dynamic, _> = engine.call_fn(&mut Scope::new(), &self.ast, "claim", (file,));
        match answer {
            Ok(v) if v.as_bool() == Ok(true) => Claim::Content(90),
            Ok(v) => match v.as_int() {
                Ok(score @ 1..=100) => Claim::Content(score as u8),
                _ => Claim::NotMine,
            },
            // The bytes may be too short for the header: if the name matches, `import` reports the error.
            Err(_) => plain.min(Claim::Extension),
        }
    }

    fn import(
        &self,
        source: &Source,
        files: &dyn Files,
        needs: ImportScope,
        options: &ImportOptions,
    ) -> Result<Asset, ImportError> {
        let budget = Budget::for_file(source.bytes.len());
        let (file_requests, received_requests) = mpsc::channel::<FileRequest>();
        // The script runs on a thread of its own, whose stack is known to hold the deepest calls that the limits allow; the files
        // beside the source are read on this thread, the only one that may use `files`.
        let built = std::thread::scope(|scope| {
            let worker = std::thread::Builder::new().name("importer".into()).stack_size(STACK_BYTES);
            let budget = &budget;
            let worker = worker
                .spawn_scoped(scope, move || self.run_load(source, needs, options, budget, file_requests));
            for (name, reply) in received_requests {
                // The send fails if the script has ended by now, which is no error.
                let _ = reply.send(files.read(&name));
            }
            match worker.map(|w| w.join()) {
                Ok(Ok(built)) => built,
                Ok(Err(panic)) => std::panic::resume_unwind(panic),
                Err(e) => Err(self
                    .load_error(native_error(format!("cannot start a thread: {e}")), &KnownNames::default())),
            }
        });
        let place = |error: ScriptError| ImportError {
            file: source.name.clone(),
            place: format!("{}:{}:{}", error.file, error.line, error.column),
            what: error.what(),
            hint: None,
        };
        built.map_err(place)?.finish(&source.name).map_err(|e| ImportError {
            file: source.name.clone(),
            place: self.file.clone(),
            what: e.to_string(),
            hint: None,
        })
    }
}

/// Compiles a plugin's script and keeps its functions. `needed`: name, number of parameters and declaration of each function that
/// the script must define.
pub(crate) fn compile_functions(
    script: &ScriptSource,
    what: &str,
    needed: &[(&str, usize, &str)],
) -> Result<AST, ScriptError> {
    let engine = build_engine(&Budget::for_file(0), None);
    let ScriptSource { file, text } = *script;
    let failed = |e| script_error(script, e, &KnownNames::of(&engine), line_of_function(text, "manifest"));
    let mut ast = engine.compile(text).map_err(|e| failed(e.into()))?;
    if let Some(at) = find_unclosed_comment(&engine, text) {
        let before = &text[..at];
        let line = before.matches('\n').count() + 1;
        let column = before.chars().rev().take_while(|c| *c != '\n').count() + 1;
        let message = "this comment is never closed: nothing after it is read".into();
        return Err(ScriptError::new(script, (line, column), message));
    }
    ast.set_source(file);
    if let Some((_, _, shown)) =
        needed.iter().find(|(name, parameters, _)| !has_function(&ast, name, *parameters))
    {
        let message = format!("{what} needs {shown}");
        // A missing function has no line to show.
        let source_line = String::new();
        return Err(ScriptError { file: file.into(), line: 1, column: 1, message, source_line });
    }
    // Statements outside functions are dropped: a plugin consists of functions only.
    Ok(ast.clone_functions_only())
}

fn has_function(ast: &AST, name: &str, parameters: usize) -> bool {
    ast.iter_functions().any(|f| f.name == name && f.params.len() == parameters)
}

/// The manifest that `fn manifest()` returns.
pub(crate) fn call_manifest(ast: &AST, script: &ScriptSource) -> Result<Manifest, ScriptError> {
    let line = line_of_function(script.text, "manifest");
    let engine = build_manifest_engine();
    let called = engine.call_fn(&mut Scope::new(), ast, "manifest", ());
    let value: Dynamic = called.map_err(|e| script_error(script, e, &KnownNames::of(&engine), line))?;
    let wrong = |message| ScriptError::new(script, (line, 1), message);
    manifest::read_manifest(&value).map_err(|error| wrong(error.to_string()))
}

/// A text without the byte order mark that some editors put before it.
pub(crate) fn strip_byte_order_mark(text: &str) -> &str {
    text.strip_prefix('\u{feff}').unwrap_or(text)
}

/// Byte offset of an unclosed block comment in a text that compiles: Rhai silently takes such a comment for the end of the
/// script. To detect it, a closing bracket is appended, which is an error everywhere except inside a comment.
fn find_unclosed_comment(engine: &Engine, text: &str) -> Option<usize> {
    /// Maximum number of `/*` that are tried, from the end of the text.
    const MAX_OPENINGS: usize = 64;
    let inside = |text: &str| engine.compile(format!("{text}\n)")).is_ok();
    if !text.contains("/*") || !inside(text) {
        return None;
    }
    let mut openings = text.rmatch_indices("/*").map(|(at, _)| at).take(MAX_OPENINGS);
    openings.find(|at| !inside(&text[..*at])).or_else(|| text.find("/*"))
}

/// The line (from 1) on which a function is defined.
pub(crate) fn line_of_function(text: &str, function: &str) -> usize {
    let starts = |l: &str| {
        let rest =
            l.trim_start().strip_prefix("fn ").map(str::trim_start).and_then(|r| r.strip_prefix(function));
        rest.is_some_and(|r| r.trim_start().starts_with('('))
    };
    text.lines().position(starts).map_or(1, |l| l + 1)
}
