//! Precision of positions far from the origin.

use crate::{BUDGET_SECS, Random, Section};
use choreo_asset::Projection;
use choreo_bench::plots::{Cell, Choice, Row, Table, quantity};
use choreo_bench::reference::ErrorStats;
use choreo_bench::timing::{Case, Clock, Nanos, interleaved};
use choreo_render::plan::View;
use choreo_render::view::camera_relative;
use choreo_stage::CameraState;
use glam::{DAffine3, DMat4, DQuat, DVec3};

/// Distances from the origin in metres: a room, a town, a country, the Earth, the Moon.
const DISTANCES: [(f64, &str); 5] =
    [(1.0, "1 m"), (1e3, "1 km"), (1e5, "100 km"), (1e7, "10 000 km"), (4e8, "400 000 km")];
const TYPICAL_DISTANCE: usize = 1;
const POINT_COUNT: usize = 256;
const IMAGE_HEIGHT: f64 = 720.0;
const YFOV: f64 = 0.7;
const CHOSEN_METHOD: &str = "f64 world, camera-relative f32";
const METHODS: [&str; 4] =
    ["f64 throughout", CHOSEN_METHOD, "f32 world and view", "f32 world, f32 subtracted from the camera"];

pub(crate) fn section() -> Result<Section, String> {
    let mut by_distance = vec![vec![ErrorStats::default(); DISTANCES.len()]; METHODS.len()];
    let mut nanos = vec![Nanos::default(); METHODS.len()];
    for (at, (distance, _)) in DISTANCES.iter().enumerate() {
        let shot = Shot::new(*distance);
        let exact = shot.project_points(0);
        for (method, errors) in by_distance.iter_mut().enumerate() {
            let got = shot.project_points(method);
            for point in 0..POINT_COUNT {
                // If f32 cannot represent the position, the error counts as the height of the image.
                let difference = [0, 1].map(|i| got[i][point] - exact[i][point]);
                let difference = libm::hypot(difference[0], difference[1]);
                errors[at].add(if difference.is_finite() { difference } else { IMAGE_HEIGHT });
            }
        }
        if at == TYPICAL_DISTANCE {
            let shot = &shot;
            let case = |method: usize| {
                Case::new(POINT_COUNT, move || drop(std::hint::black_box(shot.project_points(method))))
            };
            let mut cases: Vec<Case> = (0..METHODS.len()).map(case).collect();
            nanos = interleaved(Clock::Thread, BUDGET_SECS, &mut cases);
        }
    }
    let mut choice = Choice::new("far_away", "In which number format are points projected to the image?");
    choice.error_unit = "pixels";
    choice.reference = format!(
        "f64 throughout; a figure {} from the origin, seen by a camera 5 m before it, 720 pixels high",
        DISTANCES[TYPICAL_DISTANCE].1
    );
    choice.per = "point of 256, coordinates apart, in vector instructions of the type's width".into();
    for (method, name) in METHODS.iter().enumerate() {
        let error = &by_distance[method][TYPICAL_DISTANCE];
        choice.rows.push(Row::new(*name).error(error.worst, error.mean()).nanos(nanos[method]));
    }
    choice.choose(CHOSEN_METHOD, "as exact everywhere as at the origin, and the GPU part is f32");
    let titles: Vec<String> = DISTANCES.iter().map(|d| format!(">{}", d.1)).collect();
    let mut columns: Vec<(&str, &'static str)> = vec![("worst error in pixels, from the origin", "way")];
    columns.extend(titles.iter().map(|t| (t.as_str(), "distance")));
    let mut table = Table::new("By the distance from the origin", &columns);
    for (name, errors) in METHODS.iter().zip(&by_distance) {
        let cells = errors.iter().map(|e| Cell::number(quantity(e.worst), e.worst));
        table.rows.push([Cell::text(*name)].into_iter().chain(cells).collect());
    }
    Ok(Section {
        title: "Far from the origin",
        text: "A step of f32 is 0.06 mm at 1 km and a metre at 10 000 km. The position of an actor minus \
               that of the camera, subtracted in f64 and rounded once, is exact to f32 wherever both are; \
               it costs one subtraction for each actor, not for each point, so the times here, of one point \
               each, are the worst case."
            .into(),
        choices: vec![choice],
        tables: vec![table],
        off_front: vec![(
            "far_away",
            "f64 is exact, and on a CPU hardly slower; GPUs take many times as long for f64 as for f32.",
        )],
    })
}

/// Points of a character, stored by coordinate, and a camera in front of it.
struct Shot {
    world_from_model: DAffine3,
    points: [Vec<f64>; 3],
    points32: [Vec<f32>; 3],
    view: View,
    clip_from_world: DMat4,
    world_from_view: DAffine3,
}

/// Image coordinates of all points in pixels: all x, then all y.
type ImagePoints = [Vec<f64>; 2];

/// Defines a function that transforms points by several matrices in turn, in loops that the compiler vectorizes for this number type.
macro_rules! on_image {
    ($name:ident, $number:ty) => {
        /// `steps`: rows of affine maps, each with an offset that is subtracted afterwards. `clip`: rows x, y and w of the projection.
        fn $name(
            points: &[Vec<$number>; 3],
            steps: &[([[$number; 4]; 3], [$number; 3])],
            clip: &[[$number; 4]; 3],
        ) -> ImagePoints {
            let row =
                |m: &[$number; 4], x: $number, y: $number, z: $number| m[0] * x + m[1] * y + m[2] * z + m[3];
            let mut at = points.clone();
            for (map, less) in steps {
                let [x, y, z] = &mut at;
                for ((x, y), z) in x.iter_mut().zip(y).zip(z) {
                    let of = |i: usize| row(&map[i], *x, *y, *z) - less[i];
                    (*x, *y, *z) = (of(0), of(1), of(2));
                }
            }
            let [mut right, mut up] = [vec![0.0; points[0].len()], vec![0.0; points[0].len()]];
            let half = (IMAGE_HEIGHT * 0.5) as $number;
            let all = at[0].iter().zip(&at[1]).zip(&at[2]).zip(&mut right).zip(&mut up);
            for ((((x, y), z), right), up) in all {
                let scale = half / row(&clip[2], *x, *y, *z);
                *right = row(&clip[0], *x, *y, *z) * scale;
                *up = row(&clip[1], *x, *y, *z) * scale;
            }
            [right, up].map(|places| places.into_iter().map(f64::from).collect())
        }
    };
}
on_image!(on_image32, f32);
on_image!(on_image64, f64);

/// Rows x, y and z of an affine map.
fn affine_rows(m: &DAffine3) -> [[f64; 4]; 3] {
    let rows = DMat4::from(*m).transpose();
    [rows.x_axis, rows.y_axis, rows.z_axis].map(|row| row.to_array())
}

/// Rows x, y and w of a projection.
fn clip_rows(m: &DMat4) -> [[f64; 4]; 3] {
    let rows = m.transpose();
    [rows.x_axis, rows.y_axis, rows.w_axis].map(|row| row.to_array())
}

fn rows_to_f32<const N: usize>(rows: [[f64; N]; 3]) -> [[f32; N]; 3] {
    rows.map(|row| row.map(|v| v as f32))
}

impl Shot {
    fn new(distance: f64) -> Shot {
        let mut random = Random(5);
        // The direction is arbitrary, so that coordinates are not exact in f32 by chance.
        let origin = DVec3::new(0.48, 0.6, 0.64) * distance + DVec3::new(0.123, 0.0, 0.456);
        let world_from_model = DAffine3::from_rotation_translation(DQuat::from_rotation_y(0.4), origin);
        let mut points = [Vec::new(), Vec::new(), Vec::new()];
        for _ in 0..POINT_COUNT {
            points[0].push(random.signed() * 0.5);
            points[1].push(random.unit() * 1.8);
            points[2].push(random.signed() * 0.3);
        }
        let points32 = points.each_ref().map(|values| values.iter().map(|v| *v as f32).collect());
        let position = origin + DVec3::new(0.3, 1.2, 5.0);
        let world_from_view = DAffine3::from_rotation_translation(DQuat::from_rotation_y(0.06), position);
        let projection = Projection::Perspective { yfov: YFOV as f32, near: 0.05, far: None };
        let camera = CameraState { camera: None, world_from_view, projection };
        let view = View::new(&camera, [1280, IMAGE_HEIGHT as u32]);
        let clip_from_world = view.clip_from_view.as_dmat4() * DMat4::from(world_from_view.inverse());
        Shot { world_from_model, points, points32, view, clip_from_world, world_from_view }
    }

    fn project_points(&self, method: usize) -> ImagePoints {
        let world = affine_rows(&self.world_from_model);
        let relative_clip = clip_rows(&self.view.clip_from_relative.as_dmat4());
        match method {
            0 => on_image64(&self.points, &[(world, [0.0; 3])], &clip_rows(&self.clip_from_world)),
            1 => {
                // Same computation as in the planner and the vertex shader.
                let offset = camera_relative(self.world_from_model.translation, &self.view).as_dvec3();
                let moved = DAffine3 { translation: offset, ..self.world_from_model };
                let steps = [(rows_to_f32(affine_rows(&moved)), [0.0; 3])];
                on_image32(&self.points32, &steps, &rows_to_f32(relative_clip))
            }
            2 => {
                let view_from_world = DMat4::from(self.world_from_view).as_mat4().inverse();
                let view_from_world = DAffine3::from_mat4(view_from_world.as_dmat4());
                let steps = [world, affine_rows(&view_from_world)].map(|rows| (rows_to_f32(rows), [0.0; 3]));
                on_image32(
                    &self.points32,
                    &steps,
                    &rows_to_f32(clip_rows(&self.view.clip_from_view.as_dmat4())),
                )
            }
            _ => {
                let camera = self.world_from_view.translation.as_vec3().to_array();
                on_image32(&self.points32, &[(rows_to_f32(world), camera)], &rows_to_f32(relative_clip))
            }
        }
    }
}
