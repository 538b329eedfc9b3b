//! How much memory the process has taken at most, and how often a thread waited for a page of it.

/// The peak resident size of this process in bytes, from `VmHWM` of `/proc/self/status`; `None` where there is none.
pub fn peak_resident_bytes() -> Option<u64> {
    parse_peak(&std::fs::read_to_string("/proc/self/status").ok()?)
}

/// How many pages this thread has waited for, from field 12 of `/proc/thread-self/stat`; `None` where there is none.
pub fn thread_major_faults() -> Option<u64> {
    parse_major_faults(&std::fs::read_to_string("/proc/thread-self/stat").ok()?)
}

fn parse_major_faults(stat: &str) -> Option<u64> {
    // The name of the program, in brackets, may hold anything.
    stat.rsplit_once(')')?.1.split_ascii_whitespace().nth(9)?.parse().ok()
}

fn parse_peak(status: &str) -> Option<u64> {
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()?.checked_mul(1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_peak_is_parsed() {
        assert_eq!(parse_peak("VmPeak:\t  9 kB\nVmHWM:\t   12 kB\n"), Some(12 * 1024));
        assert_eq!(parse_peak("VmHWM:\t 99999999999999999999 kB"), None);
        assert_eq!(parse_peak(""), None);
        assert_eq!(parse_major_faults("1 (a) b) S 4 5 6 7 8 9 10 11 12 13"), Some(12));
        assert_eq!(parse_major_faults("1"), None);
        if cfg!(target_os = "linux") {
            assert!(peak_resident_bytes().unwrap() > 1 << 20);
            thread_major_faults().unwrap();
        }
    }
}
