//! Finds the elements that an animation stack drives, and by which curves and layers.

use crate::clips::TRANSFORM_PROPERTIES;
use crate::curve::Span;
use crate::local::{self, LocalTransform};
use crate::sampled::is_flat;
use crate::weights::WEIGHT_PROPERTY;
use glam::DVec3;
use std::collections::{BTreeMap, BTreeSet};
use ufbx::{
    AnimCurve, AnimLayer, AnimProp, AnimStack, AnimValue, BlendChannel, Element, ElementType,
    ExtrapolationMode,
};
use ufbx::{Node, PropFlags, Scene};

/// One animated property of an element in one layer.
struct Entry<'a> {
    layer: usize,
    name: &'a str,
    value: &'a AnimValue,
}

pub(crate) struct DrivenProperties<'a> {
    layers: Vec<&'a AnimLayer>,
    /// Animated properties by element, in the order of layers.
    entries: BTreeMap<u32, (ElementType, Vec<Entry<'a>>)>,
    has_overrides: bool,
}

/// The curves of a node that a single layer drives.
pub(crate) struct NodeCurves<'a> {
    pub local: LocalTransform,
    values: [Option<&'a AnimValue>; 3],
    /// Scales that are not inherited, helper by helper. They multiply the node's translation, or the scale of a scale helper.
    pub factors: Vec<ScaleFactor<'a>>,
}

pub(crate) struct ScaleFactor<'a> {
    value: Option<&'a AnimValue>,
    rest: DVec3,
}

fn curves(value: &AnimValue) -> impl Iterator<Item = &AnimCurve> {
    value.curves.iter().flatten().map(|c| c.as_ref())
}

/// Source of a property outside transforms.
pub(crate) enum PropertySource<'a> {
    Nothing,
    One(&'a AnimValue),
    /// Curves of several layers, or a connected property.
    Mixed(Vec<&'a AnimCurve>),
}

impl<'a> DrivenProperties<'a> {
    pub(crate) fn new(stack: &'a AnimStack) -> DrivenProperties<'a> {
        let layers: Vec<&AnimLayer> = stack.anim.layers.into_iter().collect();
        let mut entries: BTreeMap<u32, (ElementType, Vec<Entry<'a>>)> = BTreeMap::new();
        for (index, layer) in layers.iter().enumerate() {
            for prop in &layer.anim_props {
                let AnimProp { element, prop_name, anim_value, .. } = prop;
                let list = entries.entry(element.element_id).or_insert_with(|| (element.type_, Vec::new()));
                list.1.push(Entry { layer: index, name: prop_name.as_ref(), value: anim_value });
            }
        }
        let has_overrides =
            !stack.anim.prop_overrides.is_empty() || !stack.anim.transform_overrides.is_empty();
        DrivenProperties { layers, entries, has_overrides }
    }

    fn all_curves(&self) -> impl Iterator<Item = &'a AnimCurve> {
        self.entries.values().flat_map(|e| &e.1).flat_map(|e| curves(e.value))
    }

    /// Times of the first and the last key, seconds.
    pub(crate) fn key_range(&self) -> Option<(f64, f64)> {
        let times = || self.all_curves().flat_map(|c| &c.keyframes).map(|k| k.time);
        let first = times().min_by(f64::total_cmp)?;
        Some((first, times().max_by(f64::total_cmp)?))
    }

    /// Elements (by id) with a curve that ends within the span and then repeats or continues, instead of holding its value.
    pub(crate) fn repeating_elements(&self, span: Span) -> BTreeSet<u32> {
        let (begin, end) = (span.begin.as_secs(), span.end.as_secs());
        let goes_on = |curve: &AnimCurve| {
            let before =
                curve.pre_extrapolation.mode != ExtrapolationMode::Constant && curve.min_time > begin;
            let after = curve.post_extrapolation.mode != ExtrapolationMode::Constant && curve.max_time < end;
            before || after
        };
        let of = |list: &[Entry<'a>]| list.iter().flat_map(|e| curves(e.value)).any(goes_on);
        self.entries.iter().filter(|(_, (_, list))| of(list)).map(|(id, _)| *id).collect()
    }

    /// Moving nodes (by `typed_id`): those with curves, and those that a moving scale helper affects.
    pub(crate) fn nodes(&self, scene: &Scene) -> Vec<u32> {
        let moves = |node: &Node| {
            let drives = |id: &u32| {
                self.entries
                    .get(id)
                    .is_some_and(|(_, list)| list.iter().any(|e| local::TRANSFORM_INPUTS.contains(&e.name)))
            };
            drives(&node.element.element_id) || helpers(node).iter().any(|h| drives(&h.element.element_id))
        };
        let nodes = scene.nodes.into_iter().filter(|n| !n.is_root && moves(n));
        nodes.map(|n| n.element.typed_id).collect()
    }

    /// The curves of a node; `None` where they have no closed form: blended layers, animated pivots, connections.
    pub(crate) fn node_curves(&self, node: &Node) -> Option<NodeCurves<'a>> {
        let local = LocalTransform::new(node).filter(|_| !self.has_overrides)?;
        let values = self.single_layer_transform(&node.element)?;
        let factor = |helper: &Node| {
            let [_, _, value] = self.single_layer_transform(&helper.element)?;
            Some(ScaleFactor { value, rest: local::property(helper, local::SCALING).unwrap_or(DVec3::ONE) })
        };
        let factors = helpers(node).into_iter().map(factor).collect::<Option<_>>()?;
        Some(NodeCurves { local, values, factors })
    }

    /// The animated translation, rotation and scale of an element, each from a single layer; `None` where they have no closed
    /// form.
    fn single_layer_transform(&self, element: &Element) -> Option<[Option<&'a AnimValue>; 3]> {
        let mut values = [None; 3];
        for entry in self.entries.get(&element.element_id).map_or(&[][..], |(_, list)| list) {
            let Some(part) = TRANSFORM_PROPERTIES.iter().position(|p| *p == entry.name) else {
                if local::TRANSFORM_INPUTS.contains(&entry.name) {
                    return None;
                }
                continue;
            };
            let layer = self.layers[entry.layer];
            let replaces = entry.layer == 0 || !layer.additive && !layer.blended;
            let prop = element.props.find_prop(entry.name)?;
            if !replaces || prop.flags.has_any(PropFlags::CONNECTED) {
                return None;
            }
            values[part] = Some(entry.value);
        }
        let connected = |name: &&str| {
            let prop = element.props.find_prop(name);
            prop.is_some_and(|p| p.flags.has_any(PropFlags::CONNECTED))
        };
        (!local::TRANSFORM_INPUTS.iter().any(connected)).then_some(values)
    }

    /// Whether a node, or a helper whose scale affects it, is among these elements.
    pub(crate) fn contains_node(elements: &BTreeSet<u32>, node: &Node) -> bool {
        let of = |n: &Node| elements.contains(&n.element.element_id);
        of(node) || helpers(node).into_iter().any(of)
    }

    /// All curves that a node's transform depends on.
    pub(crate) fn curves_of(&self, node: &Node) -> impl Iterator<Item = &'a AnimCurve> {
        let own = [node.element.element_id];
        let ids: BTreeSet<u32> = helpers(node).iter().map(|h| h.element.element_id).chain(own).collect();
        let of_node = move |id: &u32| ids.contains(id);
        let known = |e: &&Entry<'a>| local::TRANSFORM_INPUTS.contains(&e.name) || e.name == LAYER_WEIGHT;
        self.entries
            .iter()
            .filter(move |(id, (kind, _))| of_node(id) || *kind == ElementType::AnimLayer)
            .flat_map(move |(_, (_, list))| list.iter().filter(known))
            .flat_map(|e| curves(e.value))
    }

    pub(crate) fn property_source(&self, element: &Element, name: &str) -> PropertySource<'a> {
        let Some((_, list)) = self.entries.get(&element.element_id) else { return PropertySource::Nothing };
        let named: Vec<&Entry<'a>> = list.iter().filter(|e| e.name == name).collect();
        let Some(last) = named.last() else { return PropertySource::Nothing };
        let layer = self.layers[last.layer];
        let replaces = last.layer == 0 || !layer.additive && !layer.blended;
        let prop = element.props.find_prop(name);
        let connected = prop.is_some_and(|p| p.flags.has_any(PropFlags::CONNECTED));
        match replaces && !connected && !self.has_overrides {
            true => PropertySource::One(last.value),
            false => PropertySource::Mixed(named.iter().flat_map(|e| curves(e.value)).collect()),
        }
    }

    /// Curves of a blend channel's weight; empty where nothing drives it.
    pub(crate) fn weight_curves(&self, channel: &BlendChannel) -> Vec<&'a AnimCurve> {
        let Some((_, list)) = self.entries.get(&channel.element.element_id) else { return Vec::new() };
        list.iter().filter(|e| e.name == WEIGHT_PROPERTY).flat_map(|e| curves(e.value)).collect()
    }

    /// Animated properties that are neither transforms, nor blend weights, nor `known` for their element.
    pub(crate) fn other_properties(&self, known: impl Fn(u32, &str) -> bool) -> BTreeMap<u32, Vec<&'a str>> {
        let mut out = BTreeMap::new();
        for (id, (kind, list)) in &self.entries {
            let known = |name: &str| match kind {
                ElementType::Node => local::TRANSFORM_INPUTS.contains(&name),
                ElementType::AnimLayer => name == LAYER_WEIGHT,
                ElementType::Camera | ElementType::Light => known(*id, name),
                _ => name == WEIGHT_PROPERTY,
            };
            let changes = |e: &&Entry<'a>| {
                curves(e.value).any(|c| c.keyframes.windows(2).any(|k| !is_flat(&k[0], &k[1])))
            };
            let mut names: Vec<&str> =
                list.iter().filter(|e| !known(e.name)).filter(changes).map(|e| e.name).collect();
            names.sort_unstable();
            names.dedup();
            if !names.is_empty() {
                out.insert(*id, names);
            }
        }
        out
    }
}

const LAYER_WEIGHT: &str = "Weight";

/// Scale helpers whose scale multiplies a node's translation, or a scale helper's scale. Walks up from the parent as long as
/// there are helpers, as `ufbx_evaluate_transform` does.
fn helpers(node: &Node) -> Vec<&Node> {
    let mut out: Vec<&Node> = Vec::new();
    let Some(parent) = &node.parent else { return out };
    match &parent.scale_helper {
        Some(helper) if !node.is_scale_helper => out.push(helper),
        None if !node.is_scale_helper => return out,
        _ => {}
    }
    let mut above = parent.inherit_scale_node.as_ref();
    while let Some(node) = above {
        let Some(helper) = &node.scale_helper else { break };
        let known = |h: &&Node| h.element.element_id == helper.element.element_id;
        // ufbx guarantees that there is no cycle; checking costs nothing.
        if out.iter().any(known) {
            break;
        }
        out.push(helper);
        above = node.inherit_scale_node.as_ref();
    }
    out
}

impl<'a> ScaleFactor<'a> {
    pub(crate) fn drives(&self) -> bool {
        self.value.is_some()
    }

    pub(crate) fn curve(&self, axis: usize) -> (Option<&'a AnimCurve>, f64) {
        match self.value {
            Some(value) => {
                let v = &value.default_value;
                (value.curves[axis].as_deref(), [v.x, v.y, v.z][axis])
            }
            None => (None, self.rest[axis]),
        }
    }
}

impl<'a> NodeCurves<'a> {
    /// Whether the stack has curves for a part: 0 translation, 1 rotation, 2 scale.
    pub(crate) fn drives(&self, part: usize) -> bool {
        self.values[part].is_some()
    }

    /// The curve of a part along an axis, and the value where it has no curve.
    pub(crate) fn curve(&self, part: usize, axis: usize) -> (Option<&'a AnimCurve>, f64) {
        match self.values[part] {
            Some(value) => {
                let v = &value.default_value;
                (value.curves[axis].as_deref(), [v.x, v.y, v.z][axis])
            }
            None => (None, self.rest(part)[axis]),
        }
    }

    /// The value of a part that is treated as constant: that of its first keys, else at rest.
    pub(crate) fn rest(&self, part: usize) -> DVec3 {
        if let Some(value) = self.values[part] {
            let v = &value.default_value;
            let first = |axis: usize, otherwise: f64| {
                let curve = value.curves[axis].as_ref();
                curve.and_then(|c| c.keyframes.first()).map_or(otherwise, |k| k.value)
            };
            return DVec3::new(first(0, v.x), first(1, v.y), first(2, v.z));
        }
        match part {
            0 => self.local.translation,
            1 => self.local.rotation,
            _ => self.local.scaling,
        }
    }
}
