//! `NAME.exporter.rhai`: a script with `fn manifest()` and `fn save(scene)`, which writes a scene for another program.

use crate::budget::{Budget, NativeError, native_error};
use crate::engine::build_engine;
use crate::importer::{
    STACK_BYTES, call_manifest, compile_functions, line_of_function, option_to_script_value,
    strip_byte_order_mark,
};
use crate::posed;
use crate::script_error::{KnownNames, ScriptError, ScriptSource, script_error};
use choreo_plugin::{ExportError, ExportedScene, Manifest, PluginFile, SceneExporter, SceneFiles};
use rhai::{AST, Array, Dynamic, Engine, Map, Scope};
use std::collections::BTreeMap;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};

/// File name ending of exporter scripts.
pub const EXPORTER_ENDING: &str = ".exporter.rhai";

/// Number of buffered bytes at which text is sent to the writing thread.
const PIECE_BYTES: usize = 64 << 10;

/// An exporter read from a script. Every export runs in an interpreter of its own.
pub struct RhaiExporter {
    /// The name in messages.
    file: String,
    text: String,
    ast: AST,
    manifest: Manifest,
    origin: Option<PluginFile>,
    /// Line of `fn save`, from 1.
    save_line: usize,
}

impl RhaiExporter {
    /// Compiles the script and asks it for its manifest. `file` is its name in messages.
    pub fn from_text(file: &str, text: &str) -> Result<RhaiExporter, ScriptError> {
        let script = ScriptSource { file, text: strip_byte_order_mark(text) };
        let needed = [("manifest", 0, "fn manifest()"), ("save", 1, "fn save(scene)")];
        let ast = compile_functions(&script, "an exporter", &needed)?;
        let manifest = call_manifest(&ast, &script)?;
        let save_line = line_of_function(script.text, "save");
        Ok(RhaiExporter {
            file: file.into(),
            text: script.text.into(),
            ast,
            manifest,
            origin: None,
            save_line,
        })
    }

    /// Sets the file that the text was read from.
    pub fn with_file(mut self, file: PluginFile) -> RhaiExporter {
        self.origin = Some(file);
        self
    }

    fn run_save(&self, scene: &ExportedScene, output: &Arc<ScriptOutput>) -> Result<(), ScriptError> {
        let mut engine = build_engine(&Budget::for_file(0), None);
        posed::register_pose(&mut engine, scene);
        register_output(&mut engine, output);
        let saved = engine.call_fn::<Dynamic>(&mut Scope::new(), &self.ast, "save", (scene_map(scene),));
        saved.and_then(|_| output.send_all()).map_err(|e| self.save_error(e, &KnownNames::of(&engine)))
    }

    fn save_error(&self, error: NativeError, known: &KnownNames) -> ScriptError {
        script_error(&ScriptSource { file: &self.file, text: &self.text }, error, known, self.save_line)
    }
}

impl SceneExporter for RhaiExporter {
    fn manifest(&self) -> &Manifest {
        &self.manifest
    }

    fn file(&self) -> Option<&PluginFile> {
        self.origin.as_ref()
    }

    fn export(&self, scene: &ExportedScene, files: &mut dyn SceneFiles) -> Result<Vec<String>, ExportError> {
        let (sender, pieces) = sync_channel::<TextPiece>(16);
        let notes = Arc::new(Mutex::new(Vec::new()));
        // The channel closes when the script has ended and its only sender is dropped.
        let output = Arc::new(ScriptOutput { texts: Mutex::default(), notes: notes.clone(), sender });
        // The script runs on a thread with a large stack; this thread is the only one that may use `files`.
        let (ran, written) = std::thread::scope(|scope| {
            let worker = std::thread::Builder::new().name("exporter".into()).stack_size(STACK_BYTES);
            let worker = worker.spawn_scoped(scope, move || self.run_save(scene, &output));
            let Ok(worker) = worker else {
                return (
                    Err(self.save_error(native_error("cannot start a thread"), &KnownNames::default())),
                    Ok(()),
                );
            };
            let written = write_pieces(&pieces, files);
            // Dropping the receiver ends a script that keeps writing after a file error.
            drop(pieces);
            match worker.join() {
                Ok(ran) => (ran, written),
                Err(panic) => std::panic::resume_unwind(panic),
            }
        });
        written?;
        ran.map_err(|error| ExportError::Format(error.to_string()))?;
        let mut notes = notes.lock().unwrap_or_else(PoisonError::into_inner);
        Ok(std::mem::take(&mut notes))
    }
}

/// Name ending of the file (empty for the main file), and text to append to that file.
type TextPiece = (String, String);

/// Writes received pieces to their files until the channel closes.
fn write_pieces(pieces: &Receiver<TextPiece>, files: &mut dyn SceneFiles) -> Result<(), ExportError> {
    for (name, text) in pieces {
        let file = if name.is_empty() { files.main() } else { files.beside(&name)? };
        file.write_all(text.as_bytes())?;
    }
    Ok(())
}

/// Text that a script has written but not yet sent, by file ending, and the notes of the script.
struct ScriptOutput {
    texts: Mutex<BTreeMap<String, String>>,
    notes: Arc<Mutex<Vec<String>>>,
    sender: SyncSender<TextPiece>,
}

impl ScriptOutput {
    fn write(&self, name: &str, text: &str) -> Result<(), NativeError> {
        let mut texts = self.texts.lock().unwrap_or_else(PoisonError::into_inner);
        let waiting = texts.entry(name.to_string()).or_default();
        waiting.push_str(text);
        match waiting.len() >= PIECE_BYTES {
            true => self.send(name, std::mem::take(waiting)),
            false => Ok(()),
        }
    }

    fn send(&self, name: &str, text: String) -> Result<(), NativeError> {
        let sent = self.sender.send((name.to_string(), text));
        sent.map_err(|_| native_error("write: the file cannot be written"))
    }

    fn send_all(&self) -> Result<(), NativeError> {
        let texts = std::mem::take(&mut *self.texts.lock().unwrap_or_else(PoisonError::into_inner));
        texts.into_iter().try_for_each(|(name, text)| self.send(&name, text))
    }
}

/// Maximum number of notes kept, so that a loop over joints cannot fill the memory.
const MAX_NOTES: usize = 1000;

fn register_output(engine: &mut Engine, output: &Arc<ScriptOutput>) {
    let o = output.clone();
    engine.register_fn("write", move |text: &str| o.write("", text));
    let o = output.clone();
    engine.register_fn("writeln", move |text: &str| o.write("", &format!("{text}\n")));
    let o = output.clone();
    engine.register_fn("write_to", move |ending: &str, text: &str| match ending {
        "" => Err(native_error("write_to: the ending of the file's name is empty")),
        ending => o.write(ending, text),
    });
    let o = output.clone();
    engine.register_fn("note", move |text: &str| {
        let mut notes = o.notes.lock().unwrap_or_else(PoisonError::into_inner);
        if notes.len() < MAX_NOTES {
            notes.push(text.to_string());
        }
    });
}

/// The argument of `fn save(scene)`.
fn scene_map(scene: &ExportedScene) -> Map {
    let named =
        |list: &mut dyn Iterator<Item = &String>| -> Array { list.map(|n| n.clone().into()).collect() };
    let times: Array = scene.times.iter().map(|time| Dynamic::from_float(time.as_secs())).collect();
    let options: Map =
        scene.options.0.iter().map(|(k, v)| (k.as_str().into(), option_to_script_value(v))).collect();
    let actors: Array = scene
        .stage
        .actors
        .iter()
        .map(|actor| {
            let skeleton = &actor.asset.skeleton;
            let joints: Array = named(&mut skeleton.names().iter());
            let parents = skeleton.parents().iter().map(|p| Dynamic::from_int(p.map_or(-1, i64::from)));
            let fields: [(&str, Dynamic); 4] = [
                ("name", actor.name.clone().into()),
                ("asset", actor.asset.name.clone().into()),
                ("joints", joints.into()),
                ("parents", parents.collect::<Array>().into()),
            ];
            posed::object_map(fields).into()
        })
        .collect();
    posed::object_map([
        ("name", scene.name.clone().into()),
        ("stem", scene.stem.clone().into()),
        ("fps", Dynamic::from_float(scene.fps.as_fps())),
        ("times", times.into()),
        ("options", options.into()),
        ("actors", actors.into()),
        ("cameras", named(&mut scene.stage.cameras.iter().map(|c| &c.name)).into()),
    ])
}
