//! Loading a file with ufbx: the options, the limits, and the errors.

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

/// Nodes below one another.
pub const MAX_DEPTH: u32 = 4096;
/// Each of three: what ufbx works with, what it hands over, what the importer makes of that. The first is free again before
/// the third grows, so that together they stay within 16 times the file and 64 MiB.
pub(crate) const MEMORY_OF_FILE: usize = 8;
pub(crate) const MEMORY_BESIDE: usize = 32 << 20;

/// Bytes that one of the three may take for a file of this size.
pub(crate) fn memory_limit(file_size: usize) -> usize {
    file_size.saturating_mul(MEMORY_OF_FILE).saturating_add(MEMORY_BESIDE)
}

pub fn allocator(file_size: usize) -> AllocatorOpts {
    AllocatorOpts {
        memory_limit: memory_limit(file_size),
        // Small files would else take chunks that they do not fill.
        max_chunk_size: 1 << 20,
        huge_threshold: 64 << 10,
        ..AllocatorOpts::default()
    }
}

/// Bytes between two words about how far it is. Each interrupts what unpacks arrays: at 256 they cost a fifth of its time.
const INTERVAL: u64 = 16 << 10;
/// The same where only the place of an error is wanted.
const FINE_INTERVAL: u64 = 256;

/// The file from memory: ufbx opens nothing itself. A file that fails is read once more, to find the exact place.
pub fn load(bytes: &[u8], needs: ImportScope, files: &dyn Files) -> Result<SceneRoot> {
    attempt(bytes, needs, files, INTERVAL).or_else(|(problem, cancelled)| match cancelled {
        true => Err(problem),
        false => attempt(bytes, needs, &Silent, FINE_INTERVAL).map_err(|(problem, _)| problem),
    })
}

/// Nobody listens, and nothing is beside the file.
struct Silent;

impl Files for Silent {
    fn read(&self, name: &str) -> std::result::Result<Arc<Vec<u8>>, String> {
        Err(format!("{name}: not read"))
    }
}

/// Loads the file; an error comes with whether it was cancelled.
fn attempt(
    bytes: &[u8],
    needs: ImportScope,
    files: &dyn Files,
    interval: u64,
) -> std::result::Result<SceneRoot, (Problem, bool)> {
    let reached = Cell::new(0);
    let progress = |p: &ufbx::Progress| {
        reached.set(p.bytes_read);
        // The data read becomes curves and meshes after that: about as much work again.
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
        // One tree of translations, rotations and scales, in metres: what it cannot say otherwise becomes helper nodes. Those of
        // geometry go into the meshes, where `nodes` can: with our own trigonometry.
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

/// ufbx does not say where it stopped; how far it had read is known.
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
        .hint("the file is damaged, or its data are packed beyond all measure"),
        ErrorType::NodeDepthLimit => {
            Problem::new(place, format!("has nodes more than {MAX_DEPTH} deep, which is the limit"))
        }
        ErrorType::UnrecognizedFileFormat => Problem::new("byte 0", "is not an FBX file"),
        ErrorType::UnsupportedVersion => Problem::new(place, format!("is of a version that cannot be read: {described}"))
            .hint("export it again as FBX 2013 or later"),
        _ => Problem::new(place, format!("is damaged: {described}")),
    }
}

/// Passes on the guesses of ufbx as warnings.
pub(crate) fn pass_warnings(file: &File<'_>) {
    let element = |w: &ufbx::Warning| file.scene.elements.as_ref().get(w.element_id as usize);
    let mut names = 0;
    for warning in &file.scene.metadata.warnings {
        if warning.type_ == WarningType::BadUnicode {
            // MotionBuilder writes such names for what is no part of the scene.
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
        file.notes.warn("", format!("{names} not in UTF-8; what cannot be read there is replaced"));
    }
}
