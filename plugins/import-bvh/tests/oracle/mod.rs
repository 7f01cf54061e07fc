//! BVH again, in f64 and with matrices, for well-formed files only.

use glam::{DMat3, DVec3};

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Fault {
    OppositeOrder,
    PositionAddsToOffset,
}

pub(crate) struct Joint {
    parent: Option<usize>,
    offset: DVec3,
    channels: Vec<String>,
}

pub(crate) struct Oracle {
    pub joints: Vec<Joint>,
    pub frames: Vec<Vec<f64>>,
}

impl Oracle {
    pub(crate) fn read(text: &str) -> Oracle {
        let (head, motion) = text.split_once("MOTION").unwrap();
        let mut joints: Vec<Joint> = Vec::new();
        let mut stack: Vec<usize> = Vec::new();
        for line in head.replace('{', "\n{\n").lines().map(str::trim) {
            let mut words = line.split_whitespace();
            let numbers = |l: &str| l.split_whitespace().filter_map(|w| w.parse().ok()).collect::<Vec<f64>>();
            match words.next() {
                Some("ROOT" | "JOINT" | "End") => {
                    let parent = stack.last().copied();
                    joints.push(Joint { parent, offset: DVec3::ZERO, channels: Vec::new() });
                }
                Some("{") => stack.push(joints.len() - 1),
                Some("}") => drop(stack.pop()),
                Some("OFFSET") => joints[*stack.last().unwrap()].offset = DVec3::from_slice(&numbers(line)),
                Some("CHANNELS") => {
                    joints[*stack.last().unwrap()].channels = words.skip(1).map(str::to_string).collect();
                }
                _ => {}
            }
        }
        let lines = motion.lines().filter(|l| !l.trim().is_empty()).skip(2);
        let frames = lines.map(|l| l.split_whitespace().map(|w| w.parse().unwrap()).collect()).collect();
        Oracle { joints, frames }
    }

    /// Greatest extent at rest.
    pub(crate) fn size(&self) -> f64 {
        let mut at: Vec<DVec3> = Vec::new();
        for j in &self.joints {
            at.push(j.offset + j.parent.map_or(DVec3::ZERO, |p| at[p]));
        }
        let max = at.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
        let min = at.iter().copied().fold(DVec3::INFINITY, DVec3::min);
        (max - min).max_element()
    }

    /// Joint positions in the file's units, interpolated by `part` from a frame to the next.
    pub(crate) fn positions(&self, frame: usize, part: f64, fault: Option<Fault>) -> Vec<DVec3> {
        let a = self.locals(frame, fault);
        let b = if part > 0.0 { self.locals(frame + 1, fault) } else { a.clone() };
        let mut world: Vec<(DMat3, DVec3)> = Vec::new();
        for (i, joint) in self.joints.iter().enumerate() {
            let rotation = a[i].0 * partial_rotation(a[i].0.transpose() * b[i].0, part);
            let position = a[i].1 + (b[i].1 - a[i].1) * part;
            world.push(match joint.parent {
                None => (rotation, position),
                Some(p) => (world[p].0 * rotation, world[p].1 + world[p].0 * position),
            });
        }
        world.into_iter().map(|w| w.1).collect()
    }

    fn locals(&self, frame: usize, fault: Option<Fault>) -> Vec<(DMat3, DVec3)> {
        let mut values = self.frames[frame].iter();
        let mut out = Vec::new();
        for joint in &self.joints {
            let (mut rotation, mut position) = (DMat3::IDENTITY, joint.offset);
            for channel in &joint.channels {
                let value = *values.next().unwrap();
                let turn = axis_matrix(&channel[..1], value.to_radians());
                match (&channel[1..], fault) {
                    ("rotation", Some(Fault::OppositeOrder)) => rotation = turn * rotation,
                    ("rotation", _) => rotation *= turn,
                    (_, fault) => {
                        let axis = ["X", "Y", "Z"].iter().position(|a| channel.starts_with(a)).unwrap();
                        let add = fault == Some(Fault::PositionAddsToOffset);
                        position[axis] = if add { position[axis] + value } else { value };
                    }
                }
            }
            out.push((rotation, position));
        }
        out
    }
}

fn axis_matrix(axis: &str, angle: f64) -> DMat3 {
    let (s, c) = angle.sin_cos();
    let rows = match axis {
        "X" => [[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]],
        "Y" => [[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]],
        _ => [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]],
    };
    DMat3::from_cols_array_2d(&rows).transpose()
}

/// The rotation about the same axis by `part` of its angle, by Rodrigues' formula and its inverse.
fn partial_rotation(r: DMat3, part: f64) -> DMat3 {
    let twice_sin = DVec3::new(r.y_axis.z - r.z_axis.y, r.z_axis.x - r.x_axis.z, r.x_axis.y - r.y_axis.x);
    let trace = r.x_axis.x + r.y_axis.y + r.z_axis.z;
    let angle = twice_sin.length().atan2(trace - 1.0);
    if angle < 1e-12 {
        return DMat3::IDENTITY;
    }
    let axis = twice_sin.normalize();
    let k = DMat3::from_cols(
        DVec3::new(0.0, axis.z, -axis.y),
        DVec3::new(-axis.z, 0.0, axis.x),
        DVec3::new(axis.y, -axis.x, 0.0),
    );
    let (s, c) = (angle * part).sin_cos();
    DMat3::IDENTITY + k * s + k * k * (1.0 - c)
}
