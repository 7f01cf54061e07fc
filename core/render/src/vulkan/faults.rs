//! Vulkan failures on purpose, for tests, since no driver fails on request. Without faults a check only looks at an empty option.

use ash::vk;
use std::sync::{Arc, Mutex, PoisonError};

/// Places at which a call to the driver can be made to fail.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FaultPlace {
    /// Creating the device.
    Device,
    /// Allocating the memory of a buffer or image.
    Memory,
    Pipeline,
    Submit,
    /// Waiting for a frame.
    Wait,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FaultKind {
    /// The device is lost: every later call on it fails.
    DeviceLost,
    OutOfMemory,
    TimedOut,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fault {
    pub place: FaultPlace,
    /// Index of the failing call at this place, counted over all devices created with these faults.
    pub nth: usize,
    pub kind: FaultKind,
}

/// Faults to inject. Clones share the counts of calls.
#[derive(Clone, Default)]
pub struct Faults(Option<Arc<Mutex<FaultCounts>>>);

#[derive(Default)]
struct FaultCounts {
    faults: Vec<Fault>,
    /// Number of calls at each place.
    calls: [usize; 5],
}

impl Faults {
    pub fn new(faults: Vec<Fault>) -> Faults {
        Faults(Some(Arc::new(Mutex::new(FaultCounts { faults, ..FaultCounts::default() }))))
    }

    /// Number of calls at a place so far.
    pub fn calls(&self, place: FaultPlace) -> usize {
        let state = self.0.as_ref().map(|s| s.lock().unwrap_or_else(PoisonError::into_inner));
        state.map_or(0, |s| s.calls[place as usize])
    }

    pub(super) fn check(&self, place: FaultPlace) -> Result<(), vk::Result> {
        let Some(state) = &self.0 else { return Ok(()) };
        let mut state = state.lock().unwrap_or_else(PoisonError::into_inner);
        let nth = state.calls[place as usize];
        state.calls[place as usize] += 1;
        match state.faults.iter().find(|f| (f.place, f.nth) == (place, nth)) {
            None => Ok(()),
            Some(fault) => Err(match fault.kind {
                FaultKind::DeviceLost => vk::Result::ERROR_DEVICE_LOST,
                FaultKind::OutOfMemory => vk::Result::ERROR_OUT_OF_DEVICE_MEMORY,
                FaultKind::TimedOut => vk::Result::TIMEOUT,
            }),
        }
    }
}
