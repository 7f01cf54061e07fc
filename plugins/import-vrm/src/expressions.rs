//! Facial expressions: VRM 1.0 `expressions`, and `blendShapeMaster` of VRM 0.x under 1.0's names.

use crate::json::At;
use choreo_asset::{
    Asset, ColorBind, Expression, ExpressionGroup, GAZE, MaterialColor, MorphBind, Override, UvBind,
};
use choreo_importer_kit::color::linear_from_srgb;
use choreo_importer_kit::{Problem, Result};
use choreo_plugin::ImportScope;
use glam::{Vec2, Vec4};
use import_gltf::profile::Document;

/// Reads the expressions of VRM 1.0 ("expressions.md").
pub(crate) fn read(
    document: &Document<'_>,
    vrm: &At<'_>,
    scope: ImportScope,
    asset: &mut Asset,
) -> Result<()> {
    let Some(expressions) = vrm.get("expressions") else { return Ok(()) };
    let mut reader = ExpressionReader::new(document, scope, asset);
    for list in ["preset", "custom"] {
        for (name, at) in expressions.members(list)? {
            let group =
                if list == "preset" { ExpressionGroup::of_preset(name) } else { ExpressionGroup::Other };
            let over = |key: &str| override_of(document, &at, key);
            let mut expression = Expression {
                name: name.to_string(),
                binary: at.flag("isBinary")?.unwrap_or(false),
                group,
                over_mouth: over("overrideMouth"),
                over_blink: over("overrideBlink"),
                over_gaze: over("overrideLookAt"),
                ..Expression::default()
            };
            for bind in at.list("morphTargetBinds")? {
                let node = bind.needed_index("node")?;
                let joint = document.joint(node, &|| bind.place_of("node"))?;
                let weight = bind.number_or("weight", 1.0)?.clamp(0.0, 1.0);
                reader.bind(&mut expression, &bind, weight, |i| Some(i.joint) == joint)?;
            }
            for bind in at.list("materialColorBinds")? {
                let color = bind.text("type").and_then(color_of);
                let to = bind.first::<4>("targetValue")?;
                let (Some(color), Some(to)) = (color, to) else {
                    reader.note_incomplete(&expression);
                    continue;
                };
                let material = reader.material(&bind, bind.needed_index("material")?)?;
                expression.colors.extend(material.map(|material| ColorBind {
                    material,
                    color,
                    to: Vec4::from(to),
                }));
            }
            for bind in at.list("textureTransformBinds")? {
                let material = reader.material(&bind, bind.needed_index("material")?)?;
                let scale = bind.first::<2>("scale")?.map_or(Vec2::ONE, Vec2::from);
                let offset = bind.first::<2>("offset")?.map_or(Vec2::ZERO, Vec2::from);
                expression.uvs.extend(material.map(|material| UvBind { material, offset, scale }));
            }
            reader.add(expression, &at);
        }
    }
    reader.finish(expressions.place());
    Ok(())
}

/// Adds the expressions [`GAZE`], with which the gaze is set, to a character with eyes.
pub(crate) fn add_gaze(asset: &mut Asset) {
    if asset.eyes.is_none() {
        return;
    }
    for name in GAZE {
        if asset.expressions.iter().all(|e| e.name != name) {
            let (name, group) = (name.to_string(), ExpressionGroup::Gaze);
            asset.expressions.push(Expression { name, group, ..Expression::default() });
        }
    }
}

/// Reads the expressions of VRM 0.x ("Morph setting"): binds refer to meshes, and weights go up to 100.
pub(crate) fn read_v0(
    document: &Document<'_>,
    vrm: &At<'_>,
    scope: ImportScope,
    asset: &mut Asset,
) -> Result<()> {
    let Some(master) = vrm.get("blendShapeMaster") else { return Ok(()) };
    let mut reader = ExpressionReader::new(document, scope, asset);
    for at in master.list("blendShapeGroups")? {
        let own = at.text("name").unwrap_or_default();
        let preset = at.text("presetName").and_then(preset_v0);
        let mut expression = Expression {
            name: preset.unwrap_or(own).to_string(),
            binary: at.flag("isBinary")?.unwrap_or(false),
            group: preset.map_or(ExpressionGroup::Other, ExpressionGroup::of_preset),
            ..Expression::default()
        };
        for bind in at.list("binds")? {
            let mesh = bind.needed_index("mesh")?;
            let weight = bind.number_or("weight", 100.0)?.clamp(0.0, 100.0) / 100.0;
            reader.bind(&mut expression, &bind, weight, |i| i.mesh as usize == mesh)?;
        }
        for value in at.list("materialValues")? {
            let to = value.first::<4>("targetValue")?;
            let material = value.text("materialName").and_then(|name| reader.material_index(name));
            let (Some(to), Some(material)) = (to, material) else {
                reader.note_incomplete(&expression);
                continue;
            };
            match value.text("propertyName") {
                // Applies to all textures except the matcap. v points up.
                Some("_MainTex_ST") => expression.uvs.push(UvBind {
                    material,
                    offset: Vec2::new(to[2], 1.0 - to[3] - to[1]),
                    scale: Vec2::new(to[0], to[1]),
                }),
                Some(name) if color_v0(name).is_some() => {
                    expression.colors.extend(color_v0(name).map(|color| {
                        let [r, g, b] = [to[0], to[1], to[2]].map(|c| linear_from_srgb(c.max(0.0)));
                        ColorBind { material, color, to: Vec4::new(r, g, b, to[3]) }
                    }))
                }
                _ => reader.note_incomplete(&expression),
            }
        }
        reader.add(expression, &at);
    }
    reader.finish(master.place());
    Ok(())
}

/// The VRM 1.0 name of a 0.x preset; `None` for "unknown", which custom groups have.
fn preset_v0(name: &str) -> Option<&'static str> {
    Some(match name.to_ascii_lowercase().as_str() {
        "neutral" => "neutral",
        "a" => "aa",
        "i" => "ih",
        "u" => "ou",
        "e" => "ee",
        "o" => "oh",
        "blink" => "blink",
        "blink_l" => "blinkLeft",
        "blink_r" => "blinkRight",
        "joy" => "happy",
        "angry" => "angry",
        "sorrow" => "sad",
        "fun" => "relaxed",
        "lookup" => "lookUp",
        "lookdown" => "lookDown",
        "lookleft" => "lookLeft",
        "lookright" => "lookRight",
        _ => return None,
    })
}

/// The color of a VRM 1.0 "materialColorBinds" type; `None` for outline colors, which expressions cannot change here.
fn color_of(name: &str) -> Option<MaterialColor> {
    Some(match name {
        "color" => MaterialColor::Base,
        "emissionColor" => MaterialColor::Emission,
        "shadeColor" => MaterialColor::Shade,
        "matcapColor" => MaterialColor::Matcap,
        "rimColor" => MaterialColor::Rim,
        _ => return None,
    })
}

/// The color of an MToon 0.x property.
fn color_v0(name: &str) -> Option<MaterialColor> {
    Some(match name {
        "_Color" => MaterialColor::Base,
        "_EmissionColor" => MaterialColor::Emission,
        "_ShadeColor" => MaterialColor::Shade,
        "_RimColor" => MaterialColor::Rim,
        _ => return None,
    })
}

fn override_of(document: &Document<'_>, at: &At<'_>, key: &str) -> Override {
    match at.text(key) {
        None | Some("none") => Override::None,
        Some("block") => Override::Block,
        Some("blend") => Override::Blend,
        Some(_) => {
            document.warn(at.place_of(key), "is not none, block or blend; none is used");
            Override::None
        }
    }
}

/// Adds expressions to an asset.
struct ExpressionReader<'a, 'd> {
    document: &'a Document<'d>,
    /// Whether geometry is imported. Without it there are no meshes to bind to, and that is no fault.
    geometry: bool,
    asset: &'a mut Asset,
    /// Names of expressions that also change a material property which is not supported, or a missing material.
    incomplete: Vec<String>,
}

impl<'a, 'd> ExpressionReader<'a, 'd> {
    fn new(document: &'a Document<'d>, scope: ImportScope, asset: &'a mut Asset) -> ExpressionReader<'a, 'd> {
        ExpressionReader { document, geometry: scope.geometry, asset, incomplete: Vec::new() }
    }

    fn bind(
        &self,
        expression: &mut Expression,
        at: &At<'_>,
        weight: f32,
        is_meant: impl Fn(&choreo_asset::MeshInstance) -> bool,
    ) -> Result<()> {
        let target = at.needed_index("index")?;
        if !self.geometry {
            return Ok(());
        }
        // Charged, because a file can request this search through all instances for any number of binds.
        self.document.charge(self.asset.instances.len() as u64, 16, &|| at.place())?;
        let mut found = false;
        for (instance, i) in self.asset.instances.iter().enumerate().filter(|(_, i)| is_meant(i)) {
            let targets = self.asset.meshes.get(i.mesh as usize).map_or(0, |m| m.morph_targets);
            if target >= targets {
                let what = format!("is {target}, but the mesh has {targets} morph targets");
                return Err(Problem::new(at.place_of("index"), what));
            }
            found = true;
            expression.morphs.push(MorphBind { instance: instance as u32, target: target as u32, weight });
        }
        if !found {
            self.document.warn(at.place(), "binds a mesh that is not in the scene; it is left out");
        }
        Ok(())
    }

    /// A material of the file; `None` where the asset has no materials because geometry is not imported.
    fn material(&self, at: &At<'_>, index: usize) -> Result<Option<u32>> {
        if !self.geometry && self.asset.materials.is_empty() {
            return Ok(None);
        }
        match index < self.asset.materials.len() {
            true => Ok(Some(index as u32)),
            false => {
                let what = format!(
                    "is {index}, but the file has {} materials, from 0 on",
                    self.asset.materials.len()
                );
                Err(Problem::new(at.place_of("material"), what))
            }
        }
    }

    fn material_index(&self, name: &str) -> Option<u32> {
        self.asset.materials.iter().position(|m| m.name == name).map(|i| i as u32)
    }

    fn note_incomplete(&mut self, expression: &Expression) {
        if !self.incomplete.contains(&expression.name) && (self.geometry || !self.asset.materials.is_empty())
        {
            self.incomplete.push(expression.name.clone());
        }
    }

    fn add(&mut self, expression: Expression, at: &At<'_>) {
        if expression.name.is_empty() {
            return self.document.warn(at.place(), "has no name; it is left out");
        }
        if self.asset.expressions.iter().any(|e| e.name == expression.name) {
            let shown: String = expression.name.chars().take(40).collect();
            return self
                .document
                .warn(at.place(), format!("is a second expression \"{shown}\"; it is left out"));
        }
        self.asset.expressions.push(expression);
    }

    fn finish(self, place: String) {
        if !self.incomplete.is_empty() {
            let names: Vec<&str> = self.incomplete.iter().take(12).map(String::as_str).collect();
            let what = "material properties that are missing or not drawn";
            let expressions = match self.incomplete.len() {
                1 => "1 expression also changes".into(),
                count => format!("{count} expressions also change"),
            };
            self.document.warn(place, format!("{expressions} {what}: {}", names.join(", ")));
        }
    }
}
