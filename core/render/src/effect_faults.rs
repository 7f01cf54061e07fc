//! Faults of effects: results that are not finite, and loops that do not end. Faulty pixels become magenta, and other faulty
//! results are ignored. A warning names the effect and the first faulty pixel or item. CPU reference of effect_faults.wgsl.

use choreo_plugin::effect::endless_loop;
use choreo_plugin::{Effect, MAX_EFFECT_STEPS};
use glam::{Vec3, Vec4};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Mutex, PoisonError};

/// Color of pixels in which an effect failed.
pub(crate) const MAGENTA: Vec4 = Vec4::new(1.0, 0.0, 1.0, 1.0);

/// Number of records that a device has for each effect: the first for results that are not finite, then one for each loop by its
/// number. The last one is also for all further loops.
pub(crate) const RECORDS_PER_EFFECT: u32 = 16;

/// Values of an unused record, and of a fault at a vertex.
pub(crate) const NO_FAULT: u32 = u32::MAX;
const VERTEX_FAULT: u32 = u32::MAX - 1;

/// Kind of fault of an effect's result.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Fault {
    NotFinite,
    /// A call took too many steps. The value is the number of the loop, from 1, or 0 outside known loops.
    Endless(u32),
}

impl Fault {
    /// The fault of a result, if it has one.
    #[inline(always)]
    pub(crate) fn of(value: Vec4) -> Option<Fault> {
        if value.is_finite() {
            return None;
        }
        Some(endless_loop(value.x).map_or(Fault::NotFinite, Fault::Endless))
    }
}

/// Place of a fault. In the order of places, pixels come first, row by row.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum FaultPlace {
    Pixel { row: u32, column: u32 },
    Vertex,
    Outline,
    Wireframe,
    Shutter,
    Line,
    Triangle,
    Lattice,
    Label,
}

impl FaultPlace {
    pub(crate) fn pixel([x, y]: [i32; 2]) -> FaultPlace {
        FaultPlace::Pixel { row: y.max(0) as u32, column: x.max(0) as u32 }
    }

    /// Texts for a warning: the place of the fault, and what happens there.
    fn description_and_consequence(self) -> (String, &'static str) {
        let (place, consequence) = match self {
            FaultPlace::Pixel { row, column } => {
                return (format!("at pixel ({column}, {row})"), "such pixels are magenta");
            }
            FaultPlace::Vertex => ("at a vertex", "such vertices are not moved"),
            FaultPlace::Outline => ("for the outline", "no outline is drawn"),
            FaultPlace::Wireframe => ("for the wireframe", "no wireframe is drawn"),
            FaultPlace::Shutter => ("for the shutter", "there is no motion blur"),
            FaultPlace::Line => ("for a line or point", "such lines are not drawn"),
            FaultPlace::Triangle => ("for a triangle", "such triangles are not drawn"),
            FaultPlace::Lattice => ("for a grid", "such grids are not drawn"),
            FaultPlace::Label => ("for a label", "such labels are not drawn"),
        };
        (place.into(), consequence)
    }
}

/// A fault that was found when a frame was planned. It is the same for both renderers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PlanFault {
    /// Name of the effect.
    pub effect: String,
    pub fault: Fault,
    pub place: FaultPlace,
}

impl PlanFault {
    /// The fault of a result that is computed for both renderers, if it has one.
    pub(crate) fn of(effect: &Effect, result: &[f32], place: FaultPlace) -> Option<PlanFault> {
        let fault = result.iter().find_map(|value| Fault::of(Vec4::splat(*value)))?;
        Some(PlanFault { effect: effect.manifest().name.clone(), fault, place })
    }
}

/// Faults that have occurred in a renderer.
#[derive(Default)]
pub(crate) struct EffectFaults(Mutex<FaultLog>);

#[derive(Default)]
struct FaultLog {
    /// First place of each fault that has occurred since the last report.
    unreported: BTreeMap<(String, Fault), FaultPlace>,
    /// Faults for which a warning was returned.
    reported: BTreeSet<(String, Fault)>,
}

impl EffectFaults {
    /// Records a fault. Of several places, the first one is kept.
    pub(crate) fn record(&self, effect: &Effect, fault: Fault, place: FaultPlace) {
        self.record_by_name(&effect.manifest().name, fault, place);
    }

    pub(crate) fn record_by_name(&self, effect: &str, fault: Fault, place: FaultPlace) {
        let mut fault_log = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let first = fault_log.unreported.entry((effect.to_string(), fault)).or_insert(place);
        *first = place.min(*first);
    }

    /// Replaces faulty colors by magenta, and records their pixels.
    pub(crate) fn replace_faulty_colors(
        &self,
        effect: &Effect,
        colors: &mut [Vec4],
        pixel: impl Fn(usize) -> [i32; 2],
    ) {
        for (i, color) in colors.iter_mut().enumerate() {
            if let Some(fault) = Fault::of(*color) {
                self.record(effect, fault, FaultPlace::pixel(pixel(i)));
                *color = MAGENTA;
            }
        }
    }

    /// The offset of a vertex, or zero if it is faulty, which is recorded.
    pub(crate) fn offset_or_zero(&self, effect: &Effect, offset: Vec3) -> Vec3 {
        let Some(fault) = Fault::of(offset.extend(0.0)) else { return offset };
        self.record(effect, fault, FaultPlace::Vertex);
        Vec3::ZERO
    }

    /// Reads the records of a device. `at`: position of the drawn part in the whole image.
    pub(crate) fn read_device_records(&self, effects: &[Effect], records: &[u8], at: [u32; 2]) {
        let records = records.as_chunks::<4>().0.iter().map(|bytes| u32::from_le_bytes(*bytes));
        for (i, place) in records.enumerate().filter(|(_, place)| *place != NO_FAULT) {
            let (Some(effect), number) =
                (effects.get(i / RECORDS_PER_EFFECT as usize), i as u32 % RECORDS_PER_EFFECT)
            else {
                return;
            };
            let fault = if number == 0 { Fault::NotFinite } else { Fault::Endless(number) };
            let (row, column) = (place >> 16, place & 0xffff);
            let place = match place {
                VERTEX_FAULT => FaultPlace::Vertex,
                _ => FaultPlace::Pixel { row: row + at[1], column: column + at[0] },
            };
            self.record(effect, fault, place);
        }
    }

    /// Warnings about faults that were not reported before.
    pub(crate) fn take_warnings(&self, effects: &[Effect]) -> Vec<String> {
        let mut fault_log = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let unreported = std::mem::take(&mut fault_log.unreported);
        let new = unreported.into_iter().filter(|(key, _)| fault_log.reported.insert(key.clone()));
        new.map(|((name, fault), place)| format_warning(&name, fault, place, effects)).collect()
    }

    /// Forgets all faults, because the effects are replaced.
    pub(crate) fn clear(&self) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = FaultLog::default();
    }
}

fn format_warning(name: &str, fault: Fault, place: FaultPlace, effects: &[Effect]) -> String {
    let (place, consequence) = place.description_and_consequence();
    let effect = effects.iter().find(|e| e.manifest().name == name);
    let loops = effect.map_or(&[][..], Effect::loops);
    match fault {
        Fault::NotFinite => {
            format!("warning: effect \"{name}\": the result {place} is NaN or infinite; {consequence}")
        }
        Fault::Endless(number) => {
            let at = loops.get((number as usize).wrapping_sub(1));
            let loop_position = at.map_or_else(String::new, |at| format!("{at}: "));
            let what = if at.is_some() { "this loop" } else { "a call" };
            format!(
                "{loop_position}warning: effect \"{name}\": {what} takes more than {MAX_EFFECT_STEPS} steps {place}; {consequence}"
            )
        }
    }
}
