//! Wavefront OBJ with MTL into an [`Asset`]. What it reads, limits and options: README.md.

mod mesh;
mod mtl;
mod parse;

use choreo_asset::{Asset, Image, Material, Mesh, MeshInstance, Origin, Primitive, TextureRef, Topology};
use choreo_importer_kit::search;
use choreo_importer_kit::text::{Lines, next_word, stem};
use choreo_importer_kit::textures::{Textures, is_normal_map};
use choreo_importer_kit::{Budget, Notes, Problem, Progress, Result, normals, tangents};
use choreo_motion::{Skeleton, Transform};
use choreo_plugin::{Claim, Files, ImportError, ImportOptions, Importer, Manifest, Needs, Source};
use glam::Vec3;
use std::collections::BTreeMap;
use std::sync::{Arc, LazyLock};

/// As import-gltf: all that is decoded of one file together.
const MAX_DECODED_BYTES: u64 = 2 << 30;

static MANIFEST: LazyLock<Manifest> = LazyLock::new(|| {
    Manifest::new(
        "obj",
        env!("CARGO_PKG_VERSION"),
        "Wavefront OBJ: faces, groups, MTL materials and textures",
    )
    .extensions(["obj"])
    .number("scale", "metres a unit of the file", 1.0, 1e-6..=1e6)
    .text("up", "the file's upward axis", "y", &["y", "z"])
    .number("smooth", "degrees up to which an edge is smooth, where normals are missing", 30.0, 0.0..=180.0)
    .text(
        "colors",
        "what colours are: as shown (srgb) or linear; auto: linear from Blender",
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

    /// OBJ has no magic number; its lines have a look of their own.
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
        needs: Needs,
        options: &ImportOptions,
    ) -> std::result::Result<Asset, ImportError> {
        import(source, files, needs, options).map_err(|p| p.in_file(&source.name))
    }
}

/// The first lines are all OBJ's, and one of them is a vertex or a library.
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

fn import(source: &Source, files: &dyn Files, needs: Needs, options: &ImportOptions) -> Result<Asset> {
    let notes = Notes::default();
    let budget = Budget::new(MAX_DECODED_BYTES);
    let progress = Progress::new(files, source.bytes.len());
    let model = parse::read(&source.bytes, needs.geometry, &progress, &budget, &notes)?;
    if model.groups.is_empty() && model.materials.is_empty() && model.positions == 0 && needs.geometry {
        return Err(Problem::new("line 1", "there is nothing of OBJ in it")
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

    // Pictures take as long as everything else together: they are decoded beside it.
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
            writer: writer(&model.comment).into(),
            metres_per_unit: Some(scale),
            unit_is_assumed: true,
            up: if up_z { "+Z" } else { "+Y" }.into(),
            ..Origin::default()
        },
        ..Asset::default()
    };
    take_normal_maps(&mut asset.materials, &asset.images, bumps, &notes);
    place(&mut asset, &model, built, &notes)?;
    asset.warnings = notes.into_warnings();
    Ok(asset)
}

/// What wrote a file often says so in the first comment, which else tells of anything.
fn writer(comment: &str) -> &str {
    let lower = comment.to_ascii_lowercase();
    let tells = ["blender", "export", "generated by", "created by", "written by"];
    if tells.iter().any(|words| lower.contains(words)) { comment } else { "" }
}

type Bump = (usize, TextureRef, f32);

/// Materials in the order of their first use; where faces come before any `usemtl`, one more at the end for those.
#[allow(clippy::too_many_arguments)]
fn materials(
    model: &parse::Model,
    source: &Source,
    files: &dyn Files,
    needs: Needs,
    settings: &mesh::Settings,
    textures: &mut Textures,
    budget: &Budget,
    notes: &Notes,
) -> Result<(Vec<Material>, Vec<Bump>)> {
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
                let (material, bump) = mtl::material(found, &mut from);
                bumps.extend(bump.map(|(texture, strength)| (out.len(), texture, strength)));
                out.push(material);
            }
            None => {
                notes.warn(
                    format!("line {line}"),
                    format!("material \"{name}\" is in none of the file's libraries; grey is used"),
                );
                out.push(plain(name));
            }
        }
    }
    let without = model.elements.iter().any(|e| e.material == parse::NONE);
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
    let read =
        |name: &str, place: &str, out: &mut BTreeMap<String, mtl::Mtl>| -> std::result::Result<(), String> {
            let bytes = search::read_first(files, &search::places(&[name]))?;
            budget.charge(bytes.len() as u64, 4)?;
            for material in mtl::read(&bytes, name, notes) {
                if out.contains_key(&material.name) {
                    notes.warn(
                        material.place.as_str(),
                        format!("material \"{}\" is there twice; the first counts", material.name),
                    );
                    continue;
                }
                out.insert(material.name.clone(), material);
            }
            let _ = place;
            Ok(())
        };
    let mut done = std::collections::BTreeSet::new();
    for (names, line) in &model.libraries {
        if !done.insert(names.as_str()) {
            continue;
        }
        let place = format!("line {line}");
        // One name that may hold spaces, or several apart at spaces.
        let Err(what) = read(names, &place, &mut out) else { continue };
        let several: Vec<&str> = names.split_whitespace().collect();
        if several.len() < 2 {
            notes.warn(place, format!("material library {}", search::missing(names, &what)));
            continue;
        }
        for name in several {
            if let Err(what) = read(name, &place, &mut out) {
                notes.warn(place.as_str(), format!("material library {}", search::missing(name, &what)));
            }
        }
    }
    if model.libraries.is_empty() && !model.materials.is_empty() {
        let beside = format!("{}.mtl", stem(&source.name));
        if read(&beside, "", &mut out).is_ok() {
            notes.warn(
                "mtllib",
                format!("the file names no material library; \"{beside}\" beside it is used"),
            );
        }
    }
    Ok(out)
}

/// A bump map that holds directions is used as the normal map that it is.
fn take_normal_maps(materials: &mut [Material], images: &[Arc<Image>], bumps: Vec<Bump>, notes: &Notes) {
    for (material, texture, strength) in bumps {
        let image = &images[texture.image as usize];
        let material = &mut materials[material];
        if is_normal_map(image) {
            notes.warn(
                format!("material \"{}\"", material.name),
                format!("the bump map \"{}\" looks like a normal map and is used as one", image.name),
            );
            material.normal_scale = strength;
            material.normal_texture = Some(texture);
        } else {
            notes.warn(
                format!("material \"{}\"", material.name),
                format!("the bump map \"{}\" holds heights, which are not supported", image.name),
            );
        }
    }
}

/// Nodes for the groups, meshes on them.
fn place(asset: &mut Asset, model: &parse::Model, built: Vec<(u32, Primitive)>, notes: &Notes) -> Result<()> {
    let root = stem(&asset.name).to_string();
    // A single group is the root itself; several hang on one.
    let several = model.groups.len() > 1;
    let mut names = vec![match model.groups.first() {
        Some(only) if !several && !only.is_empty() => only.clone(),
        _ => root.clone(),
    }];
    if several {
        names.extend(
            model
                .groups
                .iter()
                .enumerate()
                .map(|(i, g)| if g.is_empty() { format!("group {i}") } else { g.clone() }),
        );
    }
    let parents = (0..names.len()).map(|i| (i > 0).then_some(0)).collect();
    let rest = vec![Transform::IDENTITY; names.len()];
    let skeleton =
        Skeleton::new(names.clone(), parents, rest).map_err(|e| Problem::new("o", e.to_string()))?;
    asset.skeleton = Arc::new(skeleton);
    let default = asset.materials.len().saturating_sub(1) as u32;
    let mut last: Option<u32> = None;
    for (group, mut primitive) in built {
        if primitive.positions.iter().any(|p| !p.is_finite()) {
            let what = "is too big: its vertices times the scale are not finite";
            return Err(Problem::new(format!("group \"{}\"", model.groups[group as usize]), what));
        }
        primitive.material = primitive.material.map(|m| if m == parse::NONE { default } else { m });
        add_tangents(&mut primitive, &asset.materials, notes);
        let joint = if several { group + 1 } else { 0 };
        if last != Some(joint) {
            let mesh = asset.meshes.len() as u32;
            asset.instances.push(MeshInstance { joint, mesh, ..Default::default() });
            asset.meshes.push(Arc::new(Mesh { name: names[joint as usize].clone(), ..Mesh::default() }));
            last = Some(joint);
        }
        if let Some(mesh) = asset.meshes.last_mut().and_then(Arc::get_mut) {
            mesh.primitives.push(primitive);
        }
    }
    Ok(())
}

fn add_tangents(p: &mut Primitive, materials: &[Material], notes: &Notes) {
    let Some(material) = p.material.and_then(|m| materials.get(m as usize)) else { return };
    if material.normal_texture.is_none() || p.topology != Topology::Triangles {
        return;
    }
    if p.uvs[0].is_empty() {
        notes.warn(
            format!("material \"{}\"", material.name),
            "has a normal map, but faces without texture coordinates use it; it has no effect there",
        );
        return;
    }
    let made = tangents::corner_tangents(&p.indices, &p.positions, &p.normals, &p.uvs[0]);
    normals::apply_tangents(p, &made);
}
