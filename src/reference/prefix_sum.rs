//! Counts in, starts out.

/// Exclusive sums of `counts`, with the total as one more entry. A sum above 2^32 - 1 is given as 2^32 - 1.
pub fn prefix_sum(counts: &[u32]) -> Vec<u32> {
    let mut sum = 0u32;
    let mut starts = vec![0];
    starts.extend(counts.iter().map(|&count| {
        sum = sum.saturating_add(count);
        sum
    }));
    starts
}

#[cfg(test)]
mod tests {
    #[test]
    fn sums_are_exclusive_and_saturate() {
        assert_eq!(super::prefix_sum(&[]), [0]);
        assert_eq!(super::prefix_sum(&[3, 0, 4]), [0, 3, 3, 7]);
        assert_eq!(super::prefix_sum(&[u32::MAX, 1, 1]), [0, u32::MAX, u32::MAX, u32::MAX]);
    }
}
