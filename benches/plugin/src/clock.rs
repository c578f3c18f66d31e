//! The CPU time of this thread, and the memory of this process.

use std::time::Duration;

/// The CPU time of this thread.
#[cfg(unix)]
pub fn thread_time() -> Duration {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    Duration::new(time.tv_sec as u64, time.tv_nsec as u32)
}

/// Wall-clock time, on systems without a thread's CPU time.
#[cfg(not(unix))]
pub fn thread_time() -> Duration {
    use std::sync::LazyLock;
    use std::time::Instant;
    static START: LazyLock<Instant> = LazyLock::new(Instant::now);
    START.elapsed()
}

/// Resident memory of this process in bytes, on Linux; 0 elsewhere.
pub fn resident_bytes() -> u64 {
    let read = || {
        let pages = std::fs::read_to_string("/proc/self/statm").ok()?;
        pages.split(' ').nth(1)?.parse::<u64>().ok()
    };
    read().unwrap_or(0) * 4096
}
