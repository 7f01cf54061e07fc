//! `choreo plugins install|list|remove`: packages of plugin files in the user's plugin folder. A package appears complete or not at all: it
//! is copied to a hidden folder and then renamed.

use crate::failure::{
    Failure, Problem, describe_error, output_failure, print, print_json, print_message, write_failure,
};
use crate::terminal::page::Page;
use choreo_files::{FileError, Folder, WriteError, containing_folder};
use choreo_plugin::Registry;
use choreo_plugin::suggest::{did_you_mean, list as format_list};
use choreo_session::package::{DESCRIPTION, FILE_ENDINGS, MAX_DESCRIPTION_BYTES, Package, is_valid_name};
use choreo_session::plugin_files::{Listing, list_package, packages_in, user_folder};
use serde_json::{Value, json};
use std::io::Write;
use std::path::{Path, PathBuf};

/// Limits of a package: bytes, files, and depth of nested folders.
const MAX_PACKAGE_BYTES: u64 = 256 << 20;
const MAX_PACKAGE_FILES: usize = 1000;
const MAX_FOLDER_DEPTH: usize = 16;

/// Example of a description, shown for a folder without one.
const EXAMPLE_DESCRIPTION: &str = "name = \"my_plugin\"\nversion = \"1.0.0\"\nchoreo = \"0.1.0\"\nlicense = \"MIT\"\n[[plugin]]\nfile = \"NAME.wgsl\"\nkind = \"effect\"\nhook = \"pixel\"";

/// Opens the package at a path, or the installed package of this name.
pub(crate) fn open_or_installed(path: &Path) -> Result<(PathBuf, Package), Failure> {
    let name = path.to_str().filter(|name| is_valid_name(name) && !path.exists());
    match name.and_then(|name| user_folder().map(|folder| folder.join(name))).filter(|place| place.is_dir()) {
        Some(place) => open_package(&place),
        None => open_package(path),
    }
}

/// Opens the package at a path, which is its folder, its description or one of its plugin files. Returns the folder too.
pub(super) fn open_package(path: &Path) -> Result<(PathBuf, Package), Failure> {
    if !path.exists() {
        return Err(Failure::input(format!("{}: no such file or folder", path.display())));
    }
    let folder = match path.is_dir() {
        true => path,
        false => containing_folder(path),
    };
    let package = read_description(folder)?;
    let file = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let is_part = path.is_dir() || file == DESCRIPTION || package.plugins.iter().any(|p| p.file == file);
    match is_part {
        true => Ok((folder.to_path_buf(), package)),
        false => {
            let files = package.plugins.iter().map(|p| p.file.as_str());
            let files = format_list(files, 30);
            let what = format!("{}: {DESCRIPTION} beside it does not name it, only {files}", path.display());
            Err(Failure::input(what))
        }
    }
}

/// Reads the description in a folder.
fn read_description(folder: &Path) -> Result<Package, Failure> {
    let place = folder.join(DESCRIPTION);
    let shown = place.display().to_string();
    if place.symlink_metadata().is_err() {
        let what = format!(
            "{shown}: this file is missing; a package needs it. A complete example:\n{EXAMPLE_DESCRIPTION}"
        );
        return Err(Failure::input(what));
    }
    let failed = |e: FileError| Failure::input(format!("{shown}: cannot read: {e}"));
    let folder = Folder::open(folder).map_err(|e| failed(FileError::Io(e)))?;
    let bytes = folder.read(Path::new(DESCRIPTION), MAX_DESCRIPTION_BYTES).map_err(failed)?;
    let text = String::from_utf8(bytes);
    let text = text.map_err(|_| Failure::input(format!("{shown}: it is not UTF-8 text")))?;
    Package::parse(&shown, &text).map_err(|e| Failure::input(e.to_string()))
}

/// Lists the plugins of a package. Fails unless all of them work and agree with its description.
pub(super) fn list_working_plugins(folder: &Path, plugins: &Registry) -> Result<Listing, Failure> {
    let listing = list_package(plugins, folder).map_err(|e| Failure::input(e.to_string()))?;
    let problems: Vec<Problem> = listing.problems().into_iter().map(Problem::Text).collect();
    match problems.is_empty() {
        true => Ok(listing),
        false => Err(Failure::Input(problems)),
    }
}

/// Notes about a working package: its license, plugin files missing in its description, and plugins with the same name as other plugins of
/// the user.
pub(super) fn package_notes(folder: &Path, package: &Package, listing: &Listing) -> Vec<String> {
    let shown = folder.join(DESCRIPTION);
    let license = package.license_note().map(|note| format!("{}: {note}", shown.display()));
    let names = Folder::open(folder).and_then(|folder| folder.names(MAX_PACKAGE_FILES)).unwrap_or_default();
    let undeclared = names.iter().map(|name| name.to_string_lossy()).filter(|name| {
        FILE_ENDINGS.iter().any(|ending| name.ends_with(ending))
            && !package.plugins.iter().any(|p| p.file == *name)
    });
    let undeclared = undeclared.map(|name| {
        format!("{}: {DESCRIPTION} does not name it, so it is not a plugin", folder.join(&*name).display())
    });
    license.into_iter().chain(undeclared).chain(listing.replacement_notes.clone()).collect()
}

/// Folder in which packages are installed.
fn install_folder() -> Result<PathBuf, Failure> {
    user_folder().ok_or_else(|| {
        Failure::Usage("there is no folder for plugins: set CHOREO_PLUGINS to one, or HOME".into())
    })
}

pub(super) fn install(path: &Path, replace: bool, plugins: &Registry) -> Result<(), Failure> {
    let (source, package) = open_package(path)?;
    let listing = list_working_plugins(&source, plugins)?;
    let folder = install_folder()?;
    let target = folder.join(&package.name);
    let was_installed = target.symlink_metadata().is_ok();
    if was_installed && !replace {
        let version = read_description(&target).map(|p| format!(" {}", p.version)).unwrap_or_default();
        return Err(Failure::Output(format!(
            "{}{version} is installed already, in {}; --replace puts {} in its place",
            package.name,
            target.display(),
            package.version
        )));
    }
    let failed = |e: std::io::Error| output_failure(&target.display().to_string(), &e);
    std::fs::create_dir_all(&folder).map_err(|e| output_failure(&folder.display().to_string(), &e))?;
    let others: Vec<PathBuf> = packages_in(&folder).into_iter().map(|name| folder.join(name)).collect();
    let others = others.into_iter().filter(|other| *other != target);
    let others = others.filter_map(|other| list_package(&Registry::default(), &other).ok());
    let conflicts: Vec<String> = others.flat_map(|other| listing.name_conflicts_with(&other)).collect();
    let made = create_hidden_folder(&folder).map_err(failed)?;
    copy_package(&source, made.path())?;
    // An old version is moved into a hidden folder, which is then removed.
    let old = create_hidden_folder(&folder).map_err(failed)?;
    let kept = old.path().join("old");
    if was_installed {
        std::fs::rename(&target, &kept).map_err(failed)?;
    }
    let new = made.path().join("new");
    if let Err(error) = std::fs::rename(&new, &target) {
        if was_installed {
            std::fs::rename(&kept, &target).map_err(failed)?;
        }
        return Err(failed(error));
    }
    let notes = package_notes(&source, &package, &listing);
    notes.iter().chain(&conflicts).for_each(|text| print_message(format_args!("note: {text}")));
    let mut page = Page::default();
    let Package { name, version, license, .. } = &package;
    page.line(format_args!("{name} {version}: installed in {}", target.display()));
    page.line(format_args!("    license: {license}"));
    page.line(format_args!("    plugins: {}", package.contents()));
    print(page.as_str())
}

/// A hidden folder, which no command reads as a package; it is removed on drop.
fn create_hidden_folder(folder: &Path) -> std::io::Result<tempfile::TempDir> {
    tempfile::Builder::new().prefix(".choreo-").tempdir_in(folder)
}

/// Copies a package's folder to the folder `new` inside another folder.
fn copy_package(source: &Path, to: &Path) -> Result<(), Failure> {
    let read = |e: std::io::Error| {
        Failure::input(format!("{}: cannot read: {}", source.display(), describe_error(&e)))
    };
    let shown = to.display().to_string();
    let from = Folder::open(source).map_err(read)?;
    let to = Folder::open(to).map_err(WriteError::Io);
    let to = to.and_then(|to| to.create_folders(Path::new("new"))).map_err(|e| write_failure(&shown, e))?;
    let mut copying = FolderCopy { source: source.to_path_buf(), shown, files: 0, bytes: 0 };
    copying.copy_folder(&from, &to, Path::new(""), 0)
}

/// A copy in progress, with the number of files and bytes so far.
struct FolderCopy {
    source: PathBuf,
    /// Path of the copy in messages.
    shown: String,
    files: usize,
    bytes: u64,
}

impl FolderCopy {
    /// Copies the regular files and the folders in a folder. Hidden files and build output of Cargo are left out; links are refused.
    fn copy_folder(&mut self, from: &Folder, to: &Folder, below: &Path, level: usize) -> Result<(), Failure> {
        if level > MAX_FOLDER_DEPTH {
            return Err(
                self.refused_failure(below, format!("folders more than {MAX_FOLDER_DEPTH} levels deep"))
            );
        }
        let names = from
            .names(MAX_PACKAGE_FILES + 1)
            .map_err(|e| self.unreadable_failure(below, FileError::Io(e)))?;
        for name in names.iter().map(Path::new) {
            let path = below.join(name);
            if name.to_string_lossy().starts_with('.') || (level == 0 && name == Path::new("target")) {
                continue;
            }
            self.files += 1;
            if self.files > MAX_PACKAGE_FILES || self.bytes > MAX_PACKAGE_BYTES {
                let most = format!("{MAX_PACKAGE_FILES} files and {} MiB", MAX_PACKAGE_BYTES >> 20);
                return Err(self.refused_failure(Path::new(""), format!("a package holds at most {most}")));
            }
            let Some(metadata) = from.metadata(name) else { continue };
            if metadata.is_symlink() {
                return Err(self.refused_failure(&path, "a package must not contain links".into()));
            }
            let failed = |e: FileError| write_failure(&self.shown, WriteError::at(path.clone(), e));
            if metadata.is_dir() {
                let inner = from.folder(name).map_err(|e| self.unreadable_failure(&path, e))?;
                let made = to.create_subfolder(name).map_err(failed)?;
                self.copy_folder(&inner, &made, &path, level + 1)?;
                continue;
            }
            let bytes = from.read(name, MAX_PACKAGE_BYTES).map_err(|e| self.unreadable_failure(&path, e))?;
            self.bytes += bytes.len() as u64;
            let mut file = to.create_new(name).map_err(failed)?;
            file.write_all(&bytes).map_err(|e| output_failure(&self.shown, &e))?;
        }
        Ok(())
    }

    fn unreadable_failure(&self, path: &Path, error: FileError) -> Failure {
        self.refused_failure(path, format!("cannot read: {error}"))
    }

    fn refused_failure(&self, path: &Path, what: String) -> Failure {
        Failure::input(format!("{}: {what}", self.source.join(path).display()))
    }
}

pub(super) fn list_packages(as_json: bool) -> Result<(), Failure> {
    let folder = install_folder()?;
    let mut problems = Vec::new();
    let mut packages: Vec<(PathBuf, Package)> = Vec::new();
    for name in packages_in(&folder) {
        let place = folder.join(name);
        match read_description(&place) {
            Ok(package) => packages.push((place, package)),
            Err(Failure::Input(faults)) => problems.extend(faults),
            Err(other) => return Err(other),
        }
    }
    if as_json {
        let all: Vec<Value> = packages.iter().map(|(place, package)| package_json(place, package)).collect();
        print_json(&json!({ "folder": folder.display().to_string(), "packages": all }))?;
    } else {
        let mut page = Page::default();
        match packages.is_empty() {
            true => page.line(format_args!("no packages in {}", folder.display())),
            false => page.line(format_args!("packages in {}", folder.display())),
        }
        for (_, package) in &packages {
            let Package { name, version, license, about, .. } = package;
            let about = if about.is_empty() { String::new() } else { format!(" {about}") };
            page.line(format_args!("  {name} {version} ({license}){about}"));
            page.line(format_args!("      {}", package.contents()));
        }
        print(page.as_str())?;
    }
    if problems.is_empty() { Ok(()) } else { Err(Failure::Input(problems)) }
}

fn package_json(place: &Path, package: &Package) -> Value {
    let plugins: Vec<Value> = package
        .plugins
        .iter()
        .map(|p| json!({ "file": p.file, "kind": p.kind.word(), "hook": p.hook }))
        .collect();
    json!({
        "name": package.name, "version": package.version.to_string(), "choreo": package.choreo.to_string(),
        "license": package.license, "about": package.about, "plugins": plugins, "folder": place.display().to_string(),
    })
}

pub(super) fn remove(name: &str) -> Result<(), Failure> {
    let folder = install_folder()?;
    let place = folder.join(name);
    let is_installed = is_valid_name(name) && place.join(DESCRIPTION).symlink_metadata().is_ok();
    if !is_installed {
        let all: Vec<String> = packages_in(&folder).iter().map(|n| n.display().to_string()).collect();
        let near = did_you_mean(name, all.iter().map(String::as_str));
        let installed = match all.is_empty() {
            true => "none is installed".to_string(),
            false => format!("installed: {}", format_list(all.iter().map(String::as_str), 30)),
        };
        return Err(Failure::Usage(format!("there is no package \"{name}\"{near}; {installed}")));
    }
    if place.symlink_metadata().is_ok_and(|m| m.is_symlink()) {
        let what = format!("{}: it is a link that choreo did not make; remove it yourself", place.display());
        return Err(Failure::Output(what));
    }
    let failed = |e: std::io::Error| {
        Failure::Output(format!("{}: cannot remove: {}", place.display(), describe_error(&e)))
    };
    // The folder is renamed first, so that no command finds a half-removed package.
    let old = create_hidden_folder(&folder).map_err(failed)?;
    std::fs::rename(&place, old.path().join("old")).map_err(failed)?;
    old.close().map_err(failed)?;
    print(&format!("{name}: removed\n"))
}
