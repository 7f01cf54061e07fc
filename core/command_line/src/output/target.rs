//! Destination of a result: one file, a numbered set of files, or standard output.

use crate::failure::{Failure, describe_error, output_failure};
use choreo_plugin::{ExportError, Exporter, Registry};
use choreo_test_runner::collect::shell_quote;
use std::io::{ErrorKind, IsTerminal};
use std::path::{Path, PathBuf};
use std::sync::Arc;

#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Target {
    Stdout,
    File(PathBuf),
    /// A pattern such as `frames/%04d.png`: the folder, and the name around a number of `digits` digits.
    Numbered {
        folder: PathBuf,
        before: String,
        digits: usize,
        after: String,
    },
}

/// Refuses an output whose folder does not exist, so that a typing error does not create folders.
pub(crate) fn check_folder_exists(path: &Path) -> Result<(), Failure> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    let Some(folder) = folder.filter(|folder| !folder.exists()) else { return Ok(()) };
    Err(Failure::Output(format!(
        "{}: cannot write: the folder {} does not exist; create it: mkdir -p {}",
        path.display(),
        folder.display(),
        shell_quote(&folder.display().to_string())
    )))
}

impl Target {
    pub(crate) fn parse(text: &str) -> Result<Target, Failure> {
        if text == "-" {
            return Ok(Target::Stdout);
        }
        let usage = |what: String| Err(Failure::Usage(what));
        let path = PathBuf::from(text);
        let Some(name) = path.file_name().and_then(|n| n.to_str()).filter(|_| !text.ends_with(['/', '\\']))
        else {
            return usage(format!("-o \"{text}\" names no file; write out.mp4, out.png or frames/%04d.png"));
        };
        if let Some(at) = name.find('%') {
            let (before, rest) = (&name[..at], &name[at + 1..]);
            let width: String = rest.chars().take_while(char::is_ascii_digit).collect();
            let after = rest[width.len()..].strip_prefix('d').filter(|a| !a.contains('%'));
            let digits = if width.is_empty() { Some(1) } else { width.parse().ok() };
            return match (after, digits) {
                (Some(after), Some(digits)) if (1..=12).contains(&digits) => Ok(Target::Numbered {
                    folder: path.parent().unwrap_or(Path::new("")).to_path_buf(),
                    before: before.to_string(),
                    digits,
                    after: after.to_string(),
                }),
                _ => usage(format!("-o {text}: frame numbers are written %04d, once, in the file name")),
            };
        }
        if path.is_dir() {
            return usage(format!("{text} is a folder; for numbered images type -o {text}/%04d.png"));
        }
        Ok(Target::File(path))
    }

    /// Name of the target in messages.
    pub(crate) fn display_name(&self) -> String {
        match self {
            Target::Stdout => "standard output".into(),
            Target::File(path) => path.display().to_string(),
            Target::Numbered { folder, before, digits, after } => {
                folder.join(format!("{before}%0{digits}d{after}")).display().to_string()
            }
        }
    }

    /// Finds the exporter for the file extension, and refuses numbered files for a format that holds all frames in one file.
    pub(crate) fn exporter<'r>(&self, registry: &'r Registry) -> Result<&'r Arc<dyn Exporter>, Failure> {
        let name = match self {
            Target::Stdout => ".y4m".to_string(),
            Target::File(path) => path.display().to_string(),
            Target::Numbered { after, .. } => after.clone(),
        };
        let Some(exporter) = registry.exporter_for(&name) else {
            if registry.scene_exporter_for(&name).is_some() {
                return Err(Failure::Usage(format!(
                    "-o {}: use choreo export to write a scene in this format",
                    self.display_name()
                )));
            }
            let known: Vec<String> = registry
                .exporters()
                .iter()
                .flat_map(|e| e.manifest().extensions.iter().map(|x| format!(".{x}")))
                .collect();
            return Err(Failure::Usage(format!(
                "-o {}: the file extension selects the format; known: {}",
                self.display_name(),
                known.join(", ")
            )));
        };
        if matches!(self, Target::Numbered { .. }) && !exporter.one_frame_per_file() {
            return Err(Failure::Usage(format!(
                "-o {}: one {} file holds all frames, so its name needs no number",
                self.display_name(),
                exporter.manifest().name
            )));
        }
        Ok(exporter)
    }

    /// Fails if no output can be written there. Creates the missing folders of numbered images, and returns them, innermost last.
    pub(crate) fn check_and_create_folders(&self) -> Result<Vec<PathBuf>, Failure> {
        match self {
            Target::Stdout if std::io::stdout().is_terminal() => Err(Failure::Usage(
                "-o - writes video to standard output, which is a terminal; pipe it: … -o - | ffmpeg -i - out.mkv"
                    .into(),
            )),
            Target::Stdout => Ok(Vec::new()),
            Target::File(path) => check_folder_exists(path).map(|()| Vec::new()),
            Target::Numbered { folder, .. } => {
                let missing: Vec<PathBuf> = folder
                    .ancestors()
                    .take_while(|f| !f.as_os_str().is_empty() && !f.exists())
                    .map(Path::to_path_buf)
                    .collect();
                let made: Vec<PathBuf> = missing.into_iter().rev().collect();
                if !folder.as_os_str().is_empty() {
                    std::fs::create_dir_all(folder).map_err(|e| {
                        let why = match e.kind() {
                            ErrorKind::AlreadyExists => "it already exists and is not a folder".to_string(),
                            _ => describe_error(&e),
                        };
                        Failure::Output(format!("{}: cannot create the folder: {why}", folder.display()))
                    })?;
                }
                Ok(made)
            }
        }
    }

    /// Path of the file for one frame.
    pub(crate) fn frame_path(&self, frame: i64) -> PathBuf {
        match self {
            Target::Stdout => PathBuf::from("-"),
            Target::File(path) => path.clone(),
            Target::Numbered { folder, before, digits, after } => {
                folder.join(format!("{before}{frame:0digits$}{after}"))
            }
        }
    }
}

/// Failure for an error of an exporter. `shown`: the output in messages.
pub(crate) fn export_failure(shown: &str, error: ExportError) -> Failure {
    match error {
        ExportError::Io(e) => output_failure(shown, &e),
        ExportError::Stage(e) => Failure::input(e.to_string()),
        other => Failure::Output(format!("{shown}: {other}")),
    }
}
