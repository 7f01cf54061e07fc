//! Positions far from the origin.

use crate::{BUDGET_SECS, Random, Section};
use choreo_asset::Projection;
use choreo_bench::plots::{Cell, Choice, Row, Table, quantity};
use choreo_bench::timing::{Case, Clock, Nanos, interleaved};
use choreo_bench::truth::Spread;
use choreo_render::plan::View;
use choreo_render::view::relative;
use choreo_stage::CameraState;
use glam::{DAffine3, DMat4, DQuat, DVec3, DVec4, Vec3};

/// Metres: a room, a town, a country, the Earth, the Moon.
const DISTANCES: [(f64, &str); 5] =
    [(1.0, "1 m"), (1e3, "1 km"), (1e5, "100 km"), (1e7, "10 000 km"), (4e8, "400 000 km")];
const TYPICAL: usize = 1;
const POINTS: usize = 256;
const HEIGHT: f64 = 720.0;
const YFOV: f64 = 0.7;
const OURS: &str = "f64 world, camera-relative f32";
const WAYS: [&str; 4] =
    ["f64 throughout", OURS, "f32 world and view", "f32 world, f32 subtracted from the camera"];

pub fn section() -> Result<Section, String> {
    let mut by_distance = vec![vec![Spread::default(); DISTANCES.len()]; WAYS.len()];
    let mut nanos = vec![Nanos::default(); WAYS.len()];
    for (at, (distance, _)) in DISTANCES.iter().enumerate() {
        let shot = Shot::new(*distance);
        let mut picture = vec![DVec3::ZERO; POINTS];
        let exact: Vec<DVec3> = shot.draw(0);
        for (way, errors) in by_distance.iter_mut().enumerate() {
            picture.clone_from(&shot.draw(way));
            for (got, exact) in picture.iter().zip(&exact) {
                // Nothing at all where f32 has no such place: half an image off.
                let off = (*got - *exact).truncate().length();
                errors[at].add(if off.is_finite() { off } else { HEIGHT });
            }
        }
        if at == TYPICAL {
            let shot = &shot;
            let case = |way: usize| Case::new(POINTS, move || drop(std::hint::black_box(shot.draw(way))));
            let mut cases: Vec<Case> = (0..WAYS.len()).map(case).collect();
            nanos = interleaved(Clock::Thread, BUDGET_SECS, &mut cases);
        }
    }
    let mut choice = Choice::new("far_away", "In what numbers do points come to the image?");
    choice.error_unit = "pixels";
    choice.reference = format!(
        "f64 throughout; a figure {} from the origin, seen by a camera 5 m before it, 720 pixels high",
        DISTANCES[TYPICAL].1
    );
    choice.per = "point".into();
    for (way, name) in WAYS.iter().enumerate() {
        let error = &by_distance[way][TYPICAL];
        choice.rows.push(Row::new(*name).error(error.worst, error.mean()).nanos(nanos[way]));
    }
    choice.choose(OURS, "as exact everywhere as at the origin, and what the GPU does is f32");
    let titles: Vec<String> = DISTANCES.iter().map(|d| format!(">{}", d.1)).collect();
    let mut columns: Vec<(&str, &'static str)> = vec![("worst error in pixels, from the origin", "way")];
    columns.extend(titles.iter().map(|t| (t.as_str(), "distance")));
    let mut table = Table::new("By the distance from the origin", &columns);
    for (name, errors) in WAYS.iter().zip(&by_distance) {
        let cells = errors.iter().map(|e| Cell::number(quantity(e.worst), e.worst));
        table.rows.push([Cell::text(*name)].into_iter().chain(cells).collect());
    }
    Ok(Section {
        title: "Far from the origin",
        text: "A step of f32 is 0.06 mm at 1 km and a metre at 10 000 km. Where a thing is minus where the camera is, subtracted in f64 and \
               rounded once, is exact to f32 wherever both are; it costs one subtraction an actor, not one a point, so that the times \
               here, of one point each, are its worst case."
            .into(),
        choices: vec![choice],
        tables: vec![table],
        off_front: vec![(
            "far_away",
            "a CPU is as quick in f64, point by point; but points are moved by the GPU and by SIMD, which are not.",
        )],
    })
}

/// Points of a figure, and a camera before it.
struct Shot {
    world_from_model: DAffine3,
    points: Vec<DVec3>,
    view: View,
    clip_from_world: DMat4,
    world_from_view: DAffine3,
}

impl Shot {
    fn new(distance: f64) -> Shot {
        let mut random = Random(5);
        // The direction is arbitrary, so that f32 is not exact by chance.
        let origin = DVec3::new(0.48, 0.6, 0.64) * distance + DVec3::new(0.123, 0.0, 0.456);
        let world_from_model = DAffine3::from_rotation_translation(DQuat::from_rotation_y(0.4), origin);
        let points = (0..POINTS)
            .map(|_| DVec3::new(random.signed() * 0.5, random.unit() * 1.8, random.signed() * 0.3))
            .collect();
        let position = origin + DVec3::new(0.3, 1.2, 5.0);
        let world_from_view = DAffine3::from_rotation_translation(DQuat::from_rotation_y(0.06), position);
        let projection = Projection::Perspective { yfov: YFOV as f32, near: 0.05, far: None };
        let camera = CameraState { camera: None, world_from_view, projection };
        let view = View::new(&camera, [1280, HEIGHT as u32]);
        let clip_from_world = view.clip_from_view.as_dmat4() * DMat4::from(world_from_view.inverse());
        Shot { world_from_model, points, view, clip_from_world, world_from_view }
    }

    /// Each point in pixels.
    fn draw(&self, way: usize) -> Vec<DVec3> {
        let pixels =
            |clip: DVec4| DVec3::new(clip.x / clip.w * HEIGHT * 0.5, clip.y / clip.w * HEIGHT * 0.5, 0.0);
        let single = |clip: glam::Vec4| pixels(clip.as_dvec4());
        match way {
            0 => {
                let world = |p: &DVec3| self.world_from_model.transform_point3(*p);
                self.points.iter().map(|p| pixels(self.clip_from_world * world(p).extend(1.0))).collect()
            }
            1 => {
                // The computation of the planner and the vertex shader.
                let offset = relative(self.world_from_model.translation, &self.view);
                let turn = glam::Mat3::from_cols(
                    self.world_from_model.matrix3.x_axis.as_vec3(),
                    self.world_from_model.matrix3.y_axis.as_vec3(),
                    self.world_from_model.matrix3.z_axis.as_vec3(),
                );
                let clip =
                    |p: &DVec3| self.view.clip_from_relative * (turn * p.as_vec3() + offset).extend(1.0);
                self.points.iter().map(|p| single(clip(p))).collect()
            }
            2 => {
                let world_from_model = glam::DMat4::from(self.world_from_model).as_mat4();
                let view_from_world = DMat4::from(self.world_from_view).as_mat4().inverse();
                let clip_from_model = |p: &DVec3| {
                    let world = world_from_model * p.as_vec3().extend(1.0);
                    self.view.clip_from_view * (view_from_world * world)
                };
                self.points.iter().map(|p| single(clip_from_model(p))).collect()
            }
            _ => {
                let world_from_model = glam::DMat4::from(self.world_from_model).as_mat4();
                let camera: Vec3 = self.world_from_view.translation.as_vec3();
                let clip = |p: &DVec3| {
                    let world = world_from_model.transform_point3(p.as_vec3());
                    self.view.clip_from_relative * (world - camera).extend(1.0)
                };
                self.points.iter().map(|p| single(clip(p))).collect()
            }
        }
    }
}
