//! `collapsar info`: what a container holds, from its tables alone.

use std::collections::BTreeMap;
use std::path::PathBuf;

use clap::Args;
use collapsar::container::{Container, Form, PartRow};
use collapsar::geometry::record::Stall;
use collapsar::scene::SceneError;
use collapsar::scene::mapped::MappedFile;
use collapsar::stats::report::human;
use serde::Serialize;

use super::bake::printable;
use super::{Failure, output};

/// Arguments of `info`.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  collapsar info engine.clps\n  collapsar info engine.clps --json --parts"
)]
pub struct InfoArguments {
    /// The container.
    file: PathBuf,
    /// Print JSON.
    #[arg(long)]
    json: bool,
    /// One line (or object) a part as well.
    #[arg(long)]
    parts: bool,
}

/// What a container holds.
#[derive(Debug, Serialize)]
struct Info {
    format_version: u32,
    parts: u64,
    cells: u64,
    instances: u64,
    nodes: u64,
    materials: u64,
    vertices: u64,
    triangles: u64,
    triangles_placed: u64,
    locked_vertices: u64,
    coarsest_triangles: u64,
    file_bytes: u64,
    bytes_per_triangle: f64,
    section_bytes: BTreeMap<&'static str, u64>,
    compressed_chunks: u64,
    decoded_bytes: u64,
    tiers: Vec<TierInfo>,
    stalled_parts: u64,
    #[serde(skip_serializing_if = "Option::is_none")]
    part_list: Option<Vec<PartInfo>>,
}

/// All chunks of one tier, counted from the finest.
#[derive(Debug, Default, Clone, Serialize)]
struct TierInfo {
    tier: usize,
    chunks: u64,
    vertices: u64,
    triangles: u64,
    bytes: u64,
    decoded_bytes: u64,
}

#[derive(Debug, Serialize)]
struct PartInfo {
    name: String,
    vertices: u32,
    triangles: u32,
    tiers: u32,
    locked_vertices: u32,
    coarsest_triangles: u32,
    cell: bool,
    parent_distance: u32,
    leaf_cells: u32,
    stall: &'static str,
}

/// Runs `info`.
pub fn run(arguments: &InfoArguments) -> Result<(), Failure> {
    let file = MappedFile::open(&arguments.file).map_err(SceneError::from)?;
    let container = Container::open(file.bytes())
        .map_err(|cause| SceneError::Container { cause, path: arguments.file.clone() })?;
    let info = gather(&container, file.bytes().len() as u64, arguments.parts);
    if arguments.json {
        return output::print_json(&info);
    }
    output::print_text(&describe(&info))
}

fn gather(container: &Container<'_>, file_bytes: u64, with_parts: bool) -> Info {
    let parts = container.parts();
    let sum = |which: fn(&PartRow) -> bool, value: fn(&PartRow) -> u32| {
        parts.iter().filter(|&part| which(part)).map(|part| u64::from(value(part))).sum::<u64>()
    };
    let is_leaf = |part: &PartRow| !part.is_parent();
    let triangles = sum(is_leaf, |part| part.triangles);
    let first_cell = |part: usize| part == 0 || parts[part].source != parts[part - 1].source;
    let placed = container.instances().iter().map(|instance| instance.part as usize);
    let mut section_bytes: BTreeMap<&'static str, u64> =
        container.section_bytes().into_iter().map(|(kind, bytes)| (kind.name(), bytes)).collect();
    section_bytes.insert("payload", container.header().payload_bytes);
    let tiers = tiers(container);
    let chunks = || (0..parts.len()).flat_map(|part| container.chunk_rows(part));
    Info {
        format_version: container.header().version,
        parts: (0..parts.len()).filter(|&part| first_cell(part)).count() as u64,
        cells: parts.len() as u64,
        instances: placed.clone().filter(|&part| first_cell(part)).count() as u64,
        nodes: container.nodes().len() as u64,
        materials: container.materials().len() as u64,
        vertices: sum(is_leaf, |part| part.vertices),
        triangles,
        triangles_placed: placed
            .filter(|&part| is_leaf(&parts[part]))
            .map(|part| u64::from(parts[part].triangles))
            .sum(),
        locked_vertices: sum(PartRow::is_root, |part| part.locked),
        coarsest_triangles: sum(PartRow::is_root, |part| part.coarsest_triangles),
        file_bytes,
        bytes_per_triangle: file_bytes as f64 / triangles.max(1) as f64,
        section_bytes,
        compressed_chunks: chunks().filter(|row| row.form() == Some(Form::Compressed)).count() as u64,
        decoded_bytes: tiers.iter().map(|tier| tier.decoded_bytes).sum(),
        tiers,
        stalled_parts: parts.iter().filter(|part| part.stall() != Stall::None).count() as u64,
        part_list: with_parts.then(|| part_list(container)),
    }
}

fn tiers(container: &Container<'_>) -> Vec<TierInfo> {
    let mut tiers: Vec<TierInfo> = Vec::new();
    for part in 0..container.parts().len() {
        let rows = container.chunk_rows(part);
        for (tier, row) in rows.iter().enumerate() {
            if tiers.len() <= tier {
                tiers.push(TierInfo { tier, ..TierInfo::default() });
            }
            let total = &mut tiers[tier];
            total.chunks += 1;
            total.vertices += u64::from(row.vertices);
            total.triangles += u64::from(row.triangles);
            total.bytes += u64::from(row.bytes);
            let below = rows.get(tier + 1).map_or(0, |coarser| coarser.vertices);
            total.decoded_bytes += row.plain_bytes(row.vertices - below);
        }
    }
    tiers
}

fn part_list(container: &Container<'_>) -> Vec<PartInfo> {
    let rows = container.parts().iter().enumerate();
    rows.map(|(number, part)| PartInfo {
        name: container.part_name(number).to_owned(),
        vertices: part.vertices,
        triangles: part.triangles,
        tiers: part.tier_count,
        locked_vertices: part.locked,
        coarsest_triangles: part.coarsest_triangles,
        cell: part.is_cell(),
        parent_distance: part.parent_distance,
        leaf_cells: part.leaf_cells,
        stall: part.stall().describe(),
    })
    .collect()
}

fn describe(info: &Info) -> String {
    let count = human::count;
    let mut lines = vec![
        format!("format       version {}", info.format_version),
        format!(
            "parts        {} ({} cells), placed {} times",
            count(info.parts),
            count(info.cells),
            count(info.instances)
        ),
        format!("assembly     {} nodes, {} materials", count(info.nodes), count(info.materials)),
        format!("triangles    {} ({} placed)", count(info.triangles), count(info.triangles_placed)),
        format!("vertices     {}, {} of them locked", count(info.vertices), count(info.locked_vertices)),
        format!(
            "coarsest     {} triangles, {} parts stalled above a tenth",
            count(info.coarsest_triangles),
            count(info.stalled_parts)
        ),
        format!(
            "file         {} ({:.1} bytes/triangle)",
            human::bytes(info.file_bytes),
            info.bytes_per_triangle
        ),
        format!(
            "chunks       {}, {} of them compressed; {} in memory",
            count(info.tiers.iter().map(|tier| tier.chunks).sum()),
            count(info.compressed_chunks),
            human::bytes(info.decoded_bytes)
        ),
    ];
    lines.extend(
        info.section_bytes.iter().map(|(name, bytes)| format!("  {name:<10} {:>12}", human::bytes(*bytes))),
    );
    lines.extend(info.tiers.iter().map(|tier| {
        format!(
            "tier {}       {:>8} chunks {:>14} vertices {:>14} triangles {:>12}, {:>12} in memory",
            tier.tier,
            count(tier.chunks),
            count(tier.vertices),
            count(tier.triangles),
            human::bytes(tier.bytes),
            human::bytes(tier.decoded_bytes)
        )
    }));
    for part in info.part_list.iter().flatten() {
        lines.push(format!(
            "part         {:<50} {:>10} vertices {:>10} triangles {:>2} tiers, coarsest {:>7} triangles, stall: {}",
            printable(&part.name),
            count(part.vertices.into()),
            count(part.triangles.into()),
            part.tiers,
            count(part.coarsest_triangles.into()),
            part.stall
        ));
    }
    lines.join("\n")
}
