//! A scene of material layers: clearcoat, sheen, transmission, thin films, anisotropy and diffuse transmission, at many angles.

use super::*;

pub(crate) fn layered(layers: MaterialLayers, material: Material) -> Material {
    Material { layers: Some(Box::new(layers)), ..material }
}

/// A bent quad with uvs and tangents: 8 × 8 cells of a bulge.
pub(crate) fn bulge(size: f32) -> Primitive {
    let mut p = Primitive { material: Some(0), ..Primitive::default() };
    for j in 0..9u32 {
        for i in 0..9u32 {
            let (u, v) = (i as f32 / 8.0, j as f32 / 8.0);
            let (x, y) = (2.0 * u - 1.0, 1.0 - 2.0 * v);
            p.positions.push(Vec3::new(x, y, 1.0 - 0.5 * (x * x + y * y)) * size);
            p.normals.push(Vec3::new(x, y, 1.0).normalize());
            p.tangents.push(Vec3::new(1.0, 0.0, -x).normalize().extend(1.0));
            p.uvs[0].push(Vec2::new(u, v));
        }
    }
    for cell in 0..64u32 {
        let a = cell / 8 * 9 + cell % 8;
        p.indices.extend([a, a + 9, a + 1, a + 1, a + 9, a + 10]);
    }
    p
}

pub(crate) fn layered_scene() -> Scene {
    let mut scene = Scene::perspective(0.9, 6.0);
    scene.snapshot.background =
        Background::Gradient { top: Vec3::new(0.1, 0.3, 0.6), bottom: Vec3::new(0.6, 0.5, 0.4) };
    scene.snapshot.ambient_up = Vec3::new(0.3, 0.35, 0.4);
    scene.snapshot.ambient_down = Vec3::splat(0.1);
    scene.sun(Vec3::new(-0.3, -0.7, -0.6), Vec3::new(1.0, 0.9, 0.8), 0.9);
    scene.snapshot.lights.push(LightState {
        light: Light { kind: LightKind::Point, color: Vec3::ONE, intensity: 3.0, range: None },
        position: DVec3::new(1.0, 1.0, 3.0),
        direction: Vec3::NEG_Y,
        shadow: None,
        attenuation: None,
    });
    let map = image(16, 16, |x, y| [(x * 16) as u8, (y * 16) as u8, 255, (255 - x * 8) as u8]);
    let bumps = image(8, 8, |x, y| [(96 + x * 8) as u8, (96 + y * 8) as u8, 240, 255]);
    let texture = |on: bool, i: u32| on.then(|| texture(i));
    for i in 0..16 {
        let (row, textured) = (i / 4, i % 2 == 1);
        let coat = MaterialLayers {
            clearcoat: 1.0,
            clearcoat_roughness: 0.15 + 0.2 * (i % 4) as f32,
            clearcoat_texture: texture(textured, 0),
            clearcoat_roughness_texture: texture(textured, 0),
            clearcoat_normal_texture: texture(i == 3, 1),
            ..MaterialLayers::default()
        };
        let sheen = MaterialLayers {
            sheen_color: Vec3::new(0.9, 0.4, 0.2),
            sheen_roughness: 0.3 + 0.2 * (i % 4) as f32,
            sheen_color_texture: texture(textured, 0),
            sheen_roughness_texture: texture(textured, 0),
            ..MaterialLayers::default()
        };
        let glass = MaterialLayers {
            transmission: 1.0 - 0.2 * (i % 4) as f32,
            thickness: 0.4,
            // Two refract, one of them with dispersion.
            ior: if i % 2 == 0 { 1.0 } else { 1.5 },
            dispersion: if i == 11 { 4.0 } else { 0.0 },
            attenuation_distance: 0.5,
            attenuation_color: Vec3::new(0.3, 0.9, 0.5),
            transmission_texture: texture(textured, 0),
            thickness_texture: texture(textured, 0),
            clearcoat: if i == 11 { 0.5 } else { 0.0 },
            ..MaterialLayers::default()
        };
        let film = MaterialLayers {
            iridescence: 1.0,
            iridescence_thickness: [150.0, 600.0],
            iridescence_texture: texture(textured, 0),
            iridescence_thickness_texture: texture(textured, 0),
            ..MaterialLayers::default()
        };
        let thin = [
            film.clone(),
            MaterialLayers { anisotropy: 0.5, ..film },
            MaterialLayers {
                anisotropy: 0.9,
                anisotropy_rotation: 0.7,
                anisotropy_texture: texture(true, 1),
                ..MaterialLayers::default()
            },
            MaterialLayers {
                diffuse_transmission: 0.8,
                diffuse_transmission_color: Vec3::new(0.3, 0.9, 0.2),
                diffuse_transmission_texture: texture(true, 0),
                diffuse_transmission_color_texture: texture(true, 0),
                thickness: 0.2,
                attenuation_distance: 0.5,
                attenuation_color: Vec3::new(0.9, 0.5, 0.5),
                ..MaterialLayers::default()
            },
        ];
        let base = Material { roughness: 0.5, ..matte(Vec4::new(0.6, 0.3, 0.3, 1.0)) };
        let material = match row {
            0 => layered(coat, Material { normal_texture: texture(i == 2, 1), metallic: 0.5, ..base }),
            1 => layered(sheen, base),
            3 => layered(
                thin[i as usize - 12].clone(),
                Material { roughness: 0.3, double_sided: true, ..base },
            ),
            _ => {
                layered(glass, Material { roughness: 0.1 * (i % 4) as f32, double_sided: i % 3 == 0, ..base })
            }
        };
        let a = asset(vec![bulge(0.5)], vec![material], vec![map.clone(), bumps.clone()]);
        let turn = glam::DQuat::from_euler(
            glam::EulerRot::YXZ,
            (i % 4) as f64 * 0.4 - 0.6,
            row as f64 * 0.3 - 0.3,
            0.1,
        );
        let place = DVec3::new((i % 4) as f64 * 1.1 - 1.65, row as f64 * 1.1 - 1.1, 0.0);
        scene.add(&a, DAffine3::from_scale_rotation_translation(DVec3::splat(1.2), turn, place));
    }
    // A background mesh that the glass refracts.
    let striped = image(8, 1, |x, _| if x % 2 == 0 { [255, 255, 255, 255] } else { [20, 20, 20, 255] });
    let back = Material { base_color_texture: Some(super::texture(0)), ..unlit(Vec4::ONE) };
    scene.at(&asset(vec![quad(2.4, 0.6)], vec![back], vec![striped]), 0.0, 1.3, -0.8);
    scene
}
