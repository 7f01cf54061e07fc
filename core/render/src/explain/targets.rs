//! Pictures and depths that a frame is drawn into, for [`crate::explain`].

use crate::commands::{Command, Recording, Target};
use crate::explain::{Askers, Kind, Parts};
use crate::plan::{Behind, DeferredCause, Shadows};
use crate::shader::{SceneVariant, switches};
use crate::vulkan::deferred::{BYTES, FORMATS};

impl Parts<'_> {
    /// Why surfaces are not lit as they are drawn.
    fn of_deferred(&self) -> Askers {
        let other = Some(match self.plan.deferred.as_ref().map(|d| d.cause) {
            Some(DeferredCause::Pays { .. }) => "lights and surfaces over each other",
            _ => "the stage's pipeline \"deferred\"",
        });
        let of = self.actors(self.plan.draws.iter().filter(|d| d.deferred));
        Askers { other, ..of }
    }

    /// The pass that keeps what light needs.
    pub fn geometry(&mut self) {
        let deferred = self.plan.draws.iter().filter(|d| d.deferred).count();
        let forward = self.plan.draws.len() - deferred;
        let mut what =
            format!("surfaces without light, depth: {deferred} draws, and {forward} lit as they are drawn");
        if let Some(DeferredCause::Pays { lights, surfaces, in_vain }) =
            self.plan.deferred.as_ref().map(|d| d.cause)
        {
            what += &format!(
                "; about {lights:.1} lights a place, {surfaces:.1} surfaces over each other: {in_vain:.1} lights a pixel spared"
            );
        }
        let askers = self.of_deferred();
        self.add(Kind::Pass, what, None, askers);
    }

    /// What lights what was kept.
    pub fn light(&mut self, variant: &SceneVariant) {
        let what = format!(
            "light on what is kept, {} lights: {}",
            self.plan.lights.len(),
            switches(variant).join(" ")
        );
        let askers = self.of_deferred();
        self.add(Kind::Pipeline, what, None, askers);
    }

    pub fn targets(&mut self, recording: &Recording) {
        let pixels = u64::from(recording.size[0]) * u64::from(recording.size[1]);
        let (mut floats, mut scene) = (0, None);
        for command in &recording.commands {
            let mut seen = |t: &Target| {
                if let Target::Float(i) = t {
                    floats = floats.max(*i as usize + 1);
                }
            };
            match command {
                Command::BeginPass { target, samples, depth, .. } => {
                    seen(target);
                    scene = Some((*target, u64::from(*samples), *depth));
                }
                Command::PostPass { from, to, .. } => {
                    seen(from);
                    seen(to);
                }
                _ => {}
            }
        }
        let asked = |other| Askers { other: Some(other), ..Askers::default() };
        if let Some(Shadows { image: [w, h], .. }) = &self.plan.shadows {
            let bytes = 4 * u64::from(*w) * u64::from(*h);
            let askers = self.actors(self.shadow_draws());
            self.add(Kind::Target, format!("shadow maps {w}×{h}, 32-bit float"), Some(bytes), askers);
        }
        let size = format!("{}×{}", recording.size[0], recording.size[1]);
        if let Some(Behind { levels }) = self.plan.behind {
            let [w, h] = recording.size;
            let texels = |l: u32| u64::from((w >> l).max(1)) * u64::from((h >> l).max(1));
            let bytes = (0..levels).map(|l| 8 * texels(l)).sum();
            let askers = self.askers(self.refracting());
            let what = format!("picture behind glass {size}, {levels} levels, 16-bit floats");
            self.add(Kind::Target, what, Some(bytes), askers);
        }
        self.add(
            Kind::Target,
            format!("picture {size}, 8 bits sRGB"),
            Some(4 * pixels),
            asked("every frame"),
        );
        self.add(Kind::Target, format!("read back {size}"), Some(4 * pixels), asked("every frame"));
        let mut effects = Askers::default();
        effects.effects.extend(self.plan.post.iter().map(|p| p.effect.clone()));
        for i in 0..floats {
            let what = format!("linear picture {i} {size}, 16-bit floats");
            self.add(Kind::Target, what, Some(8 * pixels), effects.clone());
        }
        if recording.commands.contains(&Command::BeginGeometry) {
            let names = ["normals and shares", "colours", "depths"];
            for ((name, format), bytes) in names.iter().zip(FORMATS).zip(BYTES) {
                let what = format!("kept of surfaces, {name} {size}, {format:?}");
                let askers = self.of_deferred();
                self.add(Kind::Target, what, Some(bytes * pixels), askers);
            }
        }
        if let Some((target, samples, depth)) = scene {
            if depth {
                let what = format!("depth {size}, {samples} samples of 32-bit float");
                let askers = self.actors(self.plan.draws.iter());
                self.add(Kind::Target, what, Some(4 * samples * pixels), askers);
            }
            if recording.commands.iter().any(|c| matches!(c, Command::BeginPeel { .. })) {
                let what = format!("depths of two layers {size}, {samples} samples of 32-bit float");
                let askers = self.of_peel();
                self.add(Kind::Target, what, Some(8 * samples * pixels), askers);
            }
            if samples > 1 {
                let each = if target == Target::Picture { 4 } else { 8 };
                let what = format!("multisampled picture {size}, {samples} samples");
                self.add(Kind::Target, what, Some(each * samples * pixels), asked("smooth edges: samples"));
            }
        }
    }
}
