//! Wavefront OBJ with MTL into an [`Asset`]. Contents, limits and options: README.md.

mod mesh;
mod mtl;
mod parse;

use choreo_asset::{Asset, Material, Origin, Primitive};
use choreo_importer_kit::search;
use choreo_importer_kit::text::{Lines, next_word, stem};
use choreo_importer_kit::textures::{BumpMap, Textures, use_normal_maps};
use choreo_importer_kit::{Budget, Notes, Problem, Progress, Result, parts, tangents};
use choreo_plugin::{Claim, Files, ImportError, ImportOptions, ImportScope, Importer, Manifest, Source};
use glam::Vec3;
use std::collections::BTreeMap;
use std::sync::LazyLock;

/// Limit of all bytes decoded from one file together; the same as in import-gltf.
const MAX_DECODED_BYTES: u64 = 2 << 30;

/// The page of the documentation.
pub const README: &str = include_str!("../README.md");

static MANIFEST: LazyLock<Manifest> = LazyLock::new(|| {
    Manifest::new(
        "obj",
        env!("CARGO_PKG_VERSION"),
        "Wavefront OBJ: faces, groups, MTL materials and textures",
    )
    .extensions(["obj"])
    .number("scale", "metres per file unit", 1.0, 1e-6..=1e6)
    .text("up", "the file's upward axis", "y", &["y", "z"])
    .number("smooth", "degrees up to which an edge is smooth, where normals are missing", 30.0, 0.0..=180.0)
    .text(
        "colors",
        "color space of the colors: srgb or linear; auto: linear in files of Blender, else srgb",
        "auto",
        &["auto", "srgb", "linear"],
    )
});

#[derive(Clone, Copy, Debug, Default)]
pub struct ObjImporter;

impl Importer for ObjImporter {
    fn manifest(&self) -> &Manifest {
        &MANIFEST
    }

    /// OBJ has no magic number, so files are claimed by the look of their first lines.
    fn claim(&self, source: &Source) -> Claim {
        if looks_like_obj(&source.bytes) {
            Claim::Content(40)
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

/// Whether the first lines are OBJ statements and contain a vertex or a material library.
fn looks_like_obj(bytes: &[u8]) -> bool {
    let mut sure = false;
    for (_, line) in Lines::new(&bytes[..bytes.len().min(4096)]).take(64) {
        let mut rest = line;
        match next_word(&mut rest) {
            None => {}
            Some(word) if word.starts_with(b"#") => {}
            Some(b"mtllib") => sure |= !rest.trim_ascii().is_empty(),
            Some(b"v") => {
                let words = std::iter::from_fn(|| next_word(&mut rest));
                let numbers =
                    words.take(3).filter(|w| choreo_importer_kit::text::number(w).is_some()).count();
                if numbers < 3 {
                    return false;
                }
                sure = true;
            }
            Some(b"vt" | b"vn" | b"vp" | b"f" | b"l" | b"p" | b"o" | b"g" | b"s" | b"usemtl") => {}
            Some(_) => return sure,
        }
    }
    sure
}

fn import(source: &Source, files: &dyn Files, needs: ImportScope, options: &ImportOptions) -> Result<Asset> {
    let notes = Notes::default();
    let budget = Budget::new(MAX_DECODED_BYTES);
    let progress = Progress::new(files, source.bytes.len());
    let model = parse::read(&source.bytes, needs.geometry, &progress, &budget, &notes)?;
    if model.groups.is_empty() && model.materials.is_empty() && model.positions == 0 && needs.geometry {
        return Err(Problem::new("line 1", "the file has no OBJ data")
            .hint("an OBJ file has lines \"v x y z\" and \"f 1 2 3\""));
    }
    let scale = options.number("scale").unwrap_or(1.0);
    let up_z = options.text("up") == Some("z");
    let settings = mesh::Settings {
        scale,
        up_z,
        smooth_rad: options.number("smooth").unwrap_or(30.0).to_radians(),
        srgb: match options.text("colors") {
            Some("srgb") => true,
            Some("linear") => false,
            _ => !model.comment.contains("Blender"),
        },
    };
    let mut textures = Textures::default();
    let (materials, bumps) =
        materials(&model, source, files, needs, &settings, &mut textures, &budget, &notes)?;

    // Decoding images takes as long as everything else together, so both run in parallel.
    let (images, built) = textures.decode_beside(&notes, needs, files, || match needs.geometry {
        true => mesh::build(&model, &settings, &notes),
        false => Vec::new(),
    })?;
    let mut asset = Asset {
        name: source.name.clone(),
        images,
        materials,
        origin: Origin {
            format: "Wavefront OBJ".into(),
            writer: writing_program(&model.comment).into(),
            metres_per_unit: Some(scale),
            unit_is_assumed: true,
            up: if up_z { "+Z" } else { "+Y" }.into(),
            ..Origin::default()
        },
        ..Asset::default()
    };
    use_normal_maps(&mut asset.materials, &asset.images, bumps, &notes);
    place(&mut asset, &model, built, &notes)?;
    asset.warnings = notes.into_warnings();
    Ok(asset)
}

/// The comment, where it names the program that wrote the file. Programs often name themselves in the first comment, but it may
/// contain anything.
fn writing_program(comment: &str) -> &str {
    let lower = comment.to_ascii_lowercase();
    let tells = ["blender", "export", "generated by", "created by", "written by"];
    if tells.iter().any(|words| lower.contains(words)) { comment } else { "" }
}

/// Materials in the order of their first use, then a default material where faces come before any `usemtl`.
#[allow(clippy::too_many_arguments)]
fn materials(
    model: &parse::Model,
    source: &Source,
    files: &dyn Files,
    needs: ImportScope,
    settings: &mesh::Settings,
    textures: &mut Textures,
    budget: &Budget,
    notes: &Notes,
) -> Result<(Vec<Material>, Vec<BumpMap>)> {
    let libraries = libraries(model, source, files, budget, notes)?;
    let mut from = mtl::Source {
        textures: needs.textures.then_some(textures),
        files,
        budget,
        notes,
        srgb: settings.srgb,
    };
    let plain = |name: &str| Material {
        name: name.to_string(),
        shading: choreo_asset::Shading::BlinnPhong,
        base_color: Vec3::splat(0.6).extend(1.0),
        specular_color: Vec3::ZERO,
        double_sided: true,
        ..Material::default()
    };
    let mut out = Vec::with_capacity(model.materials.len() + 1);
    let mut bumps = Vec::new();
    for (name, line) in &model.materials {
        match libraries.get(name) {
            Some(found) => {
                let (read, bump) = mtl::material(found, &mut from);
                let material = out.len();
                bumps.extend(bump.map(|(texture, strength)| BumpMap { material, texture, strength }));
                out.push(read);
            }
            None => {
                notes.warn(
                    format!("line {line}"),
                    format!("material \"{name}\" is in none of the file's libraries; gray is used"),
                );
                out.push(plain(name));
            }
        }
    }
    let without = model.elements.iter().any(|e| e.material == parse::NO_INDEX);
    if without {
        let mut material = plain("default");
        if model.has_colors {
            material.base_color = glam::Vec4::ONE;
        }
        out.push(material);
    }
    Ok((out, bumps))
}

fn libraries(
    model: &parse::Model,
    source: &Source,
    files: &dyn Files,
    budget: &Budget,
    notes: &Notes,
) -> Result<BTreeMap<String, mtl::Mtl>> {
    let mut out = BTreeMap::new();
    let read = |name: &str, out: &mut BTreeMap<String, mtl::Mtl>| -> Result<()> {
        let bytes = search::read_first(files, &search::places(&[name]))?;
        budget.charge(bytes.len() as u64, 4)?;
        for material in mtl::read(&bytes, name, notes) {
            if out.contains_key(&material.name) {
                notes.warn(
                    material.place.as_str(),
                    format!("material \"{}\" is defined twice; the first is used", material.name),
                );
                continue;
            }
            out.insert(material.name.clone(), material);
        }
        Ok(())
    };
    let mut done = std::collections::BTreeSet::new();
    for (names, line) in &model.libraries {
        if !done.insert(names.as_str()) {
            continue;
        }
        let place = format!("line {line}");
        // The text may be one name with spaces, or several names separated by spaces.
        let Err(problem) = read(names, &mut out) else { continue };
        let several: Vec<&str> = names.split_whitespace().collect();
        if several.len() < 2 {
            notes.warn(place, format!("material library {}", search::missing(names, &problem.what)));
            continue;
        }
        for name in several {
            if let Err(problem) = read(name, &mut out) {
                notes.warn(
                    place.as_str(),
                    format!("material library {}", search::missing(name, &problem.what)),
                );
            }
        }
    }
    if model.libraries.is_empty() && !model.materials.is_empty() {
        let beside = format!("{}.mtl", stem(&source.name));
        if read(&beside, &mut out).is_ok() {
            notes.warn(
                "mtllib",
                format!("the file names no material library; \"{beside}\" beside it is used"),
            );
        }
    }
    Ok(out)
}

/// Makes a joint for each group, with the group's mesh on it.
fn place(asset: &mut Asset, model: &parse::Model, built: Vec<(u32, Primitive)>, notes: &Notes) -> Result<()> {
    let first = parts::add_joints(asset, "group", &model.groups)?;
    let default = asset.materials.len().saturating_sub(1) as u32;
    let groups = built.chunk_by(|a, b| a.0 == b.0).map(|run| (run[0].0, run.len())).collect::<Vec<_>>();
    let mut primitives = built.into_iter().map(|(_, primitive)| primitive);
    for (group, count) in groups {
        let mut primitives: Vec<Primitive> = primitives.by_ref().take(count).collect();
        for primitive in &mut primitives {
            if primitive.positions.iter().any(|p| !p.is_finite()) {
                let what = "is too big: its vertices times the scale are not finite";
                return Err(Problem::new(format!("group \"{}\"", model.groups[group as usize]), what));
            }
            primitive.material = primitive.material.map(|m| if m == parse::NO_INDEX { default } else { m });
            tangents::add_for_normal_map(primitive, &asset.materials, notes);
        }
        parts::add_mesh(asset, first + group, primitives);
    }
    Ok(())
}
