//! Memory: predicted need of an image, and available memory.

use super::progress;
use anyhow::bail;
use lumiris::import::memory::{MemoryLimit as Limit, kibibytes, peak_resident, resident, size};
use lumiris::render::memory::Prediction;
use lumiris::settings::Value;
use lumiris::settings::value::Kind;
use std::fs;
use std::path::{Path, PathBuf};

/// Value of `--memory-limit`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum MemoryLimit {
    /// Limit of the process (bytes).
    Bytes(u64),
    /// No limit.
    Off,
}

/// Parses sizes in the same format as settings, and `off`.
pub(super) fn parse_limit(text: &str) -> Result<MemoryLimit, String> {
    if text == "off" {
        return Ok(MemoryLimit::Off);
    }
    match Kind::Bytes.parse(text) {
        Ok(Value::Integer(bytes)) => Ok(MemoryLimit::Bytes(bytes)),
        Ok(_) => Err("expected a number of bytes".to_owned()),
        Err(expected) => Err(format!("{expected}, or off")),
    }
}

/// The limit of this process: the given one, or else the memory of the machine and its control groups.
pub(super) fn limit(given: Option<MemoryLimit>) -> Option<Limit> {
    match given {
        Some(MemoryLimit::Off) => None,
        Some(MemoryLimit::Bytes(bytes)) => Some(Limit { bytes, origin: "--memory-limit allows".to_owned() }),
        None => available().map(|Available { bytes, source }| Limit {
            bytes: resident() + bytes,
            origin: format!("there is ({source})"),
        }),
    }
}

/// Refuses an image that does not fit in memory.
pub(super) fn check(limit: Option<MemoryLimit>, prediction: &Prediction) -> anyhow::Result<()> {
    // Warn if loading exceeded the limit
    let (taken, most) = (resident(), peak_resident());
    if let Some(MemoryLimit::Bytes(bytes)) = limit
        && bytes < most
    {
        progress::say(&format!(
            "warning: loading the scene took {}, more than the {} that --memory-limit allows",
            size(most),
            size(bytes)
        ));
    }

    let Some(Limit { bytes: limit, origin }) = self::limit(limit) else { return Ok(()) };

    // Compare it with the need
    let needed = taken + prediction.bytes();
    if needed > limit {
        bail!(
            "the image would need about {} ({needed} bytes): {} for the scene, {} for the film, {} for the rest. This is \
             more than the {} that {origin}. --crop, --aov none and a lower --resolution need less, `--part-by tiles` \
             divides it; `--memory-limit SIZE|off` sets another limit",
            size(needed),
            size(taken),
            size(prediction.film),
            size(prediction.output + prediction.fixed),
            size(limit)
        );
    }
    Ok(())
}

/// Available memory.
struct Available {
    bytes: u64,
    source: String,
}

/// The available memory of the machine, or less if a control group limits it.
fn available() -> Option<Available> {
    let text = fs::read_to_string("/proc/meminfo").ok()?;
    let bytes = kibibytes(&text, "MemAvailable:")?;
    let machine = Available { bytes, source: "MemAvailable of /proc/meminfo".to_owned() };
    let groups = group_folders().into_iter().filter_map(|folder| {
        Some(Available { bytes: left_in(&folder)?, source: format!("the control group {}", folder.display()) })
    });
    groups.chain([machine]).min_by_key(|available| available.bytes)
}

/// Folders of this process's control group (version 2) and of its ancestors.
fn group_folders() -> Vec<PathBuf> {
    let Ok(text) = fs::read_to_string("/proc/self/cgroup") else { return Vec::new() };
    let Some(group) = text.lines().find_map(|line| line.strip_prefix("0::/")) else { return Vec::new() };
    let root = Path::new("/sys/fs/cgroup");
    let own = root.join(group);
    own.ancestors().take_while(|folder| folder.starts_with(root)).map(Path::to_path_buf).collect()
}

/// Bytes left in a control group. Inactive file pages do not count as used.
fn left_in(folder: &Path) -> Option<u64> {
    let number = |name: &str| fs::read_to_string(folder.join(name)).ok()?.trim().parse::<u64>().ok();
    let (max, current) = (number("memory.max")?, number("memory.current")?);
    let stat = fs::read_to_string(folder.join("memory.stat")).unwrap_or_default();
    let files = stat.lines().find_map(|line| line.strip_prefix("inactive_file ")?.trim().parse().ok()).unwrap_or(0);
    Some(max.saturating_sub(current.saturating_sub(files)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_have_units() {
        assert_eq!(parse_limit("24GB"), Ok(MemoryLimit::Bytes(24 << 30)));
        assert_eq!(parse_limit("1.5 MiB"), Ok(MemoryLimit::Bytes(3 << 19)));
        assert_eq!(parse_limit("off"), Ok(MemoryLimit::Off));
        for text in ["GB", "-1GB", "x MB", "1GBs", ""] {
            assert!(parse_limit(text).is_err(), "{text}");
        }
        assert_eq!([size(3 << 19), size(47 << 29)], ["1.5 MiB", "23.5 GiB"]);
    }

    #[test]
    fn what_does_not_fit_is_refused_with_its_bytes() {
        let prediction = Prediction { film: 1 << 40, output: 5, fixed: 7 };
        let error = check(Some(MemoryLimit::Bytes(1 << 40)), &prediction).unwrap_err().to_string();
        assert!(error.contains("1024.0 GiB for the film") && error.contains("--memory-limit allows"), "{error}");
        assert!(check(Some(MemoryLimit::Off), &prediction).is_ok());
        let tiny = Prediction { film: 1, output: 1, fixed: 1 };
        assert!(check(Some(MemoryLimit::Bytes(1 << 40)), &tiny).is_ok());
    }

    #[test]
    fn a_control_group_leaves_what_is_neither_taken_nor_inactive() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| fs::write(folder.path().join(name), text).unwrap();
        write("memory.current", "700\n");
        write("memory.max", "max\n");
        assert_eq!(left_in(folder.path()), None);
        write("memory.max", "1000\n");
        write("memory.stat", "anon 5\ninactive_file 100\n");
        assert_eq!(left_in(folder.path()), Some(400));
    }
}
