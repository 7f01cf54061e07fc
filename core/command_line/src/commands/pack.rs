//! `choreo pack`: packs a scene with all files that it reads into one archive. The files are found by running the scene, and the archive is
//! verified by running it again.

use crate::args::PackArgs;
use crate::failure::{Failure, output_failure, print_json, print_message, write_failure};
use crate::scene::pack::{self, Manifest, PACK_EXTENSION, Unpacked};
use crate::scene::{self, OpenedScene, opening::OpenOptions};
use choreo_files::{PartFile, containing_folder};
use choreo_plugin::Registry;
use serde_json::json;
use std::io::{Seek, SeekFrom};
use std::path::Path;

/// Writes and reports the archive. `options`: text of the project's `choreo.toml`.
pub(crate) fn run(args: &PackArgs, plugins: &Registry, options: String) -> Result<(), Failure> {
    let PackResult { manifest, bytes, warnings } = write_pack(args, plugins, options)?;
    report_pack(args, &manifest, bytes, &warnings)
}

/// Description of an archive that was written.
pub(crate) struct PackResult {
    pub manifest: Manifest,
    pub bytes: u64,
    pub warnings: Vec<String>,
}

/// Writes the archive, and verifies it.
pub(crate) fn write_pack(
    args: &PackArgs,
    plugins: &Registry,
    options: String,
) -> Result<PackResult, Failure> {
    let shown = args.output.display().to_string();
    if !is_folder(&args.output)
        && !args.output.extension().is_some_and(|e| e.eq_ignore_ascii_case(PACK_EXTENSION))
    {
        // A typing error must not replace a script or a model.
        return Err(Failure::Usage(format!(
            "-o {shown}: write a name that ends in .{PACK_EXTENSION}, or in / for a folder"
        )));
    }
    if pack::is_packed(&args.scene.input) {
        return Err(Failure::Usage(format!("{}: it is packed already", args.scene.input.display())));
    }
    let registry = scene::registry_with_plugin_files(&args.scene, plugins)?;
    let scene =
        scene::open(&args.scene, &registry, OpenOptions { quiet: args.quiet, ..OpenOptions::TO_DRAW })?;
    write_pack_of_scene(args, scene, options, |unpacked| verify_pack(args, plugins, unpacked))
}

/// Writes the archive of an open scene. `verify` verifies the unpacked archive before it is moved to its place.
pub(crate) fn write_pack_of_scene(
    args: &PackArgs,
    scene: OpenedScene,
    options: String,
    verify: impl FnOnce(Unpacked) -> Result<(), Failure>,
) -> Result<PackResult, Failure> {
    let shown = args.output.display().to_string();
    scene.inputs.check_output(&args.output)?;
    let failed = |e: std::io::Error| output_failure(&shown, &e);
    if is_folder(&args.output) {
        // The folder is created under a temporary name beside its destination, so that it is never incomplete.
        let place = args.output.components().as_path();
        let beside = containing_folder(place);
        if place.symlink_metadata().is_ok() {
            return Err(Failure::Output(format!(
                "{shown}: it exists already; name a new folder, or remove it"
            )));
        }
        let mut archive = tempfile::tempfile_in(beside).map_err(failed)?;
        let (manifest, _) = pack::write_archive(&scene, &args.scene, options, &archive)?;
        let bytes = archive.stream_position().map_err(failed)?;
        let mut rewound = || archive.rewind().and_then(|()| archive.try_clone()).map_err(failed);
        verify(Unpacked::from_archive(rewound()?, &shown, scene.limits.file)?)?;
        let folder = tempfile::tempdir_in(beside).map_err(failed)?;
        pack::write_folder(rewound()?, folder.path()).map_err(|e| write_failure(&shown, e))?;
        std::fs::rename(folder.path(), place).map_err(failed)?;
        set_default_permissions(place).map_err(failed)?;
        return Ok(PackResult { manifest, bytes, warnings: scene.warnings });
    }
    let part = PartFile::create(&args.output).map_err(|e| write_failure(&shown, e))?;
    let out = part.writer().map_err(failed)?;
    let (manifest, out) = pack::write_archive(&scene, &args.scene, options, out)?;
    let mut written = out.into_inner().map_err(|e| failed(e.into_error()))?;
    let bytes = written.seek(SeekFrom::End(0)).map_err(failed)?;
    written.rewind().map_err(failed)?;
    verify(Unpacked::from_archive(written, &shown, scene.limits.file)?)?;
    part.commit().map_err(|e| write_failure(&shown, e))?;
    Ok(PackResult { manifest, bytes, warnings: scene.warnings })
}

/// Whether the output is a folder: it exists as one, or its name ends in a slash.
fn is_folder(output: &Path) -> bool {
    output.is_dir() || output.to_string_lossy().ends_with(std::path::is_separator)
}

/// Gives a folder the permissions of a normal new folder, since temporary folders are private.
#[cfg(unix)]
fn set_default_permissions(folder: &Path) -> std::io::Result<()> {
    std::fs::set_permissions(folder, folder.join("files").metadata()?.permissions())
}

#[cfg(not(unix))]
fn set_default_permissions(_: &Path) -> std::io::Result<()> {
    Ok(())
}

/// Opens the packed scene, and fails if it differs from the original.
fn verify_pack(args: &PackArgs, plugins: &Registry, unpacked: Unpacked) -> Result<(), Failure> {
    let mut packed = args.scene.clone();
    (packed.search, packed.import.plugins) = (Vec::new(), Vec::new());
    (packed.set, packed.import.import) = (Vec::new(), Vec::new());
    (packed.clip, packed.import.importer) = (None, None);
    unpacked.merge_arguments(&mut packed);
    let registry = scene::registry_with_plugin_files(&packed, plugins)?;
    scene::open(&packed, &registry, OpenOptions { quiet: true, ..OpenOptions::TO_DRAW })?;
    Ok(())
}

fn report_pack(args: &PackArgs, manifest: &Manifest, bytes: u64, warnings: &[String]) -> Result<(), Failure> {
    if args.json {
        return print_json(&json!({
            "ok": true,
            "output": args.output.display().to_string(),
            "bytes": bytes,
            "files": manifest.files.iter().map(|file| &file.path).collect::<Vec<_>>(),
            "input_hash": manifest.input_hash,
            "stage": manifest.stage,
            "warnings": warnings,
        }));
    }
    warnings.iter().for_each(print_message);
    if !args.quiet {
        let (files, output) = (manifest.files.len(), args.output.display());
        let plural = if files == 1 { "file" } else { "files" };
        print_message(format_args!("{files} {plural}, {:.1} MB: {output}", bytes as f64 / 1e6));
    }
    Ok(())
}
