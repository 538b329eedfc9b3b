//! Grants in; budgets, and how much of each is streamed, out.

use crate::gpu::layout::{FRESH, Grant};

/// Applies grants to the budgets (vertices, `ecol`, triangles; one an instance), and returns how much of each is
/// streamed: the whole new count if it is fresh, else what the old one lacks (Peng & Cao 2012, algorithm 3).
///
/// There is at most one grant an instance; grants of instances that do not exist are ignored.
pub fn grant(grants: &[Grant], budgets: [&mut [u32]; 3]) -> [Vec<u32>; 3] {
    let mut stream = 0;
    budgets.map(|budget| {
        let mut streamed = vec![0; budget.len()];
        for grant in grants {
            let granted = [grant.vertices, grant.ecol, grant.triangles][stream];
            let instance = grant.instance as usize;
            if let Some(old) = budget.get_mut(instance) {
                let new = granted & !FRESH;
                streamed[instance] = if granted & FRESH != 0 { new } else { new.saturating_sub(*old) };
                *old = new;
            }
        }
        stream += 1;
        streamed
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn growth_is_streamed_and_fresh_blocks_are_streamed_whole() {
        let (mut v, mut e, mut t) = ([5, 5], [8, 8], [9, 9]);
        let grants = [Grant { instance: 1, vertices: 7, ecol: 3, triangles: 4 | FRESH }];
        let streamed = grant(&grants, [&mut v, &mut e, &mut t]);
        assert_eq!(streamed, [[0, 2], [0, 0], [0, 4]]);
        assert_eq!((v, e, t), ([5, 7], [8, 3], [9, 4]));
    }
}
