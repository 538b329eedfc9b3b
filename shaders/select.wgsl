// select: spends the budget of vertices on the visible instances, each by its projected area.
//
// Reads:   rows (one an instance), old wishes, candidates (the instances to look at, ascending), those of the last time
// Writes:  wishes (one an instance; 0: culled, or no candidate), found (the candidates' own, for the host to read)
// Before:  the host finds the candidates (src/select/cull.rs);  after: the host makes grants of what was found
//
// Peng & Cao 2012, section 5.1, equation 1, with floors and ceilings: an instance of weight w = area^(1/alpha) gets
// respond(lambda * w), and lambda is the greatest f32 that all can be paid with. Positive floats are ordered as their
// bits are, so lambda is found digit by digit: eight rounds over the 16 values of a hexadecimal digit of its bits.
// Of the cells of one part, parents are drawn below the factor that would give them all they have, and their children
// from there on.
//
//   select_weigh    a lane a candidate: cull, weigh
//   select_clear    a lane a candidate of the last time: its old wish was read, and is 0 from here on
//   select_spend    a lane a candidate: what each of 16 candidates costs, summed by workgroup       (8 times, with
//   select_narrow   one workgroup: sums these, keeps the greatest candidate that can be paid          select_narrow)
//   select_jump     a lane a candidate: by how much it would grow at the next f32
//   prefix_sum      over the jumps
//   select_deal     a lane a candidate: deals out, in order, what was left over
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
    parent: u32,
    log2_cells: f32,
    padding: vec2<u32>,
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
    candidate_count: u32,
    previous_count: u32,
    parallel: u32,
    padding: u32,
}

struct Weighed {
    weight: f32,
    floor: u32,
    ceiling: u32,
    old: u32,
    open: f32,
    close: f32,
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
const NO_PARENT_ROW: u32 = 0xFFFFFFFFu;
// Above any factor.
const NEVER: f32 = 3e38;
// More cells than this do not lie above each other.
const MAX_CELL_DEPTH: u32 = 16u;

@group(0) @binding(0) var<uniform> params: SelectParams;
@group(0) @binding(1) var<storage, read> rows: array<SelectRow>;
@group(0) @binding(2) var<storage, read> old_wish: array<u32>;
@group(0) @binding(3) var<storage, read_write> weighed: array<Weighed>;
@group(0) @binding(4) var<storage, read_write> state: SelectState;
@group(0) @binding(5) var<storage, read_write> partials: array<u32>;
@group(0) @binding(6) var<storage, read_write> jumps: array<u32>;
@group(0) @binding(7) var<storage, read> jump_start: array<u32>;
@group(0) @binding(8) var<storage, read_write> wish: array<u32>;
@group(0) @binding(9) var<storage, read> candidates: array<u32>;
@group(0) @binding(10) var<storage, read> previous: array<u32>;
@group(0) @binding(11) var<storage, read_write> found: array<u32>;

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

// How near an instance is, and how large in the picture.
struct Seen {
    centre: vec3<f32>,
    log2_distance2: f32,
    log2_area: f32,
}

fn see(row: SelectRow) -> Seen {
    let centre = centre_from_eye(row);
    let radius2 = exact_dot(row.half_extent, row.half_extent);
    let distance2 =
        select(max(add(exact_dot(centre, centre), -radius2), mul(radius2, 0.01)), 1.0, params.parallel != 0u);
    let log2_distance2 = log2_exact(distance2);
    let log2_area = add(add(params.log2_area_scale, log2_exact(radius2)), -log2_distance2);
    return Seen(centre, log2_distance2, log2_area);
}

// A parent weighs as much as its cells would if each had its share of the area.
fn log2_weight(row: SelectRow, seen: Seen) -> f32 {
    let of_area = mul(min(seen.log2_area, params.log2_area_max), params.inverse_alpha);
    let of_cells = mul(add(1.0, -params.inverse_alpha), row.log2_cells);
    return clamp(add(of_area, of_cells), -MAX_LOG2_WEIGHT, MAX_LOG2_WEIGHT);
}

// log2 of the error that is allowed at a distance, in units of the row's error scale.
fn log2_allowed_error(row: SelectRow, log2_distance: f32) -> f32 {
    return add(add(params.log2_error_limit, log2_distance), -log2_exact(row.error_scale));
}

fn error_is_allowed(code: u32, log2_allowed: f32) -> bool {
    return code == 0u || mul(f32(i32(code) - 255), 0.125) <= log2_allowed;
}

// The factor from which on the children of a parent are drawn; the dead band delays the way back.
fn gate(row: SelectRow, seen: Seen, old: u32) -> f32 {
    let log2_allowed = log2_allowed_error(row, mul(seen.log2_distance2, 0.5));
    if params.error_limited != 0u && error_is_allowed(row.errors[0] & 0xFFu, log2_allowed) {
        return NEVER;
    }
    let factor = exp2_exact(add(log2_exact(f32(row.ceiling)), -log2_weight(row, seen)));
    return select(factor, mul(factor, add(1.0, -params.dead_band)), old == 0u);
}

// The factor from which on no ancestor is in a row's place.
fn opening(row: SelectRow) -> f32 {
    var open = 0.0;
    var index = row.parent;
    for (var depth = 0u; depth < MAX_CELL_DEPTH && index < params.instance_count; depth += 1u) {
        let parent = rows[index];
        open = max(open, gate(parent, see(parent), old_wish[index]));
        index = parent.parent;
    }
    return open;
}

// The least sampled vertex count whose error is allowed at this distance.
fn error_ceiling(row: SelectRow, log2_distance: f32) -> u32 {
    let log2_allowed = log2_allowed_error(row, log2_distance);
    var count = row.ceiling;
    for (var j = 0u; j < 16u; j += 1u) {
        let code = (row.errors[j / 4u] >> (8u * (j & 3u))) & 0xFFu;
        if error_is_allowed(code, log2_allowed) {
            count = sampled_count(row.ceiling, j);
        }
    }
    return count;
}

fn weigh(row: SelectRow, old: u32) -> Weighed {
    let seen = see(row);
    if outside_frustum(seen.centre, row.half_extent) || seen.log2_area < params.log2_area_min {
        return Weighed();
    }
    var ceiling = row.ceiling;
    if params.error_limited != 0u {
        ceiling = max(error_ceiling(row, mul(seen.log2_distance2, 0.5)), min(row.floor, row.ceiling));
    }
    let open = opening(row);
    var close = NEVER;
    if row.log2_cells > 0.0 {
        close = max(open, gate(row, seen, old));
    }
    let weight = exp2_exact(log2_weight(row, seen));
    return Weighed(weight, min(row.floor, ceiling), ceiling, min(old, u32(MAX_RESPONSE)), open, close);
}

fn is_drawn(item: Weighed, lambda_bits: u32) -> bool {
    let lambda = bitcast<f32>(lambda_bits);
    return item.open <= lambda && lambda < item.close;
}

// The budget of an instance at a factor: while it is drawn, never falls as the factor grows.
fn respond(item: Weighed, lambda_bits: u32) -> u32 {
    if !is_drawn(item, lambda_bits) {
        return 0u;
    }
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
    let at = group_number(group_id, groups) * GROUP + lane;
    if at == 0u {
        state = SelectState(0u, FIRST_STEP, 0u, 0u);
    }
    if at < params.candidate_count {
        let index = candidates[at];
        weighed[at] = weigh(rows[index], old_wish[index]);
    }
}

@compute @workgroup_size(64)
fn select_clear(
    @builtin(workgroup_id) group_id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let at = group_number(group_id, groups) * GROUP + lane;
    if at < params.previous_count {
        wish[previous[at]] = 0u;
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
    let present = index < params.candidate_count;
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
    if lane < WAYS && group * GROUP < params.candidate_count {
        let low = saturating_add(costs[lane], costs[lane + 16u]);
        let high = saturating_add(costs[lane + 32u], costs[lane + 48u]);
        partials[group * WAYS + lane] = saturating_add(low, high);
    }
}

// What a candidate costs in all, of the 16 sums that the lanes have made.
fn cost_of(candidate: u32) -> u32 {
    var cost = 0u;
    for (var i = 0u; i < 16u; i += 1u) {
        cost = saturating_add(cost, costs[i * WAYS + candidate]);
    }
    return cost;
}

@compute @workgroup_size(256)
fn select_narrow(@builtin(local_invocation_index) lane: u32) {
    let group_count = (params.candidate_count + GROUP - 1u) / GROUP;
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
    // Candidate 0 is known to be affordable, or nothing is. Bit by bit, as costs may fall where a parent closes.
    var best = 0u;
    for (var bit = WAYS / 2u; bit > 0u; bit >>= 1u) {
        let candidate = best + bit;
        if state.low + candidate * state.step <= MAX_LAMBDA && cost_of(candidate) <= params.budget {
            best = candidate;
        }
    }
    state.left = saturating_sub(params.budget, cost_of(best));
    state.low += best * state.step;
    state.step >>= 4u;
}

fn jump(item: Weighed) -> u32 {
    if state.low >= MAX_LAMBDA || is_drawn(item, state.low) != is_drawn(item, state.low + 1u) {
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
    if index < params.candidate_count {
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
    if index < params.candidate_count {
        let dealt = min(jumps[index], saturating_sub(state.left, jump_start[index]));
        let count = respond(weighed[index], state.low) + dealt;
        found[index] = count;
        wish[candidates[index]] = count;
    }
}
