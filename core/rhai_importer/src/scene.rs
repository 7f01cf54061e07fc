//! `joint`, `mesh`, `lines`, `points`, `material`, `image`, `camera`, `light`, `clip`, `warn` and `read`: the script functions
//! that build the asset.

use crate::budget::{Budget, NativeError, native_error};
use crate::bytes::Bytes;
use crate::fields::{self, FieldError, Fields, MESH_FIELDS, mesh_data};
use choreo_asset::{
    AlphaMode, Image, Light, LightKind, Material, Projection, Sampler, Shading, TextureRef, Topology,
};
use choreo_importer_kit::images::{Encoded, Formats};
use choreo_importer_kit::problem::Problem;
use choreo_motion::{Curve, Interpolation, Path, Time, Transform};
use choreo_plugin::{AssetBuilder, ImportScope};
use glam::{Affine2, Mat4, Quat, Vec3, Vec4};
use rhai::{Array, Dynamic, Engine, Map};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, mpsc};

/// The asset that an import is building.
pub(crate) struct BuildInProgress {
    pub builder: AssetBuilder,
    pub needs: ImportScope,
    /// Requests for files beside the source, which another thread reads.
    pub file_requests: mpsc::Sender<FileRequest>,
}

/// Name of a requested file, and the channel for its bytes or the error message.
pub(crate) type FileRequest = (String, mpsc::Sender<Result<Arc<Vec<u8>>, String>>);

pub(crate) type SharedBuild = Arc<Mutex<BuildInProgress>>;

fn lock_build(scene: &SharedBuild) -> MutexGuard<'_, BuildInProgress> {
    scene.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Maximum number of warnings kept, so that a loop over vertices cannot fill the memory.
const MAX_WARNINGS: usize = 1000;

pub(crate) fn register_builders(engine: &mut Engine, scene: &SharedBuild, budget: &Budget) {
    let s = scene.clone();
    engine.register_fn("joint", move |name: &str| add_joint(&s, name, None, &Map::new()));
    let s = scene.clone();
    engine.register_fn("joint", move |name: &str, rest: Map| add_joint(&s, name, None, &rest));
    let s = scene.clone();
    engine
        .register_fn("joint", move |name: &str, parent: i64| add_joint(&s, name, Some(parent), &Map::new()));
    let s = scene.clone();
    engine.register_fn("joint", move |name: &str, parent: i64, rest: Map| {
        add_joint(&s, name, Some(parent), &rest)
    });
    for (name, topology) in
        [("mesh", Topology::Triangles), ("lines", Topology::Lines), ("points", Topology::Points)]
    {
        let s = scene.clone();
        engine.register_fn(name, move |map: Map| add_mesh(&s, name, topology, &map));
    }
    let s = scene.clone();
    engine.register_fn("material", move |map: Map| add_material(&s, &map));
    let (s, b) = (scene.clone(), budget.clone());
    engine.register_fn("image", move |map: Map| add_image(&s, &b, &map));
    let (s, b) = (scene.clone(), budget.clone());
    // The same call as in scene scripts.
    engine.register_fn("image", move |width: i64, height: i64, pixels: Dynamic| {
        let fields = [("width", width.into()), ("height", height.into()), ("pixels", pixels)];
        add_image(&s, &b, &fields.into_iter().map(|(name, value)| (name.into(), value)).collect())
    });
    let s = scene.clone();
    engine.register_fn("camera", move |map: Map| add_camera(&s, &map));
    let s = scene.clone();
    engine.register_fn("light", move |map: Map| add_light(&s, &map));
    let s = scene.clone();
    engine.register_fn("clip", move |name: &str, curves: Array| add_clip(&s, name, &curves));
    let s = scene.clone();
    engine.register_fn("warn", move |text: &str| add_warning(&s, "", text));
    let s = scene.clone();
    engine.register_fn("warn", move |place: &str, text: &str| add_warning(&s, place, text));
    let (s, b) = (scene.clone(), budget.clone());
    engine.register_fn("read", move |name: &str| {
        let (reply, replies) = mpsc::channel();
        let sent = lock_build(&s).file_requests.send((name.to_string(), reply));
        let import_has_ended =
            || native_error(format!("read: \"{name}\" cannot be read after the import has ended"));
        sent.map_err(|_| import_has_ended())?;
        let bytes = replies.recv().map_err(|_| import_has_ended())?.map_err(native_error)?;
        b.charge(bytes.len())?;
        Ok::<_, NativeError>(Bytes::new(bytes, &b))
    });
}

fn add_warning(scene: &SharedBuild, place: &str, text: &str) {
    let mut scene = lock_build(scene);
    if scene.builder.warnings() < MAX_WARNINGS {
        scene.builder.warn(place, text);
    }
}

fn add_joint(scene: &SharedBuild, name: &str, parent: Option<i64>, map: &Map) -> Result<i64, NativeError> {
    let parent = match parent {
        // Many formats write -1 for the parent of a root.
        None | Some(-1) => None,
        Some(p) => Some(u32::try_from(p).map_err(|_| {
            native_error(format!(
                "joint \"{name}\": the parent is {p}, must be the number of a joint, or -1 for none"
            ))
        })?),
    };
    let mut scene = lock_build(scene);
    if scene.builder.joints().len() >= crate::engine::MAX_ARRAY_LEN {
        return Err(native_error(format!(
            "joint \"{name}\": too many joints, at most {} are allowed",
            crate::engine::MAX_ARRAY_LEN
        )));
    }
    let rest = read_rest_transform(&format!("joint \"{name}\""), map)?;
    scene.builder.joint(name, parent, rest).map(i64::from).map_err(|e| native_error(e.to_string()))
}

fn read_rest_transform(what: &str, map: &Map) -> fields::Result<Transform> {
    let f = Fields::new(what, map, &["translation", "rotation", "scale", "matrix"])?;
    if let Some(matrix) = f.vector::<16>("matrix")? {
        let matrix = Mat4::from_cols_array(&matrix);
        if !(matrix.is_finite() && matrix.determinant() != 0.0) {
            return Err(format!("{what}: matrix must be finite and have an inverse").into());
        }
        return Ok(Transform::from_matrix(matrix));
    }
    Ok(Transform {
        translation: f.vector("translation")?.map_or(Vec3::ZERO, Vec3::from_array),
        rotation: f.vector("rotation")?.map_or(Quat::IDENTITY, Quat::from_array),
        scale: f.vector("scale")?.map_or(Vec3::ONE, Vec3::from_array),
    })
}

/// Adds a mesh and returns its index. Without a need for geometry the arrays are not read, and the result is -1.
fn add_mesh(scene: &SharedBuild, name: &str, topology: Topology, map: &Map) -> Result<i64, NativeError> {
    let f = Fields::new(name, map, MESH_FIELDS)?;
    let mut scene = lock_build(scene);
    if !scene.needs.geometry {
        return Ok(-1);
    }
    let data = mesh_data(&f, topology)?;
    scene.builder.mesh(data).map(i64::from).map_err(|e| native_error(e.to_string()))
}

fn add_material(scene: &SharedBuild, map: &Map) -> Result<i64, NativeError> {
    let mut scene = lock_build(scene);
    let material = read_material(map, scene.needs.textures)?;
    scene.builder.material(material).map(i64::from).map_err(|e| native_error(e.to_string()))
}

fn read_material(map: &Map, textures: bool) -> fields::Result<Material> {
    let known = [
        "name",
        "color",
        "image",
        "normal_image",
        "normal_scale",
        "metallic_roughness_image",
        "occlusion_image",
        "emissive_image",
        "metallic",
        "roughness",
        "emissive",
        "unlit",
        "double_sided",
        "alpha",
        "shininess",
        "specular",
    ];
    let f = Fields::new("material", map, &known)?;
    let number = |name: &str, default: f32, max: f64| match f.number(name)? {
        None => Ok(default),
        Some(v) if (0.0..=max).contains(&v) => Ok(v as f32),
        Some(v) => Err(FieldError::from(format!("material: {name} must be from 0 to {max}, got {v}"))),
    };
    let color = f.color("color")?.unwrap_or(Vec4::ONE);
    let mut material = Material {
        name: f.text("name")?.unwrap_or_default(),
        base_color: color,
        metallic: number("metallic", 0.0, 1.0)?,
        roughness: number("roughness", 0.9, 1.0)?,
        emissive: f.color("emissive")?.map_or(Vec3::ZERO, Vec4::truncate),
        double_sided: f.flag("double_sided")?.unwrap_or(false),
        ..Material::default()
    };
    if !material.base_color.is_finite() || !material.emissive.is_finite() {
        return Err("material: colors must be finite".into());
    }
    if f.number("shininess")?.is_some() {
        material.shading = Shading::BlinnPhong;
        material.shininess = number("shininess", 32.0, 10_000.0)?;
        material.specular_color = f.color("specular")?.map_or(Vec3::splat(0.04), Vec4::truncate);
    }
    if f.flag("unlit")? == Some(true) {
        material.shading = Shading::Unlit;
    }
    material.alpha_mode = match (f.text("alpha")?.as_deref(), color.w < 1.0) {
        (Some("opaque"), _) | (None, false) => AlphaMode::Opaque,
        (Some("blend"), _) | (None, true) => AlphaMode::Blend,
        (Some("mask"), _) => AlphaMode::Mask(0.5),
        (Some(other), _) => {
            return Err(format!("material: alpha is opaque, mask or blend, not \"{other}\"").into());
        }
    };
    let texture = |name: &str| {
        let (sampler, uv_transform) = (Sampler::default(), Affine2::IDENTITY);
        let image = f.optional_index(name)?.filter(|_| textures);
        Ok::<_, FieldError>(image.map(|image| TextureRef { image, sampler, uv_set: 0, uv_transform }))
    };
    material.base_color_texture = texture("image")?;
    material.normal_texture = texture("normal_image")?;
    material.normal_scale = number("normal_scale", 1.0, 100.0)?;
    material.metallic_roughness_texture = texture("metallic_roughness_image")?;
    material.occlusion_texture = texture("occlusion_image")?;
    material.emissive_texture = texture("emissive_image")?;
    Ok(material)
}

/// Adds a camera: `fov` in degrees, or `height` in metres for an orthographic camera.
fn add_camera(scene: &SharedBuild, map: &Map) -> Result<i64, NativeError> {
    let f = Fields::new("camera", map, &["name", "joint", "fov", "height", "near", "far"])?;
    let near = f.number("near")?.unwrap_or(0.05) as f32;
    let far = f.number("far")?.map(|far| far as f32);
    if !(near.is_finite() && near > 0.0 && far.is_none_or(|far| far.is_finite() && far > near)) {
        let far = far.map_or("none".to_string(), |far| far.to_string());
        let message =
            format!("camera: near must be above 0 and far above near, got near {near} and far {far}");
        return Err(native_error(message));
    }
    let within = |name: &str, value: f64, most: f64| match value > 0.0 && value < most {
        true => Ok(value as f32),
        false => Err(native_error(format!("camera: {name} must be above 0 and below {most}, got {value}"))),
    };
    let projection = match (f.number("fov")?, f.number("height")?) {
        (Some(_), Some(_)) => {
            return Err(native_error(
                "camera: give fov for a perspective camera or height for an orthographic one, not both",
            ));
        }
        (_, Some(height)) => Projection::Orthographic {
            height: within("height", height, 1e6)?,
            near,
            far: far.unwrap_or(1000.0),
        },
        (fov, None) => {
            let yfov = within("fov", fov.unwrap_or(40.0), 180.0)?.to_radians();
            Projection::Perspective { yfov, near, far }
        }
    };
    let name = f.text("name")?.unwrap_or_default();
    let joint = f.optional_index("joint")?;
    lock_build(scene)
        .builder
        .camera(&name, joint, projection)
        .map(i64::from)
        .map_err(|e| native_error(e.to_string()))
}

/// Adds a light. The cone angles are in degrees from the axis; intensity is in lux for a sun, else in candela.
fn add_light(scene: &SharedBuild, map: &Map) -> Result<i64, NativeError> {
    let known = ["name", "joint", "kind", "color", "intensity", "range", "inner", "outer"];
    let f = Fields::new("light", map, &known)?;
    let degrees = |name: &str, default: f64| {
        Ok::<_, FieldError>(f.number(name)?.unwrap_or(default).to_radians() as f32)
    };
    let kind = match f.text("kind")?.as_deref() {
        Some("sun") => LightKind::Directional,
        Some("point") => LightKind::Point,
        Some("spot") => LightKind::Spot { inner: degrees("inner", 0.0)?, outer: degrees("outer", 45.0)? },
        _ => return Err(native_error("light: kind must be \"sun\", \"point\" or \"spot\"")),
    };
    let light = Light {
        kind,
        color: f.color("color")?.map_or(Vec3::ONE, Vec4::truncate),
        intensity: f.number("intensity")?.unwrap_or(1.0) as f32,
        range: f.number("range")?.map(|range| range as f32),
    };
    let name = f.text("name")?.unwrap_or_default();
    let joint = f.optional_index("joint")?;
    lock_build(scene)
        .builder
        .light(&name, joint, light)
        .map(i64::from)
        .map_err(|e| native_error(e.to_string()))
}

/// Adds an image from pixels (bytes, or numbers from 0 to 255) or from a whole PNG, JPEG or WebP file. Returns its index, 0
/// without a need for textures.
fn add_image(scene: &SharedBuild, budget: &Budget, map: &Map) -> Result<i64, NativeError> {
    let f = Fields::new("image", map, &["name", "width", "height", "pixels", "file"])?;
    let mut scene = lock_build(scene);
    if !scene.needs.textures {
        return Ok(0);
    }
    let name = f.text("name")?.unwrap_or_default();
    if let Some(file) = f.value("file").and_then(|v| v.read_lock::<Bytes>()) {
        let image = decode_image(&name, file.slice(), scene.needs, budget)?;
        return Ok(scene.builder.decoded_image(image).into());
    }
    let mut add = |width, height, pixels: &[u8]| {
        scene
            .builder
            .image(&name, width, height, pixels)
            .map(i64::from)
            .map_err(|e| native_error(e.to_string()))
    };
    let (Some(width), Some(height)) = (f.index("width")?, f.index("height")?) else {
        return Err(native_error(
            "image: give width, height and pixels, or file: the bytes of a PNG, JPEG or WebP",
        ));
    };
    match f.value("pixels").and_then(|v| v.read_lock::<Bytes>()) {
        Some(bytes) => add(width, height, bytes.slice()),
        None => {
            let values = f.numbers("pixels")?;
            let rounded: Vec<f64> = values.iter().map(|v| libm::round(*v)).collect();
            if let Some(at) = rounded.iter().position(|v| !(0.0..=255.0).contains(v)) {
                return Err(native_error(format!(
                    "image: pixels[{at}] is {}, must be from 0 to 255",
                    values[at]
                )));
            }
            add(width, height, &rounded.iter().map(|v| *v as u8).collect::<Vec<_>>())
        }
    }
}

/// Decodes a whole PNG, JPEG or WebP file. Its bytes are kept where `needs.image_files` asks for them, so that an export can
/// write the file unchanged.
fn decode_image(
    name: &str,
    file: &[u8],
    needs: ImportScope,
    budget: &Budget,
) -> Result<Arc<Image>, NativeError> {
    let image_error = |problem: Problem| native_error(format!("image: {}", problem.what));
    let encoded = Encoded::examine("image".into(), name.into(), file, Formats::Web).map_err(image_error)?;
    let kept = if needs.image_files { file.len() } else { 0 };
    budget.charge(4 * encoded.pixels() as usize + kept)?;
    encoded.decode_for(needs).map_err(image_error)
}

fn add_clip(scene: &SharedBuild, name: &str, curves: &Array) -> Result<(), NativeError> {
    let mut scene = lock_build(scene);
    if !scene.needs.clips {
        return Ok(());
    }
    let mut all = Vec::with_capacity(curves.len());
    // Files often have one list of times for all joints, which is then shared.
    let mut times: BTreeMap<Vec<Time>, Arc<[Time]>> = BTreeMap::new();
    for (i, value) in curves.iter().enumerate() {
        let what = format!("clip \"{name}\", curve {i}");
        let map = value.read_lock::<Map>();
        let map = map.ok_or_else(|| {
            native_error(format!("{what}: must be #{{ joint: …, path: …, times: …, values: … }}"))
        })?;
        let mut curve = read_curve(&what, &map)?;
        let key = curve.times.to_vec();
        curve.times = times.entry(key).or_insert(curve.times).clone();
        all.push(curve);
    }
    scene.builder.clip(name, all);
    Ok(())
}

fn read_curve(what: &str, map: &Map) -> fields::Result<Curve> {
    let f = Fields::new(what, map, &["joint", "path", "times", "values", "interpolation"])?;
    let interpolation = match f.text("interpolation")?.as_deref() {
        None | Some("linear") => Interpolation::Linear,
        Some("step") => Interpolation::Step,
        Some("cubic") => Interpolation::CubicSpline,
        Some(other) => {
            return Err(format!("{what}: interpolation is linear, step or cubic, not \"{other}\"").into());
        }
    };
    let joint = f.index("joint")?.ok_or_else(|| format!("{what}: joint is missing"))?;
    let seconds = f.numbers("times")?;
    if let Some(bad) = seconds.iter().find(|t| !(0.0..=1e6).contains(*t)) {
        return Err(format!("{what}: times are seconds from 0 to 1000000, got {bad}").into());
    }
    let times = seconds.iter().map(|t| Time::from_secs(*t)).collect();
    let values = f.floats("values")?;
    let path = match f.text("path")?.as_deref() {
        Some("translation") => Path::Translation,
        Some("rotation") => Path::Rotation,
        Some("scale") => Path::Scale,
        Some("weights") => {
            let tangents = if interpolation == Interpolation::CubicSpline { 3 } else { 1 };
            Path::Weights((values.len() / (tangents * seconds.len()).max(1)) as u32)
        }
        _ => {
            let paths = "\"translation\", \"rotation\", \"scale\" or \"weights\"";
            return Err(format!("{what}: path must be {paths}").into());
        }
    };
    Ok(Curve { joint, path, interpolation, times, values: values.into() })
}

/// The map of `file.needs`, for scripts with `if file.needs.geometry { … }`.
pub(crate) fn needs_map(needs: ImportScope) -> Map {
    let flag = |name: &str, on: bool| (name.into(), Dynamic::from(on));
    [flag("geometry", needs.geometry), flag("clips", needs.clips), flag("textures", needs.textures)].into()
}
