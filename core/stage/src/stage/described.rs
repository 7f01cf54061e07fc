//! The types of a stage, each described once. [`described!`] declares a type with the type, default and documentation of each
//! member; its content hash follows. The list `fields` states what scripts, the reference, the check of a stage and the
//! inspector need to know of those members that a user sets.

use crate::stage::channel::Property;
use choreo_motion::Time;
use glam::{DQuat, DVec2, DVec3, Vec3, Vec4};

/// Type of a field, and the values that are allowed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FieldType {
    /// A number from … to …, both included, and its unit.
    Number(f64, f64, &'static str),
    /// Degrees from … to … in scripts and messages, radians in the stage.
    Degrees(f64, f64),
    /// A time on stage.
    Time,
    /// Seconds, not negative.
    Duration,
    /// True or false.
    Flag,
    /// Linear, not negative.
    Color,
    /// A color temperature, which sets a color.
    Kelvin,
    /// A position, metres.
    Point,
    /// A unit vector.
    Direction,
    /// A rotation of length 1.
    Rotation,
    /// A factor, or one for each axis.
    Scale,
    /// Two numbers, such as a position in the image.
    Pair,
}

/// The value of a field, whatever the type of the member that holds it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FieldValue {
    /// There is no value.
    Unset,
    /// A number, in the unit of its type.
    Number(f64),
    /// A time or duration.
    Time(Time),
    /// True or false.
    Flag(bool),
    /// Linear RGBA.
    Color(Vec4),
    /// A position, direction or scale.
    Vector(DVec3),
    /// A rotation of length 1.
    Rotation(DQuat),
    /// Two numbers.
    Pair(DVec2),
}

/// A member of `T` that scripts set, under the name that they use.
pub struct Field<T: 'static> {
    /// Name in scripts.
    pub name: &'static str,
    /// Lines of its description.
    pub doc: &'static [&'static str],
    /// Type and range of its values.
    pub field_type: FieldType,
    /// The property and the name of its keyframes, where it can be animated.
    pub keyed: Option<(&'static str, Property)>,
    /// Reason why a value of `T` does not have the field; `None` if it has it.
    pub missing_reason: fn(&T) -> Option<&'static str>,
    /// Reads the value.
    pub get: fn(&T) -> FieldValue,
    /// Sets the value.
    pub set: fn(&mut T, FieldValue),
}

/// A type whose fields are described.
pub trait Described: Sized + 'static {
    /// All fields, in the order of the reference.
    const FIELDS: &'static [Field<Self>];

    /// The field of that name.
    fn field(name: &str) -> Option<&'static Field<Self>> {
        Self::FIELDS.iter().find(|field| field.name == name)
    }

    /// Errors of the values of its fields.
    fn problems(&self) -> Vec<String> {
        let own = Self::FIELDS.iter().filter(|field| (field.missing_reason)(self).is_none());
        own.filter_map(|field| field.problem(self)).collect()
    }

    /// Whether keyframes of a property animate one of its fields.
    fn is_keyed(&self, property: Property) -> bool {
        let animates = |field: &Field<Self>| field.keyed.is_some_and(|(_, keyed)| keyed == property);
        Self::FIELDS.iter().any(|field| animates(field) && (field.missing_reason)(self).is_none())
    }
}

impl<T> Field<T> {
    /// The description, as in the reference: `in which it shines`.
    pub fn about(&self) -> String {
        self.doc.iter().map(|line| line.trim()).collect::<Vec<_>>().join(" ")
    }

    /// The value as messages, the reference and the inspector write it; `None` if it is unset.
    pub fn shown(&self, of: &T) -> Option<String> {
        Some(match ((self.get)(of), self.field_type) {
            (FieldValue::Unset, _) => return None,
            (FieldValue::Number(n), FieldType::Degrees(..)) => format_number(n.to_degrees()),
            (FieldValue::Number(n), _) => format_number(n),
            (FieldValue::Time(t), _) => format_number(t.as_secs()),
            (FieldValue::Flag(on), _) => on.to_string(),
            (FieldValue::Color(c), _) => format_numbers(&c.truncate().as_dvec3().to_array()),
            (FieldValue::Vector(v), _) => format_numbers(&v.to_array()),
            (FieldValue::Rotation(q), _) => format_numbers(&q.to_array()),
            (FieldValue::Pair(v), _) => format_numbers(&v.to_array()),
        })
    }

    /// The value with its unit; `None` if it is unset.
    pub fn shown_with_unit(&self, of: &T) -> Option<String> {
        let shown = self.shown(of)?;
        Some(match self.field_type {
            FieldType::Number(.., unit) if !unit.is_empty() => format!("{shown} {unit}"),
            FieldType::Degrees(..) => format!("{shown}°"),
            FieldType::Duration | FieldType::Time => format!("{shown} s"),
            _ => shown,
        })
    }

    fn problem(&self, of: &T) -> Option<String> {
        let name = self.name;
        match ((self.get)(of), self.field_type) {
            (FieldValue::Number(n), FieldType::Number(low, high, _)) if !is_within(n, low, high) => {
                Some(format!("{name} is {n}, must be from {low} to {high}"))
            }
            (FieldValue::Number(n), FieldType::Degrees(low, high))
                if !is_within(n.to_degrees(), low, high) =>
            {
                Some(format!("{name} is {} degrees, must be from {low} to {high}", n.to_degrees()))
            }
            (FieldValue::Time(t), FieldType::Duration) if t < Time::ZERO => {
                Some(format!("{name} is {} s, must not be negative", t.as_secs()))
            }
            (FieldValue::Color(c), _) if !(c.is_finite() && c.min_element() >= 0.0) => {
                Some(format!("{name} is {c}, must be finite and not negative"))
            }
            (FieldValue::Vector(v), FieldType::Direction)
                if (v.length() - 1.0).abs() >= 1e-3 || v.is_nan() =>
            {
                Some(format!("{name} has length {}, must be 1", v.length()))
            }
            (FieldValue::Rotation(q), _) if (q.length() - 1.0).abs() >= 1e-3 || q.is_nan() => {
                Some(format!("{name} has length {}, must be 1", q.length()))
            }
            (FieldValue::Vector(v), _) if !v.is_finite() => Some(format!("{name} is {v}, must be finite")),
            (FieldValue::Pair(v), _) if !v.is_finite() => Some(format!("{name} is {v}, must be finite")),
            _ => None,
        }
    }
}

/// Whether a number is in a range, with a tolerance for ends that f32 has rounded.
fn is_within(n: f64, low: f64, high: f64) -> bool {
    let slack = 1e-6 * low.abs().max(high.abs().min(1.0));
    (low - slack..=high * (1.0 + 1e-6)).contains(&n)
}

/// A number with at most six digits: an f32 converted to f64 would show many more.
fn format_number(n: f64) -> String {
    let rounded: f64 = format!("{n:.5e}").parse().unwrap_or(n);
    format!("{rounded}")
}

fn format_numbers(numbers: &[f64]) -> String {
    format!("[{}]", numbers.iter().map(|n| format_number(*n)).collect::<Vec<_>>().join(", "))
}

/// Conversion between a member of a stage type and the value of its field.
pub(crate) trait FieldStorage {
    fn value(&self) -> FieldValue;
    /// Values of another type are ignored: the type of the field has been checked.
    fn store(&mut self, value: FieldValue);
}

macro_rules! impl_field_storage {
    ($($ty:ty: |$this:ident| $get:expr, $pattern:pat => $set:expr;)*) => {
        $(impl FieldStorage for $ty {
            fn value(&self) -> FieldValue {
                let $this = self;
                $get
            }
            fn store(&mut self, value: FieldValue) {
                if let $pattern = value {
                    *self = $set;
                }
            }
        })*
    };
}

impl_field_storage! {
    f64: |n| FieldValue::Number(*n), FieldValue::Number(n) => n;
    f32: |n| FieldValue::Number(f64::from(*n)), FieldValue::Number(n) => n as f32;
    u32: |n| FieldValue::Number(f64::from(*n)), FieldValue::Number(n) => n as u32;
    bool: |on| FieldValue::Flag(*on), FieldValue::Flag(on) => on;
    Time: |t| FieldValue::Time(*t), FieldValue::Time(t) => t;
    DVec2: |v| FieldValue::Pair(*v), FieldValue::Pair(v) => v;
    DVec3: |v| FieldValue::Vector(*v), FieldValue::Vector(v) => v;
    DQuat: |q| FieldValue::Rotation(*q), FieldValue::Rotation(q) => q;
    Vec4: |c| FieldValue::Color(*c), FieldValue::Color(c) => c;
}

/// A linear color or a direction.
impl FieldStorage for Vec3 {
    fn value(&self) -> FieldValue {
        FieldValue::Vector(self.as_dvec3())
    }
    fn store(&mut self, value: FieldValue) {
        match value {
            FieldValue::Vector(v) => *self = v.as_vec3(),
            FieldValue::Color(c) => *self = c.truncate(),
            _ => {}
        }
    }
}

impl<T: FieldStorage + Default> FieldStorage for Option<T> {
    fn value(&self) -> FieldValue {
        self.as_ref().map_or(FieldValue::Unset, FieldStorage::value)
    }
    fn store(&mut self, value: FieldValue) {
        self.get_or_insert_default().store(value);
    }
}

/// Declares a type of the stage:
///
/// ```text
/// described! {
///     /// A light of the stage.
///     pub struct StageLight(name: String => str, light: Light) {
///         /// Position in the world, metres.
///         position: DVec3 = DVec3::ZERO;
///     }
///     fields {
///         /// lux for a sun, candela for the others
///         intensity: light.intensity, FieldType::Number(0.0, 1e9, ""), keys "intensity" Intensity;
///     }
/// }
/// ```
/// Members in parentheses are arguments of `new`, which takes `&str` for `String => str`; the others have a default there. The content hash
/// is made of all members in this order, each by [`Hashed`](choreo_asset::hash::Hashed) or by the function after `hash`. A field is a
/// member, or a member of a member; `get` and `set` give access to values that are neither, and the function after `lacks` gives the reason
/// why some do not have it.
macro_rules! described {
    (
        $(#[$attr:meta])*
        pub struct $name:ident ($($(#[$required_attr:meta])* $required:ident: $required_ty:ty $(=> $from:ty)?),* $(,)?) {
            $($(#[$member_attr:meta])* $member:ident: $ty:ty = $default:expr $(, hash $hash:expr)?;)*
        }
        $(fields { $($fields:tt)* })?
    ) => {
        $(#[$attr])*
        pub struct $name {
            $($(#[$required_attr])* pub $required: $required_ty,)*
            $($(#[$member_attr])* pub $member: $ty,)*
        }

        impl $name {
            /// A value with these members; all other members have their defaults.
            pub fn new($($required: $crate::stage::described::described!(@from $required_ty $(, $from)?)),*) -> $name {
                $($(let $required = <$from>::to_owned($required);)?)*
                $(let $member: $ty = $default;)*
                $name { $($required,)* $($member),* }
            }
        }

        impl choreo_asset::hash::Hashed for $name {
            fn hash(&self, w: &mut choreo_asset::hash::Writer) {
                $(choreo_asset::hash::Hashed::hash(&self.$required, w);)*
                $($crate::stage::described::described!(@hash self.$member, w $(, $hash)?);)*
            }
        }

        $($crate::stage::described::fields! { $name { $($fields)* } })?
    };
    (
        $(#[$attr:meta])*
        pub struct $name:ident {
            $($(#[$member_attr:meta])* $member:ident: $ty:ty = $default:expr;)*
        }
        $(fields { $($fields:tt)* })?
    ) => {
        $(#[$attr])*
        pub struct $name { $($(#[$member_attr])* pub $member: $ty,)* }

        impl Default for $name {
            fn default() -> $name {
                $name { $($member: $default),* }
            }
        }

        impl choreo_asset::hash::Hashed for $name {
            fn hash(&self, w: &mut choreo_asset::hash::Writer) {
                $(choreo_asset::hash::Hashed::hash(&self.$member, w);)*
            }
        }

        $($crate::stage::described::fields! { $name { $($fields)* } })?
    };
    (@from $ty:ty) => { $ty };
    (@from $ty:ty, $from:ty) => { &$from };
    (@hash $member:expr, $w:ident) => { choreo_asset::hash::Hashed::hash(&$member, $w) };
    (@hash $member:expr, $w:ident, $hash:expr) => { $hash($w, &$member) };
}
pub(crate) use described;

/// The `fields` of [`described!`], for a type that is declared elsewhere.
macro_rules! fields {
    ($name:ident { $(
        $(#[doc = $doc:literal])* $field:ident: $([get $get:expr, set $set:expr])? $($path:ident).*,
        $field_type:expr $(, keys $key:literal $keyed:ident)? $(, lacks $lacks:expr)?;
    )* }) => {
        impl $crate::stage::described::Described for $name {
            const FIELDS: &'static [$crate::stage::described::Field<$name>] = &[$($crate::stage::described::Field {
                name: stringify!($field),
                doc: &[$($doc),*],
                field_type: $field_type,
                keyed: $crate::stage::described::fields!(@option $(($key, $crate::stage::channel::Property::$keyed))?),
                missing_reason: $crate::stage::described::fields!(@or $($lacks)?; |_| None),
                get: $crate::stage::described::fields!(@get $name [$($get)?] $($path).*),
                set: $crate::stage::described::fields!(@set $name [$($set)?] $($path).*),
            }),*];
        }
    };
    (@option) => { None };
    (@option $some:expr) => { Some($some) };
    (@or $given:expr; $usual:expr) => { $given };
    (@or ; $usual:expr) => { $usual };
    (@get $name:ident [$get:expr]) => { $get };
    (@get $name:ident [] $($path:ident).+) => { |of: &$name| $crate::stage::described::FieldStorage::value(&of.$($path).+) };
    (@set $name:ident [$set:expr]) => { $set };
    (@set $name:ident [] $($path:ident).+) => { |of: &mut $name, v| $crate::stage::described::FieldStorage::store(&mut of.$($path).+, v) };
}
pub(crate) use fields;
