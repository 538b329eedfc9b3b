//! Existing blocks and streamed elements in, contiguous active blocks out.

/// The start lists of one stream, with one entry more than there are instances.
#[derive(Debug, Clone, Copy)]
pub struct Starts<'a> {
    /// Of the active elements of this frame.
    pub active: &'a [u32],
    /// Of the active elements of the last frame.
    pub existing: &'a [u32],
    /// Of the streamed elements.
    pub streamed: &'a [u32],
}

/// The active elements: of each instance the first of its existing block, as many as were not streamed, and then its
/// streamed block (Peng & Cao 2012, algorithm 3 and figure 6).
///
/// # Panics
/// If the start lists do not fit each other or the elements.
pub fn defragment<T: Copy>(starts: Starts<'_>, existing: &[T], streamed: &[T]) -> Vec<T> {
    let block = |list: &[u32], instance: usize| list[instance] as usize..list[instance + 1] as usize;
    let mut active = Vec::new();
    for instance in 0..starts.active.len().saturating_sub(1) {
        let new = block(starts.streamed, instance);
        let kept = block(starts.active, instance).len().saturating_sub(new.len());
        let first = starts.existing[instance] as usize;
        active.extend_from_slice(&existing[first..first + kept]);
        active.extend_from_slice(&streamed[new]);
    }
    active
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_shrink_grow_and_are_replaced() {
        // Shrinks from 3 to 1; grows from 2 to 4; is replaced.
        let starts = Starts { active: &[0, 1, 5, 7], existing: &[0, 3, 5, 6], streamed: &[0, 0, 2, 4] };
        let active = defragment(starts, b"abcdef", b"DEXY");
        assert_eq!(active, b"adeDEXY");
    }
}
