//! `joint`, `mesh`, `lines`, `points`, `material`, `image`, `clip`, `warn` and `read`: how an importer makes the asset.

use crate::budget::{Budget, Refused, refuse};
use crate::bytes::Bytes;
use crate::fields::{self, FieldError, Fields, MESH, mesh_data};
use choreo_asset::{AlphaMode, Material, Sampler, Shading, TextureRef, Topology};
use choreo_motion::{Curve, Interpolation, Path, Time, Transform};
use choreo_plugin::{AssetBuilder, ImportScope};
use glam::{Affine2, Mat4, Quat, Vec3, Vec4};
use rhai::{Array, Dynamic, Engine, Map};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, mpsc};

/// The asset that an import is building.
pub struct BuildInProgress {
    pub builder: AssetBuilder,
    pub needs: ImportScope,
    /// Channel on which a file beside the source is requested: another thread reads it.
    pub ask: mpsc::Sender<Request>,
}

/// A file's name, and where its bytes or the reason why not are awaited.
pub type Request = (String, mpsc::Sender<Result<Arc<Vec<u8>>, String>>);

pub type Shared = Arc<Mutex<BuildInProgress>>;

fn lock(scene: &Shared) -> MutexGuard<'_, BuildInProgress> {
    scene.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Most warnings kept; a loop over vertices must not fill the memory.
const MOST_WARNINGS: usize = 1000;

pub fn register(engine: &mut Engine, scene: &Shared, budget: &Budget) {
    let s = scene.clone();
    engine.register_fn("joint", move |name: &str| joint(&s, name, None, &Map::new()));
    let s = scene.clone();
    engine.register_fn("joint", move |name: &str, rest: Map| joint(&s, name, None, &rest));
    let s = scene.clone();
    engine.register_fn("joint", move |name: &str, parent: i64| joint(&s, name, Some(parent), &Map::new()));
    let s = scene.clone();
    engine
        .register_fn("joint", move |name: &str, parent: i64, rest: Map| joint(&s, name, Some(parent), &rest));
    for (name, topology) in
        [("mesh", Topology::Triangles), ("lines", Topology::Lines), ("points", Topology::Points)]
    {
        let s = scene.clone();
        engine.register_fn(name, move |map: Map| mesh(&s, name, topology, &map));
    }
    let s = scene.clone();
    engine.register_fn("material", move |map: Map| material(&s, &map));
    let (s, b) = (scene.clone(), budget.clone());
    engine.register_fn("image", move |map: Map| image(&s, &b, &map));
    let (s, b) = (scene.clone(), budget.clone());
    // The same words as in scene scripts.
    engine.register_fn("image", move |width: i64, height: i64, pixels: Dynamic| {
        let fields = [("width", width.into()), ("height", height.into()), ("pixels", pixels)];
        image(&s, &b, &fields.into_iter().map(|(name, value)| (name.into(), value)).collect())
    });
    let s = scene.clone();
    engine.register_fn("clip", move |name: &str, curves: Array| clip(&s, name, &curves));
    let s = scene.clone();
    engine.register_fn("warn", move |text: &str| warn(&s, "", text));
    let s = scene.clone();
    engine.register_fn("warn", move |place: &str, text: &str| warn(&s, place, text));
    let (s, b) = (scene.clone(), budget.clone());
    engine.register_fn("read", move |name: &str| {
        let (answer, answered) = mpsc::channel();
        let sent = lock(&s).ask.send((name.to_string(), answer));
        let gone = || refuse(format!("read: nobody reads \"{name}\""));
        sent.map_err(|_| gone())?;
        let bytes = answered.recv().map_err(|_| gone())?.map_err(refuse)?;
        b.take(bytes.len())?;
        Ok::<_, Refused>(Bytes::new(bytes, &b))
    });
}

fn warn(scene: &Shared, place: &str, text: &str) {
    let mut scene = lock(scene);
    if scene.builder.warnings() < MOST_WARNINGS {
        scene.builder.warn(place, text);
    }
}

fn joint(scene: &Shared, name: &str, parent: Option<i64>, map: &Map) -> Result<i64, Refused> {
    let parent = match parent {
        // The -1 that many formats write for a root.
        None | Some(-1) => None,
        Some(p) => {
            Some(u32::try_from(p).map_err(|_| refuse(format!("joint \"{name}\": no joint has number {p}")))?)
        }
    };
    let mut scene = lock(scene);
    if scene.builder.joints().len() >= crate::engine::MOST_IN_ARRAY {
        return Err(refuse(format!("too many joints, at most {}", crate::engine::MOST_IN_ARRAY)));
    }
    let rest = rest(&format!("joint \"{name}\""), map)?;
    scene.builder.joint(name, parent, rest).map(i64::from).map_err(|e| refuse(e.to_string()))
}

fn rest(what: &str, map: &Map) -> fields::Result<Transform> {
    let f = Fields::new(what, map, &["translation", "rotation", "scale", "matrix"])?;
    if let Some(matrix) = f.vector::<16>("matrix")? {
        let matrix = Mat4::from_cols_array(&matrix);
        if !(matrix.is_finite() && matrix.determinant() != 0.0) {
            return Err(format!("{what}: the matrix has no inverse").into());
        }
        return Ok(Transform::from_matrix(matrix));
    }
    Ok(Transform {
        translation: f.vector("translation")?.map_or(Vec3::ZERO, Vec3::from_array),
        rotation: f.vector("rotation")?.map_or(Quat::IDENTITY, Quat::from_array),
        scale: f.vector("scale")?.map_or(Vec3::ONE, Vec3::from_array),
    })
}

/// Returns the mesh's number; nothing is read of the arrays where the caller needs no geometry.
fn mesh(scene: &Shared, name: &str, topology: Topology, map: &Map) -> Result<i64, Refused> {
    let f = Fields::new(name, map, MESH)?;
    let mut scene = lock(scene);
    if !scene.needs.geometry {
        return Ok(-1);
    }
    let data = mesh_data(&f, topology)?;
    scene.builder.mesh(data).map(i64::from).map_err(|e| refuse(e.to_string()))
}

fn material(scene: &Shared, map: &Map) -> Result<i64, Refused> {
    let mut scene = lock(scene);
    let material = read_material(map, scene.needs.textures)?;
    scene.builder.material(material).map(i64::from).map_err(|e| refuse(e.to_string()))
}

fn read_material(map: &Map, textures: bool) -> fields::Result<Material> {
    let known = [
        "name",
        "color",
        "image",
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
    let color = match f.value("color") {
        None => Vec4::ONE,
        Some(_) => match f.floats("color")?.as_slice() {
            [r, g, b] => Vec4::new(*r, *g, *b, 1.0),
            [r, g, b, a] => Vec4::new(*r, *g, *b, *a),
            other => {
                return Err(format!("material: color must be 3 or 4 numbers, got {}", other.len()).into());
            }
        },
    };
    let mut material = Material {
        name: f.text("name")?.unwrap_or_default(),
        base_color: color,
        metallic: number("metallic", 0.0, 1.0)?,
        roughness: number("roughness", 0.9, 1.0)?,
        emissive: f.vector("emissive")?.map_or(Vec3::ZERO, Vec3::from_array),
        double_sided: f.flag("double_sided")?.unwrap_or(false),
        ..Material::default()
    };
    if !material.base_color.is_finite() || !material.emissive.is_finite() {
        return Err("material: colors must be finite".into());
    }
    if f.number("shininess")?.is_some() {
        material.shading = Shading::BlinnPhong;
        material.shininess = number("shininess", 32.0, 10_000.0)?;
        material.specular_color = f.vector("specular")?.map_or(Vec3::splat(0.04), Vec3::from_array);
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
    if let (Some(image), true) = (f.index("image")?, textures) {
        let sampler = Sampler::default();
        material.base_color_texture =
            Some(TextureRef { image, sampler, uv_set: 0, uv_transform: Affine2::IDENTITY });
    }
    Ok(material)
}

/// Pixels as bytes or numbers from 0 to 255, or a whole PNG, JPEG or WebP file.
fn image(scene: &Shared, budget: &Budget, map: &Map) -> Result<i64, Refused> {
    let f = Fields::new("image", map, &["name", "width", "height", "pixels", "file"])?;
    let mut scene = lock(scene);
    if !scene.needs.textures {
        return Ok(0);
    }
    let name = f.text("name")?.unwrap_or_default();
    let (width, height, pixels) = match f.value("file").and_then(|v| v.read_lock::<Bytes>()) {
        Some(file) => decode(file.slice(), budget).map_err(|e| refuse(format!("image \"{name}\": {e}")))?,
        None => {
            let (width, height) = (f.index("width")?, f.index("height")?);
            let (Some(width), Some(height)) = (width, height) else {
                return Err(refuse(
                    "image: give width, height and pixels, or file: the bytes of a PNG, JPEG or WebP",
                ));
            };
            let pixels = match f.value("pixels").and_then(|v| v.read_lock::<Bytes>()) {
                Some(bytes) => bytes.slice().to_vec(),
                None => f.numbers("pixels")?.iter().map(|v| libm::round(*v) as u8).collect(),
            };
            (width, height, pixels)
        }
    };
    scene.builder.image(&name, width, height, &pixels).map(i64::from).map_err(|e| refuse(e.to_string()))
}

fn decode(file: &[u8], budget: &Budget) -> Result<(u32, u32, Vec<u8>), Box<dyn std::error::Error>> {
    let mut reader = image::ImageReader::new(std::io::Cursor::new(file)).with_guessed_format()?;
    let mut limits = image::Limits::default();
    limits.max_image_width = Some(16_384);
    limits.max_image_height = Some(16_384);
    limits.max_alloc = Some(512 << 20);
    reader.limits(limits);
    let rgba = reader.decode()?.into_rgba8();
    // The decoder's own limit bounds what is taken before this is counted.
    budget.take(rgba.as_raw().len())?;
    Ok((rgba.width(), rgba.height(), rgba.into_raw()))
}

fn clip(scene: &Shared, name: &str, curves: &Array) -> Result<(), Refused> {
    let mut scene = lock(scene);
    if !scene.needs.clips {
        return Ok(());
    }
    let mut all = Vec::with_capacity(curves.len());
    // Files often have one list of times for all joints: it is kept once.
    let mut times: BTreeMap<Vec<Time>, Arc<[Time]>> = BTreeMap::new();
    for (i, value) in curves.iter().enumerate() {
        let what = format!("clip \"{name}\", curve {i}");
        let map = value.read_lock::<Map>();
        let map = map.ok_or_else(|| {
            refuse(format!("{what}: must be #{{ joint: …, path: …, times: …, values: … }}"))
        })?;
        let mut curve = curve(&what, &map)?;
        let key = curve.times.to_vec();
        curve.times = times.entry(key).or_insert(curve.times).clone();
        all.push(curve);
    }
    scene.builder.clip(name, all);
    Ok(())
}

fn curve(what: &str, map: &Map) -> fields::Result<Curve> {
    let f = Fields::new(what, map, &["joint", "path", "times", "values", "interpolation"])?;
    let path = match f.text("path")?.as_deref() {
        Some("translation") => Path::Translation,
        Some("rotation") => Path::Rotation,
        Some("scale") => Path::Scale,
        _ => return Err(format!("{what}: path must be \"translation\", \"rotation\" or \"scale\"").into()),
    };
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
    Ok(Curve { joint, path, interpolation, times, values: f.floats("values")?.into() })
}

/// The map of `file.needs`, for scripts with `if file.needs.geometry { … }`.
pub fn needs_map(needs: ImportScope) -> Map {
    let flag = |name: &str, on: bool| (name.into(), Dynamic::from(on));
    [flag("geometry", needs.geometry), flag("clips", needs.clips), flag("textures", needs.textures)].into()
}
