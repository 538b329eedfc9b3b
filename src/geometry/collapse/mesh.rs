//! The mesh while it is being collapsed: corners in linked lists by position, and which wedge each corner names.
//!
//! Corner `3 t + k` is corner `k` of triangle `t`. A collapse moves the corners of one position to another and kills
//! the triangles between; the corners of dead triangles stay in the lists until the next walk unlinks them.

use crate::geometry::weld::WeldedMesh;

pub(super) const NONE: u32 = u32::MAX;

/// The dynamic mesh.
pub(super) struct CornerMesh {
    /// The wedge that each corner names now.
    pub corner_wedge: Vec<u32>,
    /// The position of each wedge (never changes).
    pub wedge_position: Vec<u32>,
    /// Where the wedges of each position start (never changes).
    pub wedge_start: Vec<u32>,
    /// Whether each triangle is alive.
    pub alive: Vec<bool>,
    /// How many triangles are alive.
    pub live_triangles: usize,
    /// How many live triangles meet at each position.
    pub valence: Vec<u32>,
    /// How many live corners name each wedge; a wedge that none names has left the order or is about to.
    pub wedge_corners: Vec<u32>,
    head: Vec<u32>,
    next: Vec<u32>,
}

/// A live triangle seen from one of its corners: the corner, and the wedges of the other two in turn.
#[derive(Clone, Copy, Debug)]
pub(super) struct Face {
    pub corner: u32,
    pub wedge: u32,
    pub wedges: [u32; 2],
    pub positions: [u32; 2],
}

impl Face {
    pub fn triangle(self) -> u32 {
        self.corner / 3
    }

    /// Whether one of the other two corners is at this position.
    pub fn touches(self, position: u32) -> bool {
        self.positions[0] == position || self.positions[1] == position
    }
}

impl CornerMesh {
    pub fn new(mesh: &WeldedMesh) -> Self {
        let corner_wedge: Vec<u32> = mesh.triangles.iter().flatten().copied().collect();
        let positions = mesh.positions.len();
        let mut this = Self {
            wedge_position: mesh.wedge_position.clone(),
            wedge_start: mesh.wedge_starts(),
            alive: vec![true; mesh.triangles.len()],
            live_triangles: mesh.triangles.len(),
            valence: vec![0; positions],
            wedge_corners: vec![0; mesh.wedges.len()],
            head: vec![NONE; positions],
            next: vec![NONE; corner_wedge.len()],
            corner_wedge,
        };
        for corner in (0..this.corner_wedge.len() as u32).rev() {
            let wedge = this.corner_wedge[corner as usize];
            this.link(corner, this.wedge_position[wedge as usize]);
            this.wedge_corners[wedge as usize] += 1;
        }
        this
    }

    fn link(&mut self, corner: u32, position: u32) {
        self.next[corner as usize] = self.head[position as usize];
        self.head[position as usize] = corner;
        self.valence[position as usize] += 1;
    }

    pub fn position_count(&self) -> usize {
        self.head.len()
    }

    fn face(&self, corner: u32) -> Face {
        let first = corner - corner % 3;
        let k = corner % 3;
        let wedges = [1, 2].map(|step| self.corner_wedge[(first + (k + step) % 3) as usize]);
        Face {
            corner,
            wedge: self.corner_wedge[corner as usize],
            wedges,
            positions: wedges.map(|wedge| self.wedge_position[wedge as usize]),
        }
    }

    /// The live triangles around a position.
    pub fn faces(&self, position: u32) -> impl Iterator<Item = Face> + '_ {
        let mut corner = self.head[position as usize];
        std::iter::from_fn(move || {
            while corner != NONE {
                let current = corner;
                corner = self.next[current as usize];
                if self.alive[current as usize / 3] {
                    return Some(self.face(current));
                }
            }
            None
        })
    }

    /// Unlinks dead corners of a position and collects its live triangles.
    pub fn collect_faces(&mut self, position: u32, faces: &mut Vec<Face>) {
        faces.clear();
        let mut last = NONE;
        let mut corner = self.head[position as usize];
        while corner != NONE {
            let next = self.next[corner as usize];
            if self.alive[corner as usize / 3] {
                faces.push(self.face(corner));
                last = corner;
            } else if last == NONE {
                self.head[position as usize] = next;
            } else {
                self.next[last as usize] = next;
            }
            corner = next;
        }
    }

    /// Kills a triangle; returns the wedges of its corners.
    pub fn kill(&mut self, triangle: u32) -> [u32; 3] {
        self.alive[triangle as usize] = false;
        self.live_triangles -= 1;
        [0, 1, 2].map(|k| {
            let wedge = self.corner_wedge[(3 * triangle + k) as usize];
            self.wedge_corners[wedge as usize] -= 1;
            self.valence[self.wedge_position[wedge as usize] as usize] -= 1;
            wedge
        })
    }

    /// Points a corner, whose position's list is about to be dropped, at a wedge of another position.
    pub fn repoint(&mut self, corner: u32, wedge: u32) {
        let old = self.corner_wedge[corner as usize];
        self.wedge_corners[old as usize] -= 1;
        self.valence[self.wedge_position[old as usize] as usize] -= 1;
        self.corner_wedge[corner as usize] = wedge;
        self.wedge_corners[wedge as usize] += 1;
        self.link(corner, self.wedge_position[wedge as usize]);
    }

    /// Drops the list of a position that has no live corner left.
    pub fn drop_list(&mut self, position: u32) {
        self.head[position as usize] = NONE;
    }

    /// All wedges of a position, alive or not.
    pub fn wedges_of(&self, position: u32) -> std::ops::Range<u32> {
        self.wedge_start[position as usize]..self.wedge_start[position as usize + 1]
    }

    /// The wedges of a position that a live corner names.
    pub fn live_wedges(&self, position: u32) -> impl Iterator<Item = u32> + '_ {
        self.wedges_of(position).filter(|&wedge| self.wedge_corners[wedge as usize] > 0)
    }
}
