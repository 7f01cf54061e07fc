//! The packed scene of a batch: one archive with the files that its rows read.

use crate::args::PackArgs;
use crate::commands::pack;
use crate::failure::{Failure, print_message};
use crate::scene::opening::{OpenOptions, ReopenState};
use crate::scene::pack::Unpacked;
use crate::scene::rows::{self, ParameterRow};
use crate::scene::{self, OpenedScene};
use choreo_plugin::Registry;

/// A row that cannot be rendered: its number, and the reason.
pub(super) type RowFailure = (usize, Failure);

/// Writes the archive, and opens each row from it, which must give the same stage. Returns the rows that cannot be opened.
pub(super) fn pack_all_rows(
    args: &PackArgs,
    rows: &[ParameterRow],
    plugins: &Registry,
    options: String,
) -> Result<Vec<RowFailure>, Failure> {
    let registry = scene::registry_with_plugin_files(&args.scene, plugins)?;
    let reopen_state = ReopenState::default();
    let opening = OpenOptions { quiet: true, reopen_state: Some(&reopen_state), ..OpenOptions::TO_DRAW };
    let (mut failures, mut stages) = (Vec::new(), Vec::new());
    let mut all: Option<OpenedScene> = None;
    for row in rows {
        match scene::open(&row.scene_args(&args.scene), &registry, opening) {
            Err(failure) => failures.push((row.number, failure)),
            Ok(scene) => {
                stages.push((row, scene.stage.content_hash()));
                reopen_state.release_unused_assets(scene.limits.memory);
                match &mut all {
                    Some(all) => {
                        all.dependencies.read.extend(scene.dependencies.read);
                        all.dependencies
                            .missing_or_linked_paths
                            .extend(scene.dependencies.missing_or_linked_paths);
                    }
                    none => *none = Some(scene),
                }
            }
        }
    }
    let Some(scene) = all else {
        print_row_failures(&failures);
        return check_row_failures(&failures, rows.len()).map(|()| failures);
    };
    let verify = |unpacked: Unpacked| {
        let mut packed = args.scene.clone();
        (packed.search, packed.import.plugins, packed.set) = (Vec::new(), Vec::new(), Vec::new());
        unpacked.merge_arguments(&mut packed);
        let registry = scene::registry_with_plugin_files(&packed, plugins)?;
        let reopen_state = ReopenState::default();
        for (row, stage) in &stages {
            let opening =
                OpenOptions { quiet: true, reopen_state: Some(&reopen_state), ..OpenOptions::TO_DRAW };
            let opened = scene::open(&row.scene_args(&packed), &registry, opening)?;
            if opened.stage.content_hash() != *stage {
                let (name, row) = (opened.name, row.number);
                return Err(Failure::input(format!("{name}: row {row} is a different scene after packing")));
            }
            reopen_state.release_unused_assets(opened.limits.memory);
        }
        Ok(())
    };
    pack::write_pack_of_scene(args, scene, options, verify)?;
    Ok(failures)
}

/// Prints the failed rows and the reasons.
pub(super) fn print_row_failures(failures: &[RowFailure]) {
    for (row, failure) in failures {
        failure.message_lines().iter().for_each(|line| print_message(format_args!("row {row}: {line}")));
    }
}

/// Fails if rows failed.
pub(super) fn check_row_failures(failures: &[RowFailure], rows: usize) -> Result<(), Failure> {
    rows::check_no_row_failed(rows, failures.iter().map(|(row, failure)| (*row, failure)))
}
