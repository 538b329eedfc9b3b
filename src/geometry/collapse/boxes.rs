//! A point in, how far it is from a list of triangles out.
//!
//! Boxes around every [`FAN`] triangles that follow one another, around every [`FAN`] of these boxes, and so on: the
//! triangles of a mesh are in Morton order, so what follows one another lies together. A triangle may move or go after
//! its box was made: what is found is the distance from where it is now, though it may not be the nearest then.

use glam::{Vec3, Vec4};

use super::four::{Four, narrowed, squared_distances, widened};

/// How many triangles or boxes one box is around.
const FAN: usize = 8;
/// How many boxes a search opens at most, unless there is nothing in them.
const MOST_OPENED: usize = 256;
/// No triangle is so far away, squared, but those that have gone.
const FAR: f32 = 1e20;
/// Where a triangle is that has gone.
pub(super) const GONE: [Vec3; 3] = [Vec3::splat(1e15); 3];

/// Boxes around triangles, finest first.
#[derive(Clone)]
pub(super) struct Boxes {
    levels: Vec<Vec<Bounds>>,
    /// How many triangles they are around.
    count: usize,
}

/// A box.
#[derive(Clone, Copy)]
struct Bounds {
    low: Vec3,
    high: Vec3,
}

impl Bounds {
    const NONE: Self = Self { low: Vec3::INFINITY, high: Vec3::NEG_INFINITY };

    fn with(self, other: Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    /// The squared distance from a point, 0 inside.
    fn squared(&self, point: Vec3) -> f32 {
        let outside = (self.low - point).max(point - self.high).max(Vec3::ZERO);
        outside.length_squared()
    }
}

/// The nearest triangle, as far as a search went.
#[derive(Debug, Clone, Copy)]
pub(super) struct Found {
    /// Its squared distance.
    pub squared: f32,
    /// Its number, if there is one within the limit.
    pub triangle: Option<usize>,
    /// How many boxes have been opened.
    pub opened: usize,
}

/// A search for the triangle that is nearest to a point.
struct Search<'a, F> {
    boxes: &'a mut Boxes,
    corners: F,
    point: Vec3,
    found: Found,
    /// The search may end at this squared distance.
    enough: f32,
    /// The search ends when it has opened so many boxes and found any triangle.
    looks: usize,
}

impl Boxes {
    /// Around `count` triangles.
    pub fn new(count: usize, corners: impl Fn(usize) -> [Vec3; 3]) -> Self {
        let around = |bounds: &[Bounds]| bounds.iter().fold(Bounds::NONE, |all, &one| all.with(one));
        let leaf = |first: usize| {
            let (mut low, mut high) = (Vec4::INFINITY, Vec4::NEG_INFINITY);
            for triangle in first..count.min(first + FAN) {
                let [a, b, c] = corners(triangle).map(widened);
                low = low.min(a.min(b).min(c));
                high = high.max(a.max(b).max(c));
            }
            Bounds { low: narrowed(low), high: narrowed(high) }
        };
        let mut level: Vec<Bounds> = (0..count).step_by(FAN).map(leaf).collect();
        let mut levels = Vec::new();
        while level.len() > FAN {
            let next = level.chunks(FAN).map(around).collect();
            levels.push(std::mem::replace(&mut level, next));
        }
        levels.push(level);
        Self { levels, count }
    }

    /// The triangle nearest to a point, if its squared distance is less than `most`; if it is no more than `enough`,
    /// maybe another one, and also after it has opened `looks` boxes. Boxes in which all triangles have gone are emptied.
    pub fn nearest(
        &mut self,
        corners: impl Fn(usize) -> [Vec3; 3],
        point: Vec3,
        [most, enough]: [f32; 2],
        looks: usize,
    ) -> Found {
        let found = Found { squared: most.min(FAR), triangle: None, opened: 0 };
        let mut search = Search { boxes: self, corners, point, found, enough, looks: looks.min(MOST_OPENED) };
        search.open(search.boxes.levels.len(), 0);
        search.found
    }
}

impl<F: Fn(usize) -> [Vec3; 3]> Search<'_, F> {
    /// Looks into a box of a level; there is one above the last level, and the triangles are below the first. Returns
    /// whether all that was in it has gone.
    fn open(&mut self, level: usize, number: usize) -> bool {
        if self.found.opened >= self.looks && self.found.squared < FAR {
            return false;
        }
        self.found.opened += 1;
        let first = number * FAN;
        if level == 0 {
            return self.look_at(first);
        }
        let below = &self.boxes.levels[level - 1];
        let last = below.len().min(first + FAN);
        let mut distances = [f32::INFINITY; FAN];
        for (distance, bounds) in distances.iter_mut().zip(&below[first..last]) {
            *distance = bounds.squared(self.point);
        }
        let mut emptied = false;
        while self.found.squared > self.enough {
            let mut child = 0;
            for other in 1..FAN {
                child = if distances[other] < distances[child] { other } else { child };
            }
            if distances[child] >= self.found.squared {
                break;
            }
            distances[child] = f32::INFINITY;
            if self.open(level - 1, first + child) {
                self.boxes.levels[level - 1][first + child] = Bounds::NONE;
                emptied = true;
            }
        }
        emptied && self.boxes.levels[level - 1][first..last].iter().all(|bounds| bounds.low.x > bounds.high.x)
    }

    /// Looks at the triangles of a box; returns whether all have gone.
    fn look_at(&mut self, first: usize) -> bool {
        let last = self.boxes.count - 1;
        let mut gone = true;
        for four in (first..=last).take(FAN).step_by(4) {
            let at = |i: usize| (self.corners)(last.min(four + i));
            let (s, t, u, v) = (at(0), at(1), at(2), at(3));
            let corner = |k: usize| Four::of([widened(s[k]), widened(t[k]), widened(u[k]), widened(v[k])]);
            let corners = [corner(0), corner(1), corner(2)];
            let distances = squared_distances(Four::splat(self.point), corners);
            gone &= distances.cmpge(Vec4::splat(FAR)).all();
            if distances.cmplt(Vec4::splat(self.found.squared)).any() {
                self.found.squared = distances.min_element();
                self.found.triangle = Some(last.min(four + distances.min_position()));
            }
        }
        gone
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::super::drift::squared_distance;
    use super::*;

    proptest! {
        #[test]
        fn what_is_found_is_what_a_look_at_all_finds(
            c in prop::collection::vec(-1f32..1.0, 9 * 70),
            count in 1usize..70,
            p in prop::array::uniform3(-2f32..2.0),
            gone in 0usize..70,
        ) {
            let point = |i: usize| Vec3::new(c[3 * i], c[3 * i + 1], c[3 * i + 2]);
            let triangle = |t: usize| [point(3 * t), point(3 * t + 1), point(3 * t + 2)];
            let mut boxes = Boxes::new(count, triangle);
            let left = |t: usize| if t == gone { GONE } else { triangle(t) };
            let p = Vec3::from(p);
            let all = (0..count).filter(|&t| t != gone).map(|t| squared_distance(p, triangle(t)));
            let least = all.fold(100.0, f32::min);
            let found = boxes.nearest(left, p, [100.0, 0.0], 1000);
            prop_assert!((found.squared - least).abs() < 1e-4, "{} is not {least}", found.squared);
            prop_assert_eq!(found.triangle.is_some(), least < 100.0);
            // Enough is enough, and what is too far away is not there: four at once are rounded otherwise than one alone.
            prop_assert!(boxes.nearest(left, p, [100.0, 5.0], 1000).squared <= least.max(5.0) + 1e-4);
            prop_assert!(boxes.nearest(left, p, [0.9 * least - 1e-4, 0.0], 1000).triangle.is_none());
            let any = boxes.nearest(left, p, [f32::INFINITY, 0.0], 0).triangle;
            prop_assert!(any != Some(gone));
        }
    }
}
