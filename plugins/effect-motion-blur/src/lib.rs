//! What moves while the shutter is open is smeared along its way: each picture is the mean of several at exact times.

use choreo_plugin::{Effect, Exposure, Hook, Manifest};
use std::sync::LazyLock;

static MANIFEST: LazyLock<Manifest> = LazyLock::new(|| {
    Manifest::new("motion_blur", env!("CARGO_PKG_VERSION"), "what moves while the shutter is open is smeared")
        .number("samples", "pictures that make up one", 16.0, 1.0..=256.0)
        .number("shutter", "how long it is open, degrees; 360: from frame to frame", 180.0, 0.0..=720.0)
        .text(
            "around",
            "the shutter is open before and after the frame's time (middle), after it (start) or before it (end)",
            "middle",
            &["middle", "start", "end"],
        )
});

#[derive(Clone, Copy, Debug, Default)]
pub struct MotionBlur;

impl Effect for MotionBlur {
    fn manifest(&self) -> &Manifest {
        &MANIFEST
    }

    fn hook(&self) -> Hook {
        Hook::Exposure
    }

    fn exposure(&self, p: &[f32; 8]) -> Option<Exposure> {
        let before = match p[2] {
            0.0 => 0.5,
            1.0 => 0.0,
            _ => 1.0,
        };
        // Whole pictures: a number that is keyed steps.
        Some(Exposure { samples: (p[0] + 0.5) as u32, open: f64::from(p[1]) / 360.0, before })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn degrees_of_the_shutter_are_shares_of_a_frame() {
        let p = [8.0, 90.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        assert_eq!(MotionBlur.exposure(&p), Some(Exposure { samples: 8, open: 0.25, before: 0.0 }));
    }
}
