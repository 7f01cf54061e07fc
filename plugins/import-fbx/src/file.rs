//! The open file: scene, companions, budgets, warnings.

use crate::load;
use choreo_import::{Budget, Notes, Problem, Result};
use choreo_plugin::{Files, ImportOptions, Needs};
use choreo_stage::Origin;
use ufbx::{CoordinateAxis, Element, Exporter, Scene};

/// All pictures of one file together, decoded.
const MAX_PICTURE_BYTES: u64 = 1 << 30;

pub struct File<'a> {
    pub scene: &'a Scene,
    pub size: usize,
    pub files: &'a dyn Files,
    pub needs: Needs,
    /// Keys a second where a curve is no straight line.
    pub rate: f64,
    /// Whether more are added where a line leaves the curve.
    pub adapts: bool,
    pub hidden: bool,
    pub vertex_colors: bool,
    pub notes: Notes,
    pub budget: Budget,
    pub picture_budget: Budget,
}

impl<'a> File<'a> {
    pub fn new(
        scene: &'a Scene,
        size: usize,
        files: &'a dyn Files,
        needs: Needs,
        options: &ImportOptions,
    ) -> File<'a> {
        let own = scene.settings.frames_per_second;
        let own = if own.is_finite() && (1.0..=240.0).contains(&own) { own } else { 30.0 };
        let given = options.number("rate").filter(|r| *r > 0.0);
        File {
            scene,
            size,
            files,
            needs,
            rate: given.unwrap_or(own),
            adapts: given.is_none(),
            hidden: options.bool("hidden").unwrap_or(false),
            vertex_colors: options.bool("vertex_colors").unwrap_or(true),
            notes: Notes::default(),
            budget: Budget::new(load::memory_limit(size) as u64),
            picture_budget: Budget::new(MAX_PICTURE_BYTES),
        }
    }

    /// Takes memory from the budget before it is allocated.
    pub fn charge(&self, count: usize, size: usize, place: impl FnOnce() -> String) -> Result<()> {
        self.budget.charge(count as u64, size).map_err(|what| Problem::new(place(), what))
    }

    /// Blender writes its own units of light into FBX.
    pub fn is_from_blender(&self) -> bool {
        matches!(self.scene.metadata.exporter, Exporter::BlenderBinary | Exporter::BlenderAscii)
    }

    pub fn origin(&self) -> Origin {
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

/// `node "Hips"`: what a user finds in the program that wrote the file; by number where it has no name.
pub fn place_of(element: &Element) -> String {
    let kind = format!("{:?}", element.type_).to_ascii_lowercase();
    match element.name.as_ref() {
        "" => format!("{kind}[{}]", element.typed_id),
        name => format!("{kind} \"{name}\""),
    }
}
