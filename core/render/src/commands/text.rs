//! A recording as text, one line for each command.

use crate::commands::{Command, Recording};
use std::fmt;

impl fmt::Display for Recording {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}×{}", self.size[0], self.size[1])?;
        for command in &self.commands {
            match command {
                Command::UploadFrameData { instances, joints, morphs, lights } => writeln!(
                    f,
                    "upload {instances} instances, {joints} joints, {morphs} morphs, {lights} lights"
                )?,
                Command::Preskin { variant, primitive, count, .. } => {
                    writeln!(f, "pre-skin {count} of mesh {primitive}: {}", variant.switches().join(" "))?
                }
                Command::EndPreskin => writeln!(f, "end of pre-skinning")?,
                Command::BeginShadows { size: [w, h], .. } => writeln!(f, "begin shadow maps {w}×{h}")?,
                Command::SetShadowView { index, at, size: [w, h], .. } => {
                    writeln!(f, "  view {index}: {w}×{h} at {at:?}")?
                }
                Command::KeepShadows { .. } => writeln!(f, "keep all shadow maps")?,
                Command::BeginGBuffer => writeln!(f, "begin G-buffer")?,
                Command::BeginInputs { motion } => {
                    writeln!(f, "begin inputs of effects{}", if *motion { ", motion" } else { "" })?
                }
                Command::EndInputs => writeln!(f, "end of inputs")?,
                Command::DrawDeferredLighting { area } => {
                    let area = area.map_or(String::new(), |[x, y, w, h]| format!(", {w}×{h} at {x}, {y}"));
                    writeln!(f, "  light{area}")?
                }
                Command::CopyBackground => writeln!(f, "copy background")?,
                Command::DrawSky { .. } => writeln!(f, "  draw sky")?,
                Command::DrawLayersBehind => writeln!(f, "  draw layers behind the scene")?,
                Command::SetCull(cull) => writeln!(f, "  cull {cull:?}")?,
                Command::BeginPass { target, samples, clear, depth, area, .. } => {
                    let clear = clear.map_or("load".into(), |c| format!("clear {c}"));
                    let depth = if *depth { ", depth" } else { "" };
                    let area = area.map_or(String::new(), |[x, y, w, h]| format!(", {w}×{h} at {x}, {y}"));
                    writeln!(f, "begin {target:?}, {samples} samples, {clear}{depth}{area}")?
                }
                Command::BeginPeel { layer, .. } => writeln!(f, "begin depth of layer {layer}")?,
                Command::BeginLayer { layer, nearer, .. } => writeln!(
                    f,
                    "begin {} layer {layer}",
                    if *nearer { "surfaces nearer than" } else { "color of" }
                )?,
                Command::BindPipeline(v) => {
                    writeln!(f, "  pipeline {:?} {}", v.key.topology, crate::shader::switches(v).join(" "))?
                }
                Command::BindMaterial { material, .. } => writeln!(f, "  material {material}")?,
                Command::BindMesh { primitive, morphs, .. } => {
                    writeln!(f, "  mesh {primitive}{}", if *morphs { ", morphs" } else { "" })?
                }
                Command::Draw { first_instance, instance_count, indices } => {
                    let part = indices.map_or(String::new(), |[i, n]| format!(", indices {i} to {}", i + n));
                    writeln!(f, "  draw {instance_count} from {first_instance}{part}")?
                }
                Command::CopySceneColor { levels, .. } => writeln!(f, "copy scene color, {levels} levels")?,
                Command::DrawBackground { .. } => writeln!(f, "  background")?,
                Command::EndPass => writeln!(f, "end")?,
                Command::PostPass { effect, from, textures, to, size, .. } => {
                    let [w, h] = *size;
                    let size = if *size == self.size { String::new() } else { format!(", {w}×{h}") };
                    let textures: String = textures.iter().map(|t| format!(", {t:?}")).collect();
                    writeln!(f, "post {effect} {from:?}{textures} → {to:?}{size}")?
                }
                Command::DrawOverlay { effect, over, count, .. } => {
                    let over = if *over { ", over everything" } else { "" };
                    writeln!(f, "  {} triangles of {effect}{over}", count / 3)?
                }
                Command::ReadBack => writeln!(f, "read back")?,
                Command::ReadBackInputs => writeln!(f, "read back inputs")?,
                Command::ReadBackLinear => writeln!(f, "read back linear")?,
            }
        }
        Ok(())
    }
}
