//! Local transforms to model space along chains of joints: error by chain length.

use crate::{BUDGET_SECS, Random, Section};
use choreo_bench::plots::{Cell, Choice, Row, Table, quantity};
use choreo_bench::reference::{self, ErrorStats};
use choreo_bench::timing::{Case, Clock, Nanos, interleaved};
use choreo_motion::{Level, LocalToModel, Pose, Skeleton, Transform};
use glam::{Affine3A, DAffine3, DVec3, Quat, Vec3};

const LENGTHS: [usize; 5] = [1, 10, 50, 200, 1000];
/// Length of a bone in metres.
const BONE_LENGTH: f32 = 0.1;
/// Index of the typical length: a character with a long spine or a tail.
const TYPICAL_LENGTH: usize = 2;
const CHOSEN_METHOD: &str = "f32 matrices, by depth (LocalToModel)";
const METHODS: [&str; 4] =
    ["f64 matrices", CHOSEN_METHOD, "f32 rotation and translation", "f32 rotation, made unit at each joint"];

pub(crate) fn section() -> Result<Section, String> {
    let mut by_length = vec![vec![ErrorStats::default(); LENGTHS.len()]; METHODS.len()];
    let mut nanos = vec![Nanos::default(); METHODS.len()];
    for (at, length) in LENGTHS.iter().enumerate() {
        for seed in 0..8 {
            let (skeleton, pose) = chain(*length, seed)?;
            let exact = reference::model_from_joint(&skeleton, &reference::rest(&skeleton));
            for (method, errors) in by_length.iter_mut().enumerate() {
                let mut buffers = Buffers::default();
                buffers.run(method, &skeleton, &pose);
                let error = (buffers.tip(method) - exact[length - 1].translation).length() * 1e6;
                errors[at].add(error);
            }
        }
        if at == TYPICAL_LENGTH {
            let (skeleton, pose) = chain(*length, 0)?;
            let (skeleton, pose) = (&skeleton, &pose);
            let case = |method: usize| -> Case {
                let mut buffers = Buffers::default();
                Case::new(*length, move || {
                    buffers.run(method, skeleton, pose);
                    std::hint::black_box(&buffers);
                })
            };
            let mut cases: Vec<Case> = (0..METHODS.len()).map(case).collect();
            nanos = interleaved(Clock::Thread, BUDGET_SECS, &mut cases);
        }
    }
    let mut choice = Choice::new("chains", "In which number format are joints transformed to model space?");
    choice.error_unit = "µm";
    choice.reference = format!(
        "the tip of a chain of {} joints of 10 cm, each turned by up to 40°, in f64 from the same f32 transforms",
        LENGTHS[TYPICAL_LENGTH]
    );
    choice.per =
        "joint; one after the other, in portable instructions: joints of a chain cannot be computed in \
         parallel"
            .into();
    for (method, name) in METHODS.iter().enumerate() {
        let error = &by_length[method][TYPICAL_LENGTH];
        choice.rows.push(Row::new(*name).error(error.worst, error.mean()).nanos(nanos[method]));
    }
    choice.choose(CHOSEN_METHOD, "errors of micrometres at the tip, and the GPU needs f32 matrices anyway");
    let titles: Vec<String> = LENGTHS.iter().map(|n| format!(">{n} joints")).collect();
    let mut columns: Vec<(&str, &'static str)> = vec![("worst error of the tip in µm", "way")];
    columns.extend(titles.iter().map(|t| (t.as_str(), "joints")));
    let mut table = Table::new("By the length of the chain", &columns);
    for (name, errors) in METHODS.iter().zip(&by_length) {
        let cells = errors.iter().map(|e| Cell::number(quantity(e.worst), e.worst));
        table.rows.push([Cell::text(*name)].into_iter().chain(cells).collect());
    }
    Ok(Section {
        title: "Chains of joints",
        text: "Rounding grows with the length of the chain and with its reach; even the tip of a thousand joints is within 0.05 mm."
            .into(),
        choices: vec![choice],
        tables: vec![table],
        off_front: vec![(
            "chains",
            "the GPU and skinning take f32 matrices with scales in them; on registers of AVX2, where it runs, it takes less than half of this.",
        )],
    })
}

/// A chain in which each joint is the child of the previous one.
fn chain(length: usize, seed: u64) -> Result<(Skeleton, Pose), String> {
    let mut random = Random(seed * 77 + 1);
    let rest: Vec<Transform> = (0..length)
        .map(|_| {
            let axis = random.direction().as_vec3().normalize();
            let angle = (random.unit() * 40.0f64.to_radians()) as f32;
            Transform {
                translation: Vec3::new(0.0, BONE_LENGTH, 0.0),
                rotation: Quat::from_axis_angle(axis, angle).normalize(),
                scale: Vec3::ONE,
            }
        })
        .collect();
    let names = (0..length).map(|i| i.to_string()).collect();
    let parents = (0..length).map(|i| i.checked_sub(1).map(|p| p as u32)).collect();
    let skeleton = Skeleton::new(names, parents, rest).map_err(|e| e.to_string())?;
    let pose = Pose::rest(&skeleton);
    Ok((skeleton, pose))
}

/// Results of each method, reused between runs.
#[derive(Default)]
struct Buffers {
    exact: Vec<DAffine3>,
    matrices: Vec<Affine3A>,
    motions: Vec<(Quat, Vec3)>,
}

impl Buffers {
    fn run(&mut self, method: usize, skeleton: &Skeleton, pose: &Pose) {
        match method {
            0 => {
                self.exact.clear();
                for (local, parent) in pose.iter().zip(skeleton.parents()) {
                    let local = DAffine3::from_scale_rotation_translation(
                        local.scale.as_dvec3(),
                        local.rotation.as_dquat(),
                        local.translation.as_dvec3(),
                    );
                    self.exact.push(parent.map_or(local, |p| self.exact[p as usize] * local));
                }
            }
            1 => {
                self.matrices.resize(skeleton.len(), Affine3A::IDENTITY);
                LocalToModel { skeleton, pose, model_from_joint: &mut self.matrices }.run_on(Level::Portable);
            }
            _ => {
                self.motions.clear();
                for (local, parent) in pose.iter().zip(skeleton.parents()) {
                    let (rotation, translation) =
                        parent.map_or((Quat::IDENTITY, Vec3::ZERO), |p| self.motions[p as usize]);
                    let turned = rotation * local.rotation;
                    let turned = if method == 3 { turned.normalize() } else { turned };
                    self.motions.push((turned, translation + rotation * local.translation));
                }
            }
        }
    }

    /// Position of the last joint after a run of a method.
    fn tip(&self, method: usize) -> DVec3 {
        let place = match method {
            0 => self.exact.last().map(|m| m.translation),
            1 => self.matrices.last().map(|m| Vec3::from(m.translation).as_dvec3()),
            _ => self.motions.last().map(|(_, t)| t.as_dvec3()),
        };
        place.unwrap_or(DVec3::NAN)
    }
}
