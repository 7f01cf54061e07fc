//! Lines that add a new object to the stage, written as a person would write them.

use super::casting::{free_label, free_name, numbered_name};
use super::times::EditTime;
use super::values::format_number;
use choreo_script::quoted;
use glam::DVec3;

/// Something that the user adds to a script.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Addition {
    /// The built-in character, in a color that the script does not have yet.
    Character,
    /// A shape by its kind, as `shape` takes it.
    Shape(&'static str),
    /// A camera that circles an actor, given by its name, or else the point [`AddedAt::point`].
    Orbit(Option<String>),
    /// A camera that follows an actor, given by its name.
    Follow(String),
    Sun,
    Point,
    Spot,
    Ambient,
    /// The built-in studio room with soft boxes as an environment light.
    StudioSky,
    Title,
    /// An effect by its name.
    Effect(String),
    Marker,
}

/// Kinds that `shape` accepts.
pub const SHAPES: [&str; 7] = ["plane", "box", "sphere", "cylinder", "cone", "capsule", "torus"];

/// Names of new characters and their colors, in the order of their use.
const CHARACTERS: [(&str, &str); 8] = [
    ("ada", "coral"),
    ("bob", "teal"),
    ("cleo", "gold"),
    ("dan", "orchid"),
    ("eve", "steelblue"),
    ("finn", "olivedrab"),
    ("gina", "salmon"),
    ("hugo", "slategray"),
];

/// When and where something is added.
#[derive(Clone, Copy, Debug)]
pub struct AddedAt<'a> {
    /// Position on the ground, world space, metres.
    pub point: DVec3,
    pub from: EditTime,
    pub until: EditTime,
    /// The actor that a new camera shows.
    pub subject: Option<Subject<'a>>,
}

/// An actor that a camera follows or circles.
#[derive(Clone, Copy, Debug)]
pub struct Subject<'a> {
    /// Variable that holds the actor.
    pub variable: &'a str,
    /// Distance from the actor's center at which all of it is in the image, metres.
    pub distance: f64,
    /// Unit vector in world space from the actor's center to the camera that follows it.
    pub direction: DVec3,
}

/// The lines that add something to a script, and its name in that script, if it has one:
///
/// ```text
/// let bob_model = load("choreo:mannequin", #{ color: "teal" });
/// let bob = cast("bob", bob_model).at(1.0, 0.0, 0.0);
/// bob.play(bob_model.clip("Idle"));
/// ```
pub fn added_lines(text: &str, what: &Addition, at: AddedAt) -> (String, Option<String>) {
    let place = |p: DVec3| if p == DVec3::ZERO { String::new() } else { format!(".at({})", point_text(p)) };
    let [from, until] = [at.from, at.until].map(|time| time.written(text));
    let is_quoted = |name: &str| text.contains(&quoted(name));
    let plain = |line: &str| (format!("{line}\n"), None);
    match what {
        Addition::Character => {
            let is_free = |(name, color): &&(&str, &str)| !is_quoted(name) && !is_quoted(color);
            let (name, color) = CHARACTERS.iter().find(is_free).copied().unwrap_or(("actor", "silver"));
            let name = free_name(text, name);
            let model = free_name(text, &format!("{name}_model"));
            let lines = format!(
                "let {model} = load(\"choreo:mannequin\", #{{ color: \"{color}\" }});\n\
                 let {name} = cast(\"{name}\", {model}){};\n{name}.play({model}.clip(\"Idle\"));\n",
                place(at.point)
            );
            (lines, Some(name))
        }
        Addition::Shape(kind) => {
            let (stem, options, down) = match *kind {
                "plane" => ("floor", "size: 12.0, color: \"#5d6880\"", DVec3::new(0.0, -0.005, 0.0)),
                kind => (kind, "size: 0.5, color: \"#c9a26b\"", at.point),
            };
            let name = free_name(text, stem);
            let line = format!(
                "let {name} = cast(\"{name}\", shape(\"{kind}\", #{{ {options} }})){};\n",
                place(down)
            );
            (line, Some(name))
        }
        Addition::Orbit(of) => orbiting_camera(text, of.as_deref(), &at, &from),
        Addition::Follow(of) => following_camera(text, of, &at, &from),
        Addition::Sun => plain("sun(#{ direction: [-0.5, -1.0, -0.8], intensity: 2.8, shadow: true });"),
        Addition::Point => {
            let above = at.point + DVec3::new(0.0, 2.5, 1.0);
            plain(&format!("point(#{{ position: [{}], intensity: 30.0 }});", point_text(above)))
        }
        Addition::Spot => {
            let (above, middle) = (at.point + DVec3::new(2.0, 3.5, 3.0), at.point + DVec3::Y);
            plain(&format!(
                "spot(#{{ position: [{}], look_at: [{}], intensity: 60.0, outer: 35.0, shadow: true }});",
                point_text(above),
                point_text(middle)
            ))
        }
        Addition::Ambient => plain("ambient(\"#8fa3c8\", 0.5);"),
        Addition::StudioSky => plain("sky(\"studio\");"),
        Addition::Title => {
            plain(&format!("text(\"Title\", #{{ at: [0.5, 0.85] }}).from({from}).until({until}).fade(0.3);"))
        }
        Addition::Effect(name) => plain(&format!("effect({});", quoted(name))),
        Addition::Marker => {
            let name = numbered_name("marker", is_quoted);
            plain(&format!("marker(\"{name}\", {from});"))
        }
    }
}

/// Components as they are written in a list.
fn point_text(p: DVec3) -> String {
    p.to_array().map(format_number).join(", ")
}

/// The line of a camera that orbits a character (`of`: its name), or the middle of the stage; and the camera's name.
fn orbiting_camera(text: &str, of: Option<&str>, at: &AddedAt, from: &str) -> (String, Option<String>) {
    let is_quoted = |name: &str| text.contains(&quoted(name));
    let (name, target, distance) = match (of, &at.subject) {
        (Some(of), Some(Subject { variable, distance, .. })) => {
            let name = free_label(&format!("around {of}"), is_quoted);
            (name, variable.to_string(), round_to_two_digits_of(*distance, *distance))
        }
        _ => {
            let middle = point_text(at.point + DVec3::new(0.0, 0.95, 0.0));
            (numbered_name("round", is_quoted), format!("[{middle}]"), 4.5)
        }
    };
    let (label, distance) = (quoted(&name), format_number(distance));
    let line = format!(
        "camera({label}).orbit({target}, #{{ distance: {distance}, elevation: 10.0, speed: 30.0 }}).cut({from});\n"
    );
    (line, Some(name))
}

/// The line of a camera that follows a character (`of`: its name), and the camera's name.
fn following_camera(text: &str, of: &str, at: &AddedAt, from: &str) -> (String, Option<String>) {
    let name = free_label(&format!("with {of}"), |name: &str| text.contains(&quoted(name)));
    let (variable, offset) = match at.subject {
        Some(Subject { variable, distance, direction }) => {
            let offset = (direction * distance).to_array().map(|v| round_to_two_digits_of(v, distance));
            (variable, DVec3::from_array(offset))
        }
        None => (of, DVec3::new(0.0, 0.0, 4.5)),
    };
    let (label, offset) = (quoted(&name), point_text(offset));
    (format!("camera({label}).follow({variable}, [{offset}]).cut({from});\n"), Some(name))
}

/// Rounds to the decimal place of the second significant digit of `like`, so that lines have short numbers.
fn round_to_two_digits_of(value: f64, like: f64) -> f64 {
    let parts = libm::pow(10.0, 1.0 - libm::floor(libm::log10(like.abs().max(1e-3))));
    (value * parts).round() / parts
}

#[cfg(test)]
mod tests {
    use super::*;

    fn added_text(text: &str, what: &Addition) -> String {
        let time = |secs| EditTime { secs, fps: 30.0 };
        let subject = Subject { variable: "ada", distance: 3.24, direction: DVec3::new(0.5, 0.1, 0.86) };
        let (from, until, subject) = (time(1.0), time(3.0), Some(subject));
        added_lines(text, what, AddedAt { point: DVec3::X, from, until, subject }).0
    }

    #[test]
    fn camera_lines_have_rounded_numbers() {
        let follow = Addition::Follow("Ada L.".into());
        let first = added_text("", &follow);
        assert_eq!(first, "camera(\"with Ada L.\").follow(ada, [1.6, 0.3, 2.8]).cut(1.0);\n");
        assert!(added_text(&first, &follow).starts_with("camera(\"with Ada L. 2\").follow(ada, "));
        assert_eq!(
            added_text("", &Addition::Orbit(Some("Ada L.".into()))),
            "camera(\"around Ada L.\").orbit(ada, #{ distance: 3.2, elevation: 10.0, speed: 30.0 }).cut(1.0);\n"
        );
        assert!(
            added_text("", &Addition::Orbit(None))
                .starts_with("camera(\"round 1\").orbit([1.0, 0.95, 0.0], ")
        );
        assert_eq!([0.0324, 32.4, -324.0].map(|v| round_to_two_digits_of(v, v)), [0.032, 32.0, -320.0]);
    }

    #[test]
    fn a_new_character_gets_an_unused_name_and_color() {
        let first = added_text("", &Addition::Character);
        assert_eq!(
            first,
            "let ada_model = load(\"choreo:mannequin\", #{ color: \"coral\" });\nlet ada = cast(\"ada\", ada_model).at(1.0, 0.0, 0.0);\n\
             ada.play(ada_model.clip(\"Idle\"));\n"
        );
        assert!(added_text(&first, &Addition::Character).contains("let bob = cast(\"bob\", bob_model).at("));
        let boxes = added_text("let box = 1;", &Addition::Shape("box"));
        assert!(boxes.starts_with("let box_2 = cast(\"box_2\", shape(\"box\", #{"), "{boxes}");
        assert_eq!(
            added_text("marker(\"marker 1\", 0.0);", &Addition::Marker),
            "marker(\"marker 2\", 1.0);\n"
        );
        assert_eq!(
            added_text("", &Addition::Title),
            "text(\"Title\", #{ at: [0.5, 0.85] }).from(1.0).until(3.0).fade(0.3);\n"
        );
    }
}
