//! `collapsar bandwidth`: the graphics adapter in, its limits and how fast its memory moves bytes out.

use clap::Args;
use collapsar::gpu::bandwidth::measure;
use collapsar::gpu::{Gpu, GpuOptions};
use collapsar::stats::adapter::AdapterReport;
use collapsar::stats::report::human;

use super::{Failure, output};

/// Arguments of `bandwidth`.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  collapsar bandwidth --json\n\n\
    The copy rate counts bytes read and bytes written. No pass of a frame is faster than the bytes that it must move \
    (floor_bytes of fly's summary.json) at that rate.")]
pub struct BandwidthArguments {
    /// Print it as JSON.
    #[arg(long)]
    json: bool,
}

/// Runs `bandwidth`.
pub fn run(arguments: &BandwidthArguments) -> Result<(), Failure> {
    let gpu = Gpu::new(&GpuOptions::default())?;
    let report = AdapterReport::new(&gpu, measure(&gpu)?);
    if arguments.json { output::print_json(&report) } else { output::print_text(&describe(&report)) }
}

fn describe(report: &AdapterReport) -> String {
    let rates = &report.bytes_per_second;
    let line = |what: &str, best: f64, median: f64, note: &str| {
        format!("{what:<12} {:.1} GB/s ({:.1} median), {note}", best / 1e9, median / 1e9)
    };
    let software = if report.is_software { ": SOFTWARE, its rates are those of the processor" } else { "" };
    [
        format!(
            "adapter      {} ({}, {}, {}){software}",
            report.adapter, report.driver, report.backend, report.kind
        ),
        format!(
            "limits       buffers of {}, bindings of {}",
            human::bytes(report.largest_buffer_bytes),
            human::bytes(report.largest_binding_bytes)
        ),
        line("copy", rates.copy_best, rates.copy_median, "on the GPU, read and written bytes"),
        line("upload", rates.upload_best, rates.upload_median, "from a mapped buffer to one of the GPU"),
        line("write", rates.write_best, rates.write_median, "into a mapped buffer, by all threads"),
        format!("measured     {} times with buffers of {}", rates.runs, human::bytes(rates.buffer_bytes)),
    ]
    .join("\n")
}
