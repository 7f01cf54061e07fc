//! Procedural environment map of a photo studio: soft boxes in a gray room.

use super::Panorama;
use glam::{DVec3, Vec3};
use std::sync::{Arc, OnceLock};

/// An emissive rectangle, as seen from the center of the room.
struct SoftBox {
    /// Direction of the center, degrees: azimuth counter-clockwise from above, 0 along −Z, and elevation.
    azimuth: f64,
    elevation: f64,
    /// Half width and half height, degrees.
    half: [f64; 2],
    radiance: f64,
    color: Vec3,
}

/// Lights for a subject that faces +Z (azimuth 180): a large warm key light, left of a camera in front of it; a cool fill light
/// on the other side; two strips behind for rim light; and a sheet overhead.
const SOFT_BOXES: [SoftBox; 5] = [
    SoftBox {
        azimuth: 138.0,
        elevation: 38.0,
        half: [24.0, 19.0],
        radiance: 6.0,
        color: Vec3::new(1.0, 0.95, 0.88),
    },
    SoftBox {
        azimuth: 242.0,
        elevation: 18.0,
        half: [17.0, 27.0],
        radiance: 2.2,
        color: Vec3::new(0.86, 0.93, 1.0),
    },
    SoftBox {
        azimuth: 318.0,
        elevation: 24.0,
        half: [6.0, 34.0],
        radiance: 6.0,
        color: Vec3::new(0.92, 0.96, 1.0),
    },
    SoftBox {
        azimuth: 40.0,
        elevation: 24.0,
        half: [6.0, 34.0],
        radiance: 5.0,
        color: Vec3::new(1.0, 0.97, 0.93),
    },
    SoftBox { azimuth: 180.0, elevation: 82.0, half: [26.0, 14.0], radiance: 1.6, color: Vec3::ONE },
];

/// How far the edge of a box is blurred, degrees.
const EDGE_BLUR_DEGREES: f64 = 3.0;

fn smoothstep(low: f64, high: f64, x: f64) -> f64 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// Unit direction from azimuth (counter-clockwise from above, 0 along −Z) and elevation in degrees.
fn direction_from_angles(azimuth: f64, elevation: f64) -> DVec3 {
    let (a, e) = (azimuth.to_radians(), elevation.to_radians());
    DVec3::new(-libm::sin(a) * libm::cos(e), libm::sin(e), -libm::cos(a) * libm::cos(e))
}

/// Radiance of the room in a direction with the y component `up`: a dark floor, a bright horizon, gray above.
fn room_radiance(up: f64) -> Vec3 {
    let floor = 0.12 + 0.10 * smoothstep(-1.0, -0.1, up);
    let wall = 0.38 - 0.20 * smoothstep(0.05, 0.9, up);
    let gray = floor + (wall - floor) * smoothstep(-0.08, 0.08, up);
    Vec3::new(0.98, 0.99, 1.02) * gray as f32
}

fn studio_radiance(direction: DVec3) -> Vec3 {
    let mut light = room_radiance(direction.y);
    for soft_box in &SOFT_BOXES {
        let middle = direction_from_angles(soft_box.azimuth, soft_box.elevation);
        let ahead = direction.dot(middle);
        if ahead <= 0.0 {
            continue;
        }
        // Angles are measured along the axes of the plane that the box lies in.
        let across = middle.cross(DVec3::Y).normalize_or(DVec3::X);
        let upward = across.cross(middle);
        let degrees = |axis: DVec3| libm::atan(direction.dot(axis) / ahead).to_degrees().abs();
        let inside = |axis, half: f64| {
            1.0 - smoothstep(half - EDGE_BLUR_DEGREES, half + EDGE_BLUR_DEGREES, degrees(axis))
        };
        let share = inside(across, soft_box.half[0]) * inside(upward, soft_box.half[1]);
        light += soft_box.color * (soft_box.radiance * share) as f32;
    }
    light
}

impl Panorama {
    /// The panorama of `sky("studio")`, made once, with the same bits on every machine.
    pub fn studio() -> Arc<Panorama> {
        static STUDIO: OnceLock<Arc<Panorama>> = OnceLock::new();
        let create = || {
            let (width, height) = (512u32, 256u32);
            let mut rgb = Vec::with_capacity(3 * (width * height) as usize);
            for y in 0..height {
                let elevation = 90.0 - (f64::from(y) + 0.5) / f64::from(height) * 180.0;
                for x in 0..width {
                    let azimuth = 180.0 - (f64::from(x) + 0.5) / f64::from(width) * 360.0;
                    rgb.extend(studio_radiance(direction_from_angles(azimuth, elevation)).to_array());
                }
            }
            Arc::new(
                Panorama::new("studio", width, height, rgb).expect("the studio panorama has valid texels"),
            )
        };
        STUDIO.get_or_init(create).clone()
    }
}
