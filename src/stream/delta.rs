//! What an instance's new state has that its old one lacks.
//!
//! Vertices and `ecol` are prefixes of the part whatever the tier, so their lack is a range. Triangles are a prefix of
//! the tier's own list: a range while the tier stays, the whole list when it changes (design section 4).

use std::ops::Range;

use super::Strategy;

/// How much of an instance the GPU holds. The default is nothing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash)]
pub struct State {
    /// Active vertices: the first `vn` of the part.
    pub vertices: u32,
    /// Entries of `ecol`: as many as the tier has vertices, because its triangles name all of them.
    pub ecol: u32,
    /// Active triangles: the first `tn` of the tier's list.
    pub triangles: u32,
    /// Which tier's list.
    pub tier: u32,
}

impl State {
    /// Whether nothing is held.
    pub fn is_empty(self) -> bool {
        self.vertices == 0
    }
}

/// The change of one instance in one frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Delta {
    /// The instance, numbered in the scene.
    pub instance: u32,
    /// What the GPU holds.
    pub old: State,
    /// What it shall hold.
    pub new: State,
}

/// Records of one instance that are sent in a frame.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Lack {
    /// Vertices of the part.
    pub vertices: Range<u32>,
    /// Entries of its `ecol`.
    pub ecol: Range<u32>,
    /// Triangles of the new tier's list.
    pub triangles: Range<u32>,
}

/// Bytes of a vertex record as it is sent.
pub const VERTEX_BYTES: u64 = 12;
/// Bytes of an `ecol` entry as it is sent.
pub const ECOL_BYTES: u64 = 2;
/// Bytes of a triangle record as it is sent.
pub const TRIANGLE_BYTES: u64 = 8;

impl Lack {
    /// Bytes that sending it takes.
    pub fn bytes(&self) -> u64 {
        self.vertices.len() as u64 * VERTEX_BYTES
            + self.ecol.len() as u64 * ECOL_BYTES
            + self.triangles.len() as u64 * TRIANGLE_BYTES
    }
}

impl Delta {
    /// Whether nothing of the existing triangles can be kept.
    pub fn fresh_triangles(&self) -> bool {
        self.old.is_empty() || self.old.tier != self.new.tier
    }

    /// What is sent under a strategy.
    pub fn lack(&self, strategy: Strategy) -> Lack {
        let (old, new) = (self.old, self.new);
        if strategy != Strategy::Coherent {
            return Lack { vertices: 0..new.vertices, ecol: 0..new.ecol, triangles: 0..new.triangles };
        }
        let kept_triangles = if self.fresh_triangles() { 0 } else { old.triangles };
        Lack {
            vertices: old.vertices.min(new.vertices)..new.vertices,
            ecol: old.ecol.min(new.ecol)..new.ecol,
            triangles: kept_triangles.min(new.triangles)..new.triangles,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn state(vertices: u32, ecol: u32, triangles: u32, tier: u32) -> State {
        State { vertices, ecol, triangles, tier }
    }

    #[test]
    fn growth_within_a_tier_sends_ranges() {
        let delta = Delta { instance: 0, old: state(10, 40, 12, 1), new: state(15, 40, 20, 1) };
        let lack = delta.lack(Strategy::Coherent);
        assert_eq!(lack, Lack { vertices: 10..15, ecol: 40..40, triangles: 12..20 });
        assert_eq!(lack.bytes(), 5 * 12 + 8 * 8);
        assert_eq!(delta.lack(Strategy::Whole), Lack { vertices: 0..15, ecol: 0..40, triangles: 0..20 });
    }

    #[test]
    fn a_change_of_tier_sends_the_list_again_but_keeps_the_prefixes() {
        let delta = Delta { instance: 0, old: state(40, 40, 70, 1), new: state(50, 160, 90, 0) };
        let lack = delta.lack(Strategy::Coherent);
        assert_eq!(lack, Lack { vertices: 40..50, ecol: 40..160, triangles: 0..90 });
    }

    #[test]
    fn shrinking_and_vanishing_send_nothing() {
        let shrink = Delta { instance: 0, old: state(40, 160, 70, 0), new: state(30, 160, 50, 0) };
        assert_eq!(shrink.lack(Strategy::Coherent).bytes(), 0);
        let vanish = Delta { new: State::default(), ..shrink };
        assert_eq!(vanish.lack(Strategy::Coherent).bytes(), 0);
    }
}
