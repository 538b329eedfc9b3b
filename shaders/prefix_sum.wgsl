// prefix_sum: exclusive sums of a list of u32, with the total as one more entry; sums saturate.
//
// Reads:   input (input_count values; beyond them, zeros)
// Writes:  output (output_count values), totals (one sum a block of 256)
// Before:  grant (budgets become starts), select_jump;  after: defragment, reform, select_deal
//
// prefix_sum_blocks sums inside blocks of 256; the host runs it again on the totals until one block is left, and then
// prefix_sum_add adds to every block what came before it. Blelloch 1990; inside a block Hillis & Steele 1986.

struct PrefixSumParams {
    input_count: u32,
    output_count: u32,
}

const BLOCK: u32 = 256u;

@group(0) @binding(0) var<uniform> params: PrefixSumParams;
@group(0) @binding(1) var<storage, read> input: array<u32>;
@group(0) @binding(2) var<storage, read_write> output: array<u32>;
@group(0) @binding(3) var<storage, read_write> totals: array<u32>;

var<workgroup> sums: array<u32, 256>;

@compute @workgroup_size(256)
fn prefix_sum_blocks(
    @builtin(workgroup_id) group_id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let group = group_number(group_id, groups);
    let index = group * BLOCK + lane;
    var value = 0u;
    if index < params.input_count {
        value = input[index];
    }
    sums[lane] = value;
    workgroupBarrier();
    for (var step = 1u; step < BLOCK; step <<= 1u) {
        var below = 0u;
        if lane >= step {
            below = sums[lane - step];
        }
        workgroupBarrier();
        sums[lane] = saturating_add(sums[lane], below);
        workgroupBarrier();
    }
    if index < params.output_count {
        var before = 0u;
        if lane > 0u {
            before = sums[lane - 1u];
        }
        output[index] = before;
        if lane == 0u {
            totals[group] = sums[BLOCK - 1u];
        }
    }
}

// `input` is here the exclusive sums of the totals.
@compute @workgroup_size(256)
fn prefix_sum_add(
    @builtin(workgroup_id) group_id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let group = group_number(group_id, groups);
    let index = group * BLOCK + lane;
    if index < params.output_count {
        output[index] = saturating_add(input[group], output[index]);
    }
}
