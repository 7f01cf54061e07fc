//! Vertex attributes packed into few bits.

use crate::{Random, Section};
use choreo_bench::plots::{Choice, Row};
use choreo_bench::reference::ErrorStats;
use choreo_bench::vertex::{NORMALS, WEIGHTS, degrees_between};
use glam::{DMat3, DQuat, DVec3, Vec3};

const VERTEX_COUNT: usize = 20_000;

pub(crate) fn section() -> Result<Section, String> {
    Ok(Section {
        title: "Vertices on the GPU",
        text: "Positions and texture coordinates stay f32. An error of a normal is visible in highlights: \
               0.1° on a polished ball makes bands, 0.003° is invisible. An error of a weight moves \
               vertices: with 8 bits by millimetres where a joint bends far, which flickers from frame to \
               frame."
            .into(),
        choices: vec![compare_normal_packings(), compare_tangent_packings(), compare_weight_packings()],
        tables: Vec::new(),
        off_front: vec![
            (
                "tangents",
                "one quaternion stores normal and tangent in half the bytes, as octahedra nearly do, but every \
             shader would have to decode it.",
            ),
            (
                "normals",
                "an octahedron is nearly as exact in half the bytes, but every shader would have to decode it; \
             vertices are 20 to 52 bytes, and none of our scenes is bound by reading them.",
            ),
            (
                "weights",
                "plainly rounded weights add up to slightly more or less than 1, which moves a vertex in \
             proportion to its distance from the model's origin: nothing at the 1 m of this table, 1.5 mm \
             at 100 m.",
            ),
        ],
    })
}

fn compare_normal_packings() -> Choice {
    let mut choice = Choice::new("normals", "How are normals packed?");
    choice.error_unit = "°";
    choice.reference = format!("{VERTEX_COUNT} directions evenly over the sphere, the angle in f64");
    let mut random = Random(1);
    let directions: Vec<Vec3> = (0..VERTEX_COUNT).map(|_| random.direction().as_vec3()).collect();
    for (name, bytes, pack) in NORMALS {
        let mut error = ErrorStats::default();
        for n in &directions {
            error.add(degrees_between(*n, pack(*n)));
        }
        choice.rows.push(Row::new(name).error(error.worst, error.mean()).bytes(bytes as f64));
    }
    choice.choose(
        NORMALS[1].0,
        "an error too small to see in shading, in a format that every device reads directly",
    );
    choice
}

/// Normal and tangent are packed in the same way; the measured error is that of a normal from a normal map.
fn compare_tangent_packings() -> Choice {
    let mut choice = Choice::new("tangents", "How are tangents packed? (with their normals)");
    choice.error_unit = "°";
    choice.reference = format!(
        "normals of a map, tilted by up to 60°, in {VERTEX_COUNT} frames evenly over all directions; in f64 with the frames as they are"
    );
    let mut random = Random(3);
    let frames: Vec<[Vec3; 3]> = (0..VERTEX_COUNT)
        .map(|_| {
            let normal = random.direction();
            let tangent = normal.cross(random.direction()).normalize();
            let (tilt, around) =
                (random.unit() * 60.0f64.to_radians(), random.unit() * std::f64::consts::TAU);
            let flat = libm::sin(tilt);
            let map = DVec3::new(flat * libm::cos(around), flat * libm::sin(around), libm::cos(tilt));
            [normal.as_vec3(), tangent.as_vec3(), map.as_vec3()]
        })
        .collect();
    let bent =
        |[normal, tangent, map]: [Vec3; 3]| tangent * map.x + normal.cross(tangent) * map.y + normal * map.z;
    let mut measured = |name: String, bytes: usize, pack: &dyn Fn([Vec3; 2]) -> [Vec3; 2]| {
        let mut error = ErrorStats::default();
        for [normal, tangent, map] in &frames {
            let [n, t] = pack([*normal, *tangent]);
            error.add(degrees_between(bent([*normal, *tangent, *map]), bent([n, t, *map])));
        }
        choice.rows.push(Row::new(name).error(error.worst, error.mean()).bytes(bytes as f64));
    };
    for (name, bytes, pack) in NORMALS {
        // The sign of the bitangent is stored as a fourth number, or as one bit with octahedra and quaternions.
        let both = if bytes == 12 { 28 } else { 2 * bytes };
        measured(name.to_string(), both, &|frame| frame.map(pack));
    }
    for (name, bytes, steps) in
        [("one quaternion, 16-bit × 4", 8, 32767.0), ("one quaternion, 8-bit × 4", 4, 127.0)]
    {
        measured(name.to_string(), bytes, &|[normal, tangent]| {
            let turn =
                DMat3::from_cols(tangent.as_dvec3(), normal.cross(tangent).as_dvec3(), normal.as_dvec3());
            let q = DQuat::from_mat3(&turn).to_array().map(|v| libm::round(v * steps) / steps);
            let q = DQuat::from_array(q).normalize();
            [(q * DVec3::Z).as_vec3(), (q * DVec3::X).as_vec3()]
        });
    }
    choice.choose(NORMALS[1].0, "as for normals: the error of both together is far below a visible one");
    choice
}

/// Skin weights of vertices up to 1 m from joints that are turned by up to 120°: the largest differences that weights must blend.
fn compare_weight_packings() -> Choice {
    let mut choice = Choice::new("weights", "How are skin weights packed?");
    choice.error_unit = "mm";
    choice.reference =
        "vertices up to 1 m from four joints turned by up to 120°, in f64 with the weights as given".into();
    let mut random = Random(2);
    let mut errors = [ErrorStats::default(); WEIGHTS.len()];
    for _ in 0..VERTEX_COUNT {
        let given: [f64; 4] = std::array::from_fn(|_| random.unit());
        let sum: f64 = given.iter().sum();
        let given = given.map(|w| (w / sum) as f32);
        let at: DVec3 = random.direction() * random.unit();
        let carried: [DVec3; 4] = std::array::from_fn(|_| {
            DQuat::from_axis_angle(random.direction(), random.unit() * 120.0f64.to_radians()) * at
        });
        let place = |w: &[f32]| -> DVec3 { w.iter().zip(carried).map(|(w, p)| p * f64::from(*w)).sum() };
        let exact = place(&given);
        for ((_, _, pack), error) in WEIGHTS.iter().zip(&mut errors) {
            error.add((place(&pack(&given)) - exact).length() * 1e3);
        }
    }
    for ((name, bytes, _), error) in WEIGHTS.iter().zip(errors) {
        choice.rows.push(Row::new(*name).error(error.worst, error.mean()).bytes(*bytes as f64));
    }
    choice.choose(WEIGHTS[1].0, "hundredths of a millimetre, at half the size of floats");
    choice
}
