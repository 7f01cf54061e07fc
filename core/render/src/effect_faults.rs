//! Faults of effects: results that are no numbers, and loops that do not end. Both become magenta, and a warning names the effect and
//! the first pixel. CPU reference of effect_faults.wgsl.

use choreo_plugin::effect::endless_loop;
use choreo_plugin::{Effect, MAX_EFFECT_STEPS};
use glam::{Vec3, Vec4};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Mutex, PoisonError};

/// The sign of a faulty effect.
pub(crate) const MAGENTA: Vec4 = Vec4::new(1.0, 0.0, 1.0, 1.0);

/// Records of one effect on a device: results that are not finite, then loops by their numbers; the last for all further ones.
pub(crate) const RECORDS: u32 = 16;

/// A record that nothing was written into, and one of a vertex.
pub(crate) const NO_FAULT: u32 = u32::MAX;
const OF_VERTEX: u32 = u32::MAX - 1;

/// A fault of a result.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Fault {
    NotFinite,
    /// The number of the loop, from 1; 0 for none.
    Endless(u32),
}

impl Fault {
    /// The fault of a result, if it has one.
    #[inline(always)]
    pub fn of(value: Vec4) -> Option<Fault> {
        if value.is_finite() {
            return None;
        }
        Some(endless_loop(value.x).map_or(Fault::NotFinite, Fault::Endless))
    }
}

/// The place of a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum FaultPlace {
    /// Column and row.
    Pixel([i32; 2]),
    Vertex,
}

impl FaultPlace {
    /// Pixels row by row, then vertices.
    fn packed(self) -> u32 {
        match self {
            FaultPlace::Pixel([x, y]) => (y.max(0) as u32) << 16 | x.max(0) as u32 & 0xffff,
            FaultPlace::Vertex => OF_VERTEX,
        }
    }
}

/// The faults that a renderer has seen.
#[derive(Default)]
pub(crate) struct EffectFaults(Mutex<Seen>);

#[derive(Default)]
struct Seen {
    /// The first place of each fault, packed.
    found: BTreeMap<(String, Fault), u32>,
    /// Faults that warnings were given for.
    reported: BTreeSet<(String, Fault)>,
}

impl EffectFaults {
    /// Records a fault; of several places the first pixel stays.
    pub fn record(&self, effect: &Effect, fault: Fault, place: FaultPlace) {
        self.record_packed(effect, fault, place.packed());
    }

    fn record_packed(&self, effect: &Effect, fault: Fault, place: u32) {
        let mut seen = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let first = seen.found.entry((effect.manifest().name.clone(), fault)).or_insert(place);
        *first = place.min(*first);
    }

    /// Magenta in place of faulty colors, which are recorded with their pixels.
    pub fn checked(&self, effect: &Effect, colors: &mut [Vec4], pixel: impl Fn(usize) -> [i32; 2]) {
        for (i, color) in colors.iter_mut().enumerate() {
            if let Some(fault) = Fault::of(*color) {
                self.record(effect, fault, FaultPlace::Pixel(pixel(i)));
                *color = MAGENTA;
            }
        }
    }

    /// A vertex whose displacement is faulty stays in its place.
    pub fn checked_offset(&self, effect: &Effect, offset: Vec3) -> Vec3 {
        let Some(fault) = Fault::of(offset.extend(0.0)) else { return offset };
        self.record(effect, fault, FaultPlace::Vertex);
        Vec3::ZERO
    }

    /// Reads what a device recorded. `at`: where the image that it drew lies in the whole one.
    pub fn read(&self, effects: &[Effect], records: &[u8], at: [u32; 2]) {
        let records = records.as_chunks::<4>().0.iter().map(|bytes| u32::from_le_bytes(*bytes));
        for (i, place) in records.enumerate().filter(|(_, place)| *place != NO_FAULT) {
            let (Some(effect), number) = (effects.get(i / RECORDS as usize), i as u32 % RECORDS) else {
                return;
            };
            let fault = if number == 0 { Fault::NotFinite } else { Fault::Endless(number) };
            let moved = if place == OF_VERTEX { place } else { place + (at[1] << 16) + at[0] };
            self.record_packed(effect, fault, moved);
        }
    }

    /// Warnings of faults since the last call that were not reported before.
    pub fn take_notes(&self, effects: &[Effect]) -> Vec<String> {
        let mut seen = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let found = std::mem::take(&mut seen.found);
        let new = found.into_iter().filter(|(key, _)| seen.reported.insert(key.clone()));
        new.map(|((name, fault), place)| warning(&name, fault, place, effects)).collect()
    }

    /// Forgets everything: other effects, other faults.
    pub fn clear(&self) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Seen::default();
    }
}

fn warning(name: &str, fault: Fault, place: u32, effects: &[Effect]) -> String {
    let (at, result) = match place {
        OF_VERTEX => ("a vertex".to_string(), "such vertices stay in their places"),
        place => (format!("pixel ({}, {})", place & 0xffff, place >> 16), "such pixels are magenta"),
    };
    let effect = effects.iter().find(|e| e.manifest().name == name);
    let loops = effect.and_then(|e| e.shader()).map_or(&[][..], |shader| shader.loops());
    match fault {
        Fault::NotFinite => {
            format!("warning: effect \"{name}\": the result at {at} is NaN or infinite; {result}")
        }
        Fault::Endless(number) => {
            let place = loops.get((number as usize).wrapping_sub(1));
            let of_loop = place.map_or_else(String::new, |place| format!("{place}: "));
            let what = if place.is_some() { "this loop" } else { "a call" };
            format!(
                "{of_loop}warning: effect \"{name}\": {what} takes more than {MAX_EFFECT_STEPS} steps at {at}; {result}"
            )
        }
    }
}
