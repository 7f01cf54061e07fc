//! Frames of floats: linear images and the passes of a compositor, for exporters that ask for them.

use glam::{Vec2, Vec3, Vec4};

/// The pixels that an exporter asks for with [`Exporter::wish`](crate::Exporter::wish).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum FrameWish {
    /// 8-bit display colors: [`FrameSink::frame`](crate::FrameSink::frame).
    #[default]
    Bytes,
    /// The finished image in floats, after the view transform and with the 2D layers:
    /// [`FrameSink::float_frame`](crate::FrameSink::float_frame).
    Finished,
    /// Scene-linear light before the view transform, and other render passes: [`FrameSink::float_frame`](crate::FrameSink::float_frame).
    Scene(Passes),
}

/// The render passes of a frame that are drawn; the others cost nothing.
///
/// ```
/// use choreo_plugin::Passes;
/// let passes = Passes::parse("color, depth")?;
/// assert!(passes.color && passes.depth && !passes.normal);
/// assert_eq!(passes.names().collect::<Vec<_>>(), ["color", "depth"]);
/// assert!(Passes::parse("z").unwrap_err().to_string().contains("color, depth, normal"));
/// # Ok::<(), choreo_plugin::UnknownPass>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Passes {
    /// [`FloatFrame::color`].
    pub color: bool,
    /// [`FloatFrame::depth`].
    pub depth: bool,
    /// [`FloatFrame::normal`].
    pub normal: bool,
    /// [`FloatFrame::motion`].
    pub motion: bool,
    /// [`FloatFrame::albedo`].
    pub albedo: bool,
    /// [`FloatFrame::actors`] and [`FloatFrame::materials`].
    pub id: bool,
    /// Samples per pixel of the ids: 1, 4 or 16; 0: as many as color has.
    pub id_samples: u32,
}

impl Passes {
    /// The names of all passes.
    pub const NAMES: [&'static str; 6] = ["color", "depth", "normal", "motion", "albedo", "id"];

    /// Parses a list of pass names with commas between them.
    ///
    /// # Errors
    /// A name is none of [`Passes::NAMES`].
    pub fn parse(list: &str) -> Result<Passes, UnknownPass> {
        let mut passes = Passes::default();
        for name in list.split(',').map(str::trim) {
            let place = match name {
                "color" => &mut passes.color,
                "depth" => &mut passes.depth,
                "normal" => &mut passes.normal,
                "motion" => &mut passes.motion,
                "albedo" => &mut passes.albedo,
                "id" => &mut passes.id,
                _ => return Err(UnknownPass { name: name.to_string() }),
            };
            *place = true;
        }
        Ok(passes)
    }

    /// Whether depth, normals, motion vectors or ids are drawn for these passes.
    pub fn reads_inputs(self) -> bool {
        self.depth || self.normal || self.motion || self.id
    }

    /// Samples per pixel of the ids, for a frame with this number of samples.
    pub fn samples_of_ids(self, samples: u32) -> u32 {
        if self.id_samples == 0 { samples } else { self.id_samples }
    }

    /// The names of these passes.
    pub fn names(self) -> impl Iterator<Item = &'static str> {
        let Passes { color, depth, normal, motion, albedo, id, .. } = self;
        let on = [color, depth, normal, motion, albedo, id];
        Passes::NAMES.into_iter().zip(on).filter(|(_, on)| *on).map(|(name, _)| name)
    }
}

/// Error of a list of passes: no pass has this name.
///
/// ```
/// use choreo_plugin::Passes;
/// let unknown = Passes::parse("color, z").unwrap_err();
/// assert_eq!(unknown.name, "z");
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnknownPass {
    /// The unknown name.
    pub name: String,
}

choreo_motion::error_texts! { UnknownPass:
    Self { name, .. } => "\"{}\" is no pass; the passes are {}", name, Passes::NAMES.join(", ");
}

/// Images of one frame, each with a value per pixel, rows from the top; images that were not requested are empty.
///
/// ```
/// use choreo_plugin::FloatFrame;
/// let frame = FloatFrame { depth: vec![2.5; 2], ..FloatFrame::new([2, 1]) };
/// assert!(frame.color.is_empty());
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FloatFrame {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Linear RGBA with the primaries of sRGB, premultiplied alpha.
    pub color: Vec<Vec4>,
    /// Depth in metres along the view direction of the camera; [`FloatFrame::NO_DEPTH`] where there is no surface.
    pub depth: Vec<f32>,
    /// World normals of length 1; zero where there is no surface.
    pub normal: Vec<Vec3>,
    /// Pixels by which a surface has moved since the frame before, right and down.
    pub motion: Vec<Vec2>,
    /// Base colors without light: linear RGBA with the primaries of sRGB, premultiplied alpha.
    pub albedo: Vec<Vec4>,
    /// Actors that each pixel shows.
    pub actors: Option<IdMatte>,
    /// Materials that each pixel shows.
    pub materials: Option<IdMatte>,
}

/// The names that pixels show, each with its share of the pixel, as Cryptomatte stores them.
///
/// ```
/// use choreo_plugin::{IdMatte, IdShare, Passes};
/// // One pixel, three quarters of which show the second actor.
/// let share = IdShare { number: 2, share: 0.75 };
/// let matte = IdMatte { names: vec!["anna".into(), "boris".into()], ranks: vec![vec![share]] };
/// assert_eq!(matte.names[matte.ranks[0][0].number as usize - 1], "boris");
/// let passes = Passes { id: true, id_samples: 16, ..Passes::default() };
/// assert_eq!((passes.reads_inputs(), passes.samples_of_ids(4)), (true, 16));
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct IdMatte {
    /// All names of the scene, shown or not. Several may be equal.
    pub names: Vec<String>,
    /// One image per rank: the name with the largest share of each pixel, the name with the second largest, and so on. At most
    /// [`IdMatte::MOST_RANKS`], the same number in every frame.
    pub ranks: Vec<Vec<IdShare>>,
}

impl IdMatte {
    /// Largest number of names per pixel; names with smaller shares are left out.
    pub const MOST_RANKS: usize = 6;
}

/// A name's share of a pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct IdShare {
    /// Index into [`IdMatte::names`], plus 1; 0: none.
    pub number: u32,
    /// 0 to 1. The shares of a pixel are 1 together with that of the background.
    pub share: f32,
}

impl FloatFrame {
    /// The depth where there is no surface.
    pub const NO_DEPTH: f32 = 1e10;

    /// A frame of this size without images.
    pub fn new([width, height]: [u32; 2]) -> FloatFrame {
        FloatFrame { width, height, ..FloatFrame::default() }
    }
}
