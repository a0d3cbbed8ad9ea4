//! What a process takes of the machine's memory, where the system (Linux) tells.

/// Resident size of this process now.
pub fn resident_bytes() -> Option<u64> {
    of_process("self", "VmRSS:")
}

/// Largest resident size of a process so far, by its number or `self`.
pub fn peak_rss_bytes(process: &str) -> Option<u64> {
    of_process(process, "VmHWM:")
}

/// A line of what the system tells of a process.
fn of_process(process: &str, name: &str) -> Option<u64> {
    let status = std::fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    let kibibytes = status.lines().find_map(|line| line.strip_prefix(name))?.trim().strip_suffix("kB")?;
    Some(kibibytes.trim().parse::<u64>().ok()? * 1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[cfg(target_os = "linux")]
    fn a_process_knows_what_it_has() {
        let [now, peak] = [resident_bytes(), peak_rss_bytes("self")].map(|bytes| bytes.expect("is told"));
        assert!(now > 100_000 && peak >= now);
        assert_eq!(peak_rss_bytes("no process"), None);
    }
}
