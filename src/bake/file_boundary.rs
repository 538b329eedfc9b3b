//! A mesh as its file numbers it in, how many of its vertices lie on an open boundary out.
//!
//! CAD files often write a patch for each face, so that by index nearly every vertex is on a boundary; set beside the open
//! positions after the weld, the number says what the weld was worth.

/// How many vertices are on an edge that only one triangle has, by index and before anything is welded.
///
/// Linear in the triangles but for hubs, whose edges are sorted; takes 12 bytes a triangle and 17 a vertex.
pub fn open_vertices(triangles: &[[u32; 3]], vertices: usize) -> usize {
    let starts = edge_starts(triangles, vertices);
    let mut ends = others_by_lower(triangles, &starts);
    let mut open = vec![false; vertices];
    for lower in 0..vertices {
        let own = &mut ends[starts[lower]..starts[lower + 1]];
        own.sort_unstable();
        for edge in own.chunk_by(|a, b| a == b).filter(|edge| edge.len() == 1) {
            open[lower] = true;
            open[edge[0] as usize] = true;
        }
    }
    open.iter().filter(|&&open| open).count()
}

/// The edges of a mesh as pairs of vertices, the lower first; none from a vertex to itself.
fn edges(triangles: &[[u32; 3]]) -> impl Iterator<Item = [u32; 2]> {
    let all = triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]);
    all.filter(|[a, b]| a != b).map(|[a, b]| [a.min(b), a.max(b)])
}

/// Where the edges of each lower vertex begin, with the end of the last.
fn edge_starts(triangles: &[[u32; 3]], vertices: usize) -> Vec<usize> {
    let mut starts = vec![0; vertices + 1];
    edges(triangles).for_each(|[lower, _]| starts[lower as usize + 1] += 1);
    for vertex in 0..vertices {
        starts[vertex + 1] += starts[vertex];
    }
    starts
}

/// The higher ends of all edges, grouped by the lower ones.
fn others_by_lower(triangles: &[[u32; 3]], starts: &[usize]) -> Vec<u32> {
    let mut next = starts.to_vec();
    let mut others = vec![0; starts.last().copied().unwrap_or(0)];
    for [lower, higher] in edges(triangles) {
        others[next[lower as usize]] = higher;
        next[lower as usize] += 1;
    }
    others
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_edges_of_one_triangle_count() {
        assert_eq!(open_vertices(&[], 0), 0);
        assert_eq!(open_vertices(&[[0, 1, 2]], 5), 3);
        // A closed tetrahedron, and the same with one face apart by index.
        assert_eq!(open_vertices(&[[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]], 4), 0);
        assert_eq!(open_vertices(&[[0, 1, 2], [0, 2, 3], [0, 3, 1], [4, 6, 5]], 7), 6);
        // A fan whose hub is closed, and three triangles at one edge.
        assert_eq!(open_vertices(&[[0, 1, 2], [0, 2, 3], [0, 3, 1]], 4), 3);
        assert_eq!(open_vertices(&[[0, 1, 2], [0, 1, 3], [1, 0, 4]], 5), 5);
        assert_eq!(open_vertices(&[[0, 0, 1]], 2), 0, "an edge there and back is none of one triangle");
    }
}
