//! Active triangles and `ecol` in, the index buffer out.

use crate::geometry::TriangleRecord;

/// The vertex below `vertex_count` that `corner` has collapsed onto (Peng & Cao 2012, algorithm 4, counting from
/// zero). Bad data, where a chain does not fall or leaves `ecol`, ends at vertex 0.
fn reform_corner(corner: u16, vertex_count: u32, ecol: &[u32]) -> u32 {
    let mut vertex = u32::from(corner);
    while vertex >= vertex_count {
        match ecol.get(vertex as usize) {
            Some(&onto) if onto < vertex => vertex = onto,
            _ => return 0,
        }
    }
    vertex
}

/// Three numbers of active vertices for each active triangle.
///
/// The start lists have one entry more than there are instances. An instance's `ecol` block covers the vertices of
/// its tier, of which only the first are active.
///
/// # Panics
/// If the start lists do not fit each other or the elements.
pub fn reform(
    triangle_start: &[u32],
    vertex_start: &[u32],
    ecol_start: &[u32],
    ecol: &[u32],
    triangles: &[TriangleRecord],
) -> Vec<u32> {
    let block = |list: &[u32], instance: usize| list[instance] as usize..list[instance + 1] as usize;
    let mut indices = Vec::with_capacity(3 * triangles.len());
    for instance in 0..triangle_start.len().saturating_sub(1) {
        let first = vertex_start[instance];
        let vertex_count = vertex_start[instance + 1] - first;
        let ecol = &ecol[block(ecol_start, instance)];
        for triangle in &triangles[block(triangle_start, instance)] {
            indices.extend(triangle.vertices.map(|corner| first + reform_corner(corner, vertex_count, ecol)));
        }
    }
    indices
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_walk_until_below_the_vertex_count() {
        let triangles = [TriangleRecord { vertices: [4, 1, 3], flags: 0 }];
        // 4 collapses onto 3, 3 onto 0.
        let indices = reform(&[0, 0, 1], &[0, 10, 13], &[0, 0, 5], &[0, 1, 2, 0, 3], &triangles);
        assert_eq!(indices, [10, 11, 10]);
    }

    #[test]
    fn bad_chains_end_at_vertex_zero() {
        // A loop, a rising step, the end of ecol; no active vertices at all.
        assert_eq!(reform_corner(3, 2, &[0, 1, 2, 3]), 0);
        assert_eq!(reform_corner(2, 2, &[0, 1, 3, 2]), 0);
        assert_eq!(reform_corner(9, 2, &[0, 1, 0, 0]), 0);
        assert_eq!(reform_corner(1, 0, &[0, 0]), 0);
    }
}
