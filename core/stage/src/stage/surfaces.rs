//! Rules of an actor for cutouts and transparency of its surfaces, over the settings of the stage.

use crate::stage::actor::Actor;
use crate::stage::{Cutouts, Settings, Transparency};

/// Rule for an actor's surfaces, or for those of one material; options that it leaves open follow the stage.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SurfaceRule {
    /// Index into `Asset::materials`; `None`: all of them.
    pub material: Option<u32>,
    /// Edges of alpha-masked surfaces; `None`: as the stage has it.
    pub cutouts: Option<Cutouts>,
    /// Order in which transparent surfaces are blended; `None`: as the stage has it.
    pub transparency: Option<Transparency>,
}

impl Actor {
    /// Cutouts of a surface with a material: the last rule for it, else that of the stage.
    pub fn cutouts(&self, material: Option<u32>, settings: &Settings) -> Cutouts {
        self.rules_for_material(material).find_map(|rule| rule.cutouts).unwrap_or(settings.cutouts)
    }

    /// Blend order of a surface with a material: the last rule for it, else that of the stage.
    pub fn transparency(&self, material: Option<u32>, settings: &Settings) -> Transparency {
        self.rules_for_material(material).find_map(|rule| rule.transparency).unwrap_or(settings.transparency)
    }

    fn rules_for_material(&self, material: Option<u32>) -> impl Iterator<Item = &SurfaceRule> {
        self.surfaces.iter().rev().filter(move |rule| rule.material.is_none() || rule.material == material)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use choreo_asset::Asset;

    #[test]
    fn last_surface_rule_overrides_the_stage_setting() {
        let mut actor = Actor::new("a", Asset::default().into());
        let settings = Settings { cutouts: Cutouts::Hard, ..Settings::default() };
        assert_eq!(actor.cutouts(Some(1), &settings), Cutouts::Hard);
        let rule = |material, cutouts| SurfaceRule { material, cutouts, transparency: None };
        actor.surfaces = vec![rule(None, Some(Cutouts::Smooth)), rule(Some(1), Some(Cutouts::Hard))];
        let all = [None, Some(0), Some(1)].map(|m| actor.cutouts(m, &settings));
        assert_eq!(all, [Cutouts::Smooth, Cutouts::Smooth, Cutouts::Hard]);
        actor.surfaces.push(SurfaceRule { transparency: Some(Transparency::Sorted), ..rule(None, None) });
        assert_eq!(actor.cutouts(Some(1), &settings), Cutouts::Hard);
        assert_eq!(actor.transparency(None, &settings), Transparency::Sorted);
    }
}
