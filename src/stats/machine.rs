//! What a flight ran on: the processor, its memory, and the command that was typed.

/// Everything is `None` where the system does not tell.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Machine {
    /// The processor's name.
    pub cpu: Option<String>,
    /// How many threads may run at once.
    pub cores: Option<u64>,
    /// Main memory in bytes.
    pub memory_bytes: Option<u64>,
}

impl Machine {
    /// This machine, from `/proc` where there is one.
    pub fn this() -> Self {
        let file = |name| std::fs::read_to_string(name).unwrap_or_default();
        Self {
            cpu: parse_cpu(&file("/proc/cpuinfo")),
            cores: std::thread::available_parallelism().ok().map(|cores| cores.get() as u64),
            memory_bytes: parse_memory(&file("/proc/meminfo")),
        }
    }
}

fn parse_cpu(info: &str) -> Option<String> {
    let line = info.lines().find(|line| line.starts_with("model name"))?;
    let name = line.split_once(':')?.1.split_whitespace().collect::<Vec<_>>().join(" ");
    (!name.is_empty()).then_some(name)
}

fn parse_memory(info: &str) -> Option<u64> {
    let line = info.lines().find_map(|line| line.strip_prefix("MemTotal:"))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()?.checked_mul(1024)
}

/// The command line of this process such that a shell would read it as it was typed; the program is `collapsar`,
/// wherever it lies.
pub fn command_line() -> String {
    let arguments = std::env::args_os().skip(1).map(|argument| quoted(&argument.to_string_lossy()));
    std::iter::once("collapsar".to_owned()).chain(arguments).collect::<Vec<_>>().join(" ")
}

/// In single quotes if a shell would take any of it for more than letters.
fn quoted(argument: &str) -> String {
    let plain = |c: char| c.is_alphanumeric() || "-_./,:=+%@".contains(c);
    if !argument.is_empty() && argument.chars().all(plain) {
        argument.to_owned()
    } else {
        format!("'{}'", argument.replace('\'', r"'\''"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_processor_and_its_memory_are_parsed() {
        let info = "processor\t: 0\nmodel name\t: Some  CPU @ 2.5GHz\nmodel name\t: other\n";
        assert_eq!(parse_cpu(info).as_deref(), Some("Some CPU @ 2.5GHz"));
        assert_eq!(parse_cpu("model name\t: \n"), None);
        assert_eq!(parse_memory("MemFree: 1 kB\nMemTotal:       2048 kB\n"), Some(2 << 20));
        assert_eq!(parse_memory("MemTotal: many kB"), None);
        if cfg!(target_os = "linux") {
            assert!(Machine::this().memory_bytes.unwrap() > 1 << 28);
        }
        assert!(Machine::this().cores.unwrap() > 0);
    }

    #[test]
    fn arguments_are_quoted_where_a_shell_needs_it() {
        let typed = ["--path", "a b", "it's", "", "$x", "1280x720", "f=50%"];
        let quoted = typed.map(quoted);
        assert_eq!(quoted, ["--path", "'a b'", r"'it'\''s'", "''", "'$x'", "1280x720", "f=50%"]);
        assert!(command_line().starts_with("collapsar"));
    }
}
