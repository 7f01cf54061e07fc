//! FBX import: error of baked keyframes against the Euler curves of the file.

use crate::Section;
use crate::scenes::import_file;
use choreo_bench::plots::{Choice, Row};
use choreo_bench::reference::{ErrorStats, angle_between, pose};
use choreo_motion::Time;
use choreo_plugin::OptionValue;
use glam::DQuat;

/// Tolerances in degrees.
const TOLERANCES: [f64; 5] = [0.5, 0.1, 0.05, 0.01, 0.001];
const DEFAULT_TOLERANCE: f64 = 0.05;
/// Ticks per second in FBX.
const TICKS_PER_SECOND: i64 = 46_186_158_000;
/// Degrees about x, y and z at whole seconds, linearly interpolated.
const ANGLES: [[f64; 4]; 3] =
    [[0.0, 170.0, 40.0, -60.0], [0.0, 70.0, -50.0, 20.0], [0.0, -120.0, 90.0, 150.0]];
const TIME_COUNT: u32 = 997;

fn curve_text(axis: usize) -> String {
    let numbers = |of: &dyn Fn(usize) -> String| (0..4).map(of).collect::<Vec<_>>().join(",");
    format!(
        "AnimationCurve: {}, \"AnimCurve::\", \"\" {{\nDefault: 0\nKeyVer: 4008\nKeyTime: *4 {{\na: {}\n}}\nKeyValueFloat: *4 {{\na: {}\n}}\n\
         KeyAttrFlags: *1 {{\na: 24836\n}}\nKeyAttrDataFloat: *4 {{\na: 0,0,218434821,0\n}}\nKeyAttrRefCount: *1 {{\na: 4\n}}\n}}\n",
        10 + axis,
        numbers(&|i| (i as i64 * TICKS_PER_SECOND).to_string()),
        numbers(&|i| ANGLES[axis][i].to_string()),
    )
}

/// FBX text file of a limb whose rotation has three curves.
fn limb_fbx() -> String {
    let curves: String = (0..3).map(curve_text).collect();
    let links: String =
        (0..3).map(|i| format!("C: \"OP\",{},4, \"d|{}\"\n", 10 + i, ["X", "Y", "Z"][i])).collect();
    format!(
        "; FBX 7.4.0 project file\nFBXHeaderExtension: {{\nFBXVersion: 7400\n}}\nGlobalSettings: {{\nProperties70: {{\n\
         P: \"UnitScaleFactor\", \"double\", \"Number\", \"\", 100\n}}\n}}\nObjects: {{\n\
         Model: 1, \"Model::limb\", \"LimbNode\" {{\nProperties70: {{\n}}\n}}\n\
         AnimationStack: 2, \"AnimStack::turn\", \"\" {{\nProperties70: {{\nP: \"LocalStart\", \"KTime\", \"Time\", \"\", 0\nP: \"LocalStop\", \"KTime\", \"Time\", \"\", {}\n}}\n}}\n\
         AnimationLayer: 3, \"AnimLayer::base\", \"\" {{\n}}\n\
         AnimationCurveNode: 4, \"AnimCurveNode::R\", \"\" {{\nProperties70: {{\n}}\n}}\n{curves}}}\nConnections: {{\n\
         C: \"OO\",1,0\nC: \"OO\",3,2\nC: \"OO\",4,3\nC: \"OP\",4,1, \"Lcl Rotation\"\n{links}}}\n",
        3 * TICKS_PER_SECOND,
    )
}

/// Reference rotation: about x first, then y, then z, in the parent's axes.
fn reference_rotation(secs: f64) -> DQuat {
    let [x, y, z] = ANGLES.map(|angles| {
        let key = (secs as usize).min(2);
        (angles[key] + (angles[key + 1] - angles[key]) * (secs - key as f64)).to_radians()
    });
    DQuat::from_rotation_z(z) * DQuat::from_rotation_y(y) * DQuat::from_rotation_x(x)
}

pub(crate) fn section() -> Result<Section, String> {
    let registry = choreo::registry();
    let mut choice =
        Choice::new("fbx_tolerance", "How far may rotations of an FBX file be off between keys?");
    choice.error_unit = "°";
    choice.reference = format!(
        "the product of three rotations in f64 at {TIME_COUNT} times of 3 s; Euler angles up to 210° a second"
    );
    for degrees in TOLERANCES {
        let options = [("tolerance", OptionValue::Number(degrees))];
        let asset = import_file(&registry, "limb.fbx", limb_fbx().into_bytes(), &options)?;
        let clip = asset.clips.first().ok_or("the file has no clip")?;
        let joint = asset.skeleton.find("limb").ok_or("the file has no limb")?;
        let mut error = ErrorStats::default();
        let mut place = String::new();
        for i in 0..TIME_COUNT {
            let secs = 3.0 * (f64::from(i) + 0.37) / f64::from(TIME_COUNT);
            let found = pose(clip, &asset.skeleton, Time::from_secs(secs))[joint].rotation;
            if error.add(angle_between(found, reference_rotation(secs)).to_degrees()) {
                place = format!("{secs:.2} s");
            }
        }
        let bytes = |curve: &choreo_motion::Curve| 8 * curve.times.len() + 4 * curve.values.len();
        let keys: usize = clip.curves().iter().map(|curve| curve.times.len()).sum();
        choice.rows.push(
            Row::new(format!("{degrees}°"))
                .error(error.worst, error.mean())
                .at(place)
                .bytes(clip.curves().iter().map(bytes).sum::<usize>() as f64)
                .note(format!("{keys} keys")),
        );
    }
    choice.choose(
        &format!("{DEFAULT_TOLERANCE}°"),
        "half a millimetre at the end of an arm, and few added keys for ordinary angles",
    );
    Ok(Section {
        title: "Euler angles of FBX",
        text: "FBX rotates a joint by three angles, each with its own curve; clips here have one rotation, \
               with slerp between keys. Where slerp would be off by more than the tolerance, a key is added."
            .into(),
        choices: vec![choice],
        tables: Vec::new(),
        off_front: Vec::new(),
    })
}
