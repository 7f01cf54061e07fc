//! Pictures and depths that a frame is drawn into, for [`crate::explain`].

use crate::explain::{Askers, Kind, Parts};
use crate::plan::{Behind, Shadows};
use crate::record::{Command, Recording, Target};

impl Parts<'_> {
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
