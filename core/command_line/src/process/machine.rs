//! The machine that this process runs on.

/// Its name; empty where the system does not say.
pub(crate) fn host() -> String {
    #[cfg(unix)]
    return rustix::system::uname().nodename().to_string_lossy().into_owned();
    #[cfg(not(unix))]
    return std::env::var("COMPUTERNAME").unwrap_or_default();
}

/// A short name for the names of files, which no other machine has: containers on different machines may have one host name, and the
/// kernels beneath them were not started with the same number.
pub(crate) fn id() -> String {
    let started = std::fs::read("/proc/sys/kernel/random/boot_id").unwrap_or_default();
    blake3::hash(&[host().as_bytes(), &started].concat()).to_hex()[..8].to_string()
}
