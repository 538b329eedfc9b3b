//! How much memory the process has taken at most, and how often a thread waited for a page of it.

/// The peak resident size of this process in bytes, from `VmHWM` of `/proc/self/status`; `None` where there is none.
pub fn peak_resident_bytes() -> Option<u64> {
    parse_size(&std::fs::read_to_string("/proc/self/status").ok()?, "VmHWM:")
}

/// The resident size of this process in bytes, which is its peak from now on, where the system can forget an older one (Linux
/// can: `/proc/self/clear_refs`); `None` where it does not tell.
pub fn begin_peak() -> Option<u64> {
    // Where it is refused, the peak is that of the whole process.
    let _ = std::fs::write("/proc/self/clear_refs", "5");
    parse_size(&std::fs::read_to_string("/proc/self/status").ok()?, "VmRSS:")
}

/// How many pages this thread has waited for, from field 12 of `/proc/thread-self/stat`; `None` where there is none.
pub fn thread_major_faults() -> Option<u64> {
    parse_major_faults(&std::fs::read_to_string("/proc/thread-self/stat").ok()?)
}

fn parse_major_faults(stat: &str) -> Option<u64> {
    // The name of the program, in brackets, may hold anything.
    stat.rsplit_once(')')?.1.split_ascii_whitespace().nth(9)?.parse().ok()
}

fn parse_size(status: &str, key: &str) -> Option<u64> {
    let line = status.lines().find_map(|line| line.strip_prefix(key))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()?.checked_mul(1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_peak_is_parsed() {
        assert_eq!(parse_size("VmPeak:\t  9 kB\nVmHWM:\t   12 kB\n", "VmHWM:"), Some(12 * 1024));
        assert_eq!(parse_size("VmHWM:\t 99999999999999999999 kB", "VmHWM:"), None);
        assert_eq!(parse_size("", "VmHWM:"), None);
        assert_eq!(parse_major_faults("1 (a) b) S 4 5 6 7 8 9 10 11 12 13"), Some(12));
        assert_eq!(parse_major_faults("1"), None);
        if cfg!(target_os = "linux") {
            assert!(peak_resident_bytes().unwrap() > 1 << 20);
            thread_major_faults().unwrap();
        }
    }

    #[test]
    fn a_peak_that_is_over_does_not_count() {
        if !cfg!(target_os = "linux") {
            return;
        }
        const BYTES: usize = 256 << 20;
        let is_forgotten = || {
            drop(std::hint::black_box(vec![1u8; BYTES]));
            let old = peak_resident_bytes().unwrap();
            let before = begin_peak().unwrap();
            let peak = peak_resident_bytes().unwrap();
            before <= peak && peak + (BYTES as u64 / 2) < old
        };
        // Another test of this process may begin one in between.
        assert!((0..10).any(|_| is_forgotten()));
    }
}
