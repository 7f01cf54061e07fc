//! Applies the effects on everything to the background. CPU reference of `background_effects` in background.wgsl.

use super::raster::TILE_WIDTH;
use super::row_color;
use super::sky::Backdrop;
use crate::effect_faults::EffectFaults;
use crate::plan::Plan;
use choreo_plugin::{BACKGROUND_DISTANCE, Effect, SurfaceSample};
use glam::{Vec2, Vec3, Vec4, Vec4Swizzles};

/// Background that is not one color per row: the sky, or a background that surface effects change.
pub(crate) struct BackgroundEffects<'a> {
    pub plan: &'a Plan,
    pub backdrop: Option<Backdrop<'a>>,
    /// Effects in order, with their parameters.
    pub effects: Vec<(Effect, Vec<f32>)>,
    pub faults: &'a EffectFaults,
}

impl BackgroundEffects<'_> {
    /// Writes the linear background colors of the pixels of row `y` from `x` on, at most a tile's width: effects run over all of
    /// them at once.
    pub fn row(&self, x: i32, y: i32, colors: &mut [Vec4]) {
        for (color, x) in colors.iter_mut().zip(x..) {
            *color = match &self.backdrop {
                Some(backdrop) => backdrop.pixel(x, y),
                None => row_color(self.plan, y as usize),
            };
        }
        if self.effects.is_empty() {
            return;
        }
        let mut samples = [SurfaceSample::default(); TILE_WIDTH as usize];
        let samples = &mut samples[..colors.len()];
        for ((sample, color), x) in samples.iter_mut().zip(&*colors).zip(x..) {
            *sample = self.sample(*color, x, y);
        }
        for (effect, p) in &self.effects {
            if let Effect::Surface(function) = effect {
                function.surfaces(colors, samples, p);
                self.faults.checked(effect, colors, |i| [x + i as i32, y]);
            }
        }
    }

    /// The background's sample at a pixel, as effects read it.
    fn sample(&self, color: Vec4, x: i32, y: i32) -> SurfaceSample {
        let view = &self.plan.view;
        let size = Vec2::new(self.plan.size[0] as f32, self.plan.size[1] as f32);
        // The rows of a perspective matrix without translation are orthogonal, so dividing each by its squared length inverts it.
        let rows = view.clip_from_relative.transpose();
        let at = (Vec2::new(x as f32, y as f32) + 0.5) / size * 2.0 - 1.0;
        let along = |row: Vec3, at: f32| row * (at / row.dot(row).max(1e-20));
        let across = along(rows.x_axis.xyz(), at.x) + along(rows.y_axis.xyz(), at.y);
        let (ahead, beside) = match view.eye.w > 0.5 {
            true => (rows.w_axis.xyz() + across, Vec3::ZERO),
            false => (-view.eye.xyz(), across),
        };
        let way = ahead * (1.0 / ahead.dot(ahead).max(1e-20).sqrt());
        let viewer = view.position.as_vec3() + beside;
        SurfaceSample {
            world: viewer + way * BACKGROUND_DISTANCE,
            distance: BACKGROUND_DISTANCE,
            background: color.truncate(),
            viewer,
            ..SurfaceSample::default()
        }
    }
}
