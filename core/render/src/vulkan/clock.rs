//! Measures how long the device is busy with frames, by timestamps at the first and the last command of each.

use super::context::Context;
use super::error::Named;
use crate::error::RenderError;
use ash::vk;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Total device time of collected frames. Clones of the `Arc` share one counter.
#[derive(Debug, Default)]
pub struct DeviceTime {
    frames: AtomicU64,
    nanos: AtomicU64,
}

impl DeviceTime {
    /// Number of frames, and their total time in seconds. A frame whose commands were sent in parts counts only with its last
    /// part.
    pub fn total(&self) -> (u64, f64) {
        (self.frames.load(Ordering::Relaxed), self.nanos.load(Ordering::Relaxed) as f64 * 1e-9)
    }

    fn add(&self, nanos: u64) {
        self.frames.fetch_add(1, Ordering::Relaxed);
        self.nanos.fetch_add(nanos, Ordering::Relaxed);
    }
}

/// Two timestamps for each frame in flight.
pub(super) struct Clock {
    pool: vk::QueryPool,
    time: Arc<DeviceTime>,
    /// Nanoseconds of one tick.
    nanos_per_tick: f64,
    /// Number of valid bits of a timestamp.
    timestamp_bits: u32,
}

impl Clock {
    /// The clock; `None` if times are not requested, or the queue has no timestamps.
    pub(super) fn new(
        gpu: &Context,
        time: Option<Arc<DeviceTime>>,
        slots: u32,
    ) -> Result<Option<Clock>, RenderError> {
        let (Some(time), timestamp_bits @ 1..) = (time, gpu.timestamp_bits) else { return Ok(None) };
        let info =
            vk::QueryPoolCreateInfo::default().query_type(vk::QueryType::TIMESTAMP).query_count(2 * slots);
        // SAFETY: the device is alive; destroyed by `destroy`.
        let pool = unsafe { gpu.device.create_query_pool(&info, None) }.named("timestamps")?;
        gpu.set_name(pool, "timestamps");
        Ok(Some(Clock {
            pool,
            time,
            nanos_per_tick: f64::from(gpu.limits().timestamp_period),
            timestamp_bits,
        }))
    }

    /// Writes the timestamp before the first command of a frame in this slot.
    pub(super) fn begin(&self, gpu: &Context, commands: vk::CommandBuffer, slot: usize) {
        let first = 2 * slot as u32;
        // SAFETY: the command buffer is being recorded, outside a pass; the slot's last frame is done.
        unsafe {
            gpu.device.cmd_reset_query_pool(commands, self.pool, first, 2);
            gpu.device.cmd_write_timestamp2(commands, vk::PipelineStageFlags2::NONE, self.pool, first);
        }
    }

    /// Writes the timestamp after the last command of the frame.
    pub(super) fn end(&self, gpu: &Context, commands: vk::CommandBuffer, slot: usize) {
        let second = 2 * slot as u32 + 1;
        // SAFETY: as above.
        unsafe {
            let all = vk::PipelineStageFlags2::ALL_COMMANDS;
            gpu.device.cmd_write_timestamp2(commands, all, self.pool, second);
        }
    }

    /// Adds the time of the slot's frame, which must be done.
    pub(super) fn read(&self, gpu: &Context, slot: usize) -> Result<(), RenderError> {
        let mut ticks = [0u64; 2];
        let flags = vk::QueryResultFlags::TYPE_64 | vk::QueryResultFlags::WAIT;
        // SAFETY: both were written by commands that are done.
        unsafe { gpu.device.get_query_pool_results(self.pool, 2 * slot as u32, &mut ticks, flags) }
            .named("timestamps")?;
        // A timestamp with few bits wraps around to 0.
        let mask = u64::MAX >> (64 - self.timestamp_bits.min(64));
        let busy = ticks[1].wrapping_sub(ticks[0]) & mask;
        self.time.add((busy as f64 * self.nanos_per_tick) as u64);
        Ok(())
    }

    /// Destroys the queries. No frame may be in flight.
    pub(super) fn destroy(&self, gpu: &Context) {
        // SAFETY: made from this device, no longer used.
        unsafe { gpu.device.destroy_query_pool(self.pool, None) };
    }
}
