//! A point in, the closest of many triangles and its distance out, exactly.
//!
//! A tree of boxes over the triangles, halved at the median of the centroids along the longest side. A look-up goes to
//! the nearer box first and leaves out boxes that are farther than what it has. Closest point on a triangle: Ericson
//! 2005, *Real-Time Collision Detection*, section 5.1.5.

use glam::DVec3;

/// Triangles of a leaf.
const LEAF: usize = 4;

/// What was found for a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Hit {
    /// The squared distance.
    pub squared: f64,
    /// The triangle, an index into [`Tree::triangles`].
    pub triangle: u32,
}

/// A box and what is in it: two boxes, or a few triangles.
#[derive(Debug, Clone, Copy)]
struct Node {
    low: DVec3,
    high: DVec3,
    /// The first triangle of a leaf; the second child of any other (the first one follows it in the list).
    next: u32,
    /// How many triangles a leaf has; 0 for any other.
    count: u32,
}

/// Triangles, reordered so that those of a leaf lie together.
#[derive(Debug, Default)]
pub(super) struct Tree {
    triangles: Vec<[DVec3; 3]>,
    nodes: Vec<Node>,
}

impl Tree {
    pub(super) fn new(mut triangles: Vec<[DVec3; 3]>) -> Self {
        let mut nodes = Vec::with_capacity(triangles.len());
        if !triangles.is_empty() {
            build(&mut triangles, 0, &mut nodes);
        }
        Self { triangles, nodes }
    }

    pub(super) fn triangles(&self) -> &[[DVec3; 3]] {
        &self.triangles
    }

    /// The triangle closest to a point; `near` is one that may be close. There is at least one.
    pub(super) fn closest(&self, point: DVec3, near: u32) -> Hit {
        let mut best = Hit { squared: self.squared_to(point, near), triangle: near };
        // Halving at medians makes the tree at most 32 deep, and each level leaves one box for later.
        let mut later = [(0.0, 0u32); 40];
        let mut waiting = 1;
        while waiting > 0 {
            waiting -= 1;
            let (far, number) = later[waiting];
            if far >= best.squared {
                continue;
            }
            let node = &self.nodes[number as usize];
            if node.count > 0 {
                self.look_in_leaf(node, point, &mut best);
                continue;
            }
            let children =
                [number + 1, node.next].map(|child| (self.nodes[child as usize].squared(point), child));
            let [nearer, farther] =
                if children[0].0 <= children[1].0 { children } else { [children[1], children[0]] };
            later[waiting] = farther;
            later[waiting + 1] = nearer;
            waiting += 2;
        }
        best
    }

    fn look_in_leaf(&self, leaf: &Node, point: DVec3, best: &mut Hit) {
        for triangle in leaf.next..leaf.next + leaf.count {
            let squared = self.squared_to(point, triangle);
            if squared < best.squared {
                *best = Hit { squared, triangle };
            }
        }
    }

    fn squared_to(&self, point: DVec3, triangle: u32) -> f64 {
        let [a, b, c] = self.triangles[triangle as usize];
        closest_on_triangle(point, a, b, c).distance_squared(point)
    }
}

impl Node {
    /// The squared distance from a point to the box; 0 inside.
    fn squared(&self, point: DVec3) -> f64 {
        point.distance_squared(point.clamp(self.low, self.high))
    }
}

/// Appends the tree of triangles that start at `first` in the whole list.
fn build(triangles: &mut [[DVec3; 3]], first: u32, nodes: &mut Vec<Node>) {
    let corners = || triangles.as_flattened().iter().copied();
    let low = corners().fold(DVec3::INFINITY, DVec3::min);
    let high = corners().fold(DVec3::NEG_INFINITY, DVec3::max);
    let own = nodes.len();
    nodes.push(Node { low, high, next: first, count: triangles.len() as u32 });
    if triangles.len() <= LEAF {
        return;
    }
    let centroids = || triangles.iter().map(|&[a, b, c]| a + b + c);
    let extent =
        centroids().fold(DVec3::NEG_INFINITY, DVec3::max) - centroids().fold(DVec3::INFINITY, DVec3::min);
    let axis =
        extent.to_array().iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1)).map_or(0, |(axis, _)| axis);
    let middle = triangles.len() / 2;
    triangles.select_nth_unstable_by(middle, |s, t| {
        (s[0][axis] + s[1][axis] + s[2][axis]).total_cmp(&(t[0][axis] + t[1][axis] + t[2][axis]))
    });
    let (lower, upper) = triangles.split_at_mut(middle);
    build(lower, first, nodes);
    nodes[own].next = nodes.len() as u32;
    nodes[own].count = 0;
    build(upper, first + middle as u32, nodes);
}

/// The point of a triangle that is closest to `p`, by the region of the plane in which it falls.
fn closest_on_triangle(p: DVec3, a: DVec3, b: DVec3, c: DVec3) -> DVec3 {
    let (ab, ac) = (b - a, c - a);
    let (ap, bp, cp) = (p - a, p - b, p - c);
    let (d1, d2) = (ab.dot(ap), ac.dot(ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return a;
    }
    let (d3, d4) = (ab.dot(bp), ac.dot(bp));
    if d3 >= 0.0 && d4 <= d3 {
        return b;
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return on_segment(p, a, b);
    }
    let (d5, d6) = (ab.dot(cp), ac.dot(cp));
    if d6 >= 0.0 && d5 <= d6 {
        return c;
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return on_segment(p, a, c);
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 >= d3 && d5 >= d6 {
        return on_segment(p, b, c);
    }
    let sum = va + vb + vc;
    let (v, w) = (vb / sum, vc / sum);
    // In a sliver the three areas may be mere rounding.
    if va > 0.0 && vb > 0.0 && vc > 0.0 && sum.is_normal() {
        a + ab * v + ac * w
    } else {
        closest_on_edges(p, a, b, c)
    }
}

fn on_segment(p: DVec3, a: DVec3, b: DVec3) -> DVec3 {
    let ab = b - a;
    let squared = ab.length_squared();
    if squared > 0.0 { a + ab * (ab.dot(p - a) / squared).clamp(0.0, 1.0) } else { a }
}

fn closest_on_edges(p: DVec3, a: DVec3, b: DVec3, c: DVec3) -> DVec3 {
    let candidates = [on_segment(p, a, b), on_segment(p, b, c), on_segment(p, c, a)];
    let closer = |near: DVec3, other: DVec3| {
        if other.distance_squared(p) < near.distance_squared(p) { other } else { near }
    };
    candidates.into_iter().fold(candidates[0], closer)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Any triangle, a third of them slivers.
    fn triangles() -> impl Strategy<Value = Vec<[DVec3; 3]>> {
        let point = || prop::array::uniform3(-1f64..1.0).prop_map(DVec3::from);
        let sliver = (point(), point(), 0f64..1.0, point())
            .prop_map(|(a, b, t, noise)| [a, b, a + (b - a) * t + noise * 1e-12]);
        let any = (point(), point(), point()).prop_map(|(a, b, c)| [a, b, c]);
        prop::collection::vec(prop_oneof![2 => any, 1 => sliver], 1..60)
    }

    /// The closest point by brute force: a fine search over the triangle, narrowed where it was best.
    fn slow(p: DVec3, [a, b, c]: [DVec3; 3]) -> f64 {
        let at = |v: f64, w: f64| (a + (b - a) * v + (c - a) * w).distance(p);
        let (mut v, mut w, mut reach) = (0.33, 0.33, 1.0);
        for _ in 0..60 {
            let mut best = (at(v, w), v, w);
            for i in -8..=8 {
                for j in -8..=8 {
                    let v = (v + reach * f64::from(i) / 8.0).clamp(0.0, 1.0);
                    let w = (w + reach * f64::from(j) / 8.0).clamp(0.0, 1.0 - v);
                    let distance = at(v, w);
                    if distance < best.0 {
                        best = (distance, v, w);
                    }
                }
            }
            (_, v, w) = best;
            reach *= 0.7;
        }
        at(v, w)
    }

    proptest! {
        #[test]
        fn the_closest_point_of_a_triangle_is_the_closest(
            list in triangles(),
            p in prop::array::uniform3(-2f64..2.0),
        ) {
            let p = DVec3::from(p);
            let [a, b, c] = list[0];
            let found = closest_on_triangle(p, a, b, c).distance(p);
            let slow = slow(p, [a, b, c]);
            prop_assert!((found - slow).abs() < 1e-6, "{found} against {slow}");
        }

        #[test]
        fn the_tree_finds_what_a_look_at_all_finds(
            list in triangles(),
            points in prop::collection::vec(prop::array::uniform3(-2f64..2.0), 1..20),
        ) {
            let tree = Tree::new(list);
            for (number, p) in points.into_iter().map(DVec3::from).enumerate() {
                let all = (0..tree.triangles.len() as u32).map(|t| tree.squared_to(p, t));
                let least = all.fold(f64::INFINITY, f64::min);
                let hit = tree.closest(p, (number % tree.triangles.len()) as u32);
                prop_assert_eq!(hit.squared, least);
                prop_assert_eq!(tree.squared_to(p, hit.triangle), least);
            }
        }
    }
}
