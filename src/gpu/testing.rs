//! A device for tests, and the log by which a test run says how many GPU tests ran and on which adapter.
//!
//! A GPU test that finds no adapter fails, unless the environment says by `COLLAPSAR_NO_GPU=1` that this machine has
//! none; then it is reported as skipped. Each GPU test adds a line to the file named by `COLLAPSAR_GPU_TEST_LOG`, which
//! `make test` counts.

use std::io::Write;

/// Says that this machine has no adapter, so that GPU tests may be skipped.
pub const NO_GPU_VARIABLE: &str = "COLLAPSAR_NO_GPU";
/// Names the file to which every GPU test adds a line: `ran` or `skipped`, the test, the adapter, with tabs between.
pub const LOG_VARIABLE: &str = "COLLAPSAR_GPU_TEST_LOG";

/// A device with what the adapter offers.
#[derive(Debug)]
pub struct TestDevice {
    /// The adapter's name and driver.
    pub adapter: String,
    /// The device.
    pub device: wgpu::Device,
    /// Its queue.
    pub queue: wgpu::Queue,
}

/// The device for the test called `test`; `None` means that the test is to be skipped, and it has been said.
///
/// # Panics
/// When there is no adapter and the environment does not say that there is none.
pub fn device(test: &str) -> Option<TestDevice> {
    match pollster::block_on(request()) {
        Ok(found) => {
            log_run(test, Some(&found.adapter));
            Some(found)
        }
        Err(_) if std::env::var(NO_GPU_VARIABLE).is_ok_and(|value| value == "1") => {
            eprintln!("skipped: {test}: {NO_GPU_VARIABLE}=1");
            log_run(test, None);
            None
        }
        Err(error) => panic!("{test} needs a GPU adapter; set {NO_GPU_VARIABLE}=1 if there is none: {error}"),
    }
}

/// Adds the line of a test to the log: the adapter that it ran on, or `None` if it was skipped.
pub fn log_run(test: &str, adapter: Option<&str>) {
    let Some(path) = std::env::var_os(LOG_VARIABLE) else { return };
    let line = match adapter {
        Some(adapter) => format!("ran\t{test}\t{adapter}\n"),
        None => format!("skipped\t{test}\t-\n"),
    };
    // One write of one short line: tests of several processes do not mix theirs.
    let written = std::fs::OpenOptions::new().create(true).append(true).open(&path);
    if let Err(error) = written.and_then(|mut log| log.write_all(line.as_bytes())) {
        eprintln!("cannot add to the log of GPU tests ({error}): {}", path.display());
    }
}

async fn request() -> Result<TestDevice, Box<dyn std::error::Error>> {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle_from_env());
    let adapter = instance.request_adapter(&wgpu::RequestAdapterOptions::default()).await?;
    let info = adapter.get_info();
    let (device, queue) = adapter
        .request_device(&wgpu::DeviceDescriptor {
            label: Some("test device"),
            required_limits: adapter.limits(),
            ..Default::default()
        })
        .await?;
    Ok(TestDevice {
        adapter: format!("{} ({} {})", info.name, info.backend, info.driver_info),
        device,
        queue,
    })
}
