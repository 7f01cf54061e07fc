//! Look-up of markers by name.

use crate::call::{ApiError, Call, unknown};
use choreo_motion::{Clip, Time};
use std::sync::Arc;

pub(crate) fn find_marker(markers: &[(String, Time)], name: &str, place: &str) -> Result<Time, ApiError> {
    let found = markers.iter().find(|(known, _)| known == name).map(|(_, time)| *time);
    let known = markers.iter().map(|(known, _)| known.as_str()).collect::<Vec<_>>();
    found.ok_or_else(|| unknown("marker", name, place, known))
}

/// Time of a marker of a clip, in seconds of the clip.
pub(crate) fn clip_marker(c: &Call, clip: &Arc<Clip>, name: &str) -> Result<Time, ApiError> {
    let stage_draft = c.stage_draft();
    let markers = stage_draft.clip_notes_of(clip).map_or(&[][..], |notes| &notes.markers);
    find_marker(markers, name, &format!(" in clip \"{}\"", clip.name))
}
