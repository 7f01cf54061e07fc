//! Solids become nodes with meshes, in metres and +Y up.

use crate::Solid;
use choreo_asset::{Asset, Material, Origin, Primitive};
use choreo_importer_kit::text::count;
use choreo_importer_kit::{Notes, Problem, Result, parts, smooth};
use choreo_plugin::{ImportOptions, ImportScope, Source};
use glam::{DVec3, Vec3, Vec4};

/// Extent in the file's units from which on the unit is taken as millimetres, as in programs for machining and 3D printing. Few
/// things are 10 m long, and few of 10 mm are stored in metres.
const MILLIMETRES_FROM: f32 = 10.0;

pub(crate) fn asset(
    source: &Source,
    solids: Vec<Solid>,
    format: &str,
    needs: ImportScope,
    options: &ImportOptions,
    notes: Notes,
) -> Result<Asset> {
    let up_z = options.text("up") != Some("y");
    let scale = match options.number("scale").filter(|s| *s > 0.0) {
        Some(scale) => scale,
        None if needs.geometry => guess(&solids, &notes),
        None => 1.0,
    };
    let mut asset = Asset {
        name: source.name.clone(),
        origin: Origin {
            format: format.into(),
            metres_per_unit: needs.geometry.then_some(scale),
            unit_is_assumed: true,
            up: if up_z { "+Z" } else { "+Y" }.into(),
            ..Origin::default()
        },
        ..Asset::default()
    };
    let names: Vec<String> = solids.iter().map(|s| s.name.clone()).collect();
    let first = parts::add_joints(&mut asset, "solid", &names)?;
    let smooth = options.number("smooth").unwrap_or(0.0);
    for (joint, solid) in (first..).zip(solids).filter(|_| needs.geometry) {
        let name = asset.skeleton.names()[joint as usize].clone();
        if solid.positions.is_empty() {
            notes.warn(format!("solid \"{name}\""), "has no triangles");
            continue;
        }
        let primitive = primitive(solid, &name, scale, up_z, smooth, &notes)?;
        parts::add_mesh(&mut asset, joint, vec![primitive]);
    }
    if !asset.meshes.is_empty() {
        asset.materials.push(Material {
            name: "facets".into(),
            base_color: Vec4::new(0.6, 0.6, 0.6, 1.0),
            metallic: 0.0,
            roughness: 0.7,
            // Many solids mix both windings.
            double_sided: true,
            ..Material::default()
        });
        let colored = asset.meshes.iter().any(|m| m.primitives.iter().any(|p| !p.colors.is_empty()));
        if colored {
            asset.materials[0].base_color = Vec4::ONE;
        }
    }
    asset.warnings = notes.into_warnings();
    Ok(asset)
}

fn guess(solids: &[Solid], notes: &Notes) -> f64 {
    let all = || solids.iter().flat_map(|s| &s.positions);
    let min = all().fold(Vec3::INFINITY, |m, p| m.min(*p));
    let size = all().fold(Vec3::NEG_INFINITY, |m, p| m.max(*p)) - min;
    let size = size.max_element().max(0.0);
    let (scale, name) = if size >= MILLIMETRES_FROM { (0.001, "1 mm") } else { (1.0, "1 m") };
    notes.warn(
        "solid",
        format!(
            "the format has no unit; taken as {name} by its extent of {size} (option scale: metres a unit)"
        ),
    );
    scale
}

fn primitive(
    solid: Solid,
    name: &str,
    scale: f64,
    up_z: bool,
    smooth_degrees: f64,
    notes: &Notes,
) -> Result<Primitive> {
    // +Z up to +Y up: x stays, z becomes y, y becomes −z.
    let turned = |v: Vec3| if up_z { Vec3::new(v.x, v.z, -v.y) } else { v };
    let mut positions = solid.positions;
    for p in &mut positions {
        *p = (turned(*p).as_dvec3() * scale).as_vec3();
    }
    if positions.iter().any(|p| !p.is_finite()) {
        let what = format!("is too big: its vertices times the scale of {scale} m are not finite");
        return Err(Problem::new(format!("solid \"{name}\""), what));
    }
    let (mut against, mut without_area) = (0, 0);
    let mut normals = Vec::with_capacity(positions.len());
    for (vertices, of_file) in positions.chunks_exact(3).zip(&solid.normals) {
        let [a, b, c] = [vertices[0], vertices[1], vertices[2]].map(|v| v.as_dvec3());
        let of_file = turned(*of_file);
        // The winding decides, because the stored normal often is zero or out of date.
        let normal = match (b - a).cross(c - a).try_normalize() {
            Some(n) => {
                against += usize::from(n.dot(of_file.as_dvec3()) < -0.1);
                n.as_vec3().normalize_or(Vec3::Y)
            }
            None => {
                without_area += 1;
                of_file.as_dvec3().normalize_or(DVec3::Y).as_vec3().normalize_or(Vec3::Y)
            }
        };
        normals.extend([normal; 3]);
    }
    let place = || format!("solid \"{name}\"");
    if against > 0 {
        notes.warn(
            place(),
            format!(
                "{against} of {} facets with a normal against the order of their vertices; the order is used",
                normals.len() / 3
            ),
        );
    }
    if without_area > 0 {
        notes.warn(place(), format!("{} without area", count(without_area, "facet")));
    }
    let colors = solid.colors.iter().flat_map(|c| [linear(*c); 3]).collect();
    let mut out = Primitive {
        indices: (0..positions.len() as u32).collect(),
        positions,
        normals,
        colors,
        material: Some(0),
        ..Primitive::default()
    };
    if smooth_degrees > 0.0 {
        smooth::normals(&mut out, smooth_degrees.to_radians(), None);
    }
    Ok(out)
}

/// Converts sRGB bytes to linear color.
fn linear(rgb: [u8; 3]) -> Vec4 {
    let [r, g, b] = rgb.map(|c| choreo_importer_kit::color::linear_from_srgb(f32::from(c) / 255.0));
    Vec4::new(r, g, b, 1.0)
}
