//! Rotations for importers, many at a time: quaternions x y z w from axes and angles, products, inverses and rotated vectors.
//! Angles are in radians.

use crate::budget::{Budget, NativeError, native_error};
use crate::numbers::{self, Numbers};
use glam::{DQuat, DVec3};
use rhai::{Array, Dynamic, Engine};

/// Rows of `N` numbers. A single row is used for every index.
struct Rows<const N: usize>(Vec<[f64; N]>);

impl<const N: usize> Rows<N> {
    fn read_rows(value: &Dynamic, what: &str) -> Result<Rows<N>, NativeError> {
        let numbers = numbers::read_numbers(value);
        let wrong = || native_error(format!("{what}: {N} numbers, or rows of {N} numbers, are needed"));
        let numbers = numbers.filter(|all| !all.is_empty()).ok_or_else(wrong)?;
        let (rows, []) = numbers.as_chunks::<N>() else { return Err(wrong()) };
        Ok(Rows(rows.to_vec()))
    }

    fn row(&self, number: usize) -> [f64; N] {
        self.0[if self.0.len() == 1 { 0 } else { number }]
    }
}

impl Rows<4> {
    fn quaternion(&self, number: usize) -> DQuat {
        DQuat::from_array(self.row(number))
    }
}

/// Number of rows of an operation on two lists, where a list of one row is repeated. Error: other lengths differ.
fn row_count(a: usize, b: usize, what: &str) -> Result<usize, NativeError> {
    match a == b || a == 1 || b == 1 {
        true => Ok(a.max(b)),
        false => Err(native_error(format!("{what}: one list has {a} rows, the other {b}"))),
    }
}

fn rows_from_fn<const N: usize>(
    budget: &Budget,
    count: usize,
    row: impl Fn(usize) -> [f64; N],
) -> Result<Numbers, NativeError> {
    let share = budget.reserve(8 * N * count)?;
    Ok(Numbers::new((0..count).flat_map(row).collect(), share))
}

/// Rotation about a unit axis.
fn axis_rotation(axis: DVec3, radians: f64) -> DQuat {
    let (sin, cos) = libm::sincos(0.5 * radians);
    let v = axis * sin;
    DQuat::from_xyzw(v.x, v.y, v.z, cos)
}

/// Rotation about an axis of any length. Error: the axis is zero, or a number is not finite.
fn axis_angle_quaternion(budget: &Budget, axis: Array, radians: f64) -> Result<Numbers, NativeError> {
    let axis = DVec3::from_array(Rows::<3>::read_rows(&axis.into(), "quaternion")?.row(0));
    let length = axis.length();
    if !(length > 0.0 && length.is_finite() && radians.is_finite()) {
        return Err(native_error(
            "quaternion(axis, radians): the axis needs a length, the angle must be finite",
        ));
    }
    rows_from_fn(budget, 1, |_| axis_rotation(axis / length, radians).to_array())
}

/// Rotations about fixed axes, applied in the order of the letters. Each row of `angles` is x y z in any order of rotation.
fn euler_quaternions(budget: &Budget, order: &str, angles: &Dynamic) -> Result<Numbers, NativeError> {
    let axis = |letter: char| "xyz".find(letter);
    let axes: Option<Vec<usize>> = order.chars().map(axis).collect();
    let axes = axes.filter(|axes| axes.len() == 3 && (0..3).all(|axis| axes.contains(&axis)));
    let axes = axes.ok_or_else(|| {
        native_error(format!("quaternions: the order is the letters x, y and z, as \"xyz\", got \"{order}\""))
    })?;
    let angles = Rows::<3>::read_rows(angles, "quaternions")?;
    rows_from_fn(budget, angles.0.len(), |number| {
        let row = angles.row(number);
        let turn = axes.iter().fold(DQuat::IDENTITY, |so_far, axis| {
            let mut unit = [0.0; 3];
            unit[*axis] = 1.0;
            axis_rotation(DVec3::from_array(unit), row[*axis]) * so_far
        });
        turn.to_array()
    })
}

/// Quaternion products a · b: rotation `b`, then rotation `a`, such as a joint in its parent's space, then the parent.
fn quaternion_products(budget: &Budget, a: &Dynamic, b: &Dynamic) -> Result<Numbers, NativeError> {
    let (a, b) = (Rows::<4>::read_rows(a, "product")?, Rows::<4>::read_rows(b, "product")?);
    let count = row_count(a.0.len(), b.0.len(), "product")?;
    rows_from_fn(budget, count, |number| (a.quaternion(number) * b.quaternion(number)).to_array())
}

/// Inverses (conjugates) of unit quaternions.
fn inverse_quaternions(budget: &Budget, turns: &Dynamic) -> Result<Numbers, NativeError> {
    let turns = Rows::<4>::read_rows(turns, "inverse")?;
    rows_from_fn(budget, turns.0.len(), |number| turns.quaternion(number).conjugate().to_array())
}

/// Vectors rotated by unit quaternions.
fn rotate_vectors(budget: &Budget, turns: &Dynamic, vectors: &Dynamic) -> Result<Numbers, NativeError> {
    let (turns, vectors) = (Rows::<4>::read_rows(turns, "turned")?, Rows::<3>::read_rows(vectors, "turned")?);
    let count = row_count(turns.0.len(), vectors.0.len(), "turned")?;
    rows_from_fn(budget, count, |number| {
        (turns.quaternion(number) * DVec3::from_array(vectors.row(number))).to_array()
    })
}

pub(crate) fn register_quaternions(engine: &mut Engine, budget: &Budget) {
    let b = budget.clone();
    engine
        .register_fn("quaternion", move |axis: Array, radians: f64| axis_angle_quaternion(&b, axis, radians));
    let b = budget.clone();
    engine.register_fn("quaternion", move |axis: Array, radians: i64| {
        axis_angle_quaternion(&b, axis, radians as f64)
    });
    let b = budget.clone();
    engine.register_fn("quaternions", move |order: &str, angles: Dynamic| {
        euler_quaternions(&b, order, &angles)
    });
    let b = budget.clone();
    engine.register_fn("product", move |first: Dynamic, second: Dynamic| {
        quaternion_products(&b, &first, &second)
    });
    let b = budget.clone();
    engine.register_fn("inverse", move |turns: Dynamic| inverse_quaternions(&b, &turns));
    let b = budget.clone();
    engine
        .register_fn("turned", move |turns: Dynamic, vectors: Dynamic| rotate_vectors(&b, &turns, &vectors));
}
