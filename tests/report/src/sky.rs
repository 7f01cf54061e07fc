//! Image-based lighting: size of its maps, number of samples, and representation of the diffuse part.

use crate::{BUDGET_SECS, Section};
use choreo_asset::Panorama;
use choreo_bench::scene::sky::{diffuse, mirrored};

pub fn section() -> Result<Section, String> {
    let studio = Panorama::studio();
    Ok(Section {
        title: "Image-based light",
        text: "The studio of `sky(\"studio\")`, whose boxes have the edges that are hard for such maps. What is mirrored comes from octahedra \
               blurred for some roughnesses; between them, and between their texels, it is interpolated. What is diffuse is a slow function of \
               the direction: nine numbers a color, or a small map."
            .into(),
        choices: vec![mirrored(&studio, BUDGET_SECS), diffuse(&studio, BUDGET_SECS)],
        tables: Vec::new(),
        off_front: Vec::new(),
    })
}
