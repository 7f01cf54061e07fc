//! Inspector fields of an actor's attachments, constraints and spring bones, for each call in the script that states one. Values are those of the
//! stage if it has them, else those in the script.

use super::fields::{Form, described_field};
use super::hint::Hint;
use crate::app::Viewer;
use crate::editing::{FieldChange, StatedCall, expression};
use crate::state::selection::Selected;
use choreo_motion::Time;
use choreo_script::Place;
use choreo_stage::{
    Actor, ConstraintKind, Described, Field, FieldType, FieldValue, ParentChange, SpringParameters,
};
use egui::{Grid, RichText, Ui};

/// Largest number of displayed calls of one kind for an actor.
const MAX_CALLS: usize = 40;

/// A user's edit of a call.
pub(super) struct CallChange(pub StatedCall, pub FieldChange);

/// Shows everything that places or moves an actor in addition to its clips. `index`: index of the actor on stage.
pub(super) fn show(ui: &mut Ui, viewer: &Viewer, actor: &Actor, index: usize) -> Option<CallChange> {
    let places = &viewer.scene.as_ref()?.places;
    let shown = |calls: &[Vec<Place>], number: usize, name: &str| {
        let place = calls.get(index).and_then(|own| own.get(number)).cloned().unwrap_or_default();
        let siblings = calls.iter().flatten().filter(|other| **other == place).count();
        viewer.stated_call(&place, siblings, name)
    };
    let what = Selected::Actor(actor.name.clone());
    let attached = viewer.stated_calls(&what, &["attach", "detach"]);
    let springs = viewer.stated_calls(&what, &["spring"]);
    let count = attached.len() + actor.look_at.len() + actor.constraints.len() + springs.len();
    if count == 0 {
        return None;
    }
    let mut edit = None;
    let title = format!("constraints and springs ({count})");
    egui::CollapsingHeader::new(title).default_open(true).show(ui, |ui| {
        for call in attached.into_iter().take(MAX_CALLS) {
            let all = with_stated_literals::<ParentChange>(ParentChange::default(), viewer, &call);
            let change = show_call_section(ui, &call, |ui, form| described_fields(ui, form, &all));
            edit = change.map(|change| CallChange(call, change)).or(edit.take());
        }
        for (number, look) in actor.look_at.iter().enumerate().take(MAX_CALLS) {
            let call = shown(&places.look_at_constraints, number, "look_at");
            let change = show_call_section(ui, &call, |ui, form| described_fields(ui, form, look));
            edit = change.map(|change| CallChange(call, change)).or(edit.take());
        }
        for (number, constraint) in actor.constraints.iter().enumerate().take(MAX_CALLS) {
            let call = shown(&places.constraints, number, constraint.kind.name());
            let change = show_call_section(ui, &call, |ui, form| {
                let own = match &constraint.kind {
                    ConstraintKind::Reach(reach) => described_fields(ui, form, reach),
                    ConstraintKind::Aim(aim) => described_fields(ui, form, aim),
                    ConstraintKind::FootLock(_) | ConstraintKind::Mirror(_) => None,
                };
                described_fields(ui, form, constraint).or(own)
            });
            edit = change.map(|change| CallChange(call, change)).or(edit.take());
        }
        for call in springs.into_iter().take(MAX_CALLS) {
            let all = with_stated_literals(SpringParameters::default(), viewer, &call);
            let change = show_call_section(ui, &call, |ui, form| described_fields(ui, form, &all));
            edit = change.map(|change| CallChange(call, change)).or(edit.take());
        }
    });
    edit
}

/// A call with its name and arguments, followed by its fields.
fn show_call_section(
    ui: &mut Ui,
    call: &StatedCall,
    show: impl FnOnce(&mut Ui, &Form) -> Option<FieldChange>,
) -> Option<FieldChange> {
    let name = call.title.split_whitespace().next().unwrap_or_default();
    let name_prefix = format!("{name} ");
    let form = Form { stated: &call.values, name_prefix: &name_prefix, is_cue: false, end: None };
    let mut edit = None;
    ui.push_id((call.place.line, call.place.column, &call.title), |ui| {
        let line = format!("line {}", call.place.line);
        ui.label(RichText::new(&call.title).monospace()).hint(line);
        if call.place.line == 0 {
            ui.weak("of the character itself");
            return;
        }
        Grid::new("call").num_columns(2).show(ui, |ui| edit = show(ui, &form));
    });
    edit
}

fn described_fields<T: Described>(ui: &mut Ui, form: &Form, of: &T) -> Option<FieldChange> {
    let mut edit = None;
    for field in T::FIELDS {
        edit = described_field(ui, form, of, field).or(edit);
    }
    edit
}

/// Values that a call states as literals; others have their defaults.
fn with_stated_literals<T: Described>(mut of: T, viewer: &Viewer, call: &StatedCall) -> T {
    let fps = viewer.playhead.fps().as_fps();
    for field in T::FIELDS {
        let value = call.values.get(field.name).and_then(|text| parse_field_value(field, text, fps));
        value.into_iter().for_each(|value| (field.set)(&mut of, value));
    }
    of
}

fn parse_field_value<T: Described>(field: &Field<T>, text: &str, fps: f64) -> Option<FieldValue> {
    match field.field_type {
        FieldType::Number(..) => expression::evaluate(text, fps).map(FieldValue::Number),
        FieldType::Time | FieldType::Duration => {
            Some(FieldValue::Time(Time::from_secs(expression::evaluate(text, fps)?)))
        }
        FieldType::Flag => text.parse().ok().map(FieldValue::Flag),
        _ => None,
    }
}
