//! An importer script whose manifest alone is read at first; the rest is compiled when a file is loaded that the importer might
//! claim.

use crate::engine::build_manifest_engine;
use crate::importer::{RhaiImporter, call_manifest, strip_byte_order_mark};
use crate::script_error::{ScriptError, ScriptSource};
use choreo_asset::Asset;
use choreo_plugin::{
    Claim, Files, ImportError, ImportOptions, ImportScope, Importer, LazyPlugin, Manifest, PluginError,
    PluginFile, Source,
};
use rhai::{Engine, Position, Token};

/// An importer that is compiled at its first use.
pub struct LazyImporter {
    manifest: Manifest,
    /// The text may define `fn claim(file)`, which is called for every file.
    may_have_claim: bool,
    importer: LazyPlugin<RhaiImporter>,
}

impl LazyImporter {
    /// Compiles and runs `fn manifest()` of the text alone, or compiles the whole text if that fails, for example because the
    /// function calls others. `file` is the name in messages; `make` reads the file again and compiles all of it.
    pub fn new(
        file: &str,
        text: &str,
        make: impl FnOnce() -> Result<RhaiImporter, PluginError> + Send + 'static,
    ) -> Result<LazyImporter, ScriptError> {
        let text = strip_byte_order_mark(text);
        let alone = manifest_function(text).and_then(|function| {
            let ast = build_manifest_engine().compile(function).ok()?.clone_functions_only();
            call_manifest(&ast, &ScriptSource { file, text }).ok()
        });
        let manifest = match alone {
            Some(manifest) => manifest,
            None => RhaiImporter::from_text(file, text)?.manifest().clone(),
        };
        let may_have_claim = text.contains("claim");
        Ok(LazyImporter { manifest, may_have_claim, importer: LazyPlugin::new(make) })
    }

    /// The importer, compiled now unless it is compiled already. Other threads that need it wait.
    pub fn get(&self) -> Result<&RhaiImporter, &PluginError> {
        self.importer.get()
    }
}

impl Importer for LazyImporter {
    fn manifest(&self) -> &Manifest {
        &self.manifest
    }

    fn file(&self) -> Option<&PluginFile> {
        self.get().ok()?.file()
    }

    /// A script that cannot be compiled claims by its manifest, and by extension at most; `import` then reports the error.
    fn claim(&self, source: &Source) -> Claim {
        let plain = self.manifest.claim(source);
        if !self.may_have_claim {
            return plain;
        }
        self.get().map_or(plain.min(Claim::Extension), |importer| importer.claim(source))
    }

    fn import(
        &self,
        source: &Source,
        files: &dyn Files,
        needs: ImportScope,
        options: &ImportOptions,
    ) -> Result<Asset, ImportError> {
        let error =
            |what: String| ImportError { file: source.name.clone(), place: String::new(), what, hint: None };
        let importer = self.get().map_err(|fault| error(fault.text.clone()))?;
        if *importer.manifest() != self.manifest {
            // The options were checked against the old manifest.
            let name = &self.manifest.name;
            return Err(error(format!("the importer \"{name}\" was changed while it was read; try again")));
        }
        importer.import(source, files, needs, options)
    }
}

/// The text of `fn manifest()` alone. Everything before it becomes blanks, so that lines and columns stay the same. `None` if the
/// tokens up to its end contain an error or an interpolated string, or define no such function.
fn manifest_function(text: &str) -> Option<String> {
    let engine = Engine::new_raw();
    let texts = [text];
    let (tokens, _) = engine.lex(&texts);
    let (mut start, mut named, mut depth) = (None, false, 0u32);
    for (token, at) in tokens {
        match &token {
            // The lexer alone cannot tell the code of an interpolated string from its text.
            Token::LexError(_) | Token::InterpolatedString(_) => return None,
            Token::Fn if !named => start = Some(at),
            Token::Identifier(name) if start.is_some() && !named => match name.as_str() {
                "manifest" => named = true,
                _ => start = None,
            },
            Token::LeftBrace | Token::MapStart if named => depth += 1,
            Token::RightBrace if named => {
                depth = depth.checked_sub(1)?;
                if depth == 0 {
                    let (from, to) = (byte_offset(text, start?)?, byte_offset(text, at)?);
                    let before = text[..from].chars();
                    let blanks: String = before.map(|c| if c == '\n' { '\n' } else { ' ' }).collect();
                    return Some(blanks + &text[from..=to]);
                }
            }
            Token::EOF => return None,
            _ => {}
        }
    }
    None
}

/// The byte offset of a Rhai position, whose columns count characters.
fn byte_offset(text: &str, at: Position) -> Option<usize> {
    let start: usize = text.split_inclusive('\n').take(at.line()?.checked_sub(1)?).map(str::len).sum();
    let (within, _) = text.get(start..)?.char_indices().nth(at.position()?.checked_sub(1)?)?;
    Some(start + within)
}

#[cfg(test)]
mod tests {
    use super::*;
    use choreo_plugin::Registry;
    use std::sync::Arc;
    use std::sync::atomic::{AtomicUsize, Ordering};

    const IMPORTER_TEXT: &str = "// é \"}\n/* } */ fn load(file) { mesh(#{ positions: [0.0] }); }\n\
        fn manifest() { #{ name: \"dots\", extensions: \"dots\", about: \"}\" } }\n fn after() { 1 }\n";

    fn source(name: &str) -> Source {
        Source { name: name.into(), bytes: Arc::default() }
    }

    /// The importer, and the number of times it was compiled.
    fn counting_importer(text: &str) -> (Result<LazyImporter, ScriptError>, Arc<AtomicUsize>) {
        let made = Arc::new(AtomicUsize::new(0));
        let (count, all) = (made.clone(), text.to_string());
        let make = move || {
            count.fetch_add(1, Ordering::Relaxed);
            let fault = |e: ScriptError| PluginError { text: e.to_string(), files: Vec::new() };
            RhaiImporter::from_text("d.importer.rhai", &all).map_err(fault)
        };
        (LazyImporter::new("d.importer.rhai", text, make), made)
    }

    #[test]
    fn manifest_is_read_without_compiling_other_functions() {
        let function = manifest_function(IMPORTER_TEXT).unwrap();
        assert_eq!(function.lines().nth(2).unwrap(), IMPORTER_TEXT.lines().nth(2).unwrap());
        assert!(!function.contains("load") && !function.contains("after"));
        // The text after `fn manifest()` is not parsed.
        let (importer, made) = counting_importer(&format!("\u{feff}{IMPORTER_TEXT} fn broken( {{ ) ` ${{"));
        let mut registry = Registry::default();
        registry.add_importer(importer.unwrap());
        let known = registry.importer_for(&source("a.dots"), None).unwrap();
        assert_eq!(known.manifest().name, "dots");
        assert!(registry.importer_for(&source("a.other"), None).is_err());
        assert_eq!(made.load(Ordering::Relaxed), 0);
        struct NoFiles;
        impl Files for NoFiles {
            fn read(&self, _: &str) -> Result<Arc<Vec<u8>>, String> {
                Err("none".into())
            }
        }
        let import = known.import(&source("a.dots"), &NoFiles, ImportScope::ALL, &ImportOptions::default());
        let error = import.unwrap_err().to_string();
        assert!(error.starts_with("a.dots: d.importer.rhai:5:13: "), "{error}");
        assert_eq!(made.load(Ordering::Relaxed), 1);
    }

    #[test]
    fn manifest_may_call_functions_of_the_script() {
        let text = "fn manifest() { #{ name: name(), extensions: `${name()}` } }\nfn name() { \"dots\" }\nfn load(f) {}";
        let (importer, made) = counting_importer(text);
        assert_eq!(importer.unwrap().manifest().extensions, ["dots"]);
        assert_eq!(made.load(Ordering::Relaxed), 0);
    }

    #[test]
    fn importer_with_claim_is_compiled_at_the_first_claim() {
        let (importer, made) =
            counting_importer(&format!("{IMPORTER_TEXT} fn claim(file) {{ file.name == \"a.other\" }}"));
        let importer = importer.unwrap();
        assert_eq!(importer.claim(&source("a.other")), Claim::Content(90));
        assert_eq!(importer.claim(&source("a.third")), Claim::NotMine);
        assert_eq!(made.load(Ordering::Relaxed), 1);
        // A script with a fault claims by extension only.
        let (importer, _) = counting_importer(&format!("{IMPORTER_TEXT} fn claim(file) {{"));
        assert_eq!(importer.unwrap().claim(&source("a.dots")), Claim::Extension);
    }

    #[test]
    fn endless_manifest_exceeds_the_size_limit() {
        let text = "fn manifest() { let a = \"x\"; loop { a += a; } }\nfn load(f) {}";
        let error = counting_importer(text).0.err().unwrap();
        assert!(error.message.contains("which is the limit"), "{error}");
    }
}
