//! The open file: scene, files beside it, budgets and warnings.

use crate::load;
use choreo_asset::Origin;
use choreo_importer_kit::{Budget, Notes, Result, WithPlace};
use choreo_plugin::{Files, ImportOptions, ImportScope};
use ufbx::{CoordinateAxis, Element, Exporter, Scene};

/// Limit of all decoded images of one file together, bytes.
const MAX_IMAGE_BYTES: u64 = 1 << 30;

/// Largest error of a clip against the file's own curves, anywhere between keys.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Accuracy {
    /// Keys a second, joined by straight lines, instead of the limits below.
    pub rate: Option<f64>,
    pub radians: f64,
    pub metres: f64,
    pub scale: f64,
    /// Weight of a blend shape.
    pub weight: f64,
}

/// Default tolerance of rotations, degrees. README.md's table shows that it costs little.
pub(crate) const TOLERANCE_DEG: f64 = 0.05;

impl Accuracy {
    /// Limits in proportion to that of rotations: at 0.05° they are 0.1 mm, 1e-4 (scale) and 1e-3 (weight).
    pub(crate) fn of_degrees(degrees: f64, rate: Option<f64>) -> Accuracy {
        let share = degrees / 0.05;
        let radians = degrees * (std::f64::consts::PI / 180.0);
        Accuracy { rate, radians, metres: 1e-4 * share, scale: 1e-4 * share, weight: 1e-3 * share }
    }
}

pub(crate) struct File<'a> {
    pub scene: &'a Scene,
    pub files: &'a dyn Files,
    pub needs: ImportScope,
    /// Samples a second of motion without a closed form.
    pub rate: f64,
    pub accuracy: Accuracy,
    pub hidden: bool,
    pub vertex_colors: bool,
    pub notes: Notes,
    pub budget: Budget,
    pub image_budget: Budget,
}

impl<'a> File<'a> {
    pub(crate) fn new(
        scene: &'a Scene,
        size: usize,
        files: &'a dyn Files,
        needs: ImportScope,
        options: &ImportOptions,
    ) -> File<'a> {
        let own = scene.settings.frames_per_second;
        let own = if own.is_finite() && (1.0..=240.0).contains(&own) { own } else { 30.0 };
        let given = options.number("rate").filter(|r| *r > 0.0);
        File {
            scene,
            files,
            needs,
            rate: given.unwrap_or(own),
            accuracy: Accuracy::of_degrees(options.number("tolerance").unwrap_or(TOLERANCE_DEG), given),
            hidden: options.bool("hidden").unwrap_or(false),
            vertex_colors: options.bool("vertex_colors").unwrap_or(true),
            notes: Notes::default(),
            budget: Budget::new(load::memory_limit(size) as u64),
            image_budget: Budget::new(MAX_IMAGE_BYTES),
        }
    }

    /// Charges memory to the budget before it is allocated.
    pub(crate) fn charge(&self, count: usize, size: usize, place: impl FnOnce() -> String) -> Result<()> {
        self.budget.charge(count as u64, size).at(place)
    }

    /// Whether Blender wrote the file: it uses units of light of its own.
    pub(crate) fn is_from_blender(&self) -> bool {
        matches!(self.scene.metadata.exporter, Exporter::BlenderBinary | Exporter::BlenderAscii)
    }

    pub(crate) fn origin(&self) -> Origin {
        let metadata = &self.scene.metadata;
        let version = metadata.version;
        let encoding = if metadata.ascii { "text" } else { "binary" };
        let settings = &self.scene.settings;
        let axis = |axis: CoordinateAxis| match axis {
            CoordinateAxis::PositiveX => "+X",
            CoordinateAxis::NegativeX => "-X",
            CoordinateAxis::PositiveY => "+Y",
            CoordinateAxis::NegativeY => "-Y",
            CoordinateAxis::PositiveZ => "+Z",
            CoordinateAxis::NegativeZ => "-Z",
            CoordinateAxis::Unknown => "",
        };
        Origin {
            format: format!("FBX {}.{} {encoding}", version / 1000, version % 1000 / 100),
            writer: metadata.creator.to_string(),
            metres_per_unit: (settings.unit_meters > 0.0).then_some(settings.unit_meters),
            up: axis(settings.axes.up).to_string(),
            ..Origin::default()
        }
    }
}

/// Name of an element for messages, as the authoring program shows it: `node "Hips"`. An element without a name has a number.
pub(crate) fn place_of(element: &Element) -> String {
    let kind = format!("{:?}", element.type_).to_ascii_lowercase();
    match element.name.as_ref() {
        "" => format!("{kind}[{}]", element.typed_id),
        name => format!("{kind} \"{name}\""),
    }
}
