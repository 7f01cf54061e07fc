//! Vulkan failures on purpose, for tests: nobody has a driver that fails when asked. Without them a check is one look at
//! an empty option.

use ash::vk;
use std::sync::{Arc, Mutex, PoisonError};

/// Places at which a call to the driver can be made to fail.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FaultPlace {
    /// Making the device.
    Device,
    /// Memory of a buffer or image.
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
    /// The index of the call there, over all devices made with these faults.
    pub nth: usize,
    pub kind: FaultKind,
}

/// Clones count together.
#[derive(Clone, Default)]
pub struct Faults(Option<Arc<Mutex<FaultCounts>>>);

#[derive(Default)]
struct FaultCounts {
    faults: Vec<Fault>,
    /// Calls by place.
    calls: [usize; 5],
}

impl Faults {
    pub fn new(faults: Vec<Fault>) -> Faults {
        Faults(Some(Arc::new(Mutex::new(FaultCounts { faults, ..FaultCounts::default() }))))
    }

    /// Calls at a place until now.
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
