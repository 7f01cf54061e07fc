//! Costs of the images that a frame is drawn into.

use crate::commands::{Command, Recording, Target};
use crate::explain::{CostKind, Costs, RequestedBy};
use crate::plan::{SceneColorCopy, ShadowMaps};
use crate::vulkan::deferred::{BYTES_PER_PIXEL, FORMATS};
use std::collections::BTreeMap;

impl Costs<'_> {
    /// Adds the color and depth targets.
    pub(super) fn add_targets(&mut self, recording: &Recording) {
        let [width, height] = recording.size;
        let pixels = u64::from(width) * u64::from(height);
        let size = format!("{width}×{height}");
        self.add_shadow_and_refraction_targets(recording, &size);
        let every_frame = RequestedBy::named("every frame");
        let image = format!("image {size}, 8 bits sRGB");
        self.add(CostKind::Target, image, Some(4 * pixels), every_frame.clone());
        self.add(CostKind::Target, format!("read back {size}"), Some(4 * pixels), every_frame);
        let (mut floats, mut scene) = (0, None);
        for command in &recording.commands {
            let mut count = |t: &Target| {
                if let Target::Float(i) = t {
                    floats = floats.max(*i as usize + 1);
                }
            };
            match command {
                Command::BeginPass { target, samples, depth, .. } => {
                    count(target);
                    scene = Some((*target, u64::from(*samples), *depth));
                }
                Command::PostPass { from, to, .. } => [from, to].into_iter().for_each(count),
                _ => {}
            }
        }
        self.add_texture_targets(recording);
        let mut effects = RequestedBy::default();
        effects.effects.extend(self.plan.post.iter().map(|p| p.effect.clone()));
        for i in 0..floats {
            let what = format!("linear image {i} {size}, 16-bit floats");
            self.add(CostKind::Target, what, Some(8 * pixels), effects.clone());
        }
        if recording.commands.contains(&Command::BeginGBuffer) {
            let names = ["normal and factors", "color", "depth"];
            for ((name, format), bytes) in names.iter().zip(FORMATS).zip(BYTES_PER_PIXEL) {
                let what = format!("G-buffer {name} {size}, {format:?}");
                self.add(CostKind::Target, what, Some(bytes * pixels), self.deferred_shading_cause());
            }
        }
        let motion = recording.commands.iter().find_map(|command| match command {
            Command::BeginInputs { motion } => Some(*motion),
            _ => None,
        });
        if let Some(motion) = motion {
            let (names, bytes) = match motion {
                true => ("normals, depth, motion and actors", 36),
                false => ("normals and depth", 20),
            };
            let no_effect = self.plan.scene_inputs.as_ref().is_some_and(|pass| pass.effects.is_empty());
            let readers = if no_effect { "passes" } else { "effects" };
            let what = format!("{names} for {readers} {size}, 32-bit floats, with the depth of their pass");
            self.add(CostKind::Target, what, Some(bytes * pixels), self.input_readers());
        }
        let Some((target, samples, depth)) = scene else { return };
        if depth {
            let what = format!("depth {size}, {samples} samples of 32-bit float");
            self.add(
                CostKind::Target,
                what,
                Some(4 * samples * pixels),
                self.requested_by_actors(self.plan.draws.iter()),
            );
        }
        if recording.commands.iter().any(|c| matches!(c, Command::BeginPeel { .. })) {
            let what = format!("depth of two transparent layers {size}, {samples} samples of 32-bit float");
            self.add(CostKind::Target, what, Some(8 * samples * pixels), self.depth_peeling_cause());
        }
        if samples > 1 {
            let each = if target == Target::Image { 4 } else { 8 };
            let what = format!("multisampled image {size}, {samples} samples");
            let requested_by = RequestedBy::named("antialiasing: samples");
            self.add(CostKind::Target, what, Some(each * samples * pixels), requested_by);
        }
    }

    /// Adds the textures of effect passes. Textures that share an image are listed together.
    fn add_texture_targets(&mut self, recording: &Recording) {
        let mut slots: BTreeMap<u8, ([u32; 2], Vec<&str>, RequestedBy)> = BTreeMap::new();
        for command in &recording.commands {
            let Command::PostPass { index, effect, to: Target::Texture(slot), size, .. } = command else {
                continue;
            };
            let (_, names, by) =
                slots.entry(*slot).or_insert_with(|| (*size, Vec::new(), RequestedBy::default()));
            names.extend(self.plan.post.get(*index).and_then(|pass| pass.texture.as_deref()));
            by.effects.insert(effect.clone());
        }
        let targets: Vec<_> = slots
            .into_values()
            .map(|([w, h], names, by)| {
                let what = format!("texture {} {w}×{h}, 16-bit floats", names.join(", "));
                (what, 8 * u64::from(w) * u64::from(h), by)
            })
            .collect();
        for (what, bytes, by) in targets {
            self.add(CostKind::Target, what, Some(bytes), by);
        }
    }

    fn add_shadow_and_refraction_targets(&mut self, recording: &Recording, size: &str) {
        if let Some(ShadowMaps { image: [w, h], .. }) = &self.plan.shadow_maps {
            let bytes = 4 * u64::from(*w) * u64::from(*h);
            let what = format!("shadow maps {w}×{h}, 32-bit float");
            self.add(CostKind::Target, what, Some(bytes), self.requested_by_actors(self.plan.shadow_draws()));
        }
        if let Some(SceneColorCopy { levels }) = self.plan.scene_color_copy {
            let [w, h] = recording.size;
            let texels = |l: u32| u64::from((w >> l).max(1)) * u64::from((h >> l).max(1));
            let bytes = (0..levels).map(|l| 8 * texels(l)).sum();
            let what = format!("scene color copy {size}, {levels} levels, 16-bit floats");
            self.add(CostKind::Target, what, Some(bytes), self.requested_by(self.refracting_draws()));
        }
    }
}
