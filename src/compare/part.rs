//! One part of the model and of the container in, its levels of detail measured out.

use std::sync::atomic::Ordering;

use glam::DVec3;
use rustc_hash::FxHashMap;

use super::source::Source;
use super::{
    CompareError, CompareOptions, CompareProgress, Counts, Level, Measured, PartOutcome, simplified, states,
    welded_corners,
};
use crate::container::{Container, ContainerError};
use crate::geometry::OrderedPart;
use crate::geometry::weld::WeldedMesh;
use crate::measure::{Sampling, Surface, SurfaceError, surface_error};

/// Half the side of a dot, in grid steps.
const DOT: f64 = 1e-3;

/// Compares one part at all ratios, and at what it gets of a dealt model, if that is so.
pub(super) fn compare_part(
    container: &Container<'_>,
    source: &Source,
    sampling: Sampling,
    counts: &[Counts],
    options: &CompareOptions,
    progress: &CompareProgress,
) -> Result<PartOutcome, CompareError> {
    let cells = source.cells.clone().map(|number| container.read_part(number));
    let cells = cells.collect::<Result<Vec<OrderedPart>, ContainerError>>()?;
    let welded = source.weld()?;
    let original = surface_of(&welded, &welded_corners(&welded));
    let mut part = Part { source, cells, welded, original, sampling, progress, known: FxHashMap::default() };
    let mut at = Vec::with_capacity(options.ratios.len());
    for (nth, &ratio) in options.ratios.iter().enumerate() {
        at.push(part.at_ratio(ratio, counts.get(nth).copied(), options.meshoptimizer)?);
        progress.triangles_done.fetch_add(source.triangles, Ordering::Relaxed);
    }
    let nothing_left = |measured: &Measured| {
        let mut levels = measured.dealt.iter().chain([&measured.ours]).chain(&measured.meshoptimizer);
        !measured.dealt.is_empty() && levels.any(|level| level.error.is_none())
    };
    let step = source.grid.step();
    Ok(PartOutcome {
        number: source.number,
        name: source.name.to_owned(),
        cells: part.cells.len() as u64,
        triangles: source.triangles,
        area: part.original.area() * step * step,
        diagonal: source.diagonal(),
        placed: source.placed,
        dot: if at.iter().any(nothing_left) { part.dot() } else { None },
        at,
    })
}

/// A part while it is measured. Distances are measured in steps of the grid, where nothing overflows and nothing
/// cancels.
struct Part<'a> {
    source: &'a Source<'a>,
    cells: Vec<OrderedPart>,
    welded: WeldedMesh,
    original: Surface,
    sampling: Sampling,
    progress: &'a CompareProgress,
    /// What has been measured: meshoptimizer's by the count that it was asked for, ours by its states.
    known: FxHashMap<Key, Level>,
}

#[derive(Debug, Clone, PartialEq, Eq, Hash)]
enum Key {
    Ours(Vec<u32>),
    Meshoptimizer(u64),
}

impl Part<'_> {
    fn at_ratio(
        &mut self,
        ratio: f64,
        counts: Option<Counts>,
        meshoptimizer: bool,
    ) -> Result<Measured, CompareError> {
        let states = states::nearest(&self.cells, ratio);
        let stated = states::stated_error(&self.cells, &states);
        let ours = self.ours(states)?;
        let other = if meshoptimizer { Some(self.meshoptimizer(ours.triangles)?) } else { None };
        let dealt = counts.map_or_else(|| Ok(Vec::new()), |counts| self.dealt(counts))?;
        Ok(Measured { ours, meshoptimizer: other, stated, dealt })
    }

    /// Ours at its count, and meshoptimizer's at its own and at that of ours.
    fn dealt(&mut self, counts: Counts) -> Result<Vec<Level>, CompareError> {
        let share = counts.cost as f64 / self.source.triangles.max(1) as f64;
        let ours = match counts.cost {
            0 => Level::default(),
            _ => self.ours(states::nearest(&self.cells, share))?,
        };
        let Some(error) = counts.error else { return Ok(vec![ours]) };
        Ok(vec![ours, self.meshoptimizer_or_nothing(error)?, self.meshoptimizer_or_nothing(ours.triangles)?])
    }

    fn meshoptimizer_or_nothing(&mut self, wanted: u64) -> Result<Level, CompareError> {
        if wanted == 0 { Ok(Level::default()) } else { self.meshoptimizer(wanted) }
    }

    fn ours(&mut self, states: Vec<u32>) -> Result<Level, CompareError> {
        if let Some(&level) = self.known.get(&Key::Ours(states.clone())) {
            return Ok(level);
        }
        let (positions, triangles) = reformed(&self.cells, &states);
        let level = self.level(&Surface::new(&positions, &triangles), triangles.len())?;
        self.known.insert(Key::Ours(states), level);
        Ok(level)
    }

    fn meshoptimizer(&mut self, wanted: u64) -> Result<Level, CompareError> {
        if let Some(&level) = self.known.get(&Key::Meshoptimizer(wanted)) {
            return Ok(level);
        }
        let triangles = simplified(&self.welded, wanted as usize);
        let level = self.level(&surface_of(&self.welded, &triangles), triangles.len())?;
        self.known.insert(Key::Meshoptimizer(wanted), level);
        Ok(level)
    }

    fn level(&self, surface: &Surface, triangles: usize) -> Result<Level, CompareError> {
        let level = Level { triangles: triangles as u64, error: self.error(surface) };
        self.progress.check()?;
        Ok(level)
    }

    fn error(&self, surface: &Surface) -> Option<SurfaceError> {
        let stopped = || self.progress.stopped();
        let error = surface_error(&self.original, surface, self.sampling, &stopped);
        error.map(|error| error.scaled(self.source.grid.step()))
    }

    /// How far a dot in the middle is from the part.
    fn dot(&self) -> Option<SurfaceError> {
        let middle = self.source.grid_middle();
        let corners = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| middle + DOT * axis);
        self.error(&Surface::new(&corners, &[[0, 1, 2]]))
    }
}

/// A surface of a welded mesh's positions, in steps of the grid.
fn surface_of(welded: &WeldedMesh, triangles: &[[u32; 3]]) -> Surface {
    let positions: Vec<DVec3> = welded.positions.iter().map(|&grid| on_grid(grid)).collect();
    Surface::new(&positions, triangles)
}

fn on_grid(grid: [u32; 3]) -> DVec3 {
    DVec3::from_array(grid.map(f64::from))
}

/// All cells at the given states as one mesh, in steps of their common grid.
fn reformed(cells: &[OrderedPart], counts: &[u32]) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for (cell, &vn) in cells.iter().zip(counts) {
        let base = positions.len() as u32;
        positions.extend(cell.vertices[..vn as usize].iter().map(|vertex| on_grid(vertex.grid())));
        triangles.extend(cell.reformed(vn).iter().map(|t| t.map(|vertex| base + u32::from(vertex))));
    }
    (positions, triangles)
}
