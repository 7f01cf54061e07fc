//! Animation stacks to clips. FBX curves are Béziers in time, rotate by Euler angles, and act through pivots and layers. Where a
//! single layer drives a node, its curves are cubics between keys, and the resulting transform nearly is. The clip then gets the
//! file's keys with exact values and slopes. All other motion is sampled through ufbx. Steps stay steps.

use crate::curve::{self, Span};
use crate::driven::{DrivenProperties, NodeCurves};
use crate::emit;
use crate::file::{File, place_of};
use crate::joined::{JoinedCurves, TransformPart};
use crate::keys::{self, Blend, Keys, SharedTimes};
use crate::local;
use crate::meshes::VisibleMesh;
use crate::morphs;
use crate::nodes::Tree;
use crate::objects::Object;
use crate::properties;
use crate::sampled;
use crate::weights::WeightTrack;
use choreo_importer_kit::{Problem, Result};
use choreo_motion::clip::MAX_WEIGHTS;
use choreo_motion::{Clip, Curve, Interpolation, Path, PropertyCurve, Time};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use ufbx::{AnimCurve, AnimStack};

/// Latest key time, seconds (about 115 days). Later keys are taken for damage.
const MAX_KEY_SECS: f64 = 1e7;
/// Largest difference from rest that counts as still: in metres, in quaternion components, and in scale.
const STILL_TOLERANCE: f32 = 1e-6;

pub(crate) fn read(
    file: &File<'_>,
    tree: &Tree,
    visible_meshes: &[VisibleMesh<'_>],
    objects: &[Object<'_>],
) -> Result<Vec<Arc<Clip>>> {
    let mut clips = Vec::new();
    for stack in &file.scene.anim_stacks {
        let name = stack_name(stack);
        if !file.files.wants_clip(clips.len(), &name) {
            let clip = Clip::new(name, tree.skeleton.len(), Vec::new());
            clips.push(Arc::new(clip.map_err(|e| Problem::new(place_of(&stack.element), e.to_string()))?));
            continue;
        }
        let driven = DrivenProperties::new(stack);
        let span = time_span(stack, &driven)?;
        let repeating_elements = driven.repeating_elements(span);
        let (times, curves) = (SharedTimes::default(), Vec::new());
        let builder = ClipBuilder {
            file,
            tree,
            visible_meshes,
            objects,
            stack,
            driven,
            repeating_elements,
            span,
            times,
            curves,
        };
        match builder.build_clip()? {
            Some(clip) => clips.push(Arc::new(clip)),
            None => file.notes.warn(place_of(&stack.element), "moves nothing and is left out"),
        }
    }
    Ok(clips)
}

fn stack_name(stack: &AnimStack) -> String {
    match stack.element.name.as_ref() {
        "" => format!("stack {}", stack.element.typed_id),
        name => name.to_string(),
    }
}

/// The time span that the stack states, else that from its first key to its last.
fn time_span(stack: &AnimStack, driven: &DrivenProperties<'_>) -> Result<Span> {
    let (begin, end) = match stack.time_end > stack.time_begin {
        true => (stack.time_begin, stack.time_end),
        false => driven.key_range().unwrap_or((0.0, 0.0)),
    };
    let is_valid = |t: f64| t.is_finite() && t.abs() <= MAX_KEY_SECS;
    match is_valid(begin) && is_valid(end) {
        true => Ok(Span { begin: Time::from_secs(begin), end: Time::from_secs(end) }),
        false => {
            let what = format!("plays from {begin} s to {end} s; times must lie within ±{MAX_KEY_SECS} s");
            Err(Problem::new(place_of(&stack.element), what))
        }
    }
}

pub(crate) struct ClipBuilder<'a, 'f> {
    pub file: &'a File<'f>,
    tree: &'a Tree,
    visible_meshes: &'a [VisibleMesh<'f>],
    pub objects: &'a [Object<'f>],
    pub stack: &'a AnimStack,
    pub driven: DrivenProperties<'a>,
    /// Elements with curves that repeat or continue beyond their keys.
    pub repeating_elements: BTreeSet<u32>,
    pub span: Span,
    pub times: SharedTimes,
    curves: Vec<Curve>,
}

/// Transform parts grouped by their intervals, which they share.
type PartsByIntervals<'a> = BTreeMap<Vec<(Time, Time)>, Vec<TransformPart<'a>>>;

impl ClipBuilder<'_, '_> {
    pub(crate) fn place(&self) -> String {
        place_of(&self.stack.element)
    }

    fn build_clip(mut self) -> Result<Option<Clip>> {
        self.warn_repeated();
        self.add_node_curves()?;
        self.add_weight_curves()?;
        let mut properties = self.property_curves()?;
        self.warn_unsupported();
        if self.curves.iter().all(|c| self.is_still(c)) && properties.is_empty() {
            return Ok(None);
        }
        self.extend_to_end(&mut properties);
        Clip::new(stack_name(self.stack), self.tree.skeleton.len(), self.curves)
            .and_then(|clip| clip.with_properties(properties))
            .map(Some)
            .map_err(|e| Problem::new(place_of(&self.stack.element), e.to_string()))
    }

    /// Whether a curve holds its joint at rest. Exporters write such curves for nodes that nobody animated.
    fn is_still(&self, curve: &Curve) -> bool {
        let Some(rest) = self.tree.skeleton.rest().get(curve.joint as usize) else { return false };
        let near = |rest: &[f32]| {
            let close = |sign: f32| {
                curve.values.iter().zip(rest).all(|(v, r)| (sign * v - r).abs() < STILL_TOLERANCE)
            };
            curve.times.len() == 1 && (close(1.0) || curve.path == Path::Rotation && close(-1.0))
        };
        match curve.path {
            Path::Translation => near(&rest.translation.to_array()),
            Path::Rotation => near(&rest.rotation.to_array()),
            Path::Scale => near(&rest.scale.to_array()),
            Path::Weights(_) => false,
        }
    }

    fn warn_repeated(&self) {
        for id in self.repeating_elements.iter().take(20) {
            if let Some(element) = self.file.scene.elements.get(*id as usize) {
                let what = format!(
                    "repeats beyond its keys, and is sampled {} times a second; steps are not kept",
                    self.file.rate
                );
                self.file.notes.warn(format!("{}: {}", self.place(), place_of(element)), what);
            }
        }
    }

    fn add_node_curves(&mut self) -> Result<()> {
        let scene = self.file.scene;
        // Collects nodes with a closed form first, because members borrow from them.
        let mut nodes_with_closed_form = Vec::new();
        for id in self.driven.nodes(scene) {
            let Some(node) = scene.nodes.get(id as usize) else { continue };
            let Some(joint) = self.tree.joint_of_node.get(id as usize).copied().flatten() else { continue };
            let repeats = DrivenProperties::contains_node(&self.repeating_elements, node);
            match self.driven.node_curves(node).filter(|_| !repeats && self.span.length() > Time(2)) {
                Some(node_curves) => nodes_with_closed_form.push((joint, node_curves)),
                None => self.add_sampled_node(node, joint, repeats)?,
            }
        }
        let mut groups = PartsByIntervals::new();
        for (joint, node_curves) in &nodes_with_closed_form {
            for path in TRANSFORM_PATHS {
                self.add_to_group(&mut groups, *joint, node_curves, path)?;
            }
        }
        for (intervals, members) in groups {
            let parts = emit::part_counts(&members, self.file.accuracy);
            let keys = parts.iter().map(|n| *n as usize).sum::<usize>() + parts.len();
            for member in members {
                // Memory of a row in f64, in f32, and of its time.
                self.file.charge(keys, 96 + 16 + 12 * member.path.width(), || self.place())?;
                let times = emit::key_times(&intervals, &parts);
                let keys = emit::member_keys(&member, &parts, &times, self.file.accuracy);
                self.push_curve(member.joint, member.path, keys);
            }
        }
        Ok(())
    }

    /// Adds a curve that never changes, and puts any other with those of the same key times, so that they share them.
    fn add_to_group<'m>(
        &mut self,
        groups: &mut PartsByIntervals<'m>,
        joint: u32,
        node_curves: &'m NodeCurves<'_>,
        path: Path,
    ) -> Result<()> {
        let local = &node_curves.local;
        let (swings, scaled) = local.swings();
        let own_part = TRANSFORM_PATHS.iter().position(|p| *p == path).unwrap_or_default();
        let swung =
            path == Path::Translation && swings && (node_curves.drives(1) || scaled && node_curves.drives(2));
        let with_scale = swung && scaled && node_curves.drives(2);
        // ufbx keeps scale that children do not inherit in a scale helper node. Its factors multiply the scale of a helper, but only the
        // translation of any other node.
        let follows = path == if local.is_scale_helper { Path::Scale } else { Path::Translation };
        let factors = if follows { &node_curves.factors[..] } else { &[] };
        if !node_curves.drives(own_part) && !swung && !factors.iter().any(|f| f.drives()) {
            return Ok(());
        }
        let mut curves: Vec<Vec<curve::Piece>> = Vec::with_capacity(9);
        let mut add = |of: &dyn Fn(usize) -> (Option<&'m AnimCurve>, f64), tolerance: f64| {
            let first = curves.len();
            for axis in 0..3 {
                let (curve, constant) = of(axis);
                self.file.charge(curve.map_or(1, |c| c.keyframes.len()), 2 * 64, || self.place())?;
                let mut out = Vec::with_capacity(curve.map_or(1, |c| c.keyframes.len() + 1));
                curve::pieces(curve, constant, self.span, tolerance, &mut out);
                curves.push(out);
            }
            Result::Ok(first)
        };
        let greatest = |of: &dyn Fn(usize) -> (Option<&'m AnimCurve>, f64)| {
            let most = |axis| match of(axis) {
                (Some(c), _) => c.min_value.abs().max(c.max_value.abs()),
                (None, v) => v.abs(),
            };
            (0..3).map(most).fold(1e-12, f64::max)
        };
        let of_factor = |f: usize| move |axis: usize| factors[f].curve(axis);
        let factor_product: f64 = (0..factors.len()).map(|f| greatest(&of_factor(f))).product();
        let tolerance = self.tolerance(path, own_part, node_curves) / factor_product.max(1e-9);
        add(&|axis| node_curves.curve(own_part, axis), tolerance)?;
        let rotation_curve = match swung {
            true => Some(add(&|axis| node_curves.curve(1, axis), self.tolerance(path, 1, node_curves))?),
            false => None,
        };
        let scale_curve = match with_scale {
            true => Some(add(&|axis| node_curves.curve(2, axis), self.tolerance(path, 2, node_curves))?),
            false => None,
        };
        let size = greatest(&|axis| node_curves.curve(own_part, axis));
        let mut multiplied = Vec::new();
        for f in 0..factors.len() {
            let of = of_factor(f);
            // The other factors multiply this one's error.
            let others = size * factor_product / greatest(&of);
            multiplied.push(add(&of, self.tolerance(path, own_part, node_curves) / others.max(1e-12))?);
        }
        let slices: Vec<&[curve::Piece]> = curves.iter().map(|c| c.as_slice()).collect();
        let count: usize = slices.iter().map(|c| c.len()).sum();
        self.file.charge(count, 32 * slices.len(), || self.place())?;
        let member = TransformPart {
            joint,
            path,
            local,
            curves: JoinedCurves::new(&slices),
            rotation_curve,
            scale_curve,
            factors: multiplied,
            rest: [node_curves.rest(1), node_curves.rest(2)],
        };
        if member.curves.is_constant() {
            let (value, _) = member.at_start();
            let values = value[..path.width()].iter().map(|v| *v as f32).collect();
            let keys = Keys { interpolation: Interpolation::Linear, times: vec![Time::ZERO], values };
            self.push_curve(joint, path, keys);
        } else {
            groups.entry(member.curves.intervals.clone()).or_default().push(member);
        }
        Ok(())
    }

    /// Tolerance in the curve's own unit. It is smaller for a rotation or scale that swings the node about a pivot.
    fn tolerance(&self, path: Path, part: usize, node_curves: &NodeCurves<'_>) -> f64 {
        let (accuracy, local) = (self.file.accuracy, &node_curves.local);
        let swung = |limit: f64, arm: f64| match path == Path::Translation && arm > 0.0 {
            true => limit.min(accuracy.metres / arm),
            false => limit,
        };
        match part {
            0 => accuracy.metres / local.metres().max(1e-12),
            1 => swung(accuracy.radians, local.lever_arm_metres(node_curves.rest(2))).to_degrees(),
            _ => swung(accuracy.scale, local.scaled_lever_arm_metres()),
        }
    }

    fn add_sampled_node(&mut self, node: &ufbx::Node, joint: u32, repeats: bool) -> Result<()> {
        let place = || format!("{}: {}", place_of(&self.stack.element), place_of(&node.element));
        let times = match repeats {
            true => sampled::even_times(self.file, self.span, &place)?,
            false => sampled::sample_times(self.file, self.driven.curves_of(node), self.span, &place)?,
        };
        if times.is_empty() {
            return Ok(());
        }
        let rows = sampled::sample_node(self.file, &self.stack.anim, node, (times, self.span), &place)?;
        self.file.charge(rows.times.len(), 8 + 4 * 10, || self.place())?;
        for (path, at) in [(Path::Translation, 0), (Path::Rotation, 3), (Path::Scale, 7)] {
            let width = path.width();
            let values = rows.values.chunks_exact(10).flat_map(|row| &row[at..at + width]);
            let values = values.map(|v| *v as f32).collect();
            let blend = if path == Path::Rotation { Blend::Rotation } else { Blend::Numbers };
            self.push_curve(joint, path, keys::simplify_keys(rows.times.clone(), values, width, blend));
        }
        Ok(())
    }

    fn push_curve(&mut self, joint: u32, path: Path, keys: Keys) {
        let Keys { interpolation, times, values } = keys;
        if times.is_empty() {
            return;
        }
        let times = self.times.share(times);
        self.curves.push(Curve { joint, path, interpolation, times, values: values.into() });
    }

    /// Makes one weight curve for each mesh. Its keys are all times at which a channel has a key or a shape's weight bends.
    fn add_weight_curves(&mut self) -> Result<()> {
        let mut done = BTreeSet::new();
        for visible_mesh in self.visible_meshes {
            let count = morphs::count(visible_mesh.mesh);
            let curves: Vec<_> =
                morphs::channels(visible_mesh.mesh).map(|c| self.driven.weight_curves(c)).collect();
            let still = curves.iter().all(|c| c.is_empty());
            if still || count > MAX_WEIGHTS as usize || !done.insert(visible_mesh.joint) {
                continue;
            }
            let mut times = BTreeSet::new();
            let mut tracks = Vec::new();
            for (channel, curves) in morphs::channels(visible_mesh.mesh).zip(&curves) {
                let id = channel.element.element_id;
                let with = (curves.as_slice(), self.repeating_elements.contains(&id));
                let track = match curves.is_empty() {
                    true => WeightTrack::still(channel),
                    false => {
                        let place = || place_of(&self.stack.element);
                        WeightTrack::new(self.file, &self.stack.anim, channel, with, self.span, &place)?
                    }
                };
                self.file.charge(track.times().count(), 64, || self.place())?;
                times.extend(track.times());
                tracks.push((channel, track));
            }
            self.file.charge(times.len(), 8 + 4 * count, || self.place())?;
            let mut values = Vec::with_capacity(times.len() * count);
            for time in &times {
                for (channel, track) in &tracks {
                    morphs::append_shape_weights(channel, track.at(*time), &mut values);
                }
            }
            let keys = keys::simplify_keys(times.into_iter().collect(), values, count, Blend::Numbers);
            self.push_curve(visible_mesh.joint, Path::Weights(count as u32), keys);
        }
        Ok(())
    }

    /// Warns about animated properties that clips cannot hold.
    fn warn_unsupported(&self) {
        let known = |id: u32, name: &str| {
            self.objects.iter().any(|o| o.element_id() == Some(id) && properties::is_known(o, name))
        };
        for (id, names) in self.driven.other_properties(known) {
            let Some(of_file) = self.file.scene.elements.get(id as usize) else { continue };
            let list = names.iter().take(6).copied().collect::<Vec<_>>().join(", ");
            let what = format!("animates {list}, which clips cannot hold; the value at rest is used");
            self.file.notes.warn(format!("{}: {}", self.place(), place_of(of_file)), what);
        }
    }

    /// Extends the first curve to the end of the stack's time span, where all curves end earlier: a clip is as long as its
    /// longest curve.
    fn extend_to_end(&mut self, properties: &mut [PropertyCurve]) {
        let length = self.span.length();
        let of_joints = self.curves.iter().map(|c| &c.times);
        let ends = of_joints.chain(properties.iter().map(|p| &p.times)).filter_map(|t| t.last());
        if ends.max().is_some_and(|end| *end >= length) {
            return;
        }
        let mut extend =
            |times: &mut Arc<[Time]>, values: &mut Arc<[f32]>, interpolation: Interpolation, width: usize| {
                let stride = if interpolation == Interpolation::CubicSpline { 3 * width } else { width };
                let mut end = values[values.len() - stride..].to_vec();
                if interpolation == Interpolation::CubicSpline {
                    // The value stays constant from there on.
                    end[..width].fill(0.0);
                    end[2 * width..].fill(0.0);
                }
                *values = values.iter().chain(&end).copied().collect();
                *times = self.times.share(times.iter().copied().chain([length]).collect());
            };
        if let Some(c) = self.curves.first_mut() {
            extend(&mut c.times, &mut c.values, c.interpolation, c.path.width());
        } else if let Some(p) = properties.first_mut() {
            extend(&mut p.times, &mut p.values, p.interpolation, p.target.width());
        }
    }
}

const TRANSFORM_PATHS: [Path; 3] = [Path::Translation, Path::Rotation, Path::Scale];
/// Properties of the parts of a transform: the first three of [`local::TRANSFORM_INPUTS`].
pub(crate) const TRANSFORM_PROPERTIES: [&str; 3] = [local::TRANSLATION, local::ROTATION, local::SCALING];
