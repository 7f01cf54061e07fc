//! Cameras and lights.

use crate::nodes::Tree;
use crate::xml::Node;
use crate::xml::{LEFT_OUT, Xml, child, children, descendant, label_of, name_of};
use choreo_asset::{AssetCamera, AssetLight, Light, LightKind, Projection};
use choreo_importer_kit::Result;
use choreo_importer_kit::text::{number, shown};
use glam::Vec3;
use std::collections::BTreeMap;
use std::f64::consts::PI;

/// Aspect ratio (width over height) where the file states none.
const DEFAULT_ASPECT: f64 = 16.0 / 9.0;

/// Distance in metres at which the renderer's inverse-square falloff equals the file's attenuation.
const EQUAL_AT: f64 = 5.0;

/// A camera or light of the asset, with the file's element that it instances.
pub(crate) struct Object<'a, T> {
    pub element: Node<'a>,
    /// The element that holds the numbers: the lens of a camera, or the light type.
    pub numbers_of: Node<'a>,
    pub object: T,
}

/// Numbers of a lens or light by element name; a color is stored as `r`, `g` and `b`.
#[derive(Clone, Debug, Default)]
pub(crate) struct Numbers(BTreeMap<&'static str, f64>);

/// Names of all numbers except those of colors.
const NAMES: [&str; 12] = [
    "xfov",
    "yfov",
    "xmag",
    "ymag",
    "aspect_ratio",
    "znear",
    "zfar",
    "constant_attenuation",
    "linear_attenuation",
    "quadratic_attenuation",
    "falloff_angle",
    "falloff_exponent",
];

impl Numbers {
    pub(crate) fn read(xml: &Xml<'_>, parent: Node<'_>) -> Result<Numbers> {
        let mut out = Numbers::default();
        for name in NAMES {
            if let Some(number) = xml.child_number(parent, name)? {
                out.0.insert(name, number);
            }
        }
        if let Some(color) = child(parent, "color") {
            out.0.extend(["r", "g", "b"].into_iter().zip(xml.array::<3>(color)?));
        }
        Ok(out)
    }

    pub(crate) fn get(&self, name: &str) -> Option<f64> {
        self.0.get(name).copied()
    }

    /// Sets a number; false where no number has this name.
    pub(crate) fn set(&mut self, name: &str, number: f64) -> bool {
        let known = NAMES.iter().chain(&["r", "g", "b"]).find(|known| **known == name);
        known.is_some_and(|known| {
            self.0.insert(*known, number);
            true
        })
    }

    /// The aspect ratio (width over height).
    fn aspect(&self) -> Option<f64> {
        self.get("aspect_ratio").filter(|a| *a > 0.0)
    }

    /// The full vertical angle of a perspective lens, radians.
    pub(crate) fn angle(&self) -> Option<f64> {
        let across = |x: f64| {
            2.0 * libm::atan(libm::tan(x.to_radians() / 2.0) / self.aspect().unwrap_or(DEFAULT_ASPECT))
        };
        self.get("yfov").map(f64::to_radians).or_else(|| self.get("xfov").map(across))
    }

    /// The full height of an orthographic view, in the file's units: magnifications are half extents.
    pub(crate) fn height(&self) -> f64 {
        let across = |x: f64| 2.0 * x / self.aspect().unwrap_or(DEFAULT_ASPECT);
        self.get("ymag").map(|y| 2.0 * y).or_else(|| self.get("xmag").map(across)).unwrap_or(2.0)
    }

    /// A light of the given type; `None` for unsupported types. A directional light of color 1 makes a white surface white: π lux. Other
    /// lights get an inverse-square falloff that equals their attenuation at five metres.
    pub(crate) fn light(&self, kind: &str, metres: f64) -> Option<Light> {
        let value = |name, default: f64| self.get(name).unwrap_or(default);
        let color = Vec3::from(["r", "g", "b"].map(|name| value(name, 1.0).max(0.0) as f32));
        let strength = f64::from(color.max_element()).max(1.0);
        let at = |d: f64| {
            let squared = value("quadratic_attenuation", 0.0) * d * d;
            (value("constant_attenuation", 1.0) + value("linear_attenuation", 0.0) * d + squared).max(1e-6)
        };
        let candela = PI * EQUAL_AT * EQUAL_AT / at(EQUAL_AT / metres) * strength;
        let (kind, intensity) = match kind {
            "directional" => (LightKind::Directional, PI * strength),
            "point" => (LightKind::Point, candela),
            "spot" => {
                // The file has the full angle. Any falloff exponent becomes a soft edge.
                let outer = (value("falloff_angle", 180.0).to_radians() / 2.0).clamp(0.001, PI / 2.0);
                let soft = if value("falloff_exponent", 0.0) > 0.0 { 0.5 } else { 0.98 };
                (LightKind::Spot { inner: (outer * soft) as f32, outer: outer as f32 }, candela)
            }
            _ => return None,
        };
        Some(Light { kind, color: color / strength as f32, intensity: intensity as f32, range: None })
    }
}

pub(crate) fn cameras<'a>(xml: &Xml<'a>, tree: &Tree<'a>) -> Result<Vec<Object<'a, AssetCamera>>> {
    let mut out = Vec::new();
    for (joint, node) in (0u32..).zip(tree.joints.iter().map(|j| j.node)) {
        for instance in children(node, "instance_camera") {
            let Some(camera) = xml.resolve_instance(instance, "url", "camera", LEFT_OUT) else { continue };
            let technique = child(camera, "optics").and_then(|o| child(o, "technique_common"));
            let Some(lens) = technique.and_then(|t| t.first_element_child()) else {
                xml.warn(camera, "has no optics; it is left out");
                continue;
            };
            let Some(projection) = projection(xml, lens, tree.convention.metres)? else { continue };
            let object = AssetCamera { name: name(camera), joint, projection };
            out.push(Object { element: camera, numbers_of: lens, object });
        }
    }
    Ok(out)
}

/// The projection of a lens; `None`, with a warning, where it cannot be used.
fn projection(xml: &Xml<'_>, lens: Node<'_>, metres: f64) -> Result<Option<Projection>> {
    let numbers = Numbers::read(xml, lens)?;
    let near = numbers.get("znear").filter(|v| *v > 0.0).map_or(0.05, |v| v * metres);
    let far = numbers.get("zfar").map(|v| v * metres).filter(|f| *f > near && f.is_finite());
    let [high, wide] = if name_of(lens) == "orthographic" { ["ymag", "xmag"] } else { ["yfov", "xfov"] };
    if numbers.get(high).is_none() && numbers.get(wide).is_some() && numbers.aspect().is_none() {
        xml.warn(lens, "gives its width without an aspect ratio; 16:9 is used");
    }
    Ok(match name_of(lens) {
        "perspective" => {
            let yfov = numbers.angle().unwrap_or_else(|| {
                xml.warn(lens, "has neither xfov nor yfov; 40 degrees are used");
                40f64.to_radians()
            });
            if !(yfov > 0.0 && yfov < PI) {
                let degrees = yfov.to_degrees();
                xml.warn(
                    lens,
                    format!("has a field of view of {degrees:.1} degrees, which no lens has; it is left out"),
                );
                return Ok(None);
            }
            let (near, far) = (near as f32, far.map(|f| f as f32));
            Some(Projection::Perspective { yfov: yfov as f32, near, far })
        }
        "orthographic" => {
            let height = numbers.height() * metres;
            if !(height > 0.0 && height.is_finite()) {
                xml.warn(lens, "has no height; it is left out");
                return Ok(None);
            }
            let far = far.unwrap_or(near + 1000.0) as f32;
            Some(Projection::Orthographic { height: height as f32, near: near as f32, far })
        }
        other => {
            xml.warn(lens, format!("is {other}, which is not supported; it is left out"));
            None
        }
    })
}

pub(crate) fn lights<'a>(xml: &Xml<'a>, tree: &Tree<'a>) -> Result<Vec<Object<'a, AssetLight>>> {
    let mut out = Vec::new();
    for (joint, node) in (0u32..).zip(tree.joints.iter().map(|j| j.node)) {
        for instance in children(node, "instance_light") {
            let Some(light) = xml.resolve_instance(instance, "url", "light", LEFT_OUT) else { continue };
            let Some(kind) = child(light, "technique_common").and_then(|t| t.first_element_child()) else {
                xml.warn(light, "has no technique_common; it is left out");
                continue;
            };
            let numbers = Numbers::read(xml, kind)?;
            let Some(of) = numbers.light(name_of(kind), tree.convention.metres) else {
                xml.warn(
                    light,
                    match name_of(kind) {
                        "ambient" => "ambient light of files is not supported; it is left out".to_string(),
                        other => format!("is {other}, which is not supported; it is left out"),
                    },
                );
                continue;
            };
            let fades = |name: &str, default: f64| numbers.get(name).unwrap_or(default) != 0.0;
            if !of.kind.is_directional()
                && (fades("linear_attenuation", 0.0) || fades("constant_attenuation", 1.0))
            {
                xml.warn(light, "its attenuation becomes an inverse square, equal at 5 m");
            }
            if !of.intensity.is_finite() {
                return Err(xml.problem(light, "its color is not finite"));
            }
            let object = AssetLight { name: name(light), joint, light: of };
            out.push(Object { element: light, numbers_of: kind, object });
        }
    }
    Ok(out)
}

fn name(node: Node<'_>) -> String {
    label_of(node).unwrap_or(name_of(node)).to_string()
}

/// Metres in a unit, and the upward axis.
pub(crate) fn convention(xml: &Xml<'_>) -> (f64, &'static str) {
    let asset = child(xml.root(), "asset");
    let unit = asset.and_then(|a| child(a, "unit"));
    let metres = unit.map_or(1.0, |unit| metres(xml, unit));
    let up = match asset.and_then(|a| descendant(a, "up_axis")).map(crate::xml::text_of) {
        Some("X_UP") => "+X",
        Some("Z_UP") => "+Z",
        Some("Y_UP") | None => "+Y",
        Some(other) => {
            xml.notes.warn("asset/up_axis", format!("\"{other}\" is not an axis; Y_UP is used"));
            "+Y"
        }
    };
    (metres, up)
}

/// The attribute `meter`. Some programs write it with a decimal comma.
fn metres(xml: &Xml<'_>, unit: Node<'_>) -> f64 {
    let Some(text) = unit.attribute("meter").map(str::trim) else { return 1.0 };
    let value = |text: &str| number(text.as_bytes()).filter(|v| (1e-6..=1e6).contains(v));
    value(text).unwrap_or_else(|| {
        let (written, fallback) = (shown(text.as_bytes()), value(&text.replacen(',', ".", 1)));
        match fallback {
            Some(v) => xml.warn(unit, format!("meter=\"{written}\" has a decimal comma; {v} is used")),
            None => {
                let what = format!("meter=\"{written}\" is not a number from 0.000001 to 1000000; 1 is used");
                xml.warn(unit, what);
            }
        }
        fallback.unwrap_or(1.0)
    })
}
