//! Vertices in few bits.

use crate::{Random, Section};
use choreo_measure::truth::Spread;
use choreo_measure::vertex::{NORMALS, WEIGHTS, degrees_between};
use choreo_report::{Choice, Row};
use glam::{DQuat, DVec3};

const VERTICES: usize = 20_000;

pub fn section() -> Result<Section, String> {
    Ok(Section {
        title: "Vertices on the GPU",
        text: "Positions and texture coordinates stay f32. An error of a normal is seen in highlights: 0.1° on a polished ball makes \
               bands, 0.003° nothing. Weights move vertices: with 8 bits by millimetres where a joint bends far, which crawls from \
               frame to frame."
            .into(),
        choices: vec![normals(), weights()],
        tables: Vec::new(),
        off_front: vec![(
            "normals",
            "the octahedron holds nearly as much in half the bytes, but every shader would have to unfold it; vertices are 20 to 52 bytes, \
             and none of our scenes is bound by reading them.",
        ), (
            "weights",
            "as rounded, weights add up to a little more or less than 1, which moves a vertex by its distance from the model's origin: nothing \
             at the 1 m of this table, 1.5 mm at 100 m.",
        )],
    })
}

fn normals() -> Choice {
    let mut choice = Choice::new("normals", "How are normals packed?");
    choice.error_unit = "°";
    choice.reference = format!("{VERTICES} directions evenly over the sphere, the angle in f64");
    let mut random = Random(1);
    let directions: Vec<glam::Vec3> = (0..VERTICES).map(|_| random.direction().as_vec3()).collect();
    for (name, bytes, pack) in NORMALS {
        let mut error = Spread::default();
        for n in &directions {
            error.add(degrees_between(*n, pack(*n)));
        }
        choice.rows.push(Row::new(name).error(error.worst, error.mean()).bytes(bytes as f64));
    }
    choice.choose(
        NORMALS[1].0,
        "far below what shading shows, in a format that every device reads without code",
    );
    choice
}

/// A metre from two joints of which one is turned by 120°: as far apart as weights have to hold together.
fn weights() -> Choice {
    let mut choice = Choice::new("weights", "How are skin weights packed?");
    choice.error_unit = "mm";
    choice.reference =
        "vertices up to 1 m from four joints turned by up to 120°, in f64 with the weights as given".into();
    let mut random = Random(2);
    let mut errors = [Spread::default(); WEIGHTS.len()];
    for _ in 0..VERTICES {
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
