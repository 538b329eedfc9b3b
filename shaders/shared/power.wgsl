// power: logarithm and power to base 2 that give the same bits as src/reference/power.rs on every adapter.
//
// A driver may fuse a multiplication with an addition, or regroup sums, where the host does not. `exact` passes a
// result through an exclusive or with a zero that the compiler cannot know: the entry point sets `exact_zero` from a
// uniform, first thing. Every float operation of a pass whose results are compared bit for bit goes through `add`
// and `mul`.

var<private> exact_zero: u32;

fn exact(x: f32) -> f32 {
    return bitcast<f32>(bitcast<u32>(x) ^ exact_zero);
}

fn mul(a: f32, b: f32) -> f32 {
    return exact(a * b);
}

fn add(a: f32, b: f32) -> f32 {
    return exact(a + b);
}

// x y z of a times those of b, summed in this order.
fn exact_dot(a: vec3<f32>, b: vec3<f32>) -> f32 {
    return add(add(mul(a.x, b.x), mul(a.y, b.y)), mul(a.z, b.z));
}

fn log2_exact(x: f32) -> f32 {
    // Below the least normal number; negative numbers and NaN lie above infinity.
    var bits = bitcast<u32>(x);
    if bits < 0x00800000u || bits > 0x7F800000u {
        bits = 0x00800000u;
    }
    let mantissa = bits & 0x7FFFFFu;
    let upper = select(0u, 1u, mantissa > 0x3504F3u);
    let exponent = i32(bits >> 23u) - 127 + i32(upper);
    let t = add(bitcast<f32>(mantissa | ((127u - upper) << 23u)), -1.0);
    var p = 0.12310968;
    p = add(mul(p, t), -0.20586188);
    p = add(mul(p, t), 0.21607822);
    p = add(mul(p, t), -0.23916988);
    p = add(mul(p, t), 0.28790326);
    p = add(mul(p, t), -0.36069327);
    p = add(mul(p, t), 0.48091075);
    p = add(mul(p, t), -0.72134747);
    p = add(mul(p, t), 1.442695);
    return add(f32(exponent), mul(t, p));
}

fn exp2_exact(x: f32) -> f32 {
    let y = clamp(x, -126.0, 126.0);
    let exponent = i32(add(y, 128.5)) - 128;
    let f = add(y, -f32(exponent));
    var p = 0.00015461445;
    p = add(mul(p, f), 0.0013400428);
    p = add(mul(p, f), 0.009618057);
    p = add(mul(p, f), 0.05550327);
    p = add(mul(p, f), 0.2402265);
    p = add(mul(p, f), 0.6931472);
    p = add(mul(p, f), 1.0);
    return bitcast<f32>(bitcast<u32>(p) + bitcast<u32>(exponent << 23u));
}
