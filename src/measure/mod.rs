//! Two triangle meshes in, how far their surfaces lie apart out.
//!
//! The measure: points uniform by area on each [`Surface`] (stratified along the cumulated area), for each the exact
//! closest point on the triangles of the other, and in the maximum the vertices too, where a Hausdorff distance is
//! usually attained. Both ways, because one way sees what was lost and the other what was invented. Cignoni et al.
//! 1998, *Metro: measuring error on simplified surfaces*. Results do not depend on the number of threads.

mod closest;
mod surface;

use glam::DVec3;
use rayon::prelude::*;

pub use surface::Surface;

/// At most about this many vertices of each mesh join the samples for the maximum.
pub const VERTEX_CAP: usize = 500_000;

/// Points that are looked up one after another, each starting from where the last was found.
const RUN: usize = 4096;

/// How to measure.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sampling {
    /// Points on each surface; at least one is taken.
    pub samples: usize,
    /// The same seed gives the same points.
    pub seed: u64,
    /// Whether to use all threads of the current pool.
    pub parallel: bool,
}

/// Distances and angles from one surface to another; distances in the unit of the positions.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct OneWay {
    /// Root of the mean squared distance of the samples.
    pub rms: f64,
    /// Mean distance of the samples.
    pub mean: f64,
    /// The distance that 99 % of the samples do not exceed.
    pub p99: f64,
    /// Greatest distance of samples and vertices.
    pub max: f64,
    /// Mean angle between the normals at a sample and at its closest point, 0 to 180 degrees.
    pub normal_degrees: f64,
}

/// Distances and angles between two surfaces.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SurfaceError {
    /// From the reference to the test: sees what was lost.
    pub lost: OneWay,
    /// From the test to the reference: sees what was invented.
    pub invented: OneWay,
}

impl SurfaceError {
    /// The greater RMS distance of both ways.
    pub fn rms(&self) -> f64 {
        self.lost.rms.max(self.invented.rms)
    }

    /// The greater mean distance of both ways.
    pub fn mean(&self) -> f64 {
        self.lost.mean.max(self.invented.mean)
    }

    /// The greater 99th percentile of both ways.
    pub fn p99(&self) -> f64 {
        self.lost.p99.max(self.invented.p99)
    }

    /// The greatest distance of both ways.
    pub fn max(&self) -> f64 {
        self.lost.max.max(self.invented.max)
    }

    /// The mean angle between normals, over both ways, in degrees.
    pub fn normal_degrees(&self) -> f64 {
        (self.lost.normal_degrees + self.invented.normal_degrees) / 2.0
    }

    /// The same with all distances in another unit.
    #[must_use]
    pub fn scaled(self, factor: f64) -> Self {
        Self { lost: self.lost.scaled(factor), invented: self.invented.scaled(factor) }
    }
}

impl OneWay {
    fn scaled(self, factor: f64) -> Self {
        let [rms, mean, p99, max] = [self.rms, self.mean, self.p99, self.max].map(|length| length * factor);
        Self { rms, mean, p99, max, ..self }
    }
}

/// Measures both ways; `None` if a surface has no triangle with an area, or if `stopped` became true.
pub fn surface_error(
    reference: &Surface,
    test: &Surface,
    sampling: Sampling,
    stopped: &(dyn Fn() -> bool + Sync),
) -> Option<SurfaceError> {
    let second = Sampling { seed: sampling.seed.wrapping_add(1), ..sampling };
    let lost = one_way(reference, test, sampling, stopped)?;
    let invented = one_way(test, reference, second, stopped)?;
    Some(SurfaceError { lost, invented })
}

fn one_way(
    from: &Surface,
    to: &Surface,
    sampling: Sampling,
    stopped: &(dyn Fn() -> bool + Sync),
) -> Option<OneWay> {
    if from.triangle_count() == 0 || to.triangle_count() == 0 {
        return None;
    }
    let samples = from.samples(sampling.samples.max(1), sampling.seed);
    let points: Vec<DVec3> = samples.iter().map(|&(point, _)| point).collect();
    let hits = look_up(&points, to, sampling.parallel, stopped)?;
    let corners = from.corners(VERTEX_CAP);
    let at_corners = look_up(&corners, to, sampling.parallel, stopped)?;
    let angles = samples.iter().zip(&hits).map(|(&(_, triangle), hit)| {
        from.normal(triangle).dot(to.normal(hit.triangle)).clamp(-1.0, 1.0).acos().to_degrees()
    });
    let normal_degrees = angles.sum::<f64>() / samples.len() as f64;
    let mut distances: Vec<f64> = hits.iter().map(|hit| hit.squared.sqrt()).collect();
    let corner_max = at_corners.iter().map(|hit| hit.squared.sqrt()).fold(0.0, f64::max);
    Some(summed(&mut distances, corner_max, normal_degrees))
}

/// The closest triangle of `to` for every point.
fn look_up(
    points: &[DVec3],
    to: &Surface,
    parallel: bool,
    stopped: &(dyn Fn() -> bool + Sync),
) -> Option<Vec<closest::Hit>> {
    let run = |points: &[DVec3]| (!stopped()).then(|| to.closest_of(points));
    let runs: Option<Vec<Vec<closest::Hit>>> = if parallel {
        points.par_chunks(RUN).map(run).collect()
    } else {
        points.chunks(RUN).map(run).collect()
    };
    runs.map(|runs| runs.concat())
}

/// The figures of one way from the distances of at least one sample.
fn summed(distances: &mut [f64], corner_max: f64, normal_degrees: f64) -> OneWay {
    let count = distances.len() as f64;
    let max = distances.iter().copied().fold(corner_max, f64::max);
    let mean = distances.iter().sum::<f64>() / count;
    let rms = (distances.iter().map(|d| d * d).sum::<f64>() / count).sqrt();
    // As numpy's percentile: linear between the two samples that it falls between.
    let place = 0.99 * (count - 1.0);
    let (_, &mut low, above) = distances.select_nth_unstable_by(place.floor() as usize, f64::total_cmp);
    let next = above.iter().copied().fold(f64::INFINITY, f64::min);
    let p99 = if next.is_finite() { low + (next - low) * place.fract() } else { low };
    OneWay { rms, mean, p99, max, normal_degrees }
}
