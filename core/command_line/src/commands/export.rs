//! `choreo export`: writes the scene itself for other programs, with the scene exporter for the file's extension.

use crate::args::ExportArgs;
use crate::args::values;
use crate::failure::{Failure, check_limit, output_failure, print_json, print_message, write_failure};
use crate::output::budget::Budget;
use crate::output::provenance;
use crate::output::target::check_folder_exists;
use crate::output::target::export_failure;
use crate::scene::inputs::Inputs;
use crate::scene::{self, opening::OpenOptions};
use crate::terminal::counted;
use choreo_files::PartFile;
use choreo_plugin::{
    ExportDeviation, ExportError, ExportOptions, ExportedScene, Manifest, Registry, SceneExporter, SceneFiles,
};
use serde_json::json;
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::io::{ErrorKind, Write};
use std::path::{Component, Path};
use std::sync::Arc;
use std::time::Instant;

pub(crate) fn run(args: &ExportArgs, plugins: &Registry) -> Result<(), Failure> {
    let start = Instant::now();
    let registry = scene::registry_with_plugin_files(&args.scene, plugins)?;
    let exporter = find_scene_exporter(&args.output, &registry)?;
    check_folder_exists(Path::new(&args.output))?;
    let options = parse_export_options(&args.export_options(), exporter.manifest())?;
    let fps = args.fps.as_deref().map(values::parse_fps).transpose()?;
    let opening = OpenOptions { quiet: args.quiet, ..OpenOptions::TO_EXPORT };
    let scene = scene::open(&args.scene, &registry, opening)?;
    let mut exported = ExportedScene::new(&scene.name, scene.stage.clone());
    exported.stem = file_stem(Path::new(&args.output));
    let extension = Path::new(&args.output).extension().unwrap_or_default();
    exported.extension = extension.to_string_lossy().to_lowercase();
    exported.fps = fps.unwrap_or(exported.fps);
    let total = exported.fps.frames_in(scene.stage.settings.length).max(1);
    let frames = args.frames.as_deref().map(|f| values::parse_frames(f, total)).transpose()?;
    let frames = frames.unwrap_or_else(|| (0..total).collect());
    check_limit(frames.len() as u64, "frames", scene.limits.frames)?;
    exported.times = frames.into_iter().map(|frame| exported.fps.time_of(frame)).collect();
    exported.provenance = provenance::of_scene_export(&scene, exported.fps, &options, exporter.manifest());
    exported.options = exporter.manifest().complete(&options).map_err(|e| Failure::Usage(e.to_string()))?;

    let path = Path::new(&args.output);
    let failed = |e| export_failure(&args.output, e);
    let mut files = ExportedFiles::create(path, &scene.inputs, Budget::new(scene.limits.output))?;
    let notes = exporter.export(&exported, &mut files).map_err(failed)?;
    let worst = files.worst.take();
    let written = files.commit()?;
    if args.json {
        return print_json(&json!({
            "ok": true,
            "output": args.output,
            "files": written,
            "exporter": exporter.manifest().name,
            "frames": exported.times.len(),
            "fps": exported.fps.as_fps(),
            "seconds": start.elapsed().as_secs_f64(),
            "notes": notes,
            "worst_error": worst.as_ref().map(deviation_json),
            "warnings": scene.warnings,
            "provenance": exported.provenance.into_iter().collect::<BTreeMap<_, _>>(),
        }));
    }
    let printed = scene.printed.iter().flat_map(|text| text.lines());
    printed.chain(scene.warnings.iter().map(String::as_str)).for_each(print_message);
    notes.iter().for_each(|note| print_message(format_args!("note: {note}")));
    if !args.quiet {
        let (frames, secs) = (counted(exported.times.len() as u64, "frame"), start.elapsed().as_secs_f64());
        print_message(format_args!("{frames} in {secs:.1} s: {}", written.join(", ")));
        worst.iter().for_each(|worst| print_message(deviation_text(worst)));
    }
    Ok(())
}

fn deviation_json(worst: &ExportDeviation) -> serde_json::Value {
    let ExportDeviation { metres, actor, joint, time } = worst;
    json!({ "metres": metres, "actor": actor, "joint": joint, "seconds": time.as_secs() })
}

fn deviation_text(worst: &ExportDeviation) -> String {
    let ExportDeviation { metres, actor, joint, time } = worst;
    if actor.is_empty() {
        return "largest error: 0 m".into();
    }
    let joint = if joint.is_empty() { String::new() } else { format!(", joint \"{joint}\"") };
    format!("largest error: {metres:.1e} m, actor \"{actor}\"{joint}, at {:.3} s", time.as_secs())
}

/// File name without folders and extension.
fn file_stem(path: &Path) -> String {
    path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default()
}

/// Scene exporter for the file's extension.
fn find_scene_exporter<'r>(
    output: &str,
    registry: &'r Registry,
) -> Result<&'r Arc<dyn SceneExporter>, Failure> {
    registry.scene_exporter_for(output).ok_or_else(|| {
        if registry.exporter_for(output).is_some() {
            return Failure::Usage(format!("-o {output}: use choreo render to write images and videos"));
        }
        let extensions = registry.scene_exporters().iter().flat_map(|e| &e.manifest().extensions);
        let known: Vec<String> = extensions.map(|extension| format!(".{extension}")).collect();
        let extension = Path::new(output).extension().unwrap_or_default().to_string_lossy().to_lowercase();
        let is_read = registry.importers().iter().any(|i| i.manifest().extensions.contains(&extension));
        let what = match is_read {
            true => format!(".{extension} is read, not written"),
            false => "the file extension selects the format".into(),
        };
        Failure::Usage(format!(
            "-o {output}: {what}; known: {}{}",
            known.join(", "),
            registry.faulty_hint(".exporter.")
        ))
    })
}

/// Parses and checks the options of `--export`.
pub(crate) fn parse_export_options(given: &[String], manifest: &Manifest) -> Result<ExportOptions, Failure> {
    let mut options = ExportOptions::default();
    for text in given {
        let (name, value) = values::split_name_value("--export", text)?;
        let value = manifest.parse_option(name, value);
        let value = value.map_err(|e| Failure::Usage(format!("--export {text}: {e}")))?;
        options.0.insert(name.to_string(), value);
    }
    Ok(options)
}

/// Files of an export: the main file, and additional files beside it. All of them are temporary until the last one is complete.
struct ExportedFiles<'a> {
    path: &'a Path,
    inputs: &'a Inputs,
    budget: Budget,
    main: OpenFile,
    additional: BTreeMap<String, OpenFile>,
    /// Largest deviation that the exporter has reported.
    worst: Option<ExportDeviation>,
}

struct OpenFile {
    part: PartFile,
    out: Box<dyn Write + Send>,
}

impl OpenFile {
    fn create(path: &Path, inputs: &Inputs, budget: &Budget) -> Result<OpenFile, Failure> {
        inputs.check_output(path)?;
        let shown = path.display().to_string();
        let part = PartFile::create(path).map_err(|e| write_failure(&shown, e))?;
        let writer = part.writer().map_err(|e| output_failure(&shown, &e))?;
        Ok(OpenFile { out: budget.counting_writer(Box::new(writer)), part })
    }
}

impl<'a> ExportedFiles<'a> {
    fn create(path: &'a Path, inputs: &'a Inputs, budget: Budget) -> Result<ExportedFiles<'a>, Failure> {
        let main = OpenFile::create(path, inputs, &budget)?;
        Ok(ExportedFiles { path, inputs, budget, main, additional: BTreeMap::new(), worst: None })
    }

    /// Moves the files to their places, the main file last. Returns their names.
    fn commit(mut self) -> Result<Vec<String>, Failure> {
        let mut all: Vec<(String, OpenFile)> = Vec::new();
        for (name, file) in std::mem::take(&mut self.additional) {
            all.push((self.path.with_file_name(name).display().to_string(), file));
        }
        all.push((self.path.display().to_string(), self.main));
        // All files are complete before the first one is moved.
        for (shown, file) in &mut all {
            file.out.flush().map_err(|e| output_failure(shown, &e))?;
        }
        let mut names = Vec::new();
        for (shown, OpenFile { part, out }) in all {
            drop(out);
            part.commit().map_err(|e| write_failure(&shown, e))?;
            names.push(shown);
        }
        Ok(names)
    }
}

impl SceneFiles for ExportedFiles<'_> {
    fn main(&mut self) -> &mut dyn Write {
        &mut self.main.out
    }

    /// The name begins with that of the main file, so that an untrusted plugin cannot replace other files of the folder.
    fn beside(&mut self, ending: &str) -> Result<&mut dyn Write, ExportError> {
        let name = file_stem(self.path) + ending;
        let plain = matches!(Path::new(&name).components().collect::<Vec<_>>()[..], [Component::Normal(_)]);
        if !plain
            || !ending.starts_with(['.', '_', '-'])
            || Path::new(&name).file_name() == self.path.file_name()
        {
            let what =
                format!("\"{ending}\" is not a valid ending for an additional file; write one as _0.png");
            return Err(ExportError::Format(what));
        }
        let file = match self.additional.entry(name.clone()) {
            Entry::Occupied(file) => file.into_mut(),
            Entry::Vacant(free) => {
                let file = OpenFile::create(&self.path.with_file_name(&name), self.inputs, &self.budget);
                free.insert(file.map_err(|failure| ExportError::Format(failure.message_lines().join("\n")))?)
            }
        };
        Ok(&mut file.out)
    }

    fn replace(&mut self, at: u64, bytes: &[u8]) -> Result<(), ExportError> {
        self.main.out.flush()?;
        let not_seekable = || ExportError::Format("this format needs a file, not a pipe or device".into());
        self.main.part.replace(at, bytes).map_err(|e| match e.kind() {
            ErrorKind::NotSeekable => not_seekable(),
            _ => e.into(),
        })
    }

    fn deviation(&mut self, worst: ExportDeviation) {
        self.worst = Some(worst);
    }
}
