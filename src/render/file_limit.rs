//! What a limit on the size of files (`ulimit -f`) does to a graphics driver.

/// Mesa's software driver keeps all graphics memory in one nameless file since this release. Where that may not grow the process is
/// killed (SIGBUS), so it must not come to that.
const FIRST_MESA_WITH_A_FILE: u32 = 23;
/// More than a scene of a table takes.
const ENOUGH: u64 = 1 << 30;

/// What is wrong with a process's limit on files, if an adapter's driver cannot work within it.
pub(super) fn complaint(info: &wgpu::AdapterInfo, limit: Option<u64>) -> Option<String> {
    let limit = limit.filter(|&limit| limit < ENOUGH)?;
    let is_software = info.device_type == wgpu::DeviceType::Cpu;
    let has_file = mesa_release(&info.driver_info)? >= FIRST_MESA_WITH_A_FILE;
    (is_software && has_file).then(|| {
        format!(
            "its driver keeps graphics memory in a file, and files of this process may be no larger than {} kB: \
             file too large; allow 1 GB (ulimit -f {})",
            limit / 1024,
            ENOUGH / 1024
        )
    })
}

/// 25 of "Mesa 25.0.7-2 (LLVM 19.1.7)".
fn mesa_release(driver_info: &str) -> Option<u32> {
    let version = driver_info.strip_prefix("Mesa ")?;
    version.split('.').next()?.parse().ok()
}

/// The largest file that this process may make, bytes; `None`: any.
pub(super) fn of_process() -> Option<u64> {
    #[cfg(unix)]
    return rustix::process::getrlimit(rustix::process::Resource::Fsize).current;
    #[cfg(not(unix))]
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_small_limit_is_a_fault_where_the_driver_has_its_memory_in_a_file() {
        let adapter = |device_type, driver_info: &str| wgpu::AdapterInfo {
            driver_info: driver_info.to_owned(),
            ..wgpu::AdapterInfo::new(device_type, wgpu::Backend::Vulkan)
        };
        let software = adapter(wgpu::DeviceType::Cpu, "Mesa 25.0.7-2+deb13u1 (LLVM 19.1.7)");
        let before = adapter(wgpu::DeviceType::Cpu, "Mesa 22.3.6 (LLVM 15.0.6)");
        let card = adapter(wgpu::DeviceType::DiscreteGpu, "Mesa 25.0.7");
        let small = Some(40 << 20);
        let told = complaint(&software, small).expect("a complaint");
        assert!(told.contains("40960 kB"), "{told}");
        assert_eq!(complaint(&software, None), None);
        assert_eq!(complaint(&software, Some(ENOUGH)), None);
        assert_eq!(complaint(&before, small), None);
        assert_eq!(complaint(&card, small), None);
    }
}
