//! The machine that this process runs on.

/// Host name; empty if the system does not report it.
pub(crate) fn host_name() -> String {
    #[cfg(unix)]
    return rustix::system::uname().nodename().to_string_lossy().into_owned();
    #[cfg(not(unix))]
    return std::env::var("COMPUTERNAME").unwrap_or_default();
}

/// A short name of this machine for file names, unique among machines: containers on different machines may share one host name, but the
/// boot ids of their kernels differ.
pub(crate) fn id() -> String {
    let started = std::fs::read("/proc/sys/kernel/random/boot_id").unwrap_or_default();
    blake3::hash(&[host_name().as_bytes(), &started].concat()).to_hex()[..8].to_string()
}
