//! Procedural assets: shapes, meshes, lines and points from arrays, and images.

mod arrays;
mod displacement;
pub(crate) mod files;
mod image_sequence;
mod maps;
mod material;
mod raw_image;
mod reflection;
mod repeat;
mod solids;
mod texture;

pub(crate) use raw_image::image;
pub(crate) use repeat::repeat;
pub(crate) use texture::texture;

use crate::call::{ApiError, Call, Options, numbers, one_of, wrong};
use crate::limits::raise_hint;
use choreo_asset::{
    Asset, Image, LineStyle, Material, Mesh, MeshInstance, Primitive, Shading, Topology, Triplanar,
};
use choreo_importer_kit::tangents;
use choreo_motion::{Skeleton, Transform};
use choreo_plugin::MeshData;
use glam::{DVec3, Vec2, Vec3};
use std::sync::Arc;

/// The asset of a `shape(kind, options?)` call. Equal calls share one.
pub(crate) fn shape(c: &Call) -> Result<Arc<Asset>, ApiError> {
    let kind = one_of(&c.value(0), "shape: kind", solids::KINDS)?;
    let known: Vec<&str> =
        material::OPTIONS.into_iter().chain(["size", "projection", "sharpness", "detail"]).collect();
    let o = c.options(1, &known)?;
    let (mut material, images) = material::material(&o, "shape")?;
    let addresses: Vec<*const Image> = images.iter().map(Arc::as_ptr).collect();
    // Each call makes a new image for a checkerboard, so its address cannot be part of the key.
    let addresses = if o.get("checker").is_some() { Vec::new() } else { addresses };
    let key = format!("{kind} {:?} {addresses:?}", o.map);
    if let Some(asset) = c.stage_draft().shapes.get(&key) {
        return Ok(asset.clone());
    }
    crate::build::check_limit(c.stage_draft().shapes.len(), "shapes", &c.context.limits)?;
    let size = read_size(&o, kind)?;
    let name = o.text("name")?.unwrap_or_else(|| kind.to_string());
    let primitive = apply_projection_and_displacement(c, &o, solids::shape_mesh(kind, size))?;
    material.triplanar = triplanar(&o, &primitive)?;
    let asset = single_mesh_asset(&format!("shape {kind}"), &name, primitive, material, images)?;
    c.stage_draft().shapes.insert(key, asset.clone());
    Ok(asset)
}

/// The asset of a `mesh(#{ … })`, `lines(#{ … })` or `points(#{ … })` call.
pub(crate) fn mesh(c: &Call, topology: Topology) -> Result<Arc<Asset>, ApiError> {
    let o = c.options(0, &mesh_options(topology))?;
    let function = o.function.clone();
    crate::build::check_limit(c.stage_draft().procedural_totals.meshes, "meshes", &c.context.limits)?;
    let positions = arrays::floats(&o, "positions", 3)?;
    let vertices = positions.len() / 3;
    {
        let mut stage_draft = c.stage_draft();
        stage_draft.procedural_totals.meshes += 1;
        stage_draft.procedural_totals.vertices =
            stage_draft.procedural_totals.vertices.saturating_add(vertices as u64);
        if stage_draft.procedural_totals.vertices > c.context.limits.vertices {
            let total = stage_draft.procedural_totals.vertices;
            let error =
                ApiError::new(format!("{function}: all meshes of the script together have {total} vertices"));
            return Err(ApiError {
                fatal: true,
                ..error.hint(raise_hint("vertices", c.context.limits.vertices))
            });
        }
    }
    let mut indices = arrays::indices(&o, "indices")?;
    if o.flag("strip")? == Some(true) {
        let all: Vec<u32> = if indices.is_empty() { (0..vertices as u32).collect() } else { indices };
        indices = all.windows(2).flatten().copied().collect();
    }
    let data = MeshData {
        topology,
        colors: arrays::colors(&o, "colors", vertices)?,
        normals: arrays::floats(&o, "normals", 3)?,
        uvs: arrays::floats(&o, "uvs", 2)?,
        positions,
        indices,
        ..MeshData::default()
    };
    let mut primitive = choreo_plugin::build::primitive(&data).map_err(|e| {
        // The error begins with the name of the array.
        let array = e.0.split(|c: char| !c.is_ascii_lowercase()).next().unwrap_or("").to_string();
        ApiError::new(format!("{function}: {e}")).focus(array)
    })?;
    if o.get("uvs2").is_some() {
        set_second_uvs(&o, &mut primitive)?;
    }
    let has_projection = o.get("projection").is_some();
    if o.get("displacement_map").is_some() && primitive.uvs[0].is_empty() && !has_projection {
        let text = format!("{function}: displacement_map needs uvs, its place on the mesh, or a projection");
        return Err(ApiError::new(text).focus("displacement_map"));
    }
    let primitive = if topology == Topology::Triangles {
        apply_projection_and_displacement(c, &o, primitive)?
    } else {
        primitive
    };
    let (mut material, images) = material::material(&o, &function)?;
    material.triplanar = triplanar(&o, &primitive)?;
    // Vertex colors are multiplied by the base color, which is white if none is given.
    if o.get("color").is_none() && !data.colors.is_empty() {
        material.base_color = glam::Vec4::ONE;
        if primitive.colors.iter().any(|c| c.w < 1.0) {
            material.alpha_mode = choreo_asset::AlphaMode::Blend;
        }
    }
    if topology != Topology::Triangles {
        // Lines and points have no faces, so they are unlit.
        material.shading = Shading::Unlit;
        material.line_style = line_style(&o, topology)?;
    }
    check_uvs(&o, &primitive, &material)?;
    let name = o.text("name")?.unwrap_or_else(|| function.clone());
    single_mesh_asset(&name, &name, primitive, material, images)
}

/// The options of `mesh`, `lines` and `points`.
fn mesh_options(topology: Topology) -> Vec<&'static str> {
    let mut known = vec!["positions", "indices", "colors", "color", "name"];
    match topology {
        Topology::Triangles => {
            known.extend(["normals", "uvs", "uvs2", "projection", "sharpness", "detail"]);
            known.extend(material::OPTIONS.into_iter().filter(|name| !["color", "name"].contains(name)));
        }
        Topology::Lines => known.extend(["strip", "width", "metres", "round"]),
        Topology::Points => known.extend(["size", "metres", "round"]),
    }
    known
}

/// Refuses textures on a mesh without texture coordinates.
fn check_uvs(o: &Options, primitive: &Primitive, material: &Material) -> Result<(), ApiError> {
    let function = &o.function;
    if let Some(option) = [
        "image",
        "normal_map",
        "height_map",
        "opacity_map",
        "specular_map",
        "reflection_map",
        "checker",
        "anisotropy",
    ]
    .into_iter()
    .find(|p| o.get(p).is_some())
        && primitive.uvs[0].is_empty()
        && material.triplanar.is_none()
    {
        return Err(
            ApiError::new(format!("{function}: {option} needs uvs, its place on the mesh")).focus(option)
        );
    }
    Ok(())
}

/// Sets the second texture coordinates, for textures with `uv_set: 1`.
fn set_second_uvs(o: &Options, primitive: &mut Primitive) -> Result<(), ApiError> {
    let given = arrays::floats(o, "uvs2", 2)?;
    let vertices = primitive.positions.len();
    if given.len() != 2 * vertices || given.iter().any(|v| !v.is_finite()) {
        let text = format!(
            "{}: uvs2 must have 2 finite numbers for each of the {vertices} vertices, has {}",
            o.function,
            given.len()
        );
        return Err(ApiError::new(text).focus("uvs2"));
    }
    primitive.uvs[1] = given.as_chunks::<2>().0.iter().copied().map(Vec2::from_array).collect();
    Ok(())
}

/// The triplanar projection of the options, if any. The image is as wide as the largest side of the bounding box, as in the box
/// projection.
fn triplanar(o: &Options, primitive: &Primitive) -> Result<Option<Triplanar>, ApiError> {
    let is_triplanar =
        o.get("projection").and_then(|v| v.into_string().ok()).is_some_and(|v| v == "triplanar");
    let sharpness = o.number_in("sharpness", 1.0, 64.0)?;
    let fail = |text: String, word: &str| Err(ApiError::new(format!("{}: {text}", o.function)).focus(word));
    if !is_triplanar {
        return match sharpness {
            Some(_) => fail("sharpness needs projection: \"triplanar\"".into(), "sharpness"),
            None => Ok(None),
        };
    }
    let needs_uvs = ["height_map", "displacement_map", "anisotropy"];
    if let Some(word) = needs_uvs.into_iter().find(|word| o.get(word).is_some()) {
        return fail(
            format!("{word} needs one texture coordinate, triplanar has three; use another projection"),
            word,
        );
    }
    let [low, high] = displacement::bounds(primitive);
    let size = (high - low).max_element().max(1e-6);
    Ok(Some(Triplanar { middle: (low + high) * 0.5, size, sharpness: sharpness.unwrap_or(4.0) as f32 }))
}

/// Maximum width of lines and size of points, in pixels or metres.
pub(crate) const MAX_LINE_WIDTH: f32 = 16384.0;

/// Line or point style: width in pixels (`width` or `size`) or in metres (`metres`).
fn line_style(o: &Options, topology: Topology) -> Result<Option<LineStyle>, ApiError> {
    let pixels = if topology == Topology::Points { "size" } else { "width" };
    let max = f64::from(MAX_LINE_WIDTH);
    let given = [o.number_in(pixels, 0.0, max)?, o.number_in("metres", 0.0, max)?];
    let round = o.flag("round")?;
    let fail = |text: String, word: &str| Err(ApiError::new(format!("{}: {text}", o.function)).focus(word));
    match given {
        [Some(_), Some(_)] => {
            fail(format!("{pixels} sets pixels and metres sets metres; leave one out"), "metres")
        }
        [None, None] if round.is_some() => fail(format!("round needs {pixels} or metres"), "round"),
        [None, None] => Ok(None),
        [in_pixels, in_metres] => Ok(Some(LineStyle {
            width: in_pixels.or(in_metres).unwrap_or(1.0) as f32,
            metres: in_metres.is_some(),
            round: round.unwrap_or(true),
        })),
    }
}

/// Sets texture coordinates by the projection of the options, then displaces the vertices by their displacement map.
fn apply_projection_and_displacement(
    c: &Call,
    o: &Options,
    mut primitive: Primitive,
) -> Result<Primitive, ApiError> {
    if let Some(how) = o.one_of("projection", displacement::PROJECTIONS)? {
        displacement::project_texture(&mut primitive, how);
    }
    let height = o.number_in("displacement", -1000.0, 1000.0)?;
    let detail = o.number_in("detail", 0.0, 8.0)?;
    let Some(map) = o.image("displacement_map")? else {
        let Some(word) = ["displacement", "detail"].into_iter().find(|w| o.get(w).is_some()) else {
            return Ok(primitive);
        };
        let text = format!("{}: {word} needs displacement_map, which is not given", o.function);
        return Err(ApiError::new(text).focus(word));
    };
    for _ in 0..detail.unwrap_or(2.0) as u32 {
        let limit = c.context.limits.vertices;
        // Each triangle becomes four, and each edge adds about one vertex.
        if primitive.positions.len() as u64 + primitive.indices.len() as u64 > limit {
            let text = format!("{}: detail makes more than {limit} vertices", o.function);
            return Err(ApiError::new(text).focus("detail").hint(raise_hint("vertices", limit)));
        }
        displacement::subdivide(&mut primitive);
    }
    let tiles = o.number_in("tiles", 1.0, 4096.0)?.unwrap_or(1.0) as f32;
    let map = map.decoded()?;
    displacement::displace(&mut primitive, &map, height.unwrap_or(0.1) as f32, tiles);
    Ok(primitive)
}

/// An asset of one joint, one mesh and one material.
fn single_mesh_asset(
    name: &str,
    joint: &str,
    mut primitive: Primitive,
    material: Material,
    images: Vec<Arc<Image>>,
) -> Result<Arc<Asset>, ApiError> {
    primitive.material = Some(0);
    let is_anisotropic = material.layers.as_ref().is_some_and(|l| l.anisotropy > 0.0);
    if material.triplanar.is_none() && (material.normal_texture.is_some() || is_anisotropic) {
        tangents::add(&mut primitive, 0);
    }
    let skeleton = Skeleton::new(vec![joint.to_string()], vec![None], vec![Transform::IDENTITY])
        .map_err(|e| ApiError::new(e.to_string()))?;
    let mesh = Mesh { name: joint.to_string(), primitives: vec![primitive], ..Mesh::default() };
    Ok(Arc::new(Asset {
        name: name.to_string(),
        skeleton: Arc::new(skeleton),
        meshes: vec![Arc::new(mesh)],
        instances: vec![MeshInstance { joint: 0, mesh: 0, ..MeshInstance::default() }],
        materials: vec![material],
        images,
        ..Asset::default()
    }))
}

/// The size of a shape in metres along x, y and z. A plane lies in the xz plane, a quad in the xy plane.
fn read_size(o: &Options, kind: &str) -> Result<Vec3, ApiError> {
    let size = match o.get("size") {
        None if kind == "plane" => Vec3::splat(10.0),
        None => solids::proportions(kind),
        Some(value) => {
            let size = match (kind, numbers(&value).as_deref()) {
                ("plane", Some([x, z])) => DVec3::new(*x, 1.0, *z),
                ("quad", Some([x, y])) => DVec3::new(*x, *y, 1.0),
                (_, Some([x, y, z])) if !matches!(kind, "plane" | "quad") => DVec3::new(*x, *y, *z),
                (_, Some(_)) => {
                    let allowed = "a number, [x, y, z], [x, z] for a plane, or [x, y] for a quad";
                    return Err(wrong(&value, "shape: size", allowed));
                }
                (_, None) => {
                    crate::call::number(&value, "shape: size")? * solids::proportions(kind).as_dvec3()
                }
            };
            if size.to_array().iter().any(|v| !(1e-4..=1e6).contains(v)) {
                return Err(ApiError::new(format!(
                    "shape: size must be from 0.0001 to 1000000 m, got {:e}, {:e}, {:e}",
                    size.x, size.y, size.z
                )));
            }
            size.as_vec3()
        }
    };
    match solids::invalid_size(kind, size) {
        Some(why) => {
            Err(ApiError::new(format!("shape: {why}, got {:?}, {:?}, {:?}", size.x, size.y, size.z)))
        }
        None => Ok(size),
    }
}
