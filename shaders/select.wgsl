// select: spends the budget of vertices on the visible instances, each by its projected area.
//
// Reads:   rows (one an instance), old wishes
// Writes:  wishes (0: culled)
// Before:  nothing;  after: the host reads the wishes and makes grants of them
//
// Peng & Cao 2012, section 5.1, equation 1, with floors and ceilings: an instance of weight w = area^(1/alpha) gets
// respond(lambda * w), and lambda is the greatest f32 that all can be paid with. Positive floats are ordered as their
// bits are, so lambda is found digit by digit: eight rounds over the 16 values of a hexadecimal digit of its bits.
//
//   select_weigh    a lane an instance: cull, weigh
//   select_spend    a lane an instance: what each of 16 candidates costs, summed by workgroup       (8 times, with
//   select_narrow   one workgroup: sums these, keeps the greatest candidate that can be paid          select_narrow)
//   select_jump     a lane an instance: by how much it would grow at the next f32
//   prefix_sum      over the jumps
//   select_deal     a lane an instance: deals out, in order, what was left over
//
// Every float operation is exact (shared/power.wgsl): wishes are those of src/reference/select.rs, bit for bit.

struct SelectRow {
    centre_high: vec3<f32>,
    floor: u32,
    centre_low: vec3<f32>,
    ceiling: u32,
    half_extent: vec3<f32>,
    error_scale: f32,
    errors: vec4<u32>,
}

struct SelectParams {
    eye_high: vec3<f32>,
    instance_count: u32,
    eye_low: vec3<f32>,
    budget: u32,
    planes: array<vec4<f32>, 6>,
    log2_area_scale: f32,
    log2_area_min: f32,
    log2_area_max: f32,
    inverse_alpha: f32,
    log2_error_limit: f32,
    error_limited: u32,
    dead_band: f32,
    zero: u32,
}

struct Weighed {
    weight: f32,
    floor: u32,
    ceiling: u32,
    old: u32,
}

struct SelectState {
    low: u32,
    step: u32,
    left: u32,
    padding: u32,
}

const GROUP: u32 = 64u;
// Candidates a round.
const WAYS: u32 = 16u;
// The first hexadecimal digit of a positive float is its highest.
const FIRST_STEP: u32 = 0x10000000u;
// 2^80, times the least weight of 2^-40 still above any ceiling, times the greatest of 2^40 still finite.
const MAX_LAMBDA: u32 = 0x67800000u;
const MAX_LOG2_WEIGHT: f32 = 40.0;
// Above any ceiling, and exact in f32.
const MAX_RESPONSE: f32 = 16777216.0;
const UNAFFORDABLE: u32 = 0xFFFFFFFFu;

@group(0) @binding(0) var<uniform> params: SelectParams;
@group(0) @binding(1) var<storage, read> rows: array<SelectRow>;
@group(0) @binding(2) var<storage, read> old_wish: array<u32>;
@group(0) @binding(3) var<storage, read_write> weighed: array<Weighed>;
@group(0) @binding(4) var<storage, read_write> state: SelectState;
@group(0) @binding(5) var<storage, read_write> partials: array<u32>;
@group(0) @binding(6) var<storage, read_write> jumps: array<u32>;
@group(0) @binding(7) var<storage, read> jump_start: array<u32>;
@group(0) @binding(8) var<storage, read_write> wish: array<u32>;

// The centre of the instance's box, seen from the eye.
fn centre_from_eye(row: SelectRow) -> vec3<f32> {
    return vec3<f32>(
        add(add(row.centre_high.x, -params.eye_high.x), add(row.centre_low.x, -params.eye_low.x)),
        add(add(row.centre_high.y, -params.eye_high.y), add(row.centre_low.y, -params.eye_low.y)),
        add(add(row.centre_high.z, -params.eye_high.z), add(row.centre_low.z, -params.eye_low.z)),
    );
}

fn outside_frustum(centre: vec3<f32>, half_extent: vec3<f32>) -> bool {
    for (var i = 0u; i < 6u; i += 1u) {
        let plane = params.planes[i];
        let distance = add(exact_dot(plane.xyz, centre), plane.w);
        if add(distance, exact_dot(abs(plane.xyz), half_extent)) < 0.0 {
            return true;
        }
    }
    return false;
}

// ceiling * 2^(-j / 2), rounded up: the vertex count of error sample j.
fn sampled_count(ceiling: u32, j: u32) -> u32 {
    var count = ceiling;
    if (j & 1u) != 0u {
        // 46341 / 65536 is the root of one half.
        count = (min(ceiling, 65536u) * 46341u + 65535u) >> 16u;
    }
    let halvings = j / 2u;
    return (count + (1u << halvings) - 1u) >> halvings;
}

// The least sampled vertex count whose error is allowed at this distance.
fn error_ceiling(row: SelectRow, log2_distance: f32) -> u32 {
    let log2_allowed = add(add(params.log2_error_limit, log2_distance), -log2_exact(row.error_scale));
    var count = row.ceiling;
    for (var j = 0u; j < 16u; j += 1u) {
        let code = (row.errors[j / 4u] >> (8u * (j & 3u))) & 0xFFu;
        let log2_error = mul(f32(i32(code) - 255), 0.125);
        if code == 0u || log2_error <= log2_allowed {
            count = sampled_count(row.ceiling, j);
        }
    }
    return count;
}

fn weigh(row: SelectRow, old: u32) -> Weighed {
    let centre = centre_from_eye(row);
    if outside_frustum(centre, row.half_extent) {
        return Weighed();
    }
    let radius2 = exact_dot(row.half_extent, row.half_extent);
    let distance2 = max(add(exact_dot(centre, centre), -radius2), mul(radius2, 0.01));
    let log2_distance2 = log2_exact(distance2);
    let log2_area = add(add(params.log2_area_scale, log2_exact(radius2)), -log2_distance2);
    if log2_area < params.log2_area_min {
        return Weighed();
    }
    let log2_weight = mul(min(log2_area, params.log2_area_max), params.inverse_alpha);
    var ceiling = row.ceiling;
    if params.error_limited != 0u {
        ceiling = max(error_ceiling(row, mul(log2_distance2, 0.5)), min(row.floor, row.ceiling));
    }
    let weight = exp2_exact(clamp(log2_weight, -MAX_LOG2_WEIGHT, MAX_LOG2_WEIGHT));
    return Weighed(weight, min(row.floor, ceiling), ceiling, min(old, u32(MAX_RESPONSE)));
}

// The budget of an instance at a factor: never falls as the factor grows.
fn respond(item: Weighed, lambda_bits: u32) -> u32 {
    let x = mul(bitcast<f32>(lambda_bits), item.weight);
    let old = f32(item.old);
    var count = u32(min(x, MAX_RESPONSE));
    if item.old > 0u && abs(add(x, -old)) <= mul(params.dead_band, old) {
        count = item.old;
    }
    return clamp(count, item.floor, item.ceiling);
}

@compute @workgroup_size(64)
fn select_weigh(
    @builtin(workgroup_id) group_id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    exact_zero = params.zero;
    let index = group_number(group_id, groups) * GROUP + lane;
    if index == 0u {
        state = SelectState(0u, FIRST_STEP, 0u, 0u);
    }
    if index < params.instance_count {
        weighed[index] = weigh(rows[index], old_wish[index]);
    }
}

var<workgroup> costs: array<u32, 1024>;

@compute @workgroup_size(64)
fn select_spend(
    @builtin(workgroup_id) group_id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    exact_zero = params.zero;
    let group = group_number(group_id, groups);
    let index = group * GROUP + lane;
    let present = index < params.instance_count;
    var item = Weighed();
    if present {
        item = weighed[index];
    }
    for (var way = 0u; way < WAYS; way += 1u) {
        let lambda = min(state.low + way * state.step, MAX_LAMBDA);
        costs[lane * WAYS + way] = respond(item, lambda);
    }
    workgroupBarrier();
    // Four lanes a candidate, 16 instances each, then one.
    let way = lane % WAYS;
    let quarter = lane / WAYS;
    var sum = 0u;
    for (var i = 0u; i < 16u; i += 1u) {
        sum = saturating_add(sum, costs[(quarter * 16u + i) * WAYS + way]);
    }
    workgroupBarrier();
    costs[lane] = sum;
    workgroupBarrier();
    if lane < WAYS && group * GROUP < params.instance_count {
        let low = saturating_add(costs[lane], costs[lane + 16u]);
        let high = saturating_add(costs[lane + 32u], costs[lane + 48u]);
        partials[group * WAYS + lane] = saturating_add(low, high);
    }
}

@compute @workgroup_size(256)
fn select_narrow(@builtin(local_invocation_index) lane: u32) {
    let group_count = (params.instance_count + GROUP - 1u) / GROUP;
    let way = lane % WAYS;
    var sum = 0u;
    for (var group = lane / WAYS; group < group_count; group += 16u) {
        sum = saturating_add(sum, partials[group * WAYS + way]);
    }
    costs[lane] = sum;
    workgroupBarrier();
    if lane != 0u {
        return;
    }
    // Candidate 0 is known to be affordable, or nothing is.
    var best = 0u;
    var best_cost = 0u;
    for (var k = 0u; k < WAYS; k += 1u) {
        var cost = 0u;
        for (var i = 0u; i < 16u; i += 1u) {
            cost = saturating_add(cost, costs[i * WAYS + k]);
        }
        if state.low + k * state.step > MAX_LAMBDA {
            cost = UNAFFORDABLE;
        }
        if k == 0u || cost <= params.budget {
            best = k;
            best_cost = cost;
        }
    }
    state.low += best * state.step;
    state.step >>= 4u;
    state.left = saturating_sub(params.budget, best_cost);
}

fn jump(item: Weighed) -> u32 {
    if state.low >= MAX_LAMBDA {
        return 0u;
    }
    return respond(item, state.low + 1u) - respond(item, state.low);
}

@compute @workgroup_size(64)
fn select_jump(
    @builtin(workgroup_id) group_id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    exact_zero = params.zero;
    let index = group_number(group_id, groups) * GROUP + lane;
    if index < params.instance_count {
        jumps[index] = jump(weighed[index]);
    }
}

@compute @workgroup_size(64)
fn select_deal(
    @builtin(workgroup_id) group_id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    exact_zero = params.zero;
    let index = group_number(group_id, groups) * GROUP + lane;
    if index < params.instance_count {
        let dealt = min(jumps[index], saturating_sub(state.left, jump_start[index]));
        wish[index] = respond(weighed[index], state.low) + dealt;
    }
}
