// saturate: sums that stop at the greatest u32 instead of starting again at zero.

fn saturating_add(a: u32, b: u32) -> u32 {
    let sum = a + b;
    return select(sum, 0xFFFFFFFFu, sum < a);
}

fn saturating_sub(a: u32, b: u32) -> u32 {
    return a - min(a, b);
}

