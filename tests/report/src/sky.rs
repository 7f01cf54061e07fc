//! Image-based lighting: size of its maps, number of samples, and representation of the diffuse part.

use crate::{BUDGET_SECS, Section};
use choreo_asset::Panorama;
use choreo_bench::scene::sky::{diffuse, mirrored};

pub(crate) fn section() -> Result<Section, String> {
    let studio = Panorama::studio();
    Ok(Section {
        title: "Image-based light",
        text: "Measured with `sky(\"studio\")`, whose light boxes have edges that are hard for such maps. \
               Reflections come from octahedral maps blurred for some roughnesses, interpolated between \
               maps and between texels. Diffuse light changes slowly with the direction: nine numbers a \
               color, or a small map."
            .into(),
        choices: vec![mirrored(&studio, BUDGET_SECS), diffuse(&studio, BUDGET_SECS)],
        tables: Vec::new(),
        off_front: Vec::new(),
    })
}
