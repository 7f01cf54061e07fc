//! `<animation>` and `<animation_clip>`: finds the value that each channel drives, and makes the clips.

use crate::bake::{self, Bound, Component};
use crate::controller::MorphTargets;
use crate::nodes::Tree;
use crate::properties::{self, Driven, Objects};
use crate::sampler::Sampler;
use crate::xml::{LEFT_OUT, Xml, child, children, descendant, label_of, name_of};
use crate::xml::{Node, NodeId};
use choreo_importer_kit::text::{self, shown};
use choreo_importer_kit::{Problem, Result, WithPlace};
use choreo_motion::{Clip, Time};
use std::collections::{BTreeMap, HashMap};
use std::rc::Rc;
use std::sync::Arc;

/// The property that a channel drives.
enum Target {
    /// A transform element (by index) of these joints' stacks, and which of its values.
    Joints(Vec<u32>, usize, Component),
    /// A weight (by index) of a morph controller.
    Morph(NodeId, usize),
    /// Numbers of a camera or light, by name.
    Object(NodeId, Vec<String>),
}

/// The channels of a clip, by target.
#[derive(Default)]
struct Channels {
    /// Channels of each joint.
    joints: BTreeMap<u32, Vec<Bound>>,
    /// Channels of each morph controller, with the index of the weight.
    weights: BTreeMap<u32, Vec<(usize, Rc<Sampler>)>>,
    properties: Vec<Driven>,
}

impl Channels {
    fn samplers(&self) -> impl Iterator<Item = &Rc<Sampler>> {
        let of_joints = self.joints.values().flatten().map(|bound| &bound.sampler);
        let of_weights = self.weights.values().flatten().map(|(_, sampler)| sampler);
        of_joints.chain(of_weights).chain(self.properties.iter().map(Driven::sampler))
    }
}

pub(crate) fn read(
    xml: &Xml<'_>,
    tree: &Tree<'_>,
    (morphs, objects): (&[MorphTargets], &Objects<'_>),
    file: &str,
) -> Result<Vec<Arc<Clip>>> {
    let mut reader = Reader { xml, tree, objects, samplers: HashMap::new(), left_out: BTreeMap::new() };
    let mut out = Vec::new();
    let mut in_clips: Vec<u32> = Vec::new();
    for library in children(xml.root(), "library_animation_clips") {
        for (index, clip) in children(library, "animation_clip").enumerate() {
            let time = |name: &str| -> Result<Option<Time>> {
                let Some(text) = clip.attribute(name) else { return Ok(None) };
                let secs =
                    choreo_importer_kit::text::number(text.trim().as_bytes()).filter(|t| t.abs() <= 1e7);
                let secs = secs.ok_or_else(|| {
                    xml.problem(clip, format!("{name}=\"{}\" is not a time", shown(text.as_bytes())))
                })?;
                Ok(Some(Time::from_secs(secs)))
            };
            let start = time("start")?.unwrap_or(Time::ZERO);
            let range = (Some(start), time("end")?);
            if range.1.is_some_and(|end| end < start) {
                xml.warn(clip, "ends before it starts; it is left out");
                continue;
            }
            let mut channels = Vec::new();
            for instance in children(clip, "instance_animation") {
                let Some(animation) = xml.resolve_instance(instance, "url", "animation", LEFT_OUT) else {
                    continue;
                };
                for channel in animation.descendants().filter(|n| name_of(*n) == "channel") {
                    in_clips.push(channel.id().get());
                    channels.push(channel);
                }
            }
            let name = label_of(clip).map_or(format!("clip {index}"), str::to_string);
            out.extend(reader.clip(name, &channels, range, morphs)?);
        }
    }
    in_clips.sort_unstable();
    let mut rest = Vec::new();
    for library in children(xml.root(), "library_animations") {
        let channels = library.descendants().filter(|n| name_of(*n) == "channel");
        rest.extend(channels.filter(|c| in_clips.binary_search(&c.id().get()).is_err()));
    }
    if !rest.is_empty() {
        // Files do not state a start for these channels, so the clip starts at the first key, as the same motion does in FBX.
        out.extend(reader.clip(file.to_string(), &rest, (None, None), morphs)?);
    }
    for (what, (count, place)) in reader.left_out {
        xml.notes.warn(place, format!("{} {what}; left out", text::count(count, "channel")));
    }
    Ok(out)
}

struct Reader<'x, 'a> {
    xml: &'x Xml<'a>,
    tree: &'x Tree<'a>,
    objects: &'x Objects<'a>,
    samplers: HashMap<NodeId, Rc<Sampler>>,
    /// Reasons why channels are left out: number of channels, and place of the first.
    left_out: BTreeMap<&'static str, (usize, String)>,
}

impl<'a> Reader<'_, 'a> {
    /// A clip of these channels. `start` and `end`: the time range that the file states, else first and last key.
    fn clip(
        &mut self,
        name: String,
        channels: &[Node<'a>],
        (start, end): (Option<Time>, Option<Time>),
        morphs: &[MorphTargets],
    ) -> Result<Option<Arc<Clip>>> {
        let mut driven = Channels::default();
        let mut before_zero = 0;
        for channel in channels {
            let Some(target) = self.target(*channel) else { continue };
            let sampler = self.sampler(*channel)?;
            before_zero += usize::from(
                start == Some(Time::ZERO) && sampler.times.first().is_some_and(|t| *t < Time::ZERO),
            );
            self.bind(&mut driven, *channel, target, sampler)?;
        }
        if before_zero > 0 {
            self.xml.notes.warn(
                format!("clip \"{name}\""),
                format!(
                    "{} with keys before 0 s, where the clip begins; those keys are left out",
                    text::count(before_zero, "channel")
                ),
            );
        }
        let first = || driven.samplers().filter_map(|s| s.times.first().copied()).min();
        let last = || driven.samplers().filter_map(|s| s.times.last().copied()).max();
        let start = start.or_else(first).unwrap_or(Time::ZERO);
        let end = end.or_else(last).unwrap_or(start).max(start);
        let mut curves = Vec::new();
        for (joint, bound) in &driven.joints {
            let made = bake::joint(self.xml, self.tree, *joint, bound, (start, end));
            curves.extend(made.at(|| self.xml.place(self.tree.joints[*joint as usize].node))?);
        }
        for (controller, samplers) in &driven.weights {
            for morph in morphs.iter().filter(|m| m.controller.get() == *controller) {
                curves.extend(bake::weights(self.xml, morph, samplers, (start, end))?);
            }
        }
        let properties = properties::curves(self.xml, self.objects, &driven.properties, (start, end))?;
        if curves.is_empty() && properties.is_empty() {
            return Ok(None);
        }
        let clip = Clip::new(name.clone(), self.tree.joints.len(), curves);
        let clip = clip.and_then(|clip| clip.with_properties(properties));
        clip.map(|c| Some(Arc::new(c))).map_err(|e| Problem::new(format!("clip \"{name}\""), e.to_string()))
    }

    /// Adds a channel to its target. Fails where the keys have another number of values than the target.
    fn bind(
        &self,
        driven: &mut Channels,
        channel: Node<'a>,
        target: Target,
        sampler: Rc<Sampler>,
    ) -> Result<()> {
        let width = sampler.width;
        let differs = |wanted: usize| {
            let values = if wanted == 1 { "one value".into() } else { format!("{wanted} values") };
            Err(self.xml.problem(channel, format!("drives {values}, but its keys have {width}")))
        };
        match target {
            Target::Joints(targets, element, component) => {
                let wanted = match component {
                    Component::One(_) => 1,
                    Component::All => self.tree.joints[targets[0] as usize].stack[element].values.len(),
                };
                if width != wanted {
                    return differs(wanted);
                }
                for joint in targets {
                    let bound = Bound { element, component, sampler: sampler.clone() };
                    driven.joints.entry(joint).or_default().push(bound);
                }
            }
            Target::Morph(..) if width != 1 => return differs(1),
            Target::Morph(controller, index) => {
                driven.weights.entry(controller.get()).or_default().push((index, sampler));
            }
            // Some programs animate colors with alpha.
            Target::Object(_, names) if width < names.len() => return differs(names.len()),
            Target::Object(object, names) => {
                driven.properties.extend(Driven::all(object, names, &sampler));
            }
        }
        Ok(())
    }

    fn sampler(&mut self, channel: Node<'a>) -> Result<Rc<Sampler>> {
        let node = self.xml.resolve_reference(channel, "source")?;
        if name_of(node) != "sampler" {
            return Err(self.xml.problem(channel, format!("source is a {}, not a sampler", name_of(node))));
        }
        if let Some(known) = self.samplers.get(&node.id()) {
            return Ok(known.clone());
        }
        let sampler = Rc::new(Sampler::read(self.xml, node)?);
        self.samplers.insert(node.id(), sampler.clone());
        Ok(sampler)
    }

    /// Resolves a channel's target: `id/sid`, `id/sid/sid.MEMBER`, `id/sid(1)(2)`.
    fn target(&mut self, channel: Node<'a>) -> Option<Target> {
        let text = channel.attribute("target").unwrap_or_default();
        let mut parts: Vec<&str> = text.split('/').collect();
        let last = parts.pop().unwrap_or_default();
        let (sid, member) = match last.find(['(', '.']) {
            Some(at) if !parts.is_empty() || last[at..].starts_with('(') => last.split_at(at),
            _ => (last, ""),
        };
        let Some(first) = parts.first().copied().or((!sid.is_empty()).then_some(sid)) else {
            return self.skip_channel(channel, "without a target");
        };
        let Some(mut node) = self.xml.node_by_id(first).or(self.xml.by_id(first)) else {
            return self.skip_channel(channel, "for something that is not in the file");
        };
        if matches!(name_of(node), "camera" | "light") {
            let of_sid = |n: &Node<'_>| n.attribute("sid").unwrap_or(name_of(*n)) == sid;
            let names = node.descendants().find(of_sid).and_then(|n| properties::names(n, member));
            return match names {
                Some(names) => Some(Target::Object(node.id(), names)),
                None => self.skip_channel(channel, "for an unsupported property of a camera or light"),
            };
        }
        if name_of(node) != "node" {
            return match self.morph(node, member) {
                Some(target) => Some(target),
                None => self.skip_channel(channel, "for something that is neither a node nor a morph weight"),
            };
        }
        for sid in parts.iter().skip(1) {
            let Some(below) = node.descendants().find(|n| n.attribute("sid") == Some(sid)) else {
                return self.skip_channel(channel, "for something that is not in the file");
            };
            node = below;
        }
        let Some(joints) = self.tree.of_element.get(&node.id()) else {
            return self.skip_channel(channel, "for nodes that are not in the scene");
        };
        let stack = &self.tree.joints[*joints.first()? as usize].stack;
        let Some(element) = stack.iter().position(|e| e.sid == sid) else {
            return self.skip_channel(channel, "for something of a node that is not a transform");
        };
        match Component::of(member, stack[element].kind) {
            Some(part) => Some(Target::Joints(joints.clone(), element, part)),
            None => self.skip_channel(channel, "for a part of a transform that it does not have"),
        }
    }

    /// Resolves `weights-source(2)` or `controller/…(2)`: the morph controller around the element, and the index of the weight.
    fn morph(&self, element: Node<'a>, member: &str) -> Option<Target> {
        let controller = element.ancestors().find(|n| name_of(*n) == "controller")?;
        descendant(controller, "morph")?;
        let index = member.strip_prefix('(')?.strip_suffix(')')?.parse().ok()?;
        Some(Target::Morph(controller.id(), index))
    }

    fn skip_channel(&mut self, channel: Node<'a>, why: &'static str) -> Option<Target> {
        let entry = self.left_out.entry(why);
        entry.or_insert_with(|| (0, self.xml.place(channel))).0 += 1;
        None
    }
}

/// The name of the program that wrote the file.
pub(crate) fn authoring_tool<'a>(xml: &Xml<'a>) -> &'a str {
    let tool = child(xml.root(), "asset").and_then(|a| descendant(a, "authoring_tool"));
    tool.map_or("", crate::xml::text_of)
}
