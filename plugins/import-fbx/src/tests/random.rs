//! Files made by dice — rotation orders, pivots, offsets, units, axes, every kind of key — against what ufbx evaluates.

use crate::tests::accuracy::{Sampling, largest_errors};
use choreo_importer_kit_testing::damage::random;
use std::fmt::Write;

const SECOND: i64 = 46_186_158_000;

struct RandomValues(u64);

impl RandomValues {
    fn integer_below(&mut self, n: u64) -> u64 {
        random(&mut self.0) % n
    }

    fn number(&mut self, low: f64, high: f64) -> f64 {
        let part = random(&mut self.0) >> 11;
        low + (high - low) * (part as f64 / (1u64 << 53) as f64)
    }

    fn vector(&mut self, size: f64) -> String {
        let v: [f64; 3] = std::array::from_fn(|_| self.number(-size, size));
        format!("{}, {}, {}", v[0], v[1], v[2])
    }

    fn chance(&mut self, one_in: u64) -> bool {
        self.integer_below(one_in) == 0
    }
}

fn array_text<T: std::fmt::Display>(name: &str, items: &[T]) -> String {
    let text: Vec<String> = items.iter().map(T::to_string).collect();
    format!("{name}: *{} {{\na: {}\n}}\n", items.len(), text.join(","))
}

/// Two to six keys of every kind: held, held from the next, straight, cubic with broken and weighted tangents.
fn random_curve(random_values: &mut RandomValues, id: u64, (middle, size): (f64, f64)) -> String {
    let count = 2 + random_values.integer_below(5);
    let (mut times, mut values, mut flags, mut data) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let mut at = random_values.integer_below(10) as i64 * SECOND / 30;
    for _ in 0..count {
        times.push(at);
        at += (1 + random_values.integer_below(20) as i64) * SECOND / 30;
        values.push(middle + random_values.number(-size, size));
        let kind = match random_values.integer_below(8) {
            0 => 0x2,
            1 => 0x2 | 0x100,
            2 => 0x4,
            3 => 0x8 | 0x400 | 0x800 | 0x300_0000,
            _ => 0x8 | 0x400 | 0x800,
        };
        flags.push(kind);
        let weights =
            (500 + random_values.integer_below(7500)) | (500 + random_values.integer_below(7500)) << 16;
        let slope = 3.0 * size;
        // Text files write the bits of floats as whole numbers.
        let slopes = [random_values.number(-slope, slope), random_values.number(-slope, slope)];
        data.extend(slopes.map(|s| (s as f32).to_bits() as i32));
        data.extend([weights as i32, 0]);
    }
    format!(
        "AnimationCurve: {id}, \"AnimCurve::\", \"\" {{\nDefault: 0\nKeyVer: 4009\n{}{}{}{}{}}}\n",
        array_text("KeyTime", &times),
        array_text("KeyValueFloat", &values),
        array_text("KeyAttrFlags", &flags),
        array_text("KeyAttrDataFloat", &data),
        array_text("KeyAttrRefCount", &vec![1; times.len()]),
    )
}

/// A chain of nodes with curves; in two layers where asked. `own_scale`: some nodes do not inherit their parent's scale, or take
/// only its axes' from all above.
fn random_file(random_values: &mut RandomValues, layers: u64, own_scale: bool) -> String {
    let (up, front) = if random_values.chance(2) { (1, 2) } else { (2, 1) };
    let sign = if up == 1 { 1 } else { -1 };
    let unit = [1.0, 2.54, 100.0][random_values.integer_below(3) as usize];
    let mut objects = String::new();
    let mut links = String::new();
    for layer in 0..layers {
        let how = if layer == 0 {
            ""
        } else {
            "P: \"Weight\", \"Number\", \"\", \"A\", 40\nP: \"BlendMode\", \"enum\", \"\", \"\", 0\n"
        };
        let _ = write!(
            objects,
            "AnimationLayer: {}, \"AnimLayer::l{layer}\", \"\" {{\nProperties70: {{\n{how}}}\n}}\n",
            500 + layer
        );
        let _ = writeln!(links, "C: \"OO\",{},400", 500 + layer);
    }
    let mut next = 10_000;
    for node in 0..4u64 {
        let mut properties =
            format!("P: \"RotationOrder\", \"enum\", \"\", \"\", {}\n", random_values.integer_below(6));
        let inherits = if own_scale { [0, 2, 1][random_values.integer_below(3) as usize] } else { 1 };
        let _ = write!(
            properties,
            "P: \"RotationActive\", \"bool\", \"\", \"\", 1\nP: \"InheritType\", \"enum\", \"\", \"\", {inherits}\n"
        );
        for (name, size) in [
            ("PreRotation", 90.0),
            ("PostRotation", 90.0),
            ("RotationPivot", 3.0),
            ("RotationOffset", 3.0),
            ("ScalingPivot", 2.0),
            ("ScalingOffset", 2.0),
        ] {
            if random_values.chance(2) {
                let _ = writeln!(
                    properties,
                    "P: \"{name}\", \"Vector3D\", \"Vector\", \"\", {}",
                    random_values.vector(size)
                );
            }
        }
        let _ = writeln!(
            properties,
            "P: \"Lcl Translation\", \"Lcl Translation\", \"\", \"A\", {}",
            random_values.vector(5.0)
        );
        let _ = writeln!(
            properties,
            "P: \"Lcl Rotation\", \"Lcl Rotation\", \"\", \"A\", {}",
            random_values.vector(180.0)
        );
        properties += "P: \"Lcl Scaling\", \"Lcl Scaling\", \"\", \"A\", 1, 1.5, 0.75\n";
        let id = 1000 + node;
        let _ = write!(
            objects,
            "Model: {id}, \"Model::n{node}\", \"LimbNode\" {{\nVersion: 232\nProperties70: {{\n{properties}}}\n}}\n"
        );
        let _ = writeln!(links, "C: \"OO\",{id},{}", if node == 0 { 0 } else { id - 1 });
        for layer in 0..layers {
            for (name, range) in
                [("Lcl Translation", (0.0, 4.0)), ("Lcl Rotation", (0.0, 120.0)), ("Lcl Scaling", (1.2, 0.5))]
            {
                // Scale in a tree that shears is another matter: only the last node's moves.
                if random_values.chance(4) || name == "Lcl Scaling" && node != 3 && !own_scale {
                    continue;
                }
                let value = next;
                next += 1;
                let _ = write!(
                    objects,
                    "AnimationCurveNode: {value}, \"AnimCurveNode::{name}\", \"\" {{\nProperties70: {{\nP: \"d|X\", \"Number\", \"\", \"A\", {0}\nP: \"d|Y\", \"Number\", \"\", \"A\", {0}\nP: \"d|Z\", \"Number\", \"\", \"A\", {0}\n}}\n}}\n",
                    range.0
                );
                let _ =
                    writeln!(links, "C: \"OO\",{value},{}\nC: \"OP\",{value},{id}, \"{name}\"", 500 + layer);
                for axis in ["X", "Y", "Z"] {
                    if !random_values.chance(5) {
                        objects += &random_curve(random_values, next, range);
                        let _ = writeln!(links, "C: \"OP\",{next},{value}, \"d|{axis}\"");
                        next += 1;
                    }
                }
            }
        }
    }
    let (start, stop) = (
        random_values.integer_below(20) as i64 * SECOND / 30,
        (40 + random_values.integer_below(40)) as i64 * SECOND / 30,
    );
    format!(
        "; FBX 7.4.0 project file\nFBXHeaderExtension: {{\nFBXHeaderVersion: 1003\nFBXVersion: 7400\n}}\nGlobalSettings: {{\nVersion: 1000\nProperties70: {{\nP: \"UpAxis\", \"int\", \"Integer\", \"\", {up}\nP: \"UpAxisSign\", \"int\", \"Integer\", \"\", 1\nP: \"FrontAxis\", \"int\", \"Integer\", \"\", {front}\nP: \"FrontAxisSign\", \"int\", \"Integer\", \"\", {sign}\nP: \"CoordAxis\", \"int\", \"Integer\", \"\", 0\nP: \"CoordAxisSign\", \"int\", \"Integer\", \"\", 1\nP: \"UnitScaleFactor\", \"double\", \"Number\", \"\", {unit}\n}}\n}}\nObjects: {{\nAnimationStack: 400, \"AnimStack::dice\", \"\" {{\nProperties70: {{\nP: \"LocalStart\", \"KTime\", \"Time\", \"\", {start}\nP: \"LocalStop\", \"KTime\", \"Time\", \"\", {stop}\n}}\n}}\n{objects}}}\nConnections: {{\n{links}}}\n"
    )
}

/// Every closed form within its tolerance, and none by chance: a hundredth of a second late is seen in every file.
#[test]
fn random_curves_of_one_layer_are_within_the_tolerance() {
    let mut random_values = RandomValues(7);
    for round in 0..60 {
        let text = random_file(&mut random_values, 1, false);
        let close = largest_errors(text.as_bytes(), Sampling::Within(0.05), 211, 0.0);
        assert!(close.keys > 0, "{round}");
        assert!(
            close.degrees < 0.0501 && close.translation < 1.02e-4 && close.scale < 1.02e-4,
            "{round}: {close:?}\n{text}"
        );
        let delayed = largest_errors(text.as_bytes(), Sampling::Within(0.05), 211, 0.01);
        assert!(delayed.degrees > 0.1 || delayed.translation > 2e-4, "{round}: {delayed:?}");
    }
}

/// Translations are products with the scale of those above, which has curves of its own.
#[test]
fn random_curves_with_uninherited_scale_are_within_the_tolerance() {
    let mut random_values = RandomValues(5);
    let mut helper_count = 0;
    for round in 0..40 {
        let text = random_file(&mut random_values, 1, true);
        let close = largest_errors(text.as_bytes(), Sampling::Within(0.05), 211, 0.0);
        helper_count += close.helpers;
        assert!(
            close.degrees < 0.0501 && close.translation < 1.02e-4 && close.scale < 1.02e-4,
            "{round}: {close:?}\n{text}"
        );
        let delayed = largest_errors(text.as_bytes(), Sampling::Within(0.05), 211, 0.01);
        assert!(delayed.degrees > 0.1 || delayed.translation > 2e-4, "{round}: {delayed:?}");
    }
    assert!(helper_count > 40, "{helper_count} helpers for scale");
}

/// Mixed layers are sampled: what the probes miss is a little more.
#[test]
fn random_curves_of_two_layers_are_close_to_ufbx() {
    let mut random_values = RandomValues(11);
    for round in 0..8 {
        let text = random_file(&mut random_values, 2, false);
        let close = largest_errors(text.as_bytes(), Sampling::Within(0.05), 101, 0.0);
        println!("{close:?}");
        assert!(close.degrees < 0.15 && close.translation < 4e-4, "{round}: {close:?}\n{text}");
    }
}
