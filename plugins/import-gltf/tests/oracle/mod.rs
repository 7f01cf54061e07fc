//! Reference implementation of glTF 2.0 in f64, independent of the importer: it reads JSON, buffers and
//! accessors itself, and evaluates interpolation (Appendix C) and matrices. Slow and simple; it does not validate its files.

use glam::{DMat4, DQuat, DVec3, DVec4};
use serde_json::Value;
use std::path::Path;

pub(crate) struct Oracle {
    pub json: Value,
    buffers: Vec<Vec<u8>>,
    /// Nodes of the default scene, each before its children, as they are listed.
    pub order: Vec<usize>,
    pub parent: Vec<Option<usize>>,
    channels: Vec<Vec<Channel>>,
    pub fault: Option<Fault>,
}

/// A deliberate mistake, to show that a comparison would see one.
#[derive(Clone, Copy)]
pub(crate) enum Fault {
    /// The x of one node's animated rotations has the other sign.
    Sign { node: usize },
    /// One node is moved by this much, in its parent's units.
    Offset { node: usize, by: f64 },
    /// Times are late by this much.
    Late { secs: f64 },
}

struct Channel {
    node: usize,
    path: String,
    interpolation: String,
    times: Vec<f64>,
    values: Vec<f64>,
    width: usize,
}

#[derive(Clone)]
enum Local {
    Matrix(DMat4),
    Parts(DVec3, DQuat, DVec3),
}

impl Oracle {
    pub(crate) fn open(path: &Path) -> Oracle {
        let bytes = std::fs::read(path).unwrap();
        let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
        let (json, bin): (Value, Vec<u8>) = if bytes.starts_with(b"glTF") {
            let json_end = 20 + word(12);
            let bin = if json_end + 8 <= bytes.len() {
                bytes[json_end + 8..json_end + 8 + word(json_end)].to_vec()
            } else {
                Vec::new()
            };
            (serde_json::from_slice(&bytes[20..json_end]).unwrap(), bin)
        } else {
            (serde_json::from_slice(&bytes).unwrap(), Vec::new())
        };
        let buffers = list(&json, "buffers")
            .iter()
            .map(|b| match b["uri"].as_str() {
                None => bin.clone(),
                Some(uri) if uri.starts_with("data:") => base64(uri.split_once(',').unwrap().1),
                Some(uri) => std::fs::read(path.parent().unwrap().join(uri)).unwrap(),
            })
            .collect();
        let nodes = list(&json, "nodes");
        let mut parent = vec![None; nodes.len()];
        for (i, node) in nodes.iter().enumerate() {
            list(node, "children").iter().for_each(|c| parent[index(c)] = Some(i));
        }
        let scene = json["scene"].as_u64().unwrap_or(0) as usize;
        let mut order = Vec::new();
        for root in list(&json["scenes"][scene], "nodes") {
            list_depth_first(nodes, index(root), &mut order);
        }
        let mut oracle = Oracle { json, buffers, order, parent, channels: Vec::new(), fault: None };
        oracle.channels = list(&oracle.json, "animations").iter().map(|a| oracle.channels_of(a)).collect();
        oracle
    }

    fn channels_of(&self, animation: &Value) -> Vec<Channel> {
        let read = |channel: &Value| {
            let sampler = &animation["samplers"][index(&channel["sampler"])];
            let times = self.accessor(index(&sampler["input"]), false);
            let path = channel["target"]["path"].as_str().unwrap().to_string();
            let normalized = path == "rotation" || path == "weights";
            let values = self.accessor(index(&sampler["output"]), normalized);
            let interpolation = sampler["interpolation"].as_str().unwrap_or("LINEAR").to_string();
            let per_key = if interpolation == "CUBICSPLINE" { 3 } else { 1 };
            let width = values.len() / times.len() / per_key;
            Channel { node: index(&channel["target"]["node"]), path, interpolation, times, values, width }
        };
        list(animation, "channels").iter().map(read).collect()
    }

    /// All components of an accessor, sparse ones replaced.
    pub(crate) fn accessor(&self, at: usize, normalized: bool) -> Vec<f64> {
        let a = &self.json["accessors"][at];
        let width = match a["type"].as_str().unwrap() {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" => 4,
            _ => 16,
        };
        let kind = a["componentType"].as_u64().unwrap();
        let normalized = normalized || a["normalized"].as_bool().unwrap_or(false);
        let count = a["count"].as_u64().unwrap() as usize;
        let mut out = match a["bufferView"].as_u64() {
            Some(view) => self.components(view as usize, offset(a), count, width, kind, normalized),
            None => vec![0.0; count * width],
        };
        if let Some(sparse) = a.get("sparse") {
            let n = sparse["count"].as_u64().unwrap() as usize;
            let (i, v) = (&sparse["indices"], &sparse["values"]);
            let at = i["componentType"].as_u64().unwrap();
            let places = self.components(index(&i["bufferView"]), offset(i), n, 1, at, false);
            let values = self.components(index(&v["bufferView"]), offset(v), n, width, kind, normalized);
            for (k, place) in places.iter().enumerate() {
                let to = *place as usize * width;
                out[to..to + width].copy_from_slice(&values[k * width..(k + 1) * width]);
            }
        }
        out
    }

    fn components(
        &self,
        view: usize,
        offset: usize,
        count: usize,
        width: usize,
        kind: u64,
        norm: bool,
    ) -> Vec<f64> {
        let view = &self.json["bufferViews"][view];
        let bytes = &self.buffers[index(&view["buffer"])];
        let start = view["byteOffset"].as_u64().unwrap_or(0) as usize + offset;
        let size = match kind {
            5120 | 5121 => 1,
            5122 | 5123 => 2,
            _ => 4,
        };
        let stride = view["byteStride"].as_u64().map_or(size * width, |s| s as usize);
        let mut out = Vec::new();
        for element in 0..count {
            for c in 0..width {
                let b = &bytes[start + element * stride + c * size..];
                let (value, largest) = match kind {
                    5120 => (f64::from(b[0] as i8), 127.0),
                    5121 => (f64::from(b[0]), 255.0),
                    5122 => (f64::from(i16::from_le_bytes([b[0], b[1]])), 32767.0),
                    5123 => (f64::from(u16::from_le_bytes([b[0], b[1]])), 65535.0),
                    5125 => (f64::from(u32::from_le_bytes([b[0], b[1], b[2], b[3]])), 1.0),
                    _ => (f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]])), 1.0),
                };
                out.push(if norm { (value / largest).max(-1.0) } else { value });
            }
        }
        out
    }

    pub(crate) fn clips(&self) -> usize {
        self.channels.len()
    }

    /// Key times of all channels of a clip; those of STEP channels also apart, where values jump.
    pub(crate) fn key_times(&self, clip: usize) -> (Vec<f64>, Vec<f64>) {
        let times = |step: bool| {
            let of = self.channels[clip].iter().filter(move |c| !step || c.interpolation == "STEP");
            of.flat_map(|c| c.times.iter().copied()).collect()
        };
        (times(false), times(true))
    }

    /// world-from-node of every node, and the animated morph weights, at a time of a clip (`None`: at rest).
    pub(crate) fn pose(&self, clip: Option<usize>, secs: f64) -> (Vec<DMat4>, Vec<(usize, Vec<f64>)>) {
        let secs = if let Some(Fault::Late { secs: late }) = self.fault { secs - late } else { secs };
        let nodes = list(&self.json, "nodes");
        let mut locals: Vec<Local> = nodes.iter().map(rest).collect();
        let mut weights = Vec::new();
        for channel in clip.into_iter().flat_map(|c| &self.channels[c]) {
            let value = channel.at(secs);
            if channel.path == "weights" {
                weights.push((channel.node, value));
                continue;
            }
            let Local::Parts(t, r, s) = &mut locals[channel.node] else { panic!("an animated matrix") };
            match channel.path.as_str() {
                "translation" => *t = DVec3::from_slice(&value),
                "scale" => *s = DVec3::from_slice(&value),
                _ => *r = DQuat::from_slice(&value),
            }
            if let Some(Fault::Sign { node }) = self.fault
                && node == channel.node
                && channel.path == "rotation"
            {
                r.x = -r.x;
            }
        }
        if let Some(Fault::Offset { node, by }) = self.fault
            && let Local::Parts(t, _, _) = &mut locals[node]
        {
            t.x += by;
        }
        let mut world = vec![DMat4::IDENTITY; nodes.len()];
        for node in &self.order {
            let local = matrix(&locals[*node]);
            world[*node] = self.parent[*node].map_or(local, |p| world[p] * local);
        }
        (world, weights)
    }

    /// World positions of the vertices of a node's mesh, one list per primitive: §3.7.2.2 (morph), §3.7.3.3 (skin).
    pub(crate) fn vertices(&self, node: usize, world: &[DMat4], weights: &[f64]) -> Vec<Vec<DVec3>> {
        let node_json = &self.json["nodes"][node];
        let mesh = &self.json["meshes"][index(&node_json["mesh"])];
        let matrices = node_json["skin"].as_u64().map(|skin| {
            let skin = &self.json["skins"][skin as usize];
            let inverse = skin["inverseBindMatrices"].as_u64().map(|a| self.accessor(a as usize, false));
            let joint_matrix = |(k, joint): (usize, &Value)| {
                let bind = inverse.as_ref().map_or(DMat4::IDENTITY, |m| DMat4::from_cols_slice(&m[k * 16..]));
                world[index(joint)] * bind
            };
            list(skin, "joints").iter().enumerate().map(joint_matrix).collect::<Vec<_>>()
        });
        let mut out = Vec::new();
        for primitive in list(mesh, "primitives") {
            let attribute = |name: &str, norm| {
                primitive["attributes"][name].as_u64().map(|a| self.accessor(a as usize, norm))
            };
            let mut positions = attribute("POSITION", false).unwrap();
            for (target, weight) in list(primitive, "targets").iter().zip(weights) {
                if let Some(a) = target["POSITION"].as_u64() {
                    let offsets = self.accessor(a as usize, false);
                    positions.iter_mut().zip(offsets).for_each(|(p, o)| *p += weight * o);
                }
            }
            let joints = attribute("JOINTS_0", false);
            let joint_weights = attribute("WEIGHTS_0", true);
            let place = |(v, p): (usize, &[f64])| {
                let point = DVec4::new(p[0], p[1], p[2], 1.0);
                match (&matrices, &joints, &joint_weights) {
                    (Some(m), Some(j), Some(w)) => {
                        let (j, w) = (&j[v * 4..v * 4 + 4], &w[v * 4..v * 4 + 4]);
                        let sum: f64 = w.iter().sum();
                        let moved: DVec4 = (0..4).map(|k| m[j[k] as usize] * point * (w[k] / sum)).sum();
                        moved.truncate()
                    }
                    _ => (world[node] * point).truncate(),
                }
            };
            out.push(positions.chunks_exact(3).enumerate().map(place).collect());
        }
        out
    }
}

impl Channel {
    fn key(&self, k: usize, part: usize) -> &[f64] {
        let parts = if self.interpolation == "CUBICSPLINE" { 3 } else { 1 };
        &self.values[(k * parts + part) * self.width..][..self.width]
    }

    /// Appendix C.
    fn at(&self, secs: f64) -> Vec<f64> {
        let rotation = self.path == "rotation";
        let value = usize::from(self.interpolation == "CUBICSPLINE");
        let last = self.times.len() - 1;
        let whole = |k: usize| {
            if rotation { unit_quaternion(self.key(k, value)) } else { self.key(k, value).to_vec() }
        };
        if secs <= self.times[0] {
            return whole(0);
        }
        if secs >= self.times[last] {
            return whole(last);
        }
        let k = self.times.partition_point(|t| *t <= secs) - 1;
        let span = self.times[k + 1] - self.times[k];
        let t = (secs - self.times[k]) / span;
        match self.interpolation.as_str() {
            "STEP" => whole(k),
            "LINEAR" if rotation => slerp(&whole(k), &whole(k + 1), t),
            "LINEAR" => {
                self.key(k, 0).iter().zip(self.key(k + 1, 0)).map(|(a, b)| a * (1.0 - t) + b * t).collect()
            }
            _ => {
                let (t2, t3) = (t * t, t * t * t);
                let (v0, b0) = (whole(k), self.key(k, 2));
                let (a1, v1) = (self.key(k + 1, 0), whole(k + 1));
                let hermite = |i: usize| {
                    (2.0 * t3 - 3.0 * t2 + 1.0) * v0[i]
                        + span * (t3 - 2.0 * t2 + t) * b0[i]
                        + (-2.0 * t3 + 3.0 * t2) * v1[i]
                        + span * (t3 - t2) * a1[i]
                };
                let out: Vec<f64> = (0..self.width).map(hermite).collect();
                if rotation { unit_quaternion(&out) } else { out }
            }
        }
    }
}

fn slerp(a: &[f64], b: &[f64], t: f64) -> Vec<f64> {
    let dot: f64 = a.iter().zip(b).map(|(a, b)| a * b).sum();
    let angle = dot.abs().min(1.0).acos();
    let (wa, wb) = if angle < 1e-9 {
        (1.0 - t, t)
    } else {
        ((angle * (1.0 - t)).sin() / angle.sin(), (angle * t).sin() / angle.sin())
    };
    let wb = wb * if dot < 0.0 { -1.0 } else { 1.0 };
    unit_quaternion(&a.iter().zip(b).map(|(a, b)| wa * a + wb * b).collect::<Vec<_>>())
}

fn unit_quaternion(q: &[f64]) -> Vec<f64> {
    let length = q.iter().map(|v| v * v).sum::<f64>().sqrt();
    q.iter().map(|v| v / length).collect()
}

fn rest(node: &Value) -> Local {
    let numbers = |name: &str| -> Option<Vec<f64>> {
        // The JSON's decimals through f32, as an importer that keeps f32 reads them.
        Some(node.get(name)?.as_array()?.iter().map(|v| f64::from(v.as_f64().unwrap() as f32)).collect())
    };
    if let Some(m) = numbers("matrix") {
        return Local::Matrix(DMat4::from_cols_slice(&m));
    }
    let translation = numbers("translation").map_or(DVec3::ZERO, |v| DVec3::from_slice(&v));
    let rotation = numbers("rotation").map_or(DQuat::IDENTITY, |v| DQuat::from_slice(&unit_quaternion(&v)));
    let scale = numbers("scale").map_or(DVec3::ONE, |v| DVec3::from_slice(&v));
    Local::Parts(translation, rotation, scale)
}

/// T · R · S, written out (§3.5.3).
fn matrix(local: &Local) -> DMat4 {
    let (t, q, s) = match local {
        Local::Matrix(m) => return *m,
        Local::Parts(t, q, s) => (t, q, s),
    };
    let [x, y, z, w] = q.to_array();
    let c0 = DVec3::new(1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + z * w), 2.0 * (x * z - y * w));
    let c1 = DVec3::new(2.0 * (x * y - z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + x * w));
    let c2 = DVec3::new(2.0 * (x * z + y * w), 2.0 * (y * z - x * w), 1.0 - 2.0 * (x * x + y * y));
    DMat4::from_cols((c0 * s.x).extend(0.0), (c1 * s.y).extend(0.0), (c2 * s.z).extend(0.0), t.extend(1.0))
}

fn list_depth_first(nodes: &[Value], node: usize, order: &mut Vec<usize>) {
    order.push(node);
    list(&nodes[node], "children").iter().for_each(|c| list_depth_first(nodes, index(c), order));
}

pub(crate) fn list<'a>(value: &'a Value, name: &str) -> &'a [Value] {
    value.get(name).and_then(Value::as_array).map_or(&[], Vec::as_slice)
}

pub(crate) fn index(value: &Value) -> usize {
    value.as_u64().unwrap() as usize
}

fn offset(value: &Value) -> usize {
    value["byteOffset"].as_u64().unwrap_or(0) as usize
}

fn base64(text: &str) -> Vec<u8> {
    let letters = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut bits: Vec<bool> = Vec::new();
    for letter in text.chars().filter(|c| *c != '=') {
        let value = letters.find(letter).unwrap();
        bits.extend((0..6).rev().map(|b| value >> b & 1 == 1));
    }
    bits.chunks_exact(8).map(|b| b.iter().fold(0, |byte, bit| byte << 1 | u8::from(*bit))).collect()
}
