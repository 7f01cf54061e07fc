//! Losses of an export: parts of a scene that the formats of other programs cannot hold.

use choreo_plugin::asset::Material;
use choreo_plugin::motion::PropertyTarget;
use choreo_plugin::stage::{Property, Stage, ViewTransform};
use std::collections::BTreeSet;

/// Names of the lost parts, each once.
pub type Losses = BTreeSet<&'static str>;

/// Adds the parts of a stage that no scene format can hold. Exporters add those that only their own format lacks.
pub fn of_stage(stage: &Stage, out: &mut Losses) {
    let settings = &stage.settings;
    let lights = |target: PropertyTarget| {
        use PropertyTarget::{LightColor, LightIntensity, LightRange, SpotInner, SpotOuter};
        matches!(target, LightColor(_) | LightIntensity(_) | LightRange(_) | SpotInner(_) | SpotOuter(_))
    };
    let clips = || stage.actors.iter().flat_map(|a| &a.layers).flat_map(|l| &l.cues).map(|cue| &cue.clip);
    let varies = |property| stage.actors.iter().flat_map(|a| &a.channels).any(|c| c.property == property);
    let all = [
        (!stage.effects.is_empty(), "effects"),
        (!stage.layers_2d.is_empty(), "2D layers"),
        (settings.exposure != 0.0, "exposure"),
        (settings.view_transform != ViewTransform::default(), "the view transform"),
        (stage.actors.iter().any(|a| !a.surfaces.is_empty()), "rules for cutouts and transparency"),
        (stage.actors.iter().any(|a| a.line_width.is_some()), "line widths"),
        (varies(Property::Copies), "a changing number of copies"),
        (clips().any(|clip| clip.properties().any(|(target, _)| lights(target))), "animated lights of files"),
    ];
    add(&all, out);
}

/// Adds the parts of a material that no scene format can hold.
pub fn of_material(material: &Material, out: &mut Losses) {
    let all = [
        (material.relief != 0.0, "relief from normal maps"),
        (material.sequence.is_some(), "image sequences"),
        (material.line_style.is_some(), "line widths"),
        (material.triplanar.is_some(), "triplanar textures"),
        (material.environment_reflection().is_some(), "reflection maps"),
    ];
    add(&all, out);
}

/// Adds the names whose condition holds.
pub fn add(all: &[(bool, &'static str)], out: &mut Losses) {
    out.extend(all.iter().filter(|(is_there, _)| *is_there).map(|(_, what)| *what));
}

/// The note about all losses. `always`: the parts that the format never holds.
pub fn note(format: &str, always: &str, losses: &Losses) -> String {
    let all: Vec<&str> = losses.iter().copied().chain([always]).collect();
    format!("{format} has no place for these, which are left out: {}", all.join(", "))
}
