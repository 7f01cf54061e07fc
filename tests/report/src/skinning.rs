//! Skinning: blending method, number of influences, and number format of positions.

use crate::{BUDGET_SECS, Random, Section};
use choreo_bench::plots::{Cell, Choice, Row, Table, quantity};
use choreo_bench::reference::ErrorStats;
use choreo_bench::timing::{Case, Clock, Nanos, interleaved};
use choreo_motion::{
    DualQuaternion, DualQuaternionSkinning, LinearSkinning, StretchedDualQuaternion, stretch_matrix,
};
use glam::{Affine3A, DAffine3, DQuat, DVec3, Mat3A, Vec3, Vec3A};

const VERTEX_COUNT: usize = 4_000;
/// Radius of the limb in metres.
const LIMB_RADIUS: f64 = 0.04;
const ANGLES: [f64; 6] = [10.0, 45.0, 90.0, 120.0, 150.0, 175.0];

pub(crate) fn section() -> Result<Section, String> {
    let (twist, table) = compare_methods();
    Ok(Section {
        title: "Skins",
        text: "With blended matrices, a vertex between two joints lies on the straight line between the two \
               places to which the joints would move it: a twisted limb shrinks to cos(θ/2) of its girth \
               halfway, to nothing at half a turn. Dual quaternions rotate it about the axis between the \
               motions. They bulge where joints bend, and other programs do not support them, so skins of \
               files stay linear, as in glTF, unless a script asks. Scales and shears are blended before \
               the motions and cost a second sum."
            .into(),
        choices: vec![twist, compare_influence_counts(), compare_position_formats()],
        tables: vec![table],
        off_front: vec![
            (
                "skinning",
                "skin weights in model files are painted for linear blend skinning, which is also the \
                 cheapest; a script selects dual quaternion skinning where limbs twist.",
            ),
            (
                "positions",
                "halving the bytes of positions saves a fifth of a vertex; 16 bits would show as creases on \
                 large flat meshes, since a step grows with the width of the mesh.",
            ),
        ],
    })
}

fn affine_to_f32(map: &DAffine3) -> Affine3A {
    Affine3A {
        matrix3: Mat3A::from(map.matrix3.as_mat3()),
        translation: Vec3A::from(map.translation.as_vec3()),
    }
}

/// Vertices with their influencing joints.
struct Mesh {
    influences: usize,
    joints: Vec<u16>,
    weights: Vec<f32>,
    positions: Vec<Vec3>,
}

#[derive(Clone, Copy)]
enum SkinningMethod {
    Linear,
    Dual,
    Stretched,
}

impl Mesh {
    fn skin(&self, method: SkinningMethod, maps: &[DAffine3], out: &mut [Vec3], normals: &mut [Vec3]) {
        let Mesh { influences, joints, weights, positions } = self;
        let carriers: Vec<StretchedDualQuaternion> =
            maps.iter().map(|m| StretchedDualQuaternion::of(*m)).collect();
        let matrices: Vec<Affine3A> = maps.iter().map(affine_to_f32).collect();
        let motions: Vec<DualQuaternion> = carriers.iter().map(DualQuaternion::from).collect();
        let stretches: Vec<Affine3A> = match method {
            SkinningMethod::Stretched => carriers.iter().map(stretch_matrix).collect(),
            _ => Vec::new(),
        };
        let (joint_indices, joint_weights, influences) = (joints, weights, *influences);
        // Positions are used as normals, because the cost is the same.
        let source: &[Vec3] = if normals.is_empty() { &[] } else { positions };
        match method {
            SkinningMethod::Linear => LinearSkinning {
                matrices: &matrices,
                influences,
                joint_indices,
                joint_weights,
                positions,
                normals: source,
                out_positions: out,
                out_normals: normals,
            }
            .run(),
            _ => DualQuaternionSkinning {
                motions: &motions,
                stretches: &stretches,
                influences,
                joint_indices,
                joint_weights,
                positions,
                normals: source,
                out_positions: out,
                out_normals: normals,
            }
            .run(),
        }
    }

    fn time_methods(&self, methods: &[SkinningMethod], maps: &[DAffine3]) -> Vec<Nanos> {
        let mut cases: Vec<Case> = methods
            .iter()
            .map(|method| {
                let (mut out, mut normals) = (self.positions.clone(), self.positions.clone());
                Case::new(VERTEX_COUNT, move || {
                    self.skin(*method, maps, &mut out, &mut normals);
                    std::hint::black_box((&mut out, &mut normals));
                })
            })
            .collect();
        interleaved(Clock::Thread, BUDGET_SECS, &mut cases)
    }
}

/// A limb along x from 0 to 25 cm, whose weights change linearly from one joint to the other.
fn limb() -> Mesh {
    let mut random = Random(3);
    let mut mesh = Mesh { influences: 4, joints: Vec::new(), weights: Vec::new(), positions: Vec::new() };
    for _ in 0..VERTEX_COUNT {
        let (along, angle) = (random.unit(), random.unit() * std::f64::consts::TAU);
        let at = DVec3::new(along * 0.25, libm::cos(angle) * LIMB_RADIUS, libm::sin(angle) * LIMB_RADIUS);
        mesh.positions.push(at.as_vec3());
        mesh.joints.extend([0, 1, 0, 0]);
        mesh.weights.extend([1.0 - along as f32, along as f32, 0.0, 0.0]);
    }
    mesh
}

fn compare_methods() -> (Choice, Table) {
    let mesh = limb();
    let methods = [
        ("linear blending", SkinningMethod::Linear),
        ("dual quaternions", SkinningMethod::Dual),
        ("dual quaternions after stretches", SkinningMethod::Stretched),
    ];
    let mut choice = Choice::new("skinning", "How do vertices follow several joints?");
    choice.error_unit = "mm";
    choice.reference = "a limb of 4 cm radius whose sections turn evenly about its axis, a closed form; twisted by 10° to 175°".into();
    choice.per = "vertex with 4 influences, position and normal".into();
    let titles: Vec<String> = ANGLES.iter().map(|a| format!(">{a}°")).collect();
    let columns: Vec<(&str, &str)> = [("worst error in mm, twisted by", "way")]
        .into_iter()
        .chain(titles.iter().map(|t| (t.as_str(), "from one end to the other")))
        .collect();
    let mut table = Table::new("By the angle of the twist", &columns);
    let nanos = mesh.time_methods(&methods.map(|w| w.1), &twisted_joint_maps(120.0));
    let mut out = mesh.positions.clone();
    for ((name, method), nanos) in methods.into_iter().zip(nanos) {
        let mut all = ErrorStats::default();
        let mut place = String::new();
        let mut cells = vec![Cell::text(name)];
        for angle in ANGLES {
            mesh.skin(method, &twisted_joint_maps(angle), &mut out, &mut []);
            let mut errors = ErrorStats::default();
            for ((at, weights), got) in mesh.positions.iter().zip(mesh.weights.chunks(4)).zip(&out) {
                let share = f64::from(weights[1]);
                let want = DQuat::from_rotation_x(angle.to_radians() * share) * at.as_dvec3();
                let error = (got.as_dvec3() - want).length() * 1e3;
                errors.add(error);
                if all.add(error) {
                    place = format!("{angle}°, {share:.2} of the way");
                }
            }
            cells.push(Cell::number(quantity(errors.worst), errors.worst));
        }
        table.rows.push(cells);
        choice.rows.push(Row::new(name).error(all.worst, all.mean()).nanos(nanos).at(place));
    }
    choice.choose(
        "linear blending",
        "the method of glTF, for which files are painted; .skinning(\"dual_quaternion\") where limbs twist",
    );
    (choice, table)
}

fn twisted_joint_maps(degrees: f64) -> Vec<DAffine3> {
    vec![DAffine3::IDENTITY, DAffine3::from_rotation_x(degrees.to_radians())]
}

/// Error by number of influences: a bent back of 16 joints 10 cm apart, with each vertex on the nearest eight; only the largest weights are
/// kept.
fn compare_influence_counts() -> Choice {
    const MAX_INFLUENCES: usize = 8;
    let mut choice = Choice::new("influences", "How many joints move a vertex?");
    choice.error_unit = "mm";
    choice.reference = "all 8 influences in f64; a back of 16 joints, each bent by 12°".into();
    choice.per = "vertex, position and normal".into();
    let mut maps = vec![DAffine3::IDENTITY];
    for joint in 1..16 {
        let pivot = DVec3::new(0.1 * f64::from(joint), 0.0, 0.0);
        let bend = DAffine3::from_translation(pivot)
            * DAffine3::from_rotation_z(12f64.to_radians())
            * DAffine3::from_translation(-pivot);
        maps.push(maps[joint as usize - 1] * bend);
    }
    let mut random = Random(5);
    let mut all: Vec<(Vec3, Vec<(u16, f64)>)> = Vec::new();
    for _ in 0..VERTEX_COUNT {
        let at = DVec3::new(random.unit() * 1.5, random.signed() * 0.12, random.signed() * 0.1);
        let far = |joint: usize| (at.x - 0.1 * joint as f64 - 0.05) / 0.12;
        let mut weights: Vec<(u16, f64)> =
            (0..16).map(|j| (j as u16, libm::exp(-0.5 * far(j) * far(j)))).collect();
        weights.sort_by(|a, b| b.1.total_cmp(&a.1));
        weights.truncate(MAX_INFLUENCES);
        all.push((at.as_vec3(), weights));
    }
    let kept = |n: usize| -> Mesh {
        let mut mesh = Mesh { influences: n, joints: Vec::new(), weights: Vec::new(), positions: Vec::new() };
        for (at, weights) in &all {
            let sum: f64 = weights[..n].iter().map(|w| w.1).sum();
            mesh.positions.push(*at);
            mesh.joints.extend(weights[..n].iter().map(|w| w.0));
            mesh.weights.extend(weights[..n].iter().map(|w| (w.1 / sum) as f32));
        }
        mesh
    };
    let exact: Vec<DVec3> = all
        .iter()
        .map(|(at, weights)| {
            let sum: f64 = weights.iter().map(|w| w.1).sum();
            weights
                .iter()
                .map(|(j, w)| maps[usize::from(*j)].transform_point3(at.as_dvec3()) * (*w / sum))
                .sum()
        })
        .collect();
    for n in 1..=MAX_INFLUENCES {
        let mesh = kept(n);
        let mut out = mesh.positions.clone();
        mesh.skin(SkinningMethod::Linear, &maps, &mut out, &mut []);
        let mut errors = ErrorStats::default();
        exact
            .iter()
            .zip(&out)
            .for_each(|(want, got)| _ = errors.add((got.as_dvec3() - *want).length() * 1e3));
        let nanos = mesh.time_methods(&[SkinningMethod::Linear], &maps)[0];
        let row = Row::new(format!("{n}, the heaviest")).error(errors.worst, errors.mean()).nanos(nanos);
        choice.rows.push(row.bytes((n * 4) as f64));
    }
    choice.choose(
        "8, the heaviest",
        "as many as a file has, up to 8; meshes whose vertices have at most 4 are drawn with 4",
    );
    choice
}

/// Error of a character's positions in smaller number formats.
fn compare_position_formats() -> Choice {
    let mut choice = Choice::new("positions", "In which number format are positions stored?");
    choice.error_unit = "mm";
    choice.reference =
        "the file's own f32, skinned in f64; a figure of 1.8 m, joints turned by up to 120°".into();
    let mut random = Random(6);
    let half_size = DVec3::new(0.5, 0.9, 0.3);
    type Pack = fn(f64, f64) -> f64;
    let methods: [(&str, usize, Pack); 4] = [
        ("f32 × 3", 12, |v, _| v),
        ("16-bit signed × 4, in the mesh's box", 8, |v, half| {
            libm::round(v / half * 32767.0) / 32767.0 * half
        }),
        ("half float × 4", 8, |v, _| round_to_half_float(v)),
        ("10-bit signed × 3, in the mesh's box", 4, |v, half| libm::round(v / half * 511.0) / 511.0 * half),
    ];
    let mut errors = [ErrorStats::default(); 4];
    for _ in 0..20_000 {
        let at = DVec3::new(random.signed(), random.signed(), random.signed()) * half_size;
        let at = at.as_vec3().as_dvec3();
        let turn = DQuat::from_axis_angle(random.direction(), random.unit() * 120f64.to_radians());
        for ((_, _, pack), error) in methods.iter().zip(&mut errors) {
            let packed =
                DVec3::new(pack(at.x, half_size.x), pack(at.y, half_size.y), pack(at.z, half_size.z));
            error.add((turn * packed - turn * at).length() * 1e3);
        }
    }
    for ((name, bytes, _), error) in methods.iter().zip(errors) {
        choice.rows.push(Row::new(*name).error(error.worst, error.mean()).bytes(*bytes as f64));
    }
    choice.choose("f32 × 3", "exact at any size of a mesh, without a box that shaders must know");
    choice
}

/// Rounds to the 11 significant bits of IEEE 754 binary16.
fn round_to_half_float(v: f64) -> f64 {
    let (_, exponent) = libm::frexp(v);
    let step = libm::ldexp(1.0, exponent.max(-13) - 11);
    libm::round(v / step) * step
}
