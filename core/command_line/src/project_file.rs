//! The project file `choreo.toml`, which marks the folder of a project. The file beside the input, or in the nearest folder around it,
//! states search folders, plugin folders and default options of commands. They are added to the command line unless it gives those options
//! itself. The defaults of the [`App`] are added after them, under the same rule.

use crate::App;
use crate::args::{Cli, values};
use crate::failure::Failure;
use crate::scene::pack;
use choreo_files::containing_folder;
use choreo_plugin::suggest::{did_you_mean, list};
use clap::parser::ValueSource;
use clap::{Arg, ArgAction, ArgMatches, CommandFactory};
use std::ffi::OsString;
use std::ops::Range;
use std::path::{Path, PathBuf};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

const FILE_NAME: &str = "choreo.toml";

/// Size limit of the file in bytes.
const MAX_FILE_BYTES: u64 = 64 << 10;

/// Options that may have a default. Options that write files, loosen limits or belong to one scene are allowed only on the command line.
const OPTIONS_WITH_DEFAULTS: [&str; 15] = [
    "size",
    "fps",
    "samples",
    "device",
    "gpu",
    "anisotropy",
    "jobs",
    "quiet",
    "timings",
    "strict",
    "notes",
    "timeout",
    "any-device",
    "only",
    "joints",
];

/// Adds default options to the command line: first those of the input's `choreo.toml`, then those of the program.
pub(crate) fn with_project_options(args: &[OsString], app: &App) -> Result<Vec<OsString>, Failure> {
    let args = with_options_of_file(args, |name, given| match given.get_flag("no_project_file") {
        true => Ok(None),
        false if packed_input(given).is_some() => {
            Ok(packed_input(given).and_then(ProjectFile::from_packed_scene))
        }
        false => search_start_folder(name, given)
            .and_then(|start| find_project_file(&start))
            .map(ProjectFile::read)
            .transpose(),
    })?;
    let args = with_options_of_file(&args, |_, _| Ok(ProjectFile::from_app_defaults(app)))?;
    with_app_folders(args, app)
}

/// The input of a command, if it is a packed scene.
fn packed_input(given: &ArgMatches) -> Option<&Path> {
    let input = given.try_get_one::<PathBuf>("input").ok()?;
    input.map(PathBuf::as_path).filter(|input| pack::is_packed(input))
}

/// Text of the `choreo.toml` that applies to an input, to be packed with it; empty if there is none.
pub(crate) fn project_file_text(args: &[OsString], input: &Path) -> Result<String, Failure> {
    if args.iter().any(|arg| arg == "--no-project-file") {
        return Ok(String::new());
    }
    let found = containing_folder(input)
        .canonicalize()
        .ok()
        .and_then(|start| find_project_file(&start))
        .map(ProjectFile::read);
    Ok(found.transpose()?.map(|file| file.text).unwrap_or_default())
}

/// Adds the options of the project file that `file` returns for the command's name and arguments.
fn with_options_of_file(
    args: &[OsString],
    file: impl FnOnce(&str, &ArgMatches) -> Result<Option<ProjectFile>, Failure>,
) -> Result<Vec<OsString>, Failure> {
    // Errors in the command line are reported later, when it is parsed.
    let Ok(matches) = Cli::command().try_get_matches_from(args) else { return Ok(args.to_vec()) };
    let Some((name, given)) = matches.subcommand() else { return Ok(args.to_vec()) };
    if given.subcommand_name().is_some() {
        // Commands about packages (`plugins …`) have no defaults.
        return Ok(args.to_vec());
    }
    let Some(file) = file(name, given)? else { return Ok(args.to_vec()) };
    let cli = Cli::command();
    let Some(command) = cli.find_subcommand(name) else { return Ok(args.to_vec()) };
    Ok(insert_options(args, file.command_options(&cli, command, given)?))
}

/// Inserts options before `--`: words after it are not options.
fn insert_options(args: &[OsString], options: Vec<OsString>) -> Vec<OsString> {
    let end = args.iter().position(|a| a == "--").unwrap_or(args.len());
    let mut extended = args.to_vec();
    extended.splice(end..end, options);
    extended
}

/// Adds the search and plugin folders of the program, if the command takes them. The viewer gets them from its own program.
fn with_app_folders(args: Vec<OsString>, app: &App) -> Result<Vec<OsString>, Failure> {
    let Ok(matches) = Cli::command().try_get_matches_from(&args) else { return Ok(args) };
    if matches.subcommand().is_some_and(|(_, given)| given.subcommand_name().is_some()) {
        return Ok(args);
    }
    let cli = Cli::command();
    let Some(command) = matches.subcommand_name().and_then(|name| cli.find_subcommand(name)) else {
        return Ok(args);
    };
    let mut options: Vec<OsString> = Vec::new();
    for (name, folders) in [("search", &app.search), ("plugins", &app.plugins)] {
        if find_argument(command, name).is_some() {
            let flag = OsString::from(format!("--{name}"));
            options.extend(folders.iter().flat_map(|folder| [flag.clone(), folder.clone().into()]));
        }
    }
    Ok(insert_options(&args, options))
}

/// Folder in which the search for the file begins. `None` for the viewer, which looks for the file itself ([`viewer_folder_options`]).
fn search_start_folder(command: &str, given: &ArgMatches) -> Option<PathBuf> {
    let input = match command {
        "plugins" => return std::env::current_dir().ok(),
        "test" => match given.get_many::<PathBuf>("paths").and_then(|mut paths| paths.next()) {
            None => return std::env::current_dir().ok(),
            Some(path) => path,
        },
        "info" => given.get_one::<PathBuf>("file")?,
        "render" | "export" | "check" | "explain" | "measure" | "pose" | "pack" | "farm" => {
            given.get_one::<PathBuf>("input")?
        }
        _ => return None,
    };
    folder_of_input(input)
}

/// Folder that contains a file; for a folder, the folder itself.
fn folder_of_input(input: &Path) -> Option<PathBuf> {
    let folder = if input.is_dir() { input } else { containing_folder(input) };
    folder.canonicalize().ok()
}

/// The folder of the project that a script or folder belongs to: the nearest one with a `choreo.toml`.
pub(crate) fn project_root(input: &Path) -> Option<PathBuf> {
    find_project_file(&folder_of_input(input)?)?.parent().map(Path::to_path_buf)
}

/// Folders in the input's `choreo.toml`, as options of the viewer.
pub(crate) fn viewer_folder_options(input: &Path, app: &App) -> Result<Vec<OsString>, Failure> {
    let Some(path) = folder_of_input(input).and_then(|start| find_project_file(&start)) else {
        return Ok(Vec::new());
    };
    let words = [OsString::from(app.name), "view".into(), input.into()];
    Ok(with_options_of_file(&words, |_, _| ProjectFile::read(path).map(Some))?.split_off(words.len()))
}

/// Finds the nearest `choreo.toml`, in `start` or above it, up to the root of a repository. Outside repositories, a file in a folder above
/// `start` must have the same owner
/// as `start`, since others may write to `/tmp`.
fn find_project_file(start: &Path) -> Option<PathBuf> {
    let repository = start.ancestors().position(|folder| folder.join(".git").exists());
    let folders = start.ancestors().take(repository.map_or(usize::MAX, |at| at + 1));
    let mut files = folders.map(|folder| folder.join(FILE_NAME));
    files.find(|file| {
        let trusted = repository.is_some() || file.parent() == Some(start) || same_owner(start, file);
        trusted && file.symlink_metadata().is_ok()
    })
}

#[cfg(unix)]
fn same_owner(folder: &Path, file: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let owner = |path: &Path| path.symlink_metadata().map(|metadata| metadata.uid()).ok();
    owner(folder) == owner(file)
}

#[cfg(not(unix))]
fn same_owner(_: &Path, _: &Path) -> bool {
    true
}

struct ProjectFile {
    path: PathBuf,
    text: String,
    origin: OptionsOrigin,
}

/// Origin of a table of default options.
#[derive(Clone, Copy, PartialEq)]
enum OptionsOrigin {
    Project,
    /// Defaults of a program, whose folders are fields of [`App`].
    App,
    /// Project file of a packed scene, whose folders are in the archive.
    Pack,
}

impl ProjectFile {
    fn read(path: PathBuf) -> Result<ProjectFile, Failure> {
        let failed = |what: String| Failure::input(format!("{}: {what}", path.display()));
        if path.symlink_metadata().is_ok_and(|m| m.is_symlink()) {
            return Err(failed("it is a symbolic link, which is not followed".into()));
        }
        let bytes =
            choreo_files::read(&path, MAX_FILE_BYTES).map_err(|e| failed(format!("cannot read: {e}")))?;
        let text = String::from_utf8(bytes).map_err(|_| failed("it is not UTF-8 text".into()))?;
        let text = text.strip_prefix('\u{feff}').map(str::to_string).unwrap_or(text);
        Ok(ProjectFile { path, text, origin: OptionsOrigin::Project })
    }

    /// Default options of the program; messages call them "defaults of NAME".
    fn from_app_defaults(app: &App) -> Option<ProjectFile> {
        let path = PathBuf::from(format!("defaults of {}", app.name));
        (!app.defaults.is_empty()).then(|| ProjectFile {
            path,
            text: app.defaults.clone(),
            origin: OptionsOrigin::App,
        })
    }

    /// The project file of a packed scene.
    fn from_packed_scene(input: &Path) -> Option<ProjectFile> {
        let text = pack::read_project_file_text(input).filter(|text| !text.is_empty())?;
        Some(ProjectFile { path: input.join(FILE_NAME), text, origin: OptionsOrigin::Pack })
    }

    /// Failure for an error at a place in the file.
    fn error_at(&self, span: Range<usize>, what: impl std::fmt::Display) -> Failure {
        let before = &self.text[..span.start.min(self.text.len())];
        let line = before.matches('\n').count() + 1;
        let column = before.rsplit('\n').next().unwrap_or_default().chars().count() + 1;
        Failure::input(format!("{}:{line}:{column}: {what}", self.path.display()))
    }

    /// Options of the file that apply to the command, as command-line words.
    fn command_options(
        &self,
        cli: &clap::Command,
        command: &clap::Command,
        given: &ArgMatches,
    ) -> Result<Vec<OsString>, Failure> {
        let table = DeTable::parse(&self.text).map_err(|e| {
            let what = e.message().lines().collect::<Vec<_>>().join(", ");
            self.error_at(e.span().unwrap_or(0..0), what)
        })?;
        let mut words = Vec::new();
        for (key, value) in table.get_ref() {
            let name = key.get_ref().as_ref();
            let of_command = cli.find_subcommand(name).filter(|of| !options_with_defaults(of).is_empty());
            match (name, value.get_ref(), of_command) {
                ("search" | "plugins", _, _) if self.origin == OptionsOrigin::Pack => {}
                ("search" | "plugins", _, _) if self.origin == OptionsOrigin::App => {
                    return Err(self.error_at(key.span(), format!("{name} is a field of App; set it there")));
                }
                ("search" | "plugins", _, _) => {
                    let folders = self.folder_options(name, value)?;
                    let takes = command.get_name() == "view" || find_argument(command, name).is_some();
                    words.extend(folders.into_iter().filter(|_| takes));
                }
                (_, DeValue::Table(options), Some(of)) => {
                    let own = self.default_options(of, options, given)?;
                    words.extend(own.into_iter().filter(|_| of.get_name() == command.get_name()));
                }
                (_, _, Some(_)) => {
                    return Err(
                        self.error_at(value.span(), format!("{name} must be a table of options: [{name}]"))
                    );
                }
                _ => {
                    let commands = cli.get_subcommands().filter(|c| !options_with_defaults(c).is_empty());
                    let known: Vec<&str> = ["search", "plugins"]
                        .into_iter()
                        .chain(commands.map(clap::Command::get_name))
                        .collect();
                    return Err(self.unknown_key_error(key, "key", &known));
                }
            }
        }
        Ok(words)
    }

    fn unknown_key_error(&self, key: &Spanned<impl AsRef<str>>, what: &str, known: &[&str]) -> Failure {
        let name = key.get_ref().as_ref();
        let meant = did_you_mean(name, known.iter().copied());
        let known = list(known.iter().copied(), 30);
        self.error_at(key.span(), format!("unknown {what} \"{name}\"{meant}\n    hint: known: {known}"))
    }

    /// Reads a list of folders. They must lie beneath the folder of the file: an untrusted project must not reach files outside it.
    fn folder_options(&self, name: &str, value: &Spanned<DeValue>) -> Result<Vec<OsString>, Failure> {
        let type_error =
            || self.error_at(value.span(), format!("{name} must be an array of folders, [\"assets\"]"));
        let DeValue::Array(folders) = value.get_ref() else { return Err(type_error()) };
        let root = self.path.parent().unwrap_or(Path::new("."));
        let mut words = Vec::new();
        for folder in folders.iter() {
            let DeValue::String(text) = folder.get_ref() else { return Err(type_error()) };
            let shown = root.join(text.as_ref());
            let found = shown.canonicalize().ok().filter(|path| path.is_dir());
            let Some(found) = found else {
                return Err(self.error_at(folder.span(), format!("{name}: there is no folder \"{text}\"")));
            };
            if !root.canonicalize().is_ok_and(|root| found.starts_with(root)) {
                let what = format!(
                    "{name}: \"{text}\" leads out of the folder of {FILE_NAME}\n    hint: type --{name} {} to allow it",
                    found.display()
                );
                return Err(self.error_at(folder.span(), what));
            }
            words.push(OsString::from(format!("--{name}")));
            words.push(found.into_os_string());
        }
        Ok(words)
    }

    /// Default options of a command, without those that the command line gives or that conflict with given ones.
    fn default_options(
        &self,
        command: &clap::Command,
        options: &DeTable,
        given: &ArgMatches,
    ) -> Result<Vec<OsString>, Failure> {
        let known = options_with_defaults(command);
        let mut words = Vec::new();
        for (key, value) in options.iter() {
            let name = key.get_ref().as_ref();
            let Some(argument) = known.iter().find(|arg| arg.get_long() == Some(name)) else {
                if find_argument(command, name).is_some() {
                    return Err(self.error_at(
                        key.span(),
                        format!("--{name} cannot have a default; give it on the command line"),
                    ));
                }
                let names: Vec<&str> = known.iter().filter_map(|arg| arg.get_long()).collect();
                return Err(self.unknown_key_error(
                    key,
                    &format!("option of {}", command.get_name()),
                    &names,
                ));
            };
            let is_typed = |arg: &Arg| {
                let id = arg.get_id().as_str();
                let source = given.try_contains_id(id).ok().and_then(|_| given.value_source(id));
                source == Some(ValueSource::CommandLine)
            };
            if !is_typed(argument) && !command.get_arg_conflicts_with(argument).into_iter().any(is_typed) {
                words.extend(self.option_words(name, argument, value)?);
            }
        }
        Ok(words)
    }

    fn option_words(
        &self,
        name: &str,
        argument: &Arg,
        value: &Spanned<DeValue>,
    ) -> Result<Vec<OsString>, Failure> {
        let flag = matches!(argument.get_action(), ArgAction::SetTrue);
        let repeated = matches!(argument.get_action(), ArgAction::Append);
        let text = |value: &Spanned<DeValue>| match value.get_ref() {
            DeValue::String(text) => Some(text.to_string()),
            DeValue::Integer(number) => Some(number.as_str().to_string()),
            DeValue::Float(number) => Some(number.as_str().to_string()),
            _ => None,
        };
        let word = |text: String| OsString::from(format!("--{name}={text}"));
        let texts = match value.get_ref() {
            DeValue::Boolean(on) if flag => {
                return Ok(on.then(|| format!("--{name}").into()).into_iter().collect());
            }
            DeValue::Array(values) if repeated => values.iter().map(text).collect::<Option<Vec<_>>>(),
            _ if flag => None,
            _ => text(value).map(|text| vec![text]),
        };
        let expected = match (flag, repeated) {
            (true, _) => "true or false".to_string(),
            (_, true) => "an array of texts".to_string(),
            _ => {
                let form = argument.get_value_names().and_then(|names| names.first());
                let form = form.map(|form| format!(", {form}")).unwrap_or_default();
                format!("a text or a number{form}")
            }
        };
        let texts = texts.ok_or_else(|| self.error_at(value.span(), format!("{name} must be {expected}")))?;
        for text in &texts {
            if let Err(Failure::Usage(what)) = values::check_option_value(name, text) {
                return Err(self.error_at(value.span(), what));
            }
        }
        Ok(texts.into_iter().map(word).collect())
    }
}

fn find_argument<'c>(command: &'c clap::Command, name: &str) -> Option<&'c Arg> {
    command.get_arguments().find(|arg| arg.get_long() == Some(name))
}

/// Options of a command that may have defaults.
fn options_with_defaults(command: &clap::Command) -> Vec<&Arg> {
    OPTIONS_WITH_DEFAULTS.iter().filter_map(|name| find_argument(command, name)).collect()
}
