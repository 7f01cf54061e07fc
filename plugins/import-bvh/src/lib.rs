//! BVH motion capture into an [`Asset`]. Contents, limits and options: README.md.

mod hierarchy;
mod motion;
mod units;

use choreo_asset::{Asset, Origin};
use choreo_importer_kit::text::stem;
use choreo_importer_kit::{Notes, Problem, Progress, Result, bones};
use choreo_motion::Skeleton;
use choreo_plugin::{Claim, Files, ImportError, ImportOptions, ImportScope, Importer, Manifest, Source};
use glam::DQuat;
use std::sync::{Arc, LazyLock};

/// The page of the documentation.
pub const README: &str = include_str!("../README.md");

static MANIFEST: LazyLock<Manifest> = LazyLock::new(|| {
    Manifest::new("bvh", env!("CARGO_PKG_VERSION"), "BVH motion capture: a skeleton and one clip")
        .extensions(["bvh"])
        .magic(b"HIERARCHY")
        .number("scale", "metres per file unit; 0: guessed from the skeleton's size", 0.0, 0.0..=1e6)
        .text("up", "the file's upward axis", "y", &["y", "z"])
        .flag("bones", "show a mesh made of the bones, since the file has none", true)
});

#[derive(Clone, Copy, Debug, Default)]
pub struct BvhImporter;

impl Importer for BvhImporter {
    fn manifest(&self) -> &Manifest {
        &MANIFEST
    }

    /// Claims files that begin with HIERARCHY, or have the extension. Some programs write `Hierarchy`, or put spaces and a byte
    /// order mark before it.
    fn claim(&self, source: &Source) -> Claim {
        let bytes = source.bytes.as_slice();
        let text = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes).trim_ascii_start();
        if text.get(..9).is_some_and(|head| head.eq_ignore_ascii_case(b"HIERARCHY")) {
            Claim::Content(90)
        } else if MANIFEST.has_extension(&source.extension()) {
            Claim::Extension
        } else {
            Claim::NotMine
        }
    }

    fn import(
        &self,
        source: &Source,
        files: &dyn Files,
        needs: ImportScope,
        options: &ImportOptions,
    ) -> std::result::Result<Asset, ImportError> {
        import(source, files, needs, options).map_err(|p| p.in_file(&source.name))
    }
}

/// Conversion from the file's units and axes to metres and +Y up.
#[derive(Clone, Copy, Debug)]
struct Convention {
    scale: f64,
    /// Applied to the roots only; children follow.
    turn: DQuat,
}

fn import(source: &Source, files: &dyn Files, needs: ImportScope, options: &ImportOptions) -> Result<Asset> {
    let notes = Notes::default();
    let (joints, rest_of_file) = hierarchy::read(&source.bytes, &notes)?;
    let up_z = options.text("up") == Some("z");
    let scale = match options.number("scale").filter(|s| *s > 0.0) {
        Some(scale) => scale,
        None => units::guess(&joints, &notes),
    };
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let turn = if up_z { DQuat::from_xyzw(-half, 0.0, 0.0, half) } else { DQuat::IDENTITY };
    let convention = Convention { scale, turn };

    let skeleton = Skeleton::new(
        joints.iter().map(|j| j.name.clone()).collect(),
        joints.iter().map(|j| j.parent).collect(),
        joints.iter().map(|j| j.rest(&convention)).collect(),
    )
    .map_err(|e| Problem::new("HIERARCHY", e.to_string()).hint("the offsets times the scale are too big"))?;
    let mut asset = Asset {
        name: source.name.clone(),
        skeleton: Arc::new(skeleton),
        origin: Origin {
            format: "BVH".into(),
            metres_per_unit: Some(scale),
            unit_is_assumed: true,
            up: if up_z { "+Z" } else { "+Y" }.into(),
            ..Origin::default()
        },
        ..Asset::default()
    };
    if needs.geometry && options.bool("bones").unwrap_or(true) {
        bones::add_bones(&mut asset);
    }
    if needs.clips {
        // Frames are nearly all of a file, so they alone count as progress.
        let progress = Progress::new(files, rest_of_file.bytes.len());
        let name = stem(&source.name);
        let clip = motion::read(rest_of_file, &joints, &convention, name, &progress, &notes)?;
        asset.clips.extend(clip.map(Arc::new));
    }
    asset.warnings = notes.into_warnings();
    Ok(asset)
}
