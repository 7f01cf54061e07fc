//! The pipeline cache on disk: a checksum, then the driver's data, whose header must name this driver and device.

use super::context::Context;
use super::error::Named;
use crate::error::RenderError;
use ash::vk;
use choreo_files::write_whole_beneath;
use std::path::{Path, PathBuf};

const CHECKSUM_BYTES: usize = 32;

pub(crate) struct PipelineCache {
    pub raw: vk::PipelineCache,
    file: Option<PathBuf>,
}

impl PipelineCache {
    pub(super) fn new(gpu: &Context, folder: Option<&Path>) -> Result<PipelineCache, RenderError> {
        let p = &gpu.properties;
        let file = folder.map(|f| {
            f.join(format!("pipelines-{:04x}-{:04x}-{:08x}.bin", p.vendor_id, p.device_id, p.driver_version))
        });
        let data = file.as_ref().and_then(|f| std::fs::read(f).ok()).unwrap_or_default();
        // A cache only saves time, so a file that cannot be read or is invalid counts as empty.
        let usable =
            valid_driver_data(&data, p.vendor_id, p.device_id, &p.pipeline_cache_uuid).unwrap_or(&[]);
        let info = vk::PipelineCacheCreateInfo::default().initial_data(usable);
        // SAFETY: the data was written by this driver for this device, its checksum holds; destroyed by `destroy`.
        let raw = unsafe { gpu.device.create_pipeline_cache(&info, None) }.named("pipeline cache")?;
        Ok(PipelineCache { raw, file })
    }

    /// Saves the cache: writes a new file and renames it. A failure is not reported, because it only makes the next start slower.
    pub(super) fn save(&self, gpu: &Context) {
        let Some(file) = &self.file else { return };
        // SAFETY: the cache belongs to this device.
        let Ok(data) = (unsafe { gpu.device.get_pipeline_cache_data(self.raw) }) else { return };
        let mut bytes = blake3::hash(&data).as_bytes().to_vec();
        bytes.extend_from_slice(&data);
        if std::fs::read(file).is_ok_and(|old| old == bytes) {
            return;
        }
        if let (Some(folder), Some(name)) = (file.parent(), file.file_name()) {
            let _ = write_whole_beneath(folder, name.as_ref(), &bytes);
        }
    }

    pub(super) fn destroy(&mut self, gpu: &Context) {
        // SAFETY: made from this device; no pipeline is being created.
        unsafe { gpu.device.destroy_pipeline_cache(self.raw, None) };
        self.raw = vk::PipelineCache::null();
    }
}

/// The driver's data, if the checksum and the header (Vulkan, "Pipeline Cache Header") match this driver and device.
fn valid_driver_data<'a>(file: &'a [u8], vendor: u32, device: u32, uuid: &[u8; 16]) -> Option<&'a [u8]> {
    let (checksum, data) = file.split_at_checked(CHECKSUM_BYTES)?;
    if blake3::hash(data).as_bytes() != checksum {
        return None;
    }
    let word = |i: usize| Some(u32::from_le_bytes(data.get(i * 4..i * 4 + 4)?.try_into().ok()?));
    let ours = word(0)? as usize <= data.len()
        && word(1)? == vk::PipelineCacheHeaderVersion::ONE.as_raw() as u32
        && word(2)? == vendor
        && word(3)? == device
        && data.get(16..32)? == uuid;
    ours.then_some(data)
}

#[cfg(test)]
mod tests {
    use super::valid_driver_data;

    fn file(vendor: u32, device: u32, uuid: u8) -> Vec<u8> {
        let mut data = Vec::new();
        for word in [32u32, 1, vendor, device] {
            data.extend_from_slice(&word.to_le_bytes());
        }
        data.extend_from_slice(&[uuid; 16]);
        data.extend_from_slice(b"pipelines");
        let mut file = blake3::hash(&data).as_bytes().to_vec();
        file.extend_from_slice(&data);
        file
    }

    #[test]
    fn only_an_intact_cache_of_this_device_is_used() {
        let ours = |file: &[u8]| valid_driver_data(file, 5, 6, &[7; 16]).is_some();
        let good = file(5, 6, 7);
        assert!(ours(&good));
        assert!(!ours(&file(4, 6, 7)) && !ours(&file(5, 5, 7)) && !ours(&file(5, 6, 8)), "another device");
        for length in 0..good.len() {
            assert!(!ours(&good[..length]), "cut at {length}");
        }
        for byte in 0..good.len() {
            let mut bad = good.clone();
            bad[byte] ^= 1;
            assert!(!ours(&bad), "a bit flipped in byte {byte}");
        }
    }
}
