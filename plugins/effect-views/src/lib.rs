//! What a mesh is made of: normals, texture coordinates, joints as colours.

use choreo_plugin::{Effect, Hook, Manifest, Seen, SurfaceNeeds};
use glam::{Vec3, Vec4};
use std::sync::LazyLock;

static MANIFEST: LazyLock<Manifest> = LazyLock::new(|| {
    Manifest::new("views", env!("CARGO_PKG_VERSION"), "shows what a mesh is made of in place of its look").text(
        "show",
        "normals (as normal maps have them, in the world), uvs (red u, green v, a checker of tenths), joints (a color each, by weight), distance (10 m a band)",
        "normals",
        &["normals", "uvs", "joints", "distance"],
    )
});

#[derive(Clone, Copy, Debug, Default)]
pub struct Views;

impl Effect for Views {
    fn manifest(&self) -> &Manifest {
        &MANIFEST
    }

    fn hook(&self) -> Hook {
        Hook::Surface
    }

    fn surface_needs(&self, p: &[f32; 8]) -> SurfaceNeeds {
        SurfaceNeeds {
            normals: p[0] == 0.0,
            uvs: p[0] == 1.0,
            joints: p[0] == 2.0,
            ..SurfaceNeeds::default()
        }
    }

    fn wgsl(&self) -> &str {
        include_str!("views.wgsl")
    }

    fn cpu_surface(&self, color: Vec4, seen: &Seen, p: &[f32; 8]) -> Vec4 {
        let fract = |v: f32| v - v.floor();
        let shown = match p[0] {
            0.0 => seen.normal * 0.5 + 0.5,
            1.0 => {
                let (u, v) = (fract(seen.uv.x), fract(seen.uv.y));
                let odd = ((u * 10.0).floor() + (v * 10.0).floor()) % 2.0;
                Vec3::new(u, v, 0.0) * (1.0 - 0.4 * odd) + 0.1 * odd
            }
            2.0 => seen.joints,
            _ => {
                let band = fract(seen.distance / 10.0);
                Vec3::splat(1.0 - band)
            }
        };
        shown.extend(color.w)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec2;

    #[test]
    fn each_view_shows_its_own() {
        let seen = Seen {
            normal: Vec3::NEG_Y,
            uv: Vec2::new(1.25, -0.75),
            joints: Vec3::X,
            distance: 12.5,
            ..Seen::default()
        };
        let show = |what: f32| {
            let p = [what, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
            Views.cpu_surface(Vec4::splat(0.5), &seen, &p)
        };
        assert_eq!(show(0.0), Vec4::new(0.5, 0.0, 0.5, 0.5));
        assert_eq!(show(1.0), Vec4::new(0.25, 0.25, 0.0, 0.5));
        assert_eq!(show(2.0), Vec4::new(1.0, 0.0, 0.0, 0.5));
        assert_eq!(show(3.0), Vec4::new(0.75, 0.75, 0.75, 0.5));
        let needs = |what: f32| Views.surface_needs(&[what, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        assert!(needs(0.0).normals && needs(1.0).uvs && needs(2.0).joints);
        assert_eq!(needs(3.0), SurfaceNeeds::default());
    }
}
