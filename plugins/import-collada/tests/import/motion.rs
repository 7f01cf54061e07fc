//! Clips against f64 evaluations that share no code with the importer.

use choreo_asset::Asset;
use choreo_importer_kit_testing::{Companions, assets, import, import_bytes, pose, source, warnings};
use choreo_motion::Time;
use choreo_plugin::ImportScope;
use glam::{DMat4, DVec3};
use import_collada::ColladaImporter;
use roxmltree::{Document, Node};

const ARM: &str = include_str!("../data/arm.dae");

fn numbers(text: &str) -> Vec<f64> {
    text.split_whitespace().map(|w| w.parse().unwrap()).collect()
}

/// Reference reader of matrix animations: the keys of every channel by node. Supports whole matrices only.
struct Oracle<'d> {
    doc: &'d Document<'d>,
    /// Node id, times, matrices.
    channels: Vec<(String, Vec<f64>, Vec<DMat4>)>,
    metres: f64,
    up: DMat4,
}

impl<'d> Oracle<'d> {
    fn new(doc: &'d Document<'d>) -> Oracle<'d> {
        let id = |id: &str| {
            doc.descendants().find(|n| n.attribute("id") == Some(id.trim_start_matches('#'))).unwrap()
        };
        let array = |source: Node<'_, '_>| {
            numbers(source.descendants().find(|n| n.has_tag_name_any("float_array")).unwrap().text().unwrap())
        };
        let mut channels = Vec::new();
        for channel in doc.descendants().filter(|n| n.has_tag_name_any("channel")) {
            let (node, _) = channel.attribute("target").unwrap().split_once('/').unwrap();
            let sampler = id(channel.attribute("source").unwrap());
            let input = |semantic: &str| {
                let input = sampler.children().find(|n| n.attribute("semantic") == Some(semantic)).unwrap();
                array(id(input.attribute("source").unwrap()))
            };
            let matrices =
                input("OUTPUT").chunks(16).map(|m| DMat4::from_cols_slice(m).transpose()).collect();
            channels.push((node.to_string(), input("INPUT"), matrices));
        }
        let unit = doc.descendants().find(|n| n.has_tag_name_any("unit")).unwrap();
        let z_up = doc.descendants().any(|n| n.has_tag_name_any("up_axis") && n.text() == Some("Z_UP"));
        let angle = if z_up { -std::f64::consts::FRAC_PI_2 } else { 0.0 };
        Oracle {
            doc,
            channels,
            metres: unit.attribute("meter").unwrap().parse().unwrap(),
            up: DMat4::from_rotation_x(angle),
        }
    }

    /// The last channel that has a key at `time` counts.
    fn local(&self, node: Node<'_, '_>, secs: f64) -> DMat4 {
        let id = node.attribute("id").unwrap_or_default();
        if let Some((_, times, matrices)) = self.channels.iter().find(|(n, ..)| n == id) {
            let key = times.partition_point(|t| *t <= secs + 1e-9).max(1) - 1;
            return matrices[key];
        }
        let mut m = DMat4::IDENTITY;
        for element in node.children().filter(Node::is_element) {
            let v = || numbers(element.text().unwrap());
            m *= match element.tag_name().name() {
                "matrix" => DMat4::from_cols_slice(&v()).transpose(),
                "translate" => DMat4::from_translation(DVec3::from_slice(&v())),
                "scale" => DMat4::from_scale(DVec3::from_slice(&v())),
                "rotate" => DMat4::from_axis_angle(DVec3::from_slice(&v()[..3]), v()[3].to_radians()),
                _ => continue,
            };
        }
        m
    }

    /// Positions of all nodes in metres and +Y up, depth first; each followed by a point 50 units along its x.
    fn positions(&self, secs: f64) -> Vec<DVec3> {
        let scene = self.doc.descendants().find(|n| n.has_tag_name_any("visual_scene")).unwrap();
        let mut out = Vec::new();
        self.walk(scene, self.up, secs, &mut out);
        out
    }

    fn walk(&self, parent: Node<'_, '_>, world: DMat4, secs: f64, out: &mut Vec<DVec3>) {
        for node in parent.children().filter(|n| n.has_tag_name_any("node")) {
            let here = world * self.local(node, secs);
            out.push(here.w_axis.truncate() * self.metres);
            out.push(here.transform_point3(DVec3::X * 50.0) * self.metres);
            self.walk(node, here, secs, out);
        }
    }
}

trait TagName {
    fn has_tag_name_any(&self, name: &str) -> bool;
}

impl TagName for Node<'_, '_> {
    fn has_tag_name_any(&self, name: &str) -> bool {
        self.tag_name().name() == name
    }
}

/// Worst distance of any node at any key of the file, relative to the size of what they span. The clip begins at the file's first
/// key.
fn worst(asset: &Asset, oracle: &Oracle<'_>, late_secs: f64) -> f64 {
    let mut keys: Vec<f64> = oracle.channels.iter().flat_map(|c| c.1.clone()).collect();
    keys.sort_by(f64::total_cmp);
    keys.dedup();
    let start = keys[0];
    let mut worst = 0.0f64;
    for secs in keys.iter().step_by(keys.len() / 30 + 1) {
        // Only where all channels that still move have a key: between keys the matrices say nothing.
        let common = |c: &(String, Vec<f64>, Vec<DMat4>)| c.1.contains(secs) || *secs > c.1[c.1.len() - 1];
        if !oracle.channels.iter().all(common) {
            continue;
        }
        let truth = oracle.positions(*secs);
        let ours = pose::at(asset, Some(0), secs - start + late_secs);
        let probe = glam::Vec3A::X * (50.0 * oracle.metres) as f32;
        let ours: Vec<glam::Vec3A> =
            ours.iter().flat_map(|m| [m.translation, m.transform_point3a(probe)]).collect();
        assert_eq!(truth.len(), ours.len());
        let low = truth.iter().copied().fold(DVec3::INFINITY, DVec3::min);
        let high = truth.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
        let size = (high - low).max_element().max(high.abs().max_element()).max(1e-9);
        for (a, b) in ours.iter().zip(&truth) {
            let error = (a.as_dvec3() - *b).length() / size;
            worst = if error.is_nan() { f64::INFINITY } else { worst.max(error) };
        }
    }
    worst
}

#[test]
fn matrix_keys_equal_the_reference() {
    let Some(folder) = assets(4) else { return };
    for name in ["pab/walk.dae", "pab/skeleton.dae", "walk.dae", "cylinder_animated_from_3ds_max.dae"] {
        let text = std::fs::read_to_string(folder.join("dae").join(name)).unwrap();
        let doc = Document::parse(&text).unwrap();
        let oracle = Oracle::new(&doc);
        let asset = import_bytes(&ColladaImporter, name, text.clone()).unwrap();
        let error = worst(&asset, &oracle, 0.0);
        println!("{name}: worst node {error:.1e} of the size; {:?}", warnings(&asset));
        // Six digits in the file make matrices that are not quite rotations; taking them apart moves what hangs on them.
        assert!(error < 3e-5, "{name}: {error}");
        // Looked at a twentieth of a second late, it must be seen.
        if name != "pab/skeleton.dae" {
            assert!(worst(&asset, &oracle, 0.05) > 1e-3, "{name}");
        }
    }
}

/// The arm with its lower node made of single transforms, driven by `channels`.
fn stacked(stack: &str, channels: &str) -> Asset {
    let node = "<matrix sid=\"transform\">1 0 0 100 0 1 0 0 0 0 1 0 0 0 0 1</matrix>";
    let (head, tail) = ARM.split_once("<library_animations>").unwrap();
    let tail = tail.split_once("</library_animations>").unwrap().1;
    let text =
        format!("{head}<library_animations><animation>{channels}</animation></library_animations>{tail}")
            .replace(node, stack);
    let files = Companions::none();
    let needs =
        ImportScope { geometry: false, clips: true, textures: false, pixels: false, image_files: false };
    let asset = import(&ColladaImporter, &source("arm.dae", text), &files, needs);
    asset.unwrap_or_else(|e| panic!("{e}"))
}

fn channel(
    id: &str,
    target: &str,
    times: &str,
    values: &str,
    how: &str,
    tangents: Option<(&str, &str)>,
) -> String {
    let source = |part: &str, kind: &str, text: &str, stride: usize| {
        let count = text.split_whitespace().count();
        format!(
            "<source id=\"{id}-{part}\"><{kind} count=\"{count}\">{text}</{kind}><technique_common>\
             <accessor count=\"{}\" stride=\"{stride}\"/></technique_common></source>",
            count / stride
        )
    };
    let mut out = source("in", "float_array", times, 1)
        + &source("out", "float_array", values, 1)
        + &source("how", "Name_array", how, 1);
    let mut inputs = format!(
        "<input semantic=\"INPUT\" source=\"#{id}-in\"/><input semantic=\"OUTPUT\" source=\"#{id}-out\"/>\
         <input semantic=\"INTERPOLATION\" source=\"#{id}-how\"/>"
    );
    if let Some((before, after)) = tangents {
        out += &(source("ti", "float_array", before, 2) + &source("to", "float_array", after, 2));
        inputs += &format!(
            "<input semantic=\"IN_TANGENT\" source=\"#{id}-ti\"/><input semantic=\"OUT_TANGENT\" source=\"#{id}-to\"/>"
        );
    }
    format!("{out}<sampler id=\"{id}\">{inputs}</sampler><channel source=\"#{id}\" target=\"{target}\"/>")
}

/// The lower node's matrix in its parent, at many times, against a truth; the worst difference.
fn compare(asset: &Asset, end: f64, truth: impl Fn(f64) -> DMat4) -> f64 {
    let mut worst = 0.0f64;
    for i in 0..=400 {
        let secs = end * f64::from(i) / 400.0 + 1e-7;
        let joints = pose::at(asset, Some(0), secs);
        let local = joints[0].inverse() * joints[1];
        let local = DMat4::from_mat3_translation(local.matrix3.as_dmat3(), local.translation.as_dvec3());
        let expected = truth(secs);
        let difference =
            (0..4).map(|c| (local.col(c) - expected.col(c)).abs().max_element()).fold(0.0, f64::max);
        worst = worst.max(difference);
    }
    worst
}

#[test]
fn angles_over_180_degrees_are_kept_and_combine_with_other_axes() {
    let stack = "<translate sid=\"t\">100 0 0</translate><rotate sid=\"z\">0 0 1 0</rotate><rotate sid=\"x\">1 0 0 0</rotate><scale sid=\"s\">1 1 1</scale>";
    let channels = channel("a", "lower-node/z.ANGLE", "0 2", "0 700", "LINEAR LINEAR", None)
        + &channel("b", "lower-node/x.ANGLE", "0 1 2", "0 90 0", "LINEAR LINEAR LINEAR", None)
        + &channel("c", "lower-node/t.Y", "0.5 1.5", "0 50", "LINEAR LINEAR", None)
        + &channel("d", "lower-node/s.X", "0 2", "1 3", "LINEAR LINEAR", None);
    let asset = stacked(stack, &channels);
    let truth = |t: f64| {
        let x = if t < 1.0 { 90.0 * t } else { 90.0 * (2.0 - t) };
        DMat4::from_translation(DVec3::new(1.0, 0.5 * (t - 0.5).clamp(0.0, 1.0), 0.0))
            * DMat4::from_rotation_z((350.0 * t).to_radians())
            * DMat4::from_rotation_x(x.max(0.0).to_radians())
            * DMat4::from_scale(DVec3::new(1.0 + t.min(2.0), 1.0, 1.0))
    };
    let error = compare(&asset, 1.999, truth);
    println!(
        "angles: {error:.1e}, {} keys",
        asset.clips[0].curves().iter().map(|c| c.times.len()).max().unwrap()
    );
    assert!(error < 3e-4, "{error}");
}

/// A cubic in x and y, x solved by small steps: slow, and nothing like the importer's halving.
fn bezier(x: [f64; 4], y: [f64; 4], t: f64) -> f64 {
    let at = |p: [f64; 4], s: f64| {
        let r = 1.0 - s;
        r * r * r * p[0] + 3.0 * r * r * s * p[1] + 3.0 * r * s * s * p[2] + s * s * s * p[3]
    };
    let mut s = 0.0;
    while s < 1.0 && at(x, s) < t {
        s += 1e-5;
    }
    at(y, s)
}

#[test]
fn bezier_step_and_component_keys_equal_the_closed_form() {
    let stack = "<matrix sid=\"m\">1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1</matrix>";
    // The x translation is a Bézier curve, z is stepped; targets are (column)(row).
    let tangents = Some(("0 0 0.4 100", "0.6 0 1 100"));
    let channels = channel("a", "lower-node/m(3)(0)", "0 1", "0 100", "BEZIER BEZIER", tangents)
        + &channel("b", "lower-node/m(3)(2)", "0 0.5 1", "0 10 20", "STEP STEP STEP", None);
    let asset = stacked(stack, &channels);
    let truth = |t: f64| {
        let x = bezier([0.0, 0.6, 0.4, 1.0], [0.0, 0.0, 1.0, 1.0], t);
        let z = if t < 0.5 { 0.0 } else { 0.1 };
        DMat4::from_translation(DVec3::new(x, 0.0, z))
    };
    let error = compare(&asset, 0.999, truth);
    println!("Bézier and held: {error:.1e}");
    assert!(error < 2e-4, "{error}");
    let straight = |t: f64| DMat4::from_translation(DVec3::new(t, 0.0, if t < 0.5 { 0.0 } else { 0.1 }));
    assert!(compare(&asset, 0.999, straight) > 0.05, "the curve is seen");

    // Hermite with tangents (1, slope): the cubic with these slopes at its ends.
    let tangents = Some(("1 0 1 300", "1 300 1 0"));
    let hermite = channel("a", "lower-node/m(3)(1)", "0 1", "0 100", "HERMITE HERMITE", tangents);
    let asset = stacked(stack, &hermite);
    let truth = |t: f64| {
        let (t2, t3) = (t * t, t * t * t);
        let y = (t3 - 2.0 * t2 + t) * 3.0 + (3.0 * t2 - 2.0 * t3) * 1.0 + (t3 - t2) * 3.0;
        DMat4::from_translation(DVec3::new(0.0, y, 0.0))
    };
    let error = compare(&asset, 0.999, truth);
    assert!(error < 2e-4, "{error}");
}

#[test]
fn channels_without_a_usable_target_are_warnings() {
    let stack = "<matrix sid=\"m\">1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1</matrix>";
    let one = |target: &str| channel("a", target, "0 1", "0 1", "LINEAR CARDINAL", None);
    let said = |target: &str| {
        let asset = stacked(
            stack,
            &(one(target) + &channel("b", "lower-node/m(3)(0)", "0 1", "0 1", "LINEAR LINEAR", None)),
        );
        assert_eq!(asset.clips[0].duration, Time::from_secs(1.0));
        warnings(&asset).last().cloned().unwrap_or_default()
    };
    assert!(said("gone/m(0)(0)").ends_with("1 channel for something that is not in the file; left out"));
    assert!(
        said("skin/x")
            .ends_with("1 channel for something that is neither a node nor a morph weight; left out")
    );
    assert!(
        said("lower-node/visibility")
            .ends_with("1 channel for something of a node that is not a transform; left out")
    );
    assert!(
        said("lower-node/m(9)(0)")
            .ends_with("1 channel for a part of a transform that it does not have; left out")
    );
    assert!(said("lower-node/m(3)(1)").ends_with("interpolation CARDINAL is not supported; LINEAR is used"));
}
