//! Applies the surface effects that cover the whole scene to the background. CPU reference of `background_effects` in background.wgsl.

use super::background_row_color;
use super::raster::TILE_WIDTH;
use super::sky::SkyBackdrop;
use crate::effect_faults::EffectFaults;
use crate::plan::Plan;
use choreo_plugin::{BACKGROUND_DISTANCE, Effect, SurfaceSample};
use glam::{Vec2, Vec3, Vec4, Vec4Swizzles};

/// Background with a color for each pixel instead of each row: the sky, or a background that surface effects change.
pub(crate) struct PixelBackground<'a> {
    pub plan: &'a Plan,
    pub sky: Option<SkyBackdrop<'a>>,
    /// Effects in order, with their parameters.
    pub effects: Vec<(Effect, Vec<f32>)>,
    pub faults: &'a EffectFaults,
}

impl PixelBackground<'_> {
    /// Writes the linear background colors of row `y`, from pixel `x` on. Effects run over all of these pixels at once, so there may
    /// be at most a tile's width of them.
    pub(super) fn write_row(&self, x: i32, y: i32, colors: &mut [Vec4]) {
        for (color, x) in colors.iter_mut().zip(x..) {
            *color = match &self.sky {
                Some(sky) => sky.pixel(x, y),
                None => background_row_color(self.plan, y as usize),
            };
        }
        if self.effects.is_empty() {
            return;
        }
        let mut samples = [SurfaceSample::default(); TILE_WIDTH as usize];
        let samples = &mut samples[..colors.len()];
        for ((sample, color), x) in samples.iter_mut().zip(&*colors).zip(x..) {
            *sample = self.surface_sample(*color, x, y);
        }
        for (effect, p) in &self.effects {
            if let Effect::Surface(function) = effect {
                function.surfaces(colors, samples, p);
                self.faults.replace_faulty_colors(effect, colors, |i| [x + i as i32, y]);
            }
        }
    }

    /// Inputs of surface effects for the background at a pixel.
    fn surface_sample(&self, color: Vec4, x: i32, y: i32) -> SurfaceSample {
        let view = &self.plan.view;
        let size = Vec2::new(self.plan.size[0] as f32, self.plan.size[1] as f32);
        // The rows of a perspective matrix without translation are orthogonal, so dividing each by its squared length inverts it.
        let rows = view.clip_from_relative.transpose();
        let at = (Vec2::new(x as f32, y as f32) + 0.5) / size * 2.0 - 1.0;
        let along = |row: Vec3, at: f32| row * (at / row.dot(row).max(1e-20));
        let across = along(rows.x_axis.xyz(), at.x) + along(rows.y_axis.xyz(), at.y);
        let (forward, origin_offset) = match view.eye.w > 0.5 {
            true => (rows.w_axis.xyz() + across, Vec3::ZERO),
            false => (-view.eye.xyz(), across),
        };
        let direction = forward * (1.0 / forward.dot(forward).max(1e-20).sqrt());
        let viewer = view.position.as_vec3() + origin_offset;
        SurfaceSample {
            world: viewer + direction * BACKGROUND_DISTANCE,
            distance: BACKGROUND_DISTANCE,
            background: color.truncate(),
            viewer,
            ..SurfaceSample::default()
        }
    }
}
