//! Modules, `import "steps" as steps;`: other scripts, from the script's own folder only.

use crate::api_error::{ApiError, Place};
use crate::build::ScriptContext;
use crate::compile::{compile_with_unknown_variables, declare_poisons, scope_with_constants};
use crate::errors::throw;
use crate::limits::raise_hint;
use rhai::{Engine, EvalAltResult, Module, ModuleResolver, Position, Shared as RhaiShared};
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError, Weak};

/// Name of the empty module, which cannot be the name of a file.
pub(crate) const EMPTY_MODULE: &str = "\0";

/// The module resolver of the engine.
pub(crate) struct Modules {
    context: Weak<ScriptContext>,
    state: Mutex<LoadedModules>,
}

#[derive(Default)]
struct LoadedModules {
    loaded: BTreeMap<PathBuf, RhaiShared<Module>>,
    /// Modules being evaluated, outermost first: canonical paths and names. Importing one of them again would never end.
    evaluating: Vec<(PathBuf, String)>,
    /// Canonical folder of each module, by its name in messages.
    folders: BTreeMap<String, PathBuf>,
}

impl Modules {
    pub(crate) fn new(context: Arc<ScriptContext>) -> Modules {
        // A weak reference, because `context` keeps the engine alive through the contexts of callbacks.
        Modules { context: Arc::downgrade(&context), state: Mutex::default() }
    }

    fn state(&self) -> std::sync::MutexGuard<'_, LoadedModules> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl ModuleResolver for Modules {
    fn resolve(
        &self,
        engine: &Engine,
        source: Option<&str>,
        path: &str,
        at: Position,
    ) -> Result<RhaiShared<Module>, Box<EvalAltResult>> {
        if path == EMPTY_MODULE {
            return Ok(Module::new().into());
        }
        let place = Place {
            file: source.unwrap_or_default().to_string(),
            line: at.line().unwrap_or(0),
            column: at.position().unwrap_or(0),
        };
        let fail = |error: ApiError| throw(error.focus(path), place.clone());
        let Some(context) = self.context.upgrade() else {
            return Err(fail(ApiError::new("modules cannot be imported inside on_frame")));
        };
        if crate::frame_callback::in_frame() {
            let error = ApiError::new("import cannot be used inside on_frame");
            return Err(fail(
                error.hint("import at the top of the script; the callback sees what is imported there"),
            ));
        }
        let name = if path.ends_with(".rhai") { path.to_string() } else { format!("{path}.rhai") };
        let folders = context.loader.folders().without_search_paths();
        let start = source.and_then(|s| self.state().folders.get(s).cloned());
        let start = start.or_else(|| context.test().scene.as_ref().map(|scene| scene.folder.clone()));
        let found = context.loader.find_in(&folders, start.as_deref(), &name).map_err(|e| {
            let mut error = ApiError::new(e.message);
            error.hint = e.hint.map(|_| "modules are imported from the script's own folder only".to_string());
            fail(error)
        })?;
        // A separate statement releases the lock: a guard in an `if let` would live through its body.
        let loaded = self.state().loaded.get(&found.path).cloned();
        if let Some(module) = loaded {
            return Ok(module);
        }
        let evaluating = self.state().evaluating.clone();
        if let Some(first) = evaluating.iter().position(|(p, _)| *p == found.path) {
            let mut chain: Vec<String> = evaluating[first..].iter().map(|(_, n)| n.clone()).collect();
            chain.push(name.clone());
            return Err(fail(ApiError::new(format!(
                "modules import each other in a circle: {}",
                chain.join(" → ")
            ))));
        }
        // Rhai counts only the imports of one file, not those that modules make in turn.
        let (count, limit) = (self.state().loaded.len() + evaluating.len(), context.limits.modules);
        if count as u64 >= limit {
            return Err(fail(ApiError::new("too many imported files").hint(raise_hint("modules", limit))));
        }
        let text = read_text(&context, &found, &name).map_err(fail)?;
        context
            .sources
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .insert(name.clone(), text.as_str().into());
        if let Some(folder) = found.path.parent() {
            self.state().folders.insert(name.clone(), folder.to_path_buf());
        }
        let (parsed, unknown) = compile_with_unknown_variables(engine, &context, &text);
        crate::errors::report_unknown_variables(&unknown, &name, &context);
        crate::errors::mark_as_reported(&unknown, &context);
        let mut ast =
            parsed.map_err(|e| Box::new(EvalAltResult::ErrorInModule(name.clone(), e.into(), at)))?;
        ast.set_source(name.as_str());
        context.add_loads_of_clips_only(&ast, &name);
        self.state().evaluating.push((found.path.clone(), name.clone()));
        let mut scope = scope_with_constants();
        declare_poisons(&unknown, &mut scope);
        let module = Module::eval_ast_as_new(scope, &ast, engine);
        self.state().evaluating.pop();
        let module: RhaiShared<Module> =
            module.map_err(|e| Box::new(EvalAltResult::ErrorInModule(name.clone(), e, at)))?.into();
        self.state().loaded.insert(found.path, module.clone());
        Ok(module)
    }
}

/// Reads a script, or its unsaved text.
///
/// # Errors
/// Returns an error if the file cannot be read, is not UTF-8, or is larger than 4 MiB.
pub(crate) fn read_text(
    context: &ScriptContext,
    found: &crate::folders::FoundFile,
    name: &str,
) -> Result<String, ApiError> {
    const MAX_BYTES: usize = 4 << 20;
    let bytes = match context.unsaved_texts.get(&found.path) {
        Some(text) => text.as_bytes().to_vec(),
        None => context.loader.folders().read(found, name)?,
    };
    if bytes.len() > MAX_BYTES {
        return Err(ApiError::new(format!(
            "\"{name}\" has {} bytes; a script may have at most {MAX_BYTES}",
            bytes.len()
        )));
    }
    context.loader.record_file_read(&found.path, &bytes);
    let text = String::from_utf8(bytes).map_err(|e| {
        let valid = &e.as_bytes()[..e.utf8_error().valid_up_to()];
        let line = valid.iter().filter(|b| **b == b'\n').count() + 1;
        ApiError::new(format!("\"{name}\" is not a text file: line {line} is not UTF-8"))
    })?;
    // Some editors put a byte order mark before the text; it takes no column.
    Ok(text.strip_prefix('\u{feff}').map(str::to_string).unwrap_or(text))
}
