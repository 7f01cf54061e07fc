//! Scenes out: a scene exporter writes a stage and its poses over time, for other programs.

use crate::{ExportError, ExportOptions, Manifest, PluginFile};
use choreo_motion::{FrameRate, Time};
use choreo_stage::{Evaluator, Snapshot, Stage, StageError};
use std::collections::BTreeMap;
use std::io::{ErrorKind, Write};
use std::sync::Arc;

/// Writes a scene to a file of one format. The program calls it for `choreo export`.
///
/// # Errors
/// Errors of [`SceneExporter::export`]: a file that cannot be written, a scene that the format cannot hold
/// ([`ExportError::Format`]), or a stage that cannot be evaluated at a time. No file appears then.
///
/// ```
/// use choreo_plugin::{ExportError, ExportedScene, Manifest, MemoryFiles, SceneExporter, SceneFiles};
/// use choreo_plugin::stage::Stage;
/// use std::sync::Arc;
///
/// /// The names of the actors, a line each.
/// struct Cast(Manifest);
///
/// impl SceneExporter for Cast {
///     fn manifest(&self) -> &Manifest {
///         &self.0
///     }
///     fn export(&self, scene: &ExportedScene, files: &mut dyn SceneFiles) -> Result<Vec<String>, ExportError> {
///         for actor in &scene.stage.actors {
///             writeln!(files.main(), "{}", actor.name)?;
///         }
///         Ok(Vec::new())
///     }
/// }
///
/// let mut stage = Stage::default();
/// stage.cast("anna", Arc::default());
/// let mut files = MemoryFiles::default();
/// let scene = ExportedScene::new("a.rhai", Arc::new(stage));
/// Cast(Manifest::new("cast", "1", "names of actors").extensions(["cast"])).export(&scene, &mut files)?;
/// assert_eq!(files.main, b"anna\n");
/// # Ok::<(), ExportError>(())
/// ```
pub trait SceneExporter: Send + Sync {
    /// Name, description, extensions and options.
    fn manifest(&self) -> &Manifest;

    /// The file that the exporter was read from, unless it is part of the program.
    fn file(&self) -> Option<&PluginFile> {
        None
    }

    /// Writes the scene, and returns notes for the user, a sentence each: what the format cannot hold, the largest error of sampled curves.
    fn export(&self, scene: &ExportedScene, files: &mut dyn SceneFiles) -> Result<Vec<String>, ExportError>;
}

/// A scene that is exported. Lengths are metres, +Y is up, right-handed.
///
/// ```
/// use choreo_plugin::{ExportError, ExportedScene};
/// use choreo_plugin::stage::Stage;
/// # use std::sync::Arc;
/// let scene = ExportedScene::new("a.rhai", Arc::new(Stage::default()));
/// let mut evaluator = scene.evaluator();
/// for time in &scene.times {
///     let snapshot = evaluator.at(*time)?;
///     assert_eq!(snapshot.actors.len(), scene.stage.actors.len());
/// }
/// # Ok::<(), ExportError>(())
/// ```
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct ExportedScene {
    /// Name of the script or model, without folders.
    pub name: String,
    /// Name of the output without folders and extension, with which the names of files beside it begin.
    pub stem: String,
    /// Extension of the output, lower case, without the dot: for an exporter of several formats.
    pub extension: String,
    /// Actors with their assets, cameras, lights and cues.
    pub stage: Arc<Stage>,
    /// Frames per second of [`ExportedScene::times`].
    pub fps: FrameRate,
    /// The times to export, rising: those of the frames that the user asked for, by default all.
    pub times: Vec<Time>,
    /// The provenance, as (keyword, text), for formats with a place for it.
    pub provenance: Vec<(String, String)>,
    /// Option values by name, complete and checked against the exporter's manifest.
    pub options: ExportOptions,
    /// Function of a plugin in WebAssembly that requests snapshots from the program, which has the whole stage.
    pub(crate) snapshots: Option<fn(Time) -> Snapshot>,
}

/// Evaluator of a scene's poses at any time, including hidden actors. Clones can be used on several threads.
///
/// ```
/// use choreo_plugin::motion::Time;
/// use choreo_plugin::stage::Stage;
/// use choreo_plugin::{ExportDeviation, ExportedScene, MemoryFiles, SceneEvaluator, SceneFiles};
/// # use std::sync::Arc;
/// let scene = ExportedScene::new("a.rhai", Arc::new(Stage::default()));
/// let mut evaluator: SceneEvaluator = scene.evaluator();
/// assert!(evaluator.at(Time::from_secs(0.5))?.actors.is_empty());
/// // An exporter that samples reports its largest error, for the summary.
/// let worst = ExportDeviation { metres: 0.001, actor: "anna".into(), joint: "hand".into(), time: Time::from_secs(0.5) };
/// let mut files = MemoryFiles::default();
/// files.deviation(worst.clone());
/// assert_eq!(files.deviation, Some(worst));
/// # Ok::<(), choreo_plugin::stage::StageError>(())
/// ```
#[derive(Clone, Debug)]
pub struct SceneEvaluator(Source);

#[derive(Clone, Debug)]
enum Source {
    Stage(Box<Evaluator>),
    Program(fn(Time) -> Snapshot),
}

impl SceneEvaluator {
    /// The stage at a time.
    ///
    /// # Errors
    /// A callback of the script has failed, or a part of the stage is faulty at that time.
    pub fn at(&mut self, time: Time) -> Result<Snapshot, StageError> {
        match &mut self.0 {
            Source::Stage(evaluator) => evaluator.at(time),
            Source::Program(snapshots) => Ok(snapshots(time)),
        }
    }
}

impl ExportedScene {
    /// All frames of a stage, without provenance and options; its output is called `out`.
    pub fn new(name: &str, stage: Arc<Stage>) -> ExportedScene {
        let fps = stage.settings.fps;
        let times =
            (0..fps.frames_in(stage.settings.length).max(1)).map(|frame| fps.time_of(frame)).collect();
        let (provenance, options) = (Vec::new(), ExportOptions::default());
        ExportedScene {
            name: name.into(),
            stem: "out".into(),
            extension: String::new(),
            stage,
            fps,
            times,
            provenance,
            options,
            snapshots: None,
        }
    }

    /// An evaluator for the poses at any time.
    pub fn evaluator(&self) -> SceneEvaluator {
        let own = || Source::Stage(Box::new(Evaluator::new(self.stage.clone()).posing_hidden()));
        SceneEvaluator(self.snapshots.map_or_else(own, Source::Program))
    }
}

/// The files of an export. They appear together, when [`SceneExporter::export`] has succeeded.
pub trait SceneFiles {
    /// The file that the user named.
    fn main(&mut self) -> &mut dyn Write;

    /// A further file in the same folder, such as a texture: `ending` follows [`ExportedScene::stem`], as `_0.png` in `dance_0.png`
    /// beside `dance.gltf`. Each ending is one file.
    ///
    /// # Errors
    /// An ending that does not begin with `.`, `_` or `-` or that has a folder, that of the main file, or a file that cannot be created.
    fn beside(&mut self, ending: &str) -> Result<&mut dyn Write, ExportError>;

    /// Replaces bytes of the main file that are there already, such as a checksum in its head that is known at the end. An empty list asks
    /// whether that is possible.
    ///
    /// # Errors
    /// The main file is a pipe or a device, or these bytes are not there yet. By default, and in WebAssembly, nothing can be replaced.
    ///
    /// ```
    /// # use choreo_plugin::{MemoryFiles, SceneFiles};
    /// let mut files = MemoryFiles::default();
    /// files.main().write_all(b"?? knights")?;
    /// files.replace(0, b"12")?;
    /// assert_eq!(files.main, b"12 knights");
    /// assert!(files.replace(9, b"12").is_err(), "a byte after the end");
    /// # Ok::<(), choreo_plugin::ExportError>(())
    /// ```
    fn replace(&mut self, at: u64, bytes: &[u8]) -> Result<(), ExportError> {
        let _ = (at, bytes);
        Err(ExportError::Io(ErrorKind::NotSeekable.into()))
    }

    /// Reports the largest deviation of sampled or reduced curves from the scene, for the summary.
    fn deviation(&mut self, worst: ExportDeviation) {
        let _ = worst;
    }
}

/// The largest distance of a joint in an exported file from where the scene has it, with its place and time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ExportDeviation {
    /// Metres in the world.
    pub metres: f64,
    /// Name of the actor.
    pub actor: String,
    /// Name of the joint; empty for the actor itself.
    pub joint: String,
    /// Time on the stage.
    pub time: Time,
}

/// Files in memory, for tests of exporters.
#[derive(Clone, Debug, Default)]
pub struct MemoryFiles {
    /// The file that the user named.
    pub main: Vec<u8>,
    /// The files beside it, by ending.
    pub beside: BTreeMap<String, Vec<u8>>,
    /// The deviation that the exporter has reported.
    pub deviation: Option<ExportDeviation>,
}

impl SceneFiles for MemoryFiles {
    fn main(&mut self) -> &mut dyn Write {
        &mut self.main
    }

    fn beside(&mut self, ending: &str) -> Result<&mut dyn Write, ExportError> {
        Ok(self.beside.entry(ending.to_string()).or_default())
    }

    fn replace(&mut self, at: u64, bytes: &[u8]) -> Result<(), ExportError> {
        let from = usize::try_from(at).unwrap_or(usize::MAX);
        let there = self.main.get_mut(from..from.saturating_add(bytes.len()));
        there.ok_or_else(|| ExportError::Io(ErrorKind::InvalidInput.into()))?.copy_from_slice(bytes);
        Ok(())
    }

    fn deviation(&mut self, worst: ExportDeviation) {
        self.deviation = Some(worst);
    }
}
