//! Loads a file with ufbx: options, limits and errors.

use crate::file::File;
use choreo_importer_kit::text::count;
use choreo_importer_kit::{Problem, Result};
use choreo_plugin::{Files, ImportScope};
use std::cell::Cell;
use std::sync::Arc;
use ufbx::{
    AllocatorOpts, CoordinateAxes, ElementType, ErrorType, FileFormat, GeometryTransformHandling,
    IndexErrorHandling, InheritModeHandling, LoadOpts, MirrorAxis, ProgressCb, ProgressResult, SceneRoot,
    SpaceConversion, WarningType,
};

/// Greatest depth of the node tree.
pub(crate) const MAX_DEPTH: u32 = 4096;
/// Memory limit, as a factor of the file size plus a constant. It applies to each of three: ufbx's temporary data, its result,
/// and the importer's own data. The first is freed before the third grows, so all together stay within 16 times the file size
/// plus 64 MiB.
pub(crate) const MEMORY_PER_FILE_BYTE: usize = 8;
pub(crate) const BASE_MEMORY: usize = 32 << 20;

/// Bytes that each of the three may take for a file of this size.
pub(crate) fn memory_limit(file_size: usize) -> usize {
    file_size.saturating_mul(MEMORY_PER_FILE_BYTE).saturating_add(BASE_MEMORY)
}

pub(crate) fn allocator(file_size: usize) -> AllocatorOpts {
    AllocatorOpts {
        memory_limit: memory_limit(file_size),
        // Smaller chunks than the default, which small files would not fill.
        max_chunk_size: 1 << 20,
        huge_threshold: 64 << 10,
        ..AllocatorOpts::default()
    }
}

/// Bytes between two progress reports. A report interrupts array decoding: with 256 bytes, reports took a fifth of the loading
/// time.
const PROGRESS_INTERVAL_BYTES: u64 = 16 << 10;
/// Bytes between two progress reports, where only the place of an error is wanted.
const FINE_PROGRESS_INTERVAL_BYTES: u64 = 256;

/// Loads a file from memory; ufbx opens no files itself. A file that fails is read again with finer progress, to find the place
/// of the error.
pub(crate) fn load(bytes: &[u8], needs: ImportScope, files: &dyn Files) -> Result<SceneRoot> {
    load_once(bytes, needs, files, PROGRESS_INTERVAL_BYTES).or_else(|(problem, cancelled)| match cancelled {
        true => Err(problem),
        false => {
            load_once(bytes, needs, &NoFiles, FINE_PROGRESS_INTERVAL_BYTES).map_err(|(problem, _)| problem)
        }
    })
}

/// Reports no progress, and finds no files.
struct NoFiles;

impl Files for NoFiles {
    fn read(&self, name: &str) -> std::result::Result<Arc<Vec<u8>>, String> {
        Err(format!("{name}: not read"))
    }
}

/// Loads the file. An error comes with whether the user cancelled.
fn load_once(
    bytes: &[u8],
    needs: ImportScope,
    files: &dyn Files,
    interval: u64,
) -> std::result::Result<SceneRoot, (Problem, bool)> {
    let reached = Cell::new(0);
    let progress = |p: &ufbx::Progress| {
        reached.set(p.bytes_read);
        // Half of the progress: turning the data into curves and meshes is about as much work again.
        match files.progress(0.5 * p.bytes_read as f32 / p.bytes_total.max(1) as f32) {
            true => ProgressResult::Continue,
            false => ProgressResult::Cancel,
        }
    };
    let axes = CoordinateAxes::right_handed_y_up();
    let options = LoadOpts {
        temp_allocator: allocator(bytes.len()),
        result_allocator: allocator(bytes.len()),
        ignore_geometry: !needs.geometry,
        ignore_animation: !needs.clips,
        ignore_embedded: !needs.textures,
        load_external_files: false,
        file_format: FileFormat::Fbx,
        node_depth_limit: MAX_DEPTH,
        index_error_handling: IndexErrorHandling::Clamp,
        clean_skin_weights: true,
        generate_missing_normals: true,
        normalize_normals: true,
        use_blender_pbr_material: true,
        // One tree of translations, rotations and scales in metres. Transforms that it cannot express become helper nodes.
        // Geometry helpers are folded into meshes where `nodes` can, with our own trigonometry.
        geometry_transform_handling: GeometryTransformHandling::HelperNodes,
        inherit_mode_handling: InheritModeHandling::Compensate,
        space_conversion: SpaceConversion::ModifyGeometry,
        handedness_conversion_axis: MirrorAxis::X,
        target_axes: axes,
        target_unit_meters: 1.0,
        target_camera_axes: axes,
        target_light_axes: axes,
        geometry_transform_helper_name: "(geometry)".into(),
        scale_helper_name: "(scale)".into(),
        progress_cb: ProgressCb::Ref(&progress),
        progress_interval_hint: interval,
        ..LoadOpts::default()
    };
    ufbx::load_memory(bytes, options).map_err(|error| {
        let cancelled = error.type_ == ErrorType::Cancelled;
        (problem(&error, reached.get(), bytes.len()), cancelled)
    })
}

/// The error with its place: ufbx does not report where it stopped, but the bytes read until then are known.
fn problem(error: &ufbx::Error, reached: u64, size: usize) -> Problem {
    let place = format!("byte {} of {size}", reached.min(size as u64));
    let info = error.info();
    let described = match (error.description.as_ref(), info) {
        (what, "") => what.to_string(),
        (what, info) => format!("{what} ({info})"),
    };
    let limit = memory_limit(size) >> 20;
    match error.type_ {
        ErrorType::EmptyFile => Problem::new("byte 0", "the file is empty"),
        ErrorType::TruncatedFile => {
            Problem::new(place, "the file ends too early").hint("it was cut off while it was copied or saved")
        }
        ErrorType::MemoryLimit | ErrorType::AllocationLimit | ErrorType::OutOfMemory => Problem::new(
            place,
            format!("needs more than {limit} MiB, which is the limit for a file of {size} bytes (8 times its size and 32 MiB)"),
        )
        .hint("the file is damaged, or its data are compressed too strongly"),
        ErrorType::NodeDepthLimit => {
            Problem::new(place, format!("has nodes more than {MAX_DEPTH} deep, which is the limit"))
        }
        ErrorType::UnrecognizedFileFormat => Problem::new("byte 0", "is not an FBX file"),
        ErrorType::UnsupportedVersion => Problem::new(place, format!("is of a version that cannot be read: {described}"))
            .hint("export it again as FBX 2013 or later"),
        _ => Problem::new(place, format!("is damaged: {described}")),
    }
}

/// Reports ufbx's warnings as our own.
pub(crate) fn pass_warnings(file: &File<'_>) {
    let element = |w: &ufbx::Warning| file.scene.elements.as_ref().get(w.element_id as usize);
    let mut names = 0;
    for warning in &file.scene.metadata.warnings {
        if warning.type_ == WarningType::BadUnicode {
            // MotionBuilder writes such names for objects outside the scene.
            let of_scene = element(warning).is_none_or(|e| e.type_ != ElementType::Unknown);
            names += if of_scene { warning.count } else { 0 };
            continue;
        }
        let place = element(warning).map_or(String::new(), |e| crate::file::place_of(e));
        let times = if warning.count > 1 { format!(" ({} times)", warning.count) } else { String::new() };
        file.notes.warn(place, format!("{}{times}", warning.description.as_ref()));
    }
    if names > 0 {
        let names = count(names, "text");
        file.notes.warn("", format!("{names} not in UTF-8; unreadable characters are replaced"));
    }
}
