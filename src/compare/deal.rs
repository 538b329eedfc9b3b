//! What every part costs at each triangle count in, how a model's triangles are dealt over its parts out.
//!
//! A renderer gives no part the same share as all others: it takes away first what is missed least. Ours has a price
//! for every step, the cost that its collapse order was made by (an area times a squared distance); meshoptimizer
//! returns an error (a distance). Both become comparable between parts in the unit of the placed model: a copy that is
//! twice as large has a cost 16 times and an error twice as large. How often a part is placed does not matter for its turn: a step
//! saves as many times more triangles as it costs. The last step of every part is that nothing of it is drawn, at the
//! price of a dot in its place.

use crate::geometry::Boundary;
use crate::geometry::collapse::collapse_order;
use crate::geometry::weld::WeldedMesh;

use super::simplify;

/// The triangle counts that a part can be brought to, the finest first, each with its price; prices never fall.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Curve {
    steps: Vec<(u64, f64)>,
}

/// Each count that meshoptimizer is asked for is this share of the one before.
const LADDER: f64 = 0.85;
/// From so many triangles on it is asked for one less each time.
const FEW: u64 = 64;
/// Below a step of so many triangles it is not expected to reach a count between.
const LARGE_STEP: u64 = 8;
/// Below this share of the triangles it is asked for nothing but the least.
const LEAST_SHARE: f64 = 1.0 / 512.0;

impl Curve {
    /// A part that has so many triangles when nothing has been taken away, which has no price.
    fn new(triangles: u64) -> Self {
        Self { steps: vec![(triangles, 0.0)] }
    }

    /// A coarser state; none if it is not coarser.
    fn push(&mut self, triangles: u64, price: f64) {
        if let Some(&(last, most)) = self.steps.last()
            && triangles < last
        {
            // What has no price that is a number comes last.
            self.steps.push((triangles, if price.is_nan() { f64::MAX } else { price.clamp(most, f64::MAX) }));
        }
    }

    /// With nothing as the last step, as a renderer leaves out what is too small to be seen.
    #[must_use]
    pub fn to_nothing(mut self, price: f64) -> Self {
        self.push(0, price);
        self
    }

    /// With prices multiplied, as they are where the part is placed at another size.
    #[must_use]
    pub fn scaled(mut self, factor: f64) -> Self {
        self.steps.iter_mut().for_each(|step| step.1 = (step.1 * factor).min(f64::MAX));
        self
    }

    /// How many steps there are before the first that costs more than this.
    fn affordable(&self, price: f64) -> usize {
        self.steps.partition_point(|&(_, own)| own <= price).max(1) - 1
    }
}

/// The costs of the collapse order of a mesh, in grid steps to the power of four.
pub fn costs(mesh: &WeldedMesh) -> Curve {
    let order = collapse_order(mesh, &vec![false; mesh.positions.len()], Boundary::Slide);
    let triangles = mesh.triangles.len();
    let mut curve = Curve::new(triangles as u64);
    for group in &order.groups {
        curve.push(triangles as u64 - u64::from(group.removed_end), f64::from(group.cost));
    }
    curve
}

/// The errors that meshoptimizer returns for a mesh, in grid steps. Between counts that are far apart, errors are
/// interpolated.
pub fn errors(mesh: &WeldedMesh) -> Curve {
    let whole = mesh.triangles.len() as u64;
    let mut curve = Curve::new(whole);
    let mut last = (whole, 0.0);
    let mut asked = next_asked(whole, whole);
    loop {
        let (left, error) = simplify(mesh, asked as usize);
        let (left, error) = (left.len() as u64, f64::from(error));
        if left < last.0 {
            interpolate(&mut curve, last, (left, error));
            last = (left, error);
        }
        if asked == 0 {
            return curve;
        }
        asked = next_asked(asked.min(last.0), whole);
    }
}

/// What meshoptimizer is asked for after so many.
fn next_asked(triangles: u64, whole: u64) -> u64 {
    let next =
        if triangles <= FEW { triangles.saturating_sub(1) } else { (triangles as f64 * LADDER) as u64 };
    if (next as f64) < whole as f64 * LEAST_SHARE { 0 } else { next }
}

/// Puts a step into a curve, and some on the way to it if it is large.
fn interpolate(curve: &mut Curve, from: (u64, f64), to: (u64, f64)) {
    let gap = from.0 - to.0;
    let parts = (gap / LARGE_STEP).clamp(1, 16);
    for part in 1..=parts {
        let share = part as f64 / parts as f64;
        curve.push(from.0 - gap * part / parts, from.1 + share * (to.1 - from.1));
    }
}

/// The triangle count of every part at which all of them together, each counted `copies` times, have at most so many
/// triangles, but for the last step; what costs least anywhere is taken first.
///
/// If they cannot come down so far, all are at their coarsest.
pub fn deal(curves: &[Curve], copies: &[u64], triangles: u64) -> Vec<u64> {
    let total = |steps: &[usize]| -> u64 {
        let counts = curves.iter().zip(steps).map(|(curve, &step)| curve.steps[step].0);
        counts.zip(copies).map(|(count, &copies)| count * copies).sum()
    };
    let at = |price: f64| -> Vec<usize> { curves.iter().map(|curve| curve.affordable(price)).collect() };
    // Numbers that are not negative are ordered as their bits are.
    let (mut low, mut high) = (0, f64::MAX.to_bits());
    while low < high {
        let middle = low + (high - low) / 2;
        if total(&at(f64::from_bits(middle))) <= triangles { high = middle } else { low = middle + 1 }
    }
    // Before the last price everything that costs less is gone; of that price only what must be.
    let mut steps = if low == 0 { vec![0; curves.len()] } else { at(f64::from_bits(low - 1)) };
    let mut left = total(&steps);
    for (part, last) in at(f64::from_bits(low)).into_iter().enumerate() {
        while left > triangles && steps[part] < last {
            left -= copies[part] * curves[part].steps[steps[part]].0;
            steps[part] += 1;
            left += copies[part] * curves[part].steps[steps[part]].0;
        }
    }
    curves.iter().zip(steps).map(|(curve, step)| curve.steps[step].0).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn curve(steps: &[(u64, f64)]) -> Curve {
        let mut curve = Curve::new(steps[0].0);
        steps[1..].iter().for_each(|&(triangles, price)| curve.push(triangles, price));
        curve
    }

    #[test]
    fn what_costs_least_anywhere_goes_first() {
        let curves = [
            curve(&[(10, 0.0), (8, 1.0), (6, 4.0), (2, 9.0)]),
            curve(&[(20, 0.0), (16, 2.0), (12, 3.0), (4, 8.0)]),
        ];
        let dealt = |triangles| deal(&curves, &[1, 1], triangles);
        assert_eq!(dealt(30), [10, 20]);
        assert_eq!(dealt(29), [8, 20]);
        assert_eq!(dealt(24), [8, 16]);
        assert_eq!(dealt(18), [6, 12]);
        assert_eq!(dealt(10), [6, 4]);
        assert_eq!(dealt(0), [2, 4]);
        // Placed three times the first saves three times as many, at the same price.
        assert_eq!(deal(&curves, &[3, 1], 44), [8, 20]);
        // Made twice as large it has 16 times the cost.
        let larger = [curves[0].clone().scaled(16.0), curves[1].clone()];
        assert_eq!(deal(&larger, &[1, 1], 22), [10, 12]);
    }

    #[test]
    fn of_one_price_only_as_many_steps_are_taken_as_must_be() {
        let flat = curve(&[(10, 0.0), (8, 0.0), (6, 0.0), (4, 5.0), (2, 5.0)]);
        let dealt = |triangles| deal(&[flat.clone(), flat.clone()], &[1, 1], triangles);
        assert_eq!(dealt(17), [6, 10]);
        assert_eq!(dealt(14), [6, 8]);
        assert_eq!(dealt(7), [2, 4]);
    }

    #[test]
    fn prices_never_fall_and_counts_always_do() {
        let odd = curve(&[(9, 0.0), (8, 4.0), (8, 5.0), (6, 1.0), (4, f64::NAN)]);
        assert_eq!(odd.steps, [(9, 0.0), (8, 4.0), (6, 4.0), (4, f64::MAX)]);
    }
}
