//! `choreo info`: content of a model file, or provenance of an image or video.

mod character;
mod hands;

use crate::args::{InfoArgs, values};
use crate::commands::compressed::CompressedClips;
use crate::failure::{Failure, print, print_json};
use crate::output::media::Media;
use crate::plugins::plugin_files;
use crate::process::memory;
use crate::scene::model;
use crate::scene::{self, opening::OpenOptions};
use crate::terminal::{counted, page::Page};
use choreo_asset::{Asset, Light, Origin, Projection};
use choreo_motion::{Clip, Facing, FacingEvidence};
use choreo_plugin::{Registry, Source};
use choreo_script::mapping_lines;
use serde_json::{Value, json};
use std::fmt::Write;
use std::sync::Arc;

pub(crate) fn run(args: InfoArgs, plugins: &Registry) -> Result<(), Failure> {
    let registry = plugin_files::registry_with_files(plugins, &args.import.plugins, &[&args.file])?;
    model::check_is_file(&args.file)?;
    if args.file.extension().is_some_and(|e| e.eq_ignore_ascii_case("rhai")) {
        let shown = args.file.display();
        return Err(Failure::Usage(format!(
            "{shown} is a script; type choreo explain {shown} or choreo check {shown}"
        )));
    }
    let head = model::read_first_bytes(&args.file)?;
    if let Some(media) = crate::output::media::read(&head) {
        return print_media(&args, &media);
    }
    let limits = values::parse_limits(&args.limit)?;
    memory::start_guard(limits.memory);
    let open = |path: &std::path::Path| {
        let choice = model::import_choice(&args.import)?;
        model::import(path, &args.search, &choice, &registry, &limits, OpenOptions::TO_INSPECT)
            .map(|imported| imported.asset)
    };
    let asset = open(&args.file)?;
    let importer = importer_name_and_about(&args, &registry, head);
    let facts = collect_facts(&asset, importer);
    let retargeting = match &args.on {
        Some(path) => {
            let on = open(path)?;
            Some(retarget_lines(&asset, &on)?)
        }
        None => None,
    };
    let compressed = args.compress.map(|metres| CompressedClips::measure(&asset, metres)).transpose()?;
    if args.json {
        let mut json = facts_json(&asset, &facts, args.joints);
        if let Some(compressed) = compressed {
            json["compressed"] = compressed.json();
        }
        if let Some(lines) = retargeting {
            json["on"] = lines.into();
        }
        return print_json(&json);
    }
    let mut page = Page::default();
    write_overview(&mut page, &asset, &facts, args.joints);
    page.lines(retargeting.unwrap_or_default());
    if let Some(compressed) = compressed {
        page.text(&compressed.text());
    }
    print(page.as_str())
}

/// Lines that describe how the file's first clip is retargeted to another character. For a file without clips, an empty clip is used.
fn retarget_lines(asset: &Asset, on: &Asset) -> Result<Vec<String>, Failure> {
    let still = Clip::new(String::new(), asset.skeleton.len(), Vec::new()).ok().map(Arc::new);
    let Some(clip) = asset.clips.first().cloned().or(still) else { return Ok(Vec::new()) };
    let lines = mapping_lines(asset, on, &clip, Default::default());
    lines.map_err(|nothing| Failure::input(format!("{}\n    {}", nothing.message, nothing.hint)))
}

fn importer_name_and_about(args: &InfoArgs, registry: &Registry, head: Vec<u8>) -> (String, String) {
    let source = Source { name: args.file.display().to_string(), bytes: Arc::new(head) };
    let found = registry.importer_for(&source, args.import.importer.as_deref());
    found.map(|i| (i.manifest().name.to_string(), i.manifest().about.to_string())).unwrap_or_default()
}

fn print_media(args: &InfoArgs, media: &Media) -> Result<(), Failure> {
    if args.json {
        let made: serde_json::Map<String, Value> =
            media.provenance.iter().map(|(k, v)| (k.clone(), v.clone().into())).collect();
        return print_json(&json!({
            "file": args.file.display().to_string(), "format": media.format,
            "size": [media.width, media.height], "provenance": made,
        }));
    }
    let mut text = Page::default();
    text.line(format_args!("{}: {}, {}×{}", args.file.display(), media.format, media.width, media.height));
    for (key, value) in media.provenance.iter().take(MAX_METADATA_ENTRIES) {
        text.line(format_args!(
            "  {:<12} {}",
            one_line(key.strip_prefix("choreo:").unwrap_or(key)),
            one_line(value)
        ));
    }
    let more = media.provenance.len().saturating_sub(MAX_METADATA_ENTRIES);
    if more > 0 {
        text.line(format_args!("  and {more} more; --json prints all"));
    }
    if media.provenance.is_empty() {
        text.line(format_args!("  does not say how it was made"));
    }
    print(text.as_str())
}

/// Largest number of metadata entries printed: the file is not trusted, and its output must stay readable.
const MAX_METADATA_ENTRIES: usize = 64;

fn one_line(text: &str) -> String {
    const MAX_CHARS: usize = 2_000;
    let mut line: String = text.chars().take(MAX_CHARS).map(|c| if c == '\n' { ' ' } else { c }).collect();
    if line.len() < text.len() {
        line.push('…');
    }
    line
}

struct AssetFacts {
    importer: (String, String),
    vertices: usize,
    triangles: usize,
    primitives: usize,
    image_bytes: usize,
    /// Bounding box (minimum, maximum) in metres; `None` if nothing is visible.
    extents: Option<[[f32; 3]; 2]>,
}

fn collect_facts(asset: &Asset, importer: (String, String)) -> AssetFacts {
    let primitives = || asset.meshes.iter().flat_map(|m| &m.primitives);
    let triangle = |p: &&choreo_asset::Primitive| p.topology == choreo_asset::Topology::Triangles;
    let bounds = asset.rest_bounds();
    AssetFacts {
        importer,
        vertices: primitives().map(|p| p.positions.len()).sum(),
        triangles: primitives().filter(triangle).map(|p| p.indices.len() / 3).sum(),
        primitives: primitives().count(),
        image_bytes: asset.images.iter().map(|i| 4 * i.width as usize * i.height as usize).sum(),
        extents: (!bounds.is_empty()).then(|| [bounds.min.to_array(), bounds.max.to_array()]),
    }
}

fn write_overview(page: &mut Page, asset: &Asset, facts: &AssetFacts, joints: bool) {
    let texts = scene::warning_texts(asset);
    page.line(format_args!("{}: {} ({})", asset.name, facts.importer.0, facts.importer.1));
    page.line(format_args!("importer   {}", asset.origin.importer));
    if !asset.origin.format.is_empty() {
        let is_warned = asset.warnings.iter().any(|w| w.text.starts_with("the format has no unit"));
        let guessed = asset.origin.unit_is_assumed && is_warned;
        page.line(format_args!("file       {}", origin_text(&asset.origin, guessed)));
    }
    if let Some([min, max]) = facts.extents {
        let size: [f32; 3] = std::array::from_fn(|i| max[i] - min[i]);
        page.line(format_args!(
            "size       {:.3} × {:.3} × {:.3} m at rest (x, y up, z)",
            size[0], size[1], size[2]
        ));
    }
    if !asset.facing().evidence.is_empty() {
        page.line(format_args!("facing     {}", facing_text(asset.facing())));
    }
    write_mesh_summary(page, asset, facts);
    let skins: Vec<String> = asset.skins.iter().map(|s| s.joints.len().to_string()).collect();
    let in_skins = match skins.as_slice() {
        [] => String::new(),
        [one] if one == "1" => " (1 joint)".to_string(),
        _ => format!(" ({} joints)", skins.join(", ")),
    };
    let (nodes, skins) = (asset.skeleton.len(), skins.len());
    let (nodes, skins) = (counted(nodes as u64, "node"), counted(skins as u64, "skin"));
    page.line(format_args!("joints     {nodes}, {skins}{in_skins}"));
    for mesh in asset.meshes.iter().filter(|m| m.morph_targets > 0) {
        let names = model::list(mesh.morph_names.iter().map(String::as_str), 12);
        let targets = counted(mesh.morph_targets as u64, "target");
        page.line(format_args!("morphs     {}: {targets} {names}", mesh.name));
    }
    page.line(format_args!(
        "materials  {}, images {} ({:.1} MB in memory)",
        asset.materials.len(),
        asset.images.len(),
        facts.image_bytes as f64 / 1e6
    ));
    for image in &asset.images {
        page.line(format_args!("  image    {} {}×{}", image.name, image.width, image.height));
    }
    page.line(format_args!("clips      {}", asset.clips.len()));
    for clip in &asset.clips {
        page.line(format_args!(
            "  {:<28} {:8.3} s, {}",
            clip.name,
            clip.duration.as_secs(),
            counted((clip.curves().len() + clip.properties().len()) as u64, "curve")
        ));
    }
    character::write_character_lines(page, asset, joints);
    for camera in &asset.cameras {
        page.line(format_args!("camera     {} ({})", camera.name, projection_text(&camera.projection)));
    }
    for light in &asset.lights {
        page.line(format_args!(
            "light      {} ({}, {})",
            light.name,
            light.light.kind.name(),
            intensity_text(&light.light)
        ));
    }
    if joints {
        write_joint_tree(page, asset);
    }
    page.lines(texts);
}

fn write_mesh_summary(page: &mut Page, asset: &Asset, facts: &AssetFacts) {
    page.line(format_args!(
        "meshes     {} with {}, {}, {}",
        asset.meshes.len(),
        counted(facts.primitives as u64, "primitive"),
        counted(facts.vertices as u64, "vertex"),
        counted(facts.triangles as u64, "triangle")
    ));
    for mesh in mesh_lines(asset) {
        page.line(format_args!("  mesh     {mesh}"));
    }
    let copied: Vec<usize> =
        asset.instances.iter().filter(|i| !i.copies.is_empty()).map(|i| asset.times(i)).collect();
    if !copied.is_empty() {
        let copies: usize = copied.iter().sum();
        let of = counted(copied.len() as u64, "mesh");
        page.line(format_args!("copies     {copies}, of {of} drawn many times"));
    }
}

/// Largest number of lines about meshes; further meshes are only counted.
const MAX_MESH_LINES: usize = 100;

/// Lines with the name of each mesh, and the nodes that show it under other names: the names that `hide_parts` accepts.
fn mesh_lines(asset: &Asset) -> Vec<String> {
    let mut lines = Vec::new();
    for (index, mesh) in asset.meshes.iter().enumerate() {
        let shown = asset.instances.iter().filter(|instance| instance.mesh as usize == index);
        let nodes = shown.filter_map(|instance| asset.skeleton.names().get(instance.joint as usize));
        let mut nodes: Vec<&str> = nodes.map(String::as_str).filter(|node| *node != mesh.name).collect();
        nodes.sort_unstable();
        nodes.dedup();
        lines.push(match nodes.is_empty() {
            true => mesh.name.clone(),
            false => format!("{} on {}", mesh.name, model::list(nodes.into_iter(), 12)),
        });
    }
    let more = lines.len().saturating_sub(MAX_MESH_LINES);
    lines.truncate(MAX_MESH_LINES);
    lines.extend((more > 0).then(|| format!("and {more} more; --json lists all")));
    lines
}

/// Formats the facing direction, as `+z (feet, eyes)`. If the evidence is contradictory, each part is listed with its direction.
fn facing_text(facing: &Facing) -> String {
    let part = |e: &FacingEvidence| match facing.doubtful {
        true => format!("{} {:+.1} {:+.1}", e.part, e.direction.x, e.direction.z),
        false => e.part.to_string(),
    };
    let parts: Vec<String> = facing.evidence.iter().map(part).collect();
    let doubt =
        if facing.doubtful { ", default: its parts point in different directions (x, z)" } else { "" };
    format!("{} ({}{doubt})", facing.front.name(), parts.join(", "))
}

/// Conventions of the file before conversion: format, unit, up axis.
fn origin_text(o: &Origin, guessed: bool) -> String {
    let mut text = o.format.clone();
    // A guessed unit is left out here: it has its own warning, with the reason.
    if let Some(metres) = o.metres_per_unit.filter(|_| !guessed) {
        // Units derived from inches have many digits; six decimal places are enough to read.
        let shown = if metres < 1e-3 { metres } else { (metres * 1e6).round() / 1e6 };
        let is = if o.unit_is_assumed { "taken as" } else { "=" };
        let _ = write!(text, ", 1 unit {is} {shown} m");
    }
    if !o.up.is_empty() {
        let _ = write!(text, ", {} up", o.up);
    }
    if !o.writer.is_empty() {
        let _ = write!(text, ", written by {}", o.writer);
    }
    text
}

/// Prints the joints, indented below their parents.
fn write_joint_tree(page: &mut Page, asset: &Asset) {
    let skeleton = &asset.skeleton;
    let mut depth = vec![0usize; skeleton.len()];
    let mut children = vec![Vec::new(); skeleton.len()];
    let mut roots = Vec::new();
    for (i, parent) in skeleton.parents().iter().enumerate() {
        match parent {
            Some(p) => {
                depth[i] = depth[*p as usize] + 1;
                children[*p as usize].push(i);
            }
            None => roots.push(i),
        }
    }
    page.line(format_args!("tree"));
    let mut stack: Vec<usize> = roots.into_iter().rev().collect();
    while let Some(joint) = stack.pop() {
        // The indentation is capped: for a chain of joints deeper than in any real skeleton, it would grow quadratically.
        let indent = "  ".repeat(depth[joint].min(40) + 1);
        page.line(format_args!("{indent}{}", skeleton.names()[joint]));
        stack.extend(children[joint].iter().rev());
    }
}

fn projection_text(p: &Projection) -> String {
    match p {
        Projection::Perspective { yfov, .. } => format!("perspective, {:.1}° high", yfov.to_degrees()),
        Projection::Orthographic { height, .. } => format!("orthographic, {height} m high"),
    }
}

/// Intensity of a light in the unit of its kind: candela, or lux for a directional light.
fn intensity_text(light: &Light) -> String {
    format!("{} {}", (f64::from(light.intensity) * 1e3).round() / 1e3, light.kind.unit())
}

fn facts_json(asset: &Asset, facts: &AssetFacts, joints: bool) -> Value {
    let names = asset.skeleton.names().iter().zip(asset.skeleton.parents());
    let list = |n: usize| (0..n).collect::<Vec<_>>();
    let mut value = json!({
        "file": asset.name,
        "importer": facts.importer.0,
        "importer_version": asset.origin.importer.rsplit(' ').next(),
        "origin": {
            "format": asset.origin.format, "writer": asset.origin.writer,
            "metres_per_unit": asset.origin.metres_per_unit, "unit_is_assumed": asset.origin.unit_is_assumed, "up": asset.origin.up,
        },
        "facing": {
            "front": asset.facing().front.name(), "doubtful": asset.facing().doubtful,
            "evidence": asset.facing().evidence.iter().map(|e| json!({ "part": e.part, "direction": e.direction.to_array() }))
                .collect::<Vec<_>>(),
        },
        "joints": asset.skeleton.len(),
        "skins": asset.skins.iter().map(|s| s.joints.len()).collect::<Vec<_>>(),
        "meshes": asset.meshes.iter().map(|m| json!({
            "name": m.name,
            "primitives": m.primitives.len(),
            "vertices": m.primitives.iter().map(|p| p.positions.len()).sum::<usize>(),
            "morph_targets": m.morph_names.iter().cloned().map(Value::from)
                .chain(list(m.morph_targets).into_iter().skip(m.morph_names.len()).map(Value::from))
                .collect::<Vec<_>>(),
        })).collect::<Vec<_>>(),
        "vertices": facts.vertices,
        "triangles": facts.triangles,
        "materials": asset.materials.iter().map(|m| m.name.clone()).collect::<Vec<_>>(),
        "images": asset.images.iter().map(|i| json!({ "name": i.name, "size": [i.width, i.height] })).collect::<Vec<_>>(),
        "clips": asset.clips.iter().map(|c| json!({
            "name": c.name, "seconds": c.duration.as_secs(), "curves": c.curves().len(),
        })).collect::<Vec<_>>(),
        "cameras": asset.cameras.iter().map(|c| c.name.clone()).collect::<Vec<_>>(),
        "lights": asset.lights.iter().map(|l| json!({ "name": l.name, "kind": l.light.kind.name() })).collect::<Vec<_>>(),
        "extents": facts.extents,
        "warnings": asset.warnings.iter().map(|w| json!({ "place": w.place, "text": w.text })).collect::<Vec<_>>(),
    });
    value["character"] = character::character_json(asset);
    if joints {
        value["skeleton"] = names.map(|(name, parent)| json!({ "name": name, "parent": parent })).collect();
    }
    value
}
