//! Cameras and lights.

use crate::convert::vec3;
use crate::file::{File, place_of};
use crate::nodes::Tree;
use crate::value_conversion;
use choreo_asset::{AssetCamera, AssetLight, Light, LightKind, Projection};
use choreo_importer_kit::{Problem, Result};
use glam::{DVec3, Vec3};
use std::f64::consts::PI;
use ufbx::{Camera, LightDecay, LightType, Node, ProjectionMode};

/// Smallest distance of a near plane, metres.
const MIN_NEAR_M: f32 = 0.001;
/// Smallest outer angle of a spot light, radians: narrower spots light nothing.
const MIN_OUTER_RAD: f64 = 1e-4;
/// Lights are matched at their distance from the middle of the scene, but at least at this one, metres.
const MIN_REFERENCE_M: f64 = 1.0;

const PRODUCERS: [&str; 7] = [
    "Producer Perspective",
    "Producer Front",
    "Producer Back",
    "Producer Right",
    "Producer Left",
    "Producer Top",
    "Producer Bottom",
];

fn name(element: &ufbx::Element, node: &Node) -> String {
    let own = if element.name.is_empty() { &node.element.name } else { &element.name };
    own.to_string()
}

/// A camera or light of the file, with its index in the asset, which clips refer to.
pub(crate) struct Object<'a> {
    pub index: u32,
    pub camera: Option<&'a Camera>,
    pub light: Option<&'a ufbx::Light>,
    /// Factor of a light's intensity: lux or candela of intensity 1.
    pub intensity_unit: f64,
}

impl Object<'_> {
    pub(crate) fn element_id(&self) -> Option<u32> {
        let camera = self.camera.map(|c| c.element.element_id);
        camera.or(self.light.map(|l| l.element.element_id))
    }
}

pub(crate) fn cameras<'a>(
    file: &File<'a>,
    tree: &Tree,
    objects: &mut Vec<Object<'a>>,
) -> Result<Vec<AssetCamera>> {
    let mut out = Vec::new();
    for (joint, id) in &tree.holders {
        let Some(node) = file.scene.nodes.as_ref().get(*id) else { continue };
        // MotionBuilder writes the views of its window into every file.
        if PRODUCERS.contains(&node.element.name.as_ref()) {
            continue;
        }
        for camera in node.all_attribs.as_ref().iter().filter_map(|a| ufbx::as_camera(a)) {
            let projection = projection(camera)?;
            let index = out.len() as u32;
            objects.push(Object { index, camera: Some(camera), light: None, intensity_unit: 1.0 });
            out.push(AssetCamera { name: name(&camera.element, node), joint: *joint, projection });
        }
    }
    Ok(out)
}

fn projection(camera: &Camera) -> Result<Projection> {
    let fail = |what: &str| Problem::new(place_of(&camera.element), what);
    let (near, far) = (camera.near_plane as f32, camera.far_plane as f32);
    let near = if near.is_finite() { near.max(MIN_NEAR_M) } else { MIN_NEAR_M };
    let far = Some(far).filter(|f| f.is_finite() && *f > near);
    match camera.projection_mode {
        ProjectionMode::Perspective => {
            let (_, conversion, at) = value_conversion::of_camera(camera);
            let yfov = conversion.at(at).0 as f32;
            if !(yfov > 0.0 && f64::from(yfov) < PI) {
                return Err(fail("its field of view must be between 0° and 180°"));
            }
            Ok(Projection::Perspective { yfov, near, far })
        }
        ProjectionMode::Orthographic => {
            let height = camera.orthographic_size.y as f32;
            if !(height > 0.0 && height.is_finite()) {
                return Err(fail("its orthographic height must be above 0"));
            }
            Ok(Projection::Orthographic { height, near, far: far.unwrap_or(near + 1000.0) })
        }
    }
}

pub(crate) fn lights<'a>(
    file: &File<'a>,
    tree: &Tree,
    objects: &mut Vec<Object<'a>>,
) -> Result<Vec<AssetLight>> {
    let mut out = Vec::new();
    for (joint, id) in &tree.holders {
        let Some(node) = file.scene.nodes.as_ref().get(*id) else { continue };
        for light in node.all_attribs.as_ref().iter().filter_map(|a| ufbx::as_light(a)) {
            if !light.cast_light || !tree.visible[*joint as usize] {
                file.notes.warn(place_of(&node.element), "its light is off in the file and left out");
                continue;
            }
            let light_name = name(&light.element, node);
            let (read, unit) = read(file, node, light)?;
            objects.push(Object {
                index: out.len() as u32,
                camera: None,
                light: Some(light),
                intensity_unit: unit,
            });
            out.push(AssetLight { name: light_name, joint: *joint, light: read });
        }
    }
    Ok(out)
}

/// Reads a light, and the factor of its intensity.
fn read(file: &File<'_>, node: &Node, light: &ufbx::Light) -> Result<(Light, f64)> {
    let color = vec3(&light.color);
    let fail = |what: &str| Problem::new(place_of(&node.element), what);
    if !color.is_finite() || !light.intensity.is_finite() {
        return Err(fail("the color and intensity of its light must be finite"));
    }
    let kind = match light.type_ {
        LightType::Directional => LightKind::Directional,
        LightType::Point => LightKind::Point,
        LightType::Spot => {
            // The file has full angles in degrees; the asset has half angles in radians.
            let half = |degrees: f64| if degrees.is_finite() { degrees * (PI / 360.0) } else { PI / 4.0 };
            let outer = half(light.outer_angle).clamp(MIN_OUTER_RAD, PI / 2.0);
            let inner = half(light.inner_angle).clamp(0.0, outer * 0.9999);
            LightKind::Spot { inner: inner as f32, outer: outer as f32 }
        }
        LightType::Area | LightType::Volume => {
            let what = format!("is a light of kind {:?}, which becomes a point light here", light.type_);
            file.notes.warn(place_of(&node.element), what.to_lowercase());
            LightKind::Point
        }
    };
    let unit = intensity_unit(file, node, light, kind);
    let intensity = (light.intensity.max(0.0) * unit) as f32;
    let intensity = if intensity.is_finite() { intensity } else { f32::MAX.sqrt() };
    Ok((Light { kind, color: color.max(Vec3::ZERO), intensity, range: None }, unit))
}

/// Lux or candela of intensity 1. FBX defines no unit: intensity 1 makes a white surface white, at a distance of one unit if the
/// light decays. Blender writes W/m² and W, which its glTF exporter converts to lux and W/4π candela.
fn intensity_unit(file: &File<'_>, node: &Node, light: &ufbx::Light, kind: LightKind) -> f64 {
    let blender = file.is_from_blender();
    if kind == LightKind::Directional {
        return if blender { 1.0 } else { PI };
    }
    if blender {
        return 1.0 / (4.0 * PI);
    }
    let metres = file.scene.settings.unit_meters;
    let metres = if metres.is_finite() && metres > 0.0 { metres } else { 0.01 };
    // The renderer only has inverse-square decay. Other laws are matched to it in the middle of the scene.
    let at = distance_to_middle(file, node);
    let (law, units) = match light.decay {
        LightDecay::Quadratic => return PI * metres * metres,
        LightDecay::None => ("does not fade with the distance", 1.0),
        LightDecay::Linear => ("fades with the distance", metres / at),
        LightDecay::Cubic => {
            ("fades with the third power of the distance", (metres / at) * (metres / at) * (metres / at))
        }
    };
    let what = format!(
        "its light {law} in the file; here it fades with the square, and is equally bright at {at:.2} m, in the middle of the scene"
    );
    file.notes.warn(place_of(&node.element), what);
    PI * units * at * at
}

/// Distance from a light to the center of the bounding box of all nodes at rest, metres.
fn distance_to_middle(file: &File<'_>, node: &Node) -> f64 {
    let at = |n: &Node| DVec3::new(n.node_to_world.m03, n.node_to_world.m13, n.node_to_world.m23);
    let others = file
        .scene
        .nodes
        .as_ref()
        .iter()
        .map(|n| n.as_ref())
        .filter(|n: &&Node| !n.is_root && n.light.is_none() && n.camera.is_none());
    let none = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let (min, max) = others.map(at).filter(|p| p.is_finite()).fold(none, |(a, b), p| (a.min(p), b.max(p)));
    let middle = if min.x <= max.x { (min + max) * 0.5 } else { DVec3::ZERO };
    let distance = at(node).distance(middle);
    if distance.is_finite() { distance.max(MIN_REFERENCE_M) } else { MIN_REFERENCE_M }
}
