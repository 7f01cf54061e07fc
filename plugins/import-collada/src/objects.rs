//! Cameras and lights.

use crate::nodes::Tree;
use crate::xml::Node;
use crate::xml::{LEFT_OUT, Xml, child, children, descendant, label_of, name_of};
use choreo_asset::{AssetCamera, AssetLight, Light, LightKind, Projection};
use choreo_importer_kit::Result;
use choreo_importer_kit::text::{number, shown};
use glam::Vec3;
use std::f64::consts::PI;

/// Distance in metres at which a light's own attenuation and the renderer's inverse square are made equal.
const EQUAL_AT: f64 = 5.0;

pub fn cameras(xml: &Xml<'_>, tree: &Tree<'_>) -> Result<Vec<AssetCamera>> {
    let mut out = Vec::new();
    for (joint, node) in (0u32..).zip(tree.joints.iter().map(|j| j.node)) {
        for instance in children(node, "instance_camera") {
            let Some(camera) = xml.instanced(instance, "url", "camera", LEFT_OUT) else { continue };
            let technique = child(camera, "optics").and_then(|o| child(o, "technique_common"));
            let Some(lens) = technique.and_then(|t| t.first_element_child()) else {
                xml.warn(camera, "has no optics; it is left out");
                continue;
            };
            let metres = tree.convention.metres;
            let value = |name| xml.child_number(lens, name);
            let near = value("znear")?.filter(|v| *v > 0.0).map_or(0.05, |v| v * metres);
            let far = value("zfar")?.map(|v| v * metres).filter(|f| *f > near && f.is_finite());
            let aspect = value("aspect_ratio")?.filter(|a| *a > 0.0);
            let from_width = |width: f64, height_of: &dyn Fn(f64, f64) -> f64| -> f64 {
                let aspect = aspect.unwrap_or_else(|| {
                    xml.warn(lens, "gives its width without an aspect ratio; 16:9 is used");
                    16.0 / 9.0
                });
                height_of(width, aspect)
            };
            let projection = match name_of(lens) {
                "perspective" => {
                    let wide = |x: f64, aspect: f64| 2.0 * libm::atan(libm::tan(x / 2.0) / aspect);
                    let yfov = match (value("yfov")?, value("xfov")?) {
                        (Some(y), _) => y.to_radians(),
                        (None, Some(x)) => from_width(x.to_radians(), &wide),
                        (None, None) => {
                            xml.warn(lens, "has neither xfov nor yfov; 40 degrees are used");
                            40f64.to_radians()
                        }
                    };
                    if !(yfov > 0.0 && yfov < PI) {
                        xml.warn(
                            lens,
                            format!(
                                "sees {:.1} degrees, which no lens does; it is left out",
                                yfov.to_degrees()
                            ),
                        );
                        continue;
                    }
                    Projection::Perspective {
                        yfov: yfov as f32,
                        near: near as f32,
                        far: far.map(|f| f as f32),
                    }
                }
                "orthographic" => {
                    // Magnifications are half the extents.
                    let height = match (value("ymag")?, value("xmag")?) {
                        (Some(y), _) => 2.0 * y,
                        (None, Some(x)) => from_width(2.0 * x, &|w, aspect| w / aspect),
                        (None, None) => 2.0,
                    };
                    let height = height * metres;
                    if !(height > 0.0 && height.is_finite()) {
                        xml.warn(lens, "has no height; it is left out");
                        continue;
                    }
                    Projection::Orthographic {
                        height: height as f32,
                        near: near as f32,
                        far: far.unwrap_or(near + 1000.0) as f32,
                    }
                }
                other => {
                    xml.warn(lens, format!("is {other}, which is not supported; it is left out"));
                    continue;
                }
            };
            out.push(AssetCamera { name: name(camera), joint, projection });
        }
    }
    Ok(out)
}

/// A directional light of color 1 makes a white surface white: π lux. Other lights fall off with their attenuation, which becomes an
/// inverse square that is equal at five metres.
pub fn lights(xml: &Xml<'_>, tree: &Tree<'_>) -> Result<Vec<AssetLight>> {
    let mut out = Vec::new();
    for (joint, node) in (0u32..).zip(tree.joints.iter().map(|j| j.node)) {
        for instance in children(node, "instance_light") {
            let Some(light) = xml.instanced(instance, "url", "light", LEFT_OUT) else { continue };
            let Some(kind) = child(light, "technique_common").and_then(|t| t.first_element_child()) else {
                xml.warn(light, "has no technique_common; it is left out");
                continue;
            };
            let value = |name, default: f64| Result::Ok(xml.child_number(kind, name)?.unwrap_or(default));
            let color = match child(kind, "color") {
                Some(c) => Vec3::from(xml.array::<3>(c)?.map(|v| v.max(0.0) as f32)),
                None => Vec3::ONE,
            };
            let strength = f64::from(color.max_element()).max(1.0);
            let (constant, along, squared) = (
                value("constant_attenuation", 1.0)?,
                value("linear_attenuation", 0.0)?,
                value("quadratic_attenuation", 0.0)?,
            );
            let at = |d: f64| (constant + along * d + squared * d * d).max(1e-6);
            let d = EQUAL_AT / tree.convention.metres;
            let candela = PI * EQUAL_AT * EQUAL_AT / at(d) * strength;
            let (kind_of, intensity) = match name_of(kind) {
                "directional" => (LightKind::Directional, PI * strength),
                "point" => (LightKind::Point, candela),
                "spot" => {
                    // The full angle; the exponent makes a soft edge of it.
                    let outer = (value("falloff_angle", 180.0)?.to_radians() / 2.0).clamp(0.001, PI / 2.0);
                    let soft = if value("falloff_exponent", 0.0)? > 0.0 { 0.5 } else { 0.98 };
                    (LightKind::Spot { inner: (outer * soft) as f32, outer: outer as f32 }, candela)
                }
                "ambient" => {
                    xml.warn(light, "ambient light is not part of a scene here; it is left out");
                    continue;
                }
                other => {
                    xml.warn(light, format!("is {other}, which is not supported; it is left out"));
                    continue;
                }
            };
            if !matches!(kind_of, LightKind::Directional) && (along != 0.0 || constant != 0.0) {
                xml.warn(light, "its attenuation becomes an inverse square, equal at 5 m");
            }
            let light_of = Light {
                kind: kind_of,
                color: color / strength as f32,
                intensity: intensity as f32,
                range: None,
            };
            if !light_of.intensity.is_finite() {
                return Err(xml.problem(light, "its color is not finite"));
            }
            out.push(AssetLight { name: name(light), joint, light: light_of });
        }
    }
    Ok(out)
}

fn name(node: Node<'_>) -> String {
    label_of(node).unwrap_or(name_of(node)).to_string()
}

/// Metres a unit, and the upward axis as written.
pub fn convention(xml: &Xml<'_>) -> (f64, &'static str) {
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

/// The number in `meter`; some programs write the decimal comma of their user's language.
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
