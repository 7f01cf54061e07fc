//! Order of the timeline's rows, which is that of the script.

use super::EditError;
use crate::app::Viewer;
use crate::state::selection::Selected;
use choreo_session::edit::{RowSide, reorder};
use std::collections::BTreeSet;

/// Rows that can be exchanged with each other.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Group {
    Actors,
    /// Layers of an actor, except for the base layer.
    Layers(String),
    Lights,
}

impl Viewer {
    /// Moves a row above or below another one, by moving the statement that creates its object.
    ///
    /// # Errors
    /// The edit is refused, with a text for the user; the script does not change.
    pub fn move_row(&mut self, row: usize, to: usize, side: RowSide) -> Result<(), EditError> {
        let (group, what) = self.group_and_object(row).ok_or_else(|| immovable_row_error(row))?;
        let target = self.drop_target(&group, to).ok_or_else(|| other_group_error(&group))?;
        let (place, siblings) = self.place_of(&what).ok_or(EditError::ObjectGone)?;
        let (beside, _) = self.place_of(&target).ok_or(EditError::ObjectGone)?;
        if what == target {
            return Ok(());
        }
        self.check_place(&beside, 1)?;
        let (moved, beside) = ((place.line, place.column), (beside.line, beside.column));
        self.edit_call(&place, siblings, |text| reorder(text, moved, beside, side))?;
        self.renumber_after_move(&group, &what, &target, side);
        Ok(())
    }

    /// Moves a row one place up or down within its group.
    ///
    /// # Errors
    /// Fails as [`Viewer::move_row`] does, or if the row is already the first or the last of its group.
    pub fn shift_row(&mut self, row: usize, side: RowSide) -> Result<(), EditError> {
        let (group, what) = self.group_and_object(row).ok_or_else(|| immovable_row_error(row))?;
        let all = 0..self.timeline.rows.len();
        let rows: Vec<(usize, Selected)> = all
            .filter_map(|row| {
                self.group_and_object(row).filter(|(other, _)| *other == group).map(|(_, what)| (row, what))
            })
            .collect();
        let at = rows.iter().position(|(_, other)| *other == what).ok_or(EditError::ObjectGone)?;
        let next = match side {
            RowSide::Above => at.checked_sub(1),
            RowSide::Below => Some(at + 1),
        };
        let next = next.and_then(|next| rows.get(next));
        let (to, _) = *next
            .as_ref()
            .ok_or_else(|| EditError::refused("the row cannot move further in that direction"))?;
        self.move_row(row, *to, side)
    }

    /// Group of a row, and the object whose position in the script decides the order. `None` if the row cannot be moved.
    fn group_and_object(&self, row: usize) -> Option<(Group, Selected)> {
        let row = self.timeline.rows.get(row)?;
        let what = row.what.clone()?;
        match (&what, row.layer) {
            (Selected::Actor(name), Some(1..)) => {
                Some((Group::Layers(name.clone()), row.bars.first()?.what.clone()))
            }
            (Selected::Actor(_), _) => Some((Group::Actors, what)),
            (Selected::Light(_), _) => Some((Group::Lights, what)),
            _ => None,
        }
    }

    /// The object next to which a row of a group would be moved, given the row under the pointer.
    fn drop_target(&self, group: &Group, row: usize) -> Option<Selected> {
        match (group, self.group_and_object(row)?) {
            (Group::Actors, (Group::Layers(name), _)) => Some(Selected::Actor(name)),
            (group, (other, what)) => (*group == other).then_some(what),
        }
    }

    /// Rows of the object next to which a row would be moved, in order. `to`: the row under the pointer.
    pub(crate) fn drop_target_rows(&self, row: usize, to: usize) -> Option<Vec<usize>> {
        let (group, _) = self.group_and_object(row)?;
        let target = self.drop_target(&group, to)?;
        let is_of_it = |row: &usize| self.drop_target(&group, *row).as_ref() == Some(&target);
        Some((0..self.timeline.rows.len()).filter(is_of_it).collect())
    }

    /// Updates the indices in the selection and in the muted and expanded layers after a move.
    fn renumber_after_move(&mut self, group: &Group, what: &Selected, target: &Selected, side: RowSide) {
        let number = |what: &Selected| match what {
            Selected::Light(index) => Some(*index),
            Selected::Cue { layer, .. } => Some(*layer),
            _ => None,
        };
        let (Some(from), Some(to)) = (number(what), number(target)) else { return };
        let to = match side {
            RowSide::Above if from < to => to - 1,
            RowSide::Below if from > to => to + 1,
            _ => to,
        };
        let renumbered = |number: usize| match number {
            number if number == from => to,
            number if from < number && number <= to => number - 1,
            number if to <= number && number < from => number + 1,
            number => number,
        };
        match (group, &mut self.selection) {
            (Group::Lights, Some(Selected::Light(index))) => *index = renumbered(*index),
            (Group::Layers(name), Some(Selected::Cue { actor, layer, .. })) if actor == name => {
                *layer = renumbered(*layer);
            }
            _ => {}
        }
        if let Group::Layers(name) = group {
            let muted = std::mem::take(&mut self.toggles.muted).into_iter();
            let of = |(actor, layer): (String, usize)| {
                let layer = if actor == *name { renumbered(layer) } else { layer };
                (actor, layer)
            };
            self.toggles.muted = muted.map(of).collect::<BTreeSet<_>>();
            let expanded = std::mem::take(&mut self.toggles.expanded).into_iter();
            let of = |(actor, layer): (String, Option<usize>)| {
                let layer = if actor == *name { layer.map(renumbered) } else { layer };
                (actor, layer)
            };
            self.toggles.expanded = expanded.map(of).collect::<BTreeSet<_>>();
        }
    }
}

fn immovable_row_error(row: usize) -> EditError {
    EditError::refused(match row {
        0 => "the row of cameras stays above the others",
        _ => "rows of actors, of their layers and of lights can be moved; this one cannot",
    })
}

fn other_group_error(group: &Group) -> EditError {
    EditError::refused(match group {
        Group::Actors => "the row of an actor can only be moved above or below that of another actor",
        Group::Layers(_) => "a layer can only be moved above or below another layer of its actor",
        Group::Lights => "the row of a light can only be moved above or below that of another light",
    })
}
