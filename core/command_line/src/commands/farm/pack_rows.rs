//! The packed scene of a batch: one archive with the files that its rows read.

use crate::args::PackArgs;
use crate::commands::pack;
use crate::failure::{Failure, print_message};
use crate::scene::opening::{Opening, ReopenState};
use crate::scene::pack::Unpacked;
use crate::scene::rows::{self, Row};
use crate::scene::{self, OpenedScene};
use choreo_plugin::Registry;

/// A row that cannot be rendered: its number, and the reason.
pub(super) type RowFailure = (usize, Failure);

/// Writes the archive, and opens each row from it, which must give the same stage. Returns the rows that cannot be opened.
pub(super) fn write(
    args: &PackArgs,
    rows: &[Row],
    plugins: &Registry,
    options: String,
) -> Result<Vec<RowFailure>, Failure> {
    let registry = scene::plugins(&args.scene, plugins)?;
    let keep = ReopenState::default();
    let opening = Opening { quiet: true, keep: Some(&keep), ..Opening::TO_DRAW };
    let (mut failures, mut stages) = (Vec::new(), Vec::new());
    let mut all: Option<OpenedScene> = None;
    for row in rows {
        match scene::open(&row.scene(&args.scene), &registry, opening) {
            Err(failure) => failures.push((row.number, failure)),
            Ok(scene) => {
                stages.push((row, scene.stage.content_hash()));
                keep.release(scene.limits.memory);
                match &mut all {
                    Some(all) => {
                        all.touched.read.extend(scene.touched.read);
                        all.touched.missing_or_linked_paths.extend(scene.touched.missing_or_linked_paths);
                    }
                    none => *none = Some(scene),
                }
            }
        }
    }
    let Some(scene) = all else {
        print(&failures);
        return check_row_failures(&failures, rows.len()).map(|()| failures);
    };
    let prove = |unpacked: Unpacked| {
        let mut packed = args.scene.clone();
        (packed.search, packed.import.plugins, packed.set) = (Vec::new(), Vec::new(), Vec::new());
        unpacked.arguments(&mut packed);
        let registry = scene::plugins(&packed, plugins)?;
        let keep = ReopenState::default();
        for (row, stage) in &stages {
            let opening = Opening { quiet: true, keep: Some(&keep), ..Opening::TO_DRAW };
            let opened = scene::open(&row.scene(&packed), &registry, opening)?;
            if opened.stage.content_hash() != *stage {
                let (name, row) = (opened.name, row.number);
                return Err(Failure::input(format!("{name}: row {row} is a different scene after packing")));
            }
            keep.release(opened.limits.memory);
        }
        Ok(())
    };
    pack::write_open(args, scene, options, prove)?;
    Ok(failures)
}

/// Prints the failed rows and the reasons.
pub(super) fn print(failures: &[RowFailure]) {
    for (row, failure) in failures {
        failure.lines().iter().for_each(|line| print_message(format_args!("row {row}: {line}")));
    }
}

/// Fails if rows failed.
pub(super) fn check_row_failures(failures: &[RowFailure], rows: usize) -> Result<(), Failure> {
    rows::rows_failure(rows, failures.iter().map(|(row, failure)| (*row, failure)))
}
