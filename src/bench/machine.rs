//! The machine of a benchmark.

use serde::{Deserialize, Serialize};

/// Properties of the machine that affect timings.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Machine {
    /// Name of the processor, or its architecture if the system does not report the name.
    pub cpu: String,
    /// Number of threads that this process may run at once (respecting affinity and quotas).
    pub cores: usize,
    /// Graphics adapter, if used.
    pub adapter: Option<String>,
}

impl Machine {
    /// This machine, without adapter.
    pub fn detect() -> Self {
        let info = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
        Self {
            cpu: cpu_name(&info).unwrap_or_else(|| std::env::consts::ARCH.to_owned()),
            cores: std::thread::available_parallelism().map_or(1, std::num::NonZero::get),
            adapter: None,
        }
    }
}

/// Name of the first processor in the text of `/proc/cpuinfo`: `model name` on x86, `Model` or `Hardware` on ARM boards,
/// `cpu` on POWER.
fn cpu_name(info: &str) -> Option<String> {
    let entry = |wanted: &str| {
        let lines = info.lines().filter_map(|line| line.split_once(':'));
        let mut found = lines.filter(|(key, _)| key.trim() == wanted).map(|(_, name)| name.trim());
        // An empty entry is none.
        found.find(|name| !name.is_empty()).map(str::to_owned)
    };
    ["model name", "Model", "Hardware", "cpu"].into_iter().find_map(entry)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cpu_is_named_on_x86_arm_and_power() {
        let x86 = "processor\t: 0\nvendor_id\t: AuthenticAMD\nmodel\t\t: 17\nmodel name\t: AMD EPYC: 9R14\n\nprocessor\t: 1\nmodel name\t: other\n";
        assert_eq!(cpu_name(x86).as_deref(), Some("AMD EPYC: 9R14"));
        assert_eq!(
            cpu_name("processor\t: 0\nCPU part\t: 0xd08\nModel\t\t: Raspberry Pi 4\n").as_deref(),
            Some("Raspberry Pi 4")
        );
        assert_eq!(cpu_name("cpu\t\t: POWER9, altivec\n").as_deref(), Some("POWER9, altivec"));
    }

    #[test]
    fn text_without_a_name_gives_none_and_detection_falls_back() {
        for text in ["", "model name\n", "model name\t: \n", "processor : 0"] {
            assert_eq!(cpu_name(text), None, "{text:?}");
        }
        let here = Machine::detect();
        assert!(!here.cpu.is_empty() && here.cores >= 1);
    }
}
