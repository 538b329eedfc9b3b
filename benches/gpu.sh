#!/usr/bin/env bash
# Measures collapsar on this machine's graphics card in one call, without a display, and leaves a record of it.
#
# Builds the release profile, measures the memory's bandwidth, makes the largest synthetic model that the time allows,
# and flies it: every strategy with the two cameras of the paper (about 5.8 and 17.4 million active triangles), every
# path, budgets on the CPU and the GPU, and live with a tenth of the file in memory. A table comes last; beside the time of
# each pass it has the bytes that the pass must move over the measured copy bandwidth: its floor.
#
# Needs bash, awk and the usual tools of a Linux system, and cargo unless COLLAPSAR_BIN names a built collapsar.
# Every command has a time limit, and the record is written anew after each: what was measured stays, whatever follows.
# benches/records/README.md explains the files.
set -uo pipefail

usage() {
    cat <<'TEXT'
usage: benches/gpu.sh [--seconds N] [--quick] [--triangles N] [--work DIR] [--keep] [OUT]

  --seconds N    how long all of it may take (default 480); half of it is for measuring, however long the build
  --quick        a tiny model and 90 seconds in all: proves that the script works, and measures nothing worth keeping
  --triangles N  the size of the model, instead of what the time allows; k and M work
  --work DIR     where models and flights go while it runs (default: a temporary folder)
  --keep         do not remove them at the end: `collapsar report` makes a page of the flights
  OUT            the folder of the record (default: benches/records/DATE-ADAPTER)

  COLLAPSAR_BIN=PATH      use this program and build nothing
  COLLAPSAR_ADAPTER=NAME  a part of the name of the adapter to use
TEXT
}

fail() {
    echo "gpu.sh: $1" >&2
    exit "${2:-1}"
}

# ---------------------------------------------------------------------------------------------------- arguments

total_seconds=480 quick=0 wanted_triangles="" work="" keep=0 out=""
while [[ $# -gt 0 ]]; do
    case $1 in
    --seconds | --triangles | --work)
        [[ $# -ge 2 ]] || fail "$1 needs a value (--help)" 2
        case $1 in
        --seconds) total_seconds=$2 ;;
        --triangles) wanted_triangles=$2 ;;
        --work) work=$2 ;;
        esac
        shift
        ;;
    --quick) quick=1 ;;
    --keep) keep=1 ;;
    -h | --help) usage && exit 0 ;;
    -*) fail "unknown option $1 (--help)" 2 ;;
    *)
        [[ -z $out ]] || fail "one output folder, please: $out, $1 (--help)" 2
        out=$1
        ;;
    esac
    shift
done
[[ $total_seconds =~ ^[1-9][0-9]{0,5}$ ]] || fail "--seconds must be a whole number from 1 to 999999: $total_seconds" 2
[[ -z $wanted_triangles || $wanted_triangles =~ ^[0-9.]+[kMG]?$ ]] ||
    fail "--triangles must be a number, with k, M or G or without: $wanted_triangles" 2
[[ $quick == 0 || $total_seconds != 480 ]] || total_seconds=90

for tool in awk timeout mktemp date df sync; do
    command -v "$tool" >/dev/null || fail "\`$tool\` is missing"
done
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd) || fail "cannot find the project's folder"
here=$PWD
export LC_ALL=C XDG_RUNTIME_DIR="${XDG_RUNTIME_DIR:-/tmp}"
readonly root here quick keep wanted_triangles

# The paper's active triangles for its cameras (a) and (b) on the Boeing 777, and the size of that.
readonly paper_a=5814786 paper_b=17373329 paper_triangles=332000000 paper_parts=718000

# ---------------------------------------------------------------------------------------------------- small tools

# Seconds since the start, with decimals.
started=$(date +%s.%N)
now() { awk -v a="$started" -v b="$(date +%s.%N)" 'BEGIN { printf "%.2f", b - a }'; }
calc() { awk "BEGIN { printf \"${2:-%.6g}\", ($1) }"; }
holds() { awk "BEGIN { exit !($1) }"; }
whole() { awk -v x="$1" 'BEGIN { printf "%d", x }'; }
left() { calc "$total_seconds - $(now)"; }
say() { printf '[%6.1f s] %s\n' "$(now)" "$*"; }

notes=()
note() {
    notes+=("$*")
    say "$*"
}

# The values of a JSON file that is printed one value a line, as `path.of.key<tab>value`.
flatten() {
    awk '
        function path(   i, text) {
            for (i = 1; i <= depth; i++) if (name[i] != "") text = text name[i] "."
            return text
        }
        {
            sub(/^[ \t]+/, ""); sub(/,$/, "")
            key = ""
            if (match($0, /^"[^"]*": /)) { key = substr($0, 2, RLENGTH - 4); $0 = substr($0, RLENGTH + 1) }
            if ($0 == "{" || $0 == "[") { name[++depth] = key; next }
            if ($0 == "}" || $0 == "]") { depth--; next }
            gsub(/^"|"$/, "")
            print path() key "\t" $0
        }' "$1"
}
value() { [[ -s $1 ]] && flatten "$1" | awk -F '\t' -v key="$2" '$1 == key { print $2 }'; }
# A column of a CSV: its sum or its greatest.
column() {
    awk -F, -v name="$2" -v what="$3" '
        NR == 1 { for (i = 1; i <= NF; i++) if ($i == name) at = i; next }
        at { sum += $at; if ($at > most) most = $at }
        END { printf "%.0f", (what == "sum" ? sum : most) }' "$1"
}

# Runs a command in the work folder within so many seconds: its output in log/LABEL.out and .err. Says what went wrong.
failures=0
limited() {
    local seconds=$1 label=$2 status
    shift 2
    (cd "$work" && exec timeout --foreground -k 5 "$(calc "$seconds" %.1f)" "$@") >"$work/log/$label.out" 2>"$work/log/$label.err" </dev/null
    status=$?
    [[ $status == 0 ]] && return 0
    failures=$((failures + 1))
    if [[ $status == 124 || $status == 137 ]]; then
        note "$label: not done within its $(calc "$seconds" %.0f) s, so without numbers"
    else
        note "$label: failed ($status): $(tail -n 1 "$work/log/$label.err")"
    fi
    return 1
}

# ---------------------------------------------------------------------------------------------------- the program

find_program() {
    if [[ -n ${COLLAPSAR_BIN:-} ]]; then
        program=$(cd "$here" && cd "$(dirname "$COLLAPSAR_BIN")" && pwd)/$(basename "$COLLAPSAR_BIN")
        [[ -x $program && -f $program ]] || fail "COLLAPSAR_BIN names no program: $COLLAPSAR_BIN"
        say "using the program that COLLAPSAR_BIN names"
        return
    fi
    command -v cargo >/dev/null || fail "\`cargo\` is missing: install Rust (https://rustup.rs), or name a built collapsar by COLLAPSAR_BIN"
    say "building the release profile"
    # Without the network first: crates that are there need no index.
    if ! build --offline && ! build; then
        tail -n 20 "$work/log/build.err" >&2
        fail "the build failed; without a network the crates must be there already (\`cargo vendor\`, \`cargo fetch\`), or build elsewhere and name the program by COLLAPSAR_BIN"
    fi
    program=${CARGO_TARGET_DIR:-target}/release/collapsar
    [[ $program == /* ]] || program=$root/$program
    total_seconds=$(calc "($(now) > $total_seconds / 2) ? $(now) + $total_seconds / 2 : $total_seconds" %.0f)
    say "built; all of it may take $total_seconds s"
}

build() {
    (cd "$root" && timeout -k 5 1500 cargo build --release --locked "$@") >"$work/log/build.out" 2>"$work/log/build.err" </dev/null
}

# ---------------------------------------------------------------------------------------------------- the machine

measure_machine() {
    say "measuring the bandwidth of the memory"
    limited 60 bandwidth "$program" bandwidth --json || fail "no measurement without a graphics adapter: $(tail -n 1 "$work/log/bandwidth.err")"
    cp "$work/log/bandwidth.out" "$work/machine.json"
    adapter=$(value "$work/machine.json" adapter)
    is_software=$(value "$work/machine.json" is_software)
    copy_rate=$(value "$work/machine.json" bytes_per_second.copy_best)
    upload_rate=$(value "$work/machine.json" bytes_per_second.upload_best)
    write_rate=$(value "$work/machine.json" bytes_per_second.write_best)
    say "$adapter: copies $(calc "$copy_rate / 1e9" %.1f) GB/s (read and written), uploads $(calc "$upload_rate / 1e9" %.1f) GB/s"
    [[ $is_software == true ]] && warn_of_software
}

warn_of_software() {
    cat <<'TEXT'

  ############################################################################################
  #  SOFTWARE VULKAN: there is no graphics card here. Times below are those of a processor   #
  #  that plays one. Only ratios within this run mean anything; do not quote them as speed.  #
  ############################################################################################

TEXT
}

open_record() {
    if [[ -z $out ]]; then
        local slug=${adapter,,}
        slug=${slug//[^a-z0-9]/-}
        while [[ $slug == *--* ]]; do slug=${slug//--/-}; done
        slug=${slug#-} && slug=${slug:0:40}
        out=$root/benches/records/$(date +%F)-${slug%-}
        local first=$out number=2
        while [[ -e $out ]]; do out=$first-$((number++)); done
    fi
    [[ $out == /* ]] || out=$here/$out
    mkdir -p "$out" || fail "cannot make the output folder: $out"
    cp "$work/machine.json" "$out/" || fail "cannot write into the output folder: $out"
}

# ---------------------------------------------------------------------------------------------------- the model

# synth NAME TRIANGLES PARTS SECONDS
synth() {
    limited "$4" "synth-$1" "$program" synth --triangles "$2" --parts "$3" --memory "$synth_memory" --json -o "$1.clps"
}

in_triangles() { awk -v text="$1" 'BEGIN {
    scale["k"] = 1e3; scale["M"] = 1e6; scale["G"] = 1e9; unit = substr(text, length(text))
    printf "%.0f", (unit in scale ? scale[unit] : 1) * text }'; }

# The largest model of a ladder of halves that time and disk allow; what it is like in $model.
make_model() {
    local memory rate seconds triangles free probe=1000000
    [[ $quick == 1 ]] && probe=100000
    memory=$(value "$work/machine.json" memory_bytes)
    synth_memory=$(awk -v m="$memory" 'BEGIN { m = m / 4; if (!(m > 1e9)) m = 1e9; if (m > 8e9) m = 8e9; printf "%.0f", m }')
    say "making a model of $probe triangles, to see how long that takes"
    synth probe "$probe" $((probe / 462)) "$(calc "30 + $(left) / 4")" || fail "not even a small model could be made: see above"
    rate=$(value "$work/log/synth-probe.out" triangles_per_second)
    seconds=$(calc "0.3 * $(left)")
    free=$(df -Pk "$work" | awk 'NR == 2 { printf "%.0f", $4 * 1024 }')
    if [[ -n $wanted_triangles ]]; then
        triangles=$(in_triangles "$wanted_triangles")
        # It is asked for, so it may take longer.
        seconds=$(calc "0.6 * $(left)")
    elif [[ $quick == 1 ]]; then
        triangles=$probe
    else
        # While it is made, a container takes up to twice its 20 bytes a triangle.
        triangles=$(awk -v most="$(calc "$rate * $seconds * 0.7")" -v disk="$(calc "$free / 50")" -v t="$paper_triangles" \
            'BEGIN { while (t > 200000 && (t > most || t > disk)) t = t / 2; printf "%.0f", t }')
    fi
    # A processor draws some ten frames a second of this many, and one in two seconds of ten times as many.
    if [[ $is_software == true && -z $wanted_triangles ]] && ((triangles > 1300000)); then
        triangles=1300000
        note "software Vulkan: the model is kept at $triangles triangles (--triangles for another)"
    fi
    model=probe
    if ((triangles > probe)); then
        say "making a model of $triangles triangles (about $(calc "$triangles / $rate" %.0f) s)"
        local parts=$((triangles * paper_parts / paper_triangles))
        if synth model "$triangles" "$parts" "$(calc "2 * $seconds")"; then
            model=model
        else
            rm -f "$work"/model.clps*
            note "the flights are through the small model of $probe triangles instead"
        fi
    fi
    model_triangles=$(value "$work/log/synth-$model.out" triangles_placed)
    model_bytes=$(value "$work/log/synth-$model.out" file_bytes)
    cp "$work/log/synth-$model.out" "$work/model.json"
    say "model: $model_triangles triangles placed, $(calc "$model_bytes / 1e6" %.0f) MB"
}

# ---------------------------------------------------------------------------------------------------- flights

# What a flight is to have, in the order flown.
flights=()
size=(--size 1280x720)
[[ $quick == 1 ]] && size=(--size 320x180)

fly() { # SECONDS LABEL FRAMES arguments...
    local seconds=$1 label=$2 frames=$3
    shift 3
    rm -rf "${work:?}/$label"
    limited "$seconds" "$label" "$program" fly "$model.clps" --frames "$frames" "${size[@]}" "$@" --out "$label"
}

# The median frame of a flight, or of the three of a comparison together, in seconds.
frame_seconds() {
    local file sum=0 ms
    for file in "$work/$1"/summary.json "$work/$1"/*/summary.json; do
        # The summary of a comparison repeats those of its three.
        if [[ ! -s $file ]] || grep -q '"strategies"' "$file"; then continue; fi
        ms=$(value "$file" frame_ms_p50)
        sum=$(calc "$sum + ${ms:-0} / 1000" %.9g)
    done
    echo "$sum"
}

# Flies as many frames as fit the seconds: a few first, to see how long they take.
fly_for() { # SECONDS LABEL MOST_FRAMES arguments...
    local seconds=$1 label=$2 most=$3 probe=5 before wall frame frames limit
    shift 3
    limit=$(calc "$(left) + 20")
    holds "$(left) < 3" && { note "$label: left out, the time is over" && return 1; }
    [[ $quick == 1 ]] && probe=3
    before=$(now)
    fly "$(calc "($seconds + 15 < $limit) ? $seconds + 15 : $limit")" "$label" $probe "$@" || return 1
    flights+=("$label")
    wall=$(calc "$(now) - $before")
    frame=$(frame_seconds "$label")
    # What the small flight took beyond its median frames is paid again: opening, and the first frame, which sends all.
    frames=$(awk -v s="$seconds" -v w="$wall" -v f="$frame" -v p=$probe -v m="$most" 'BEGIN {
        fixed = w - p * f; if (fixed < 0) fixed = 0
        n = f > 0 ? (s - w - fixed) / (1.6 * f) : m
        printf "%d", (n > m ? m : n) }')
    if ((frames > 2 * probe)); then
        limit=$(calc "$(left) + 20")
        mv "$work/$label" "$work/$label.short"
        if ! fly "$(calc "(1.5 * $seconds + 10 < $limit) ? 1.5 * $seconds + 10 : $limit")" "$label" "$frames" "$@"; then
            rm -rf "${work:?}/$label"
            mv "$work/$label.short" "$work/$label"
            note "$label: only its first $probe frames"
        fi
        rm -rf "${work:?}/$label.short"
    fi
    say "$label: $(first_summary "$label" frames) frames"
    publish
}

first_summary() {
    local file
    for file in "$work/$1/summary.json" "$work/$1/coherent/summary.json"; do
        if [[ -s $file ]] && ! grep -q '"strategies"' "$file"; then value "$file" "$2" && return; fi
    done
}

# The vertices to spend for so many active triangles: tried, and put right twice.
calibrate() { # LABEL TRIANGLES
    local label=$1 wanted=$2 round got
    budget=$(calc "0.7 * $wanted" %.0f)
    for round in 1 2 3; do
        fly "$(calc "$(left) / 6 + 20")" "calibrate-$label" 1 --path walk --budget "$budget" --no-hash || return 1
        got=$(first_summary "calibrate-$label" active_triangles_mean)
        holds "$got > 0.97 * $wanted && $got < 1.03 * $wanted" && break
        [[ $round == 3 ]] || budget=$(calc "($budget * $wanted / $got < 4e9) ? $budget * $wanted / $got : 4e9" %.0f)
    done
    holds "$got > 0.9 * $wanted && $got < 1.1 * $wanted" ||
        note "camera ($label): $(whole "$got") active triangles with a budget of $budget vertices, not the $wanted that were wanted"
    say "camera ($label): $budget vertices a frame for $(whole "$got") active triangles"
}

# What the two cameras show: the paper's numbers if the model is four times as large, else a share of it.
aim() {
    target_a=$(calc "($model_triangles / 12 < $paper_a) ? $model_triangles / 12 : $paper_a" %.0f)
    target_b=$(calc "($model_triangles / 4 < $paper_b) ? $model_triangles / 4 : $paper_b" %.0f)
    ((target_b == paper_b)) || note "the model is too small for the paper's cameras: (a) and (b) show a twelfth and a quarter of it at most"
    calibrate a "$target_a" && budget_a=$budget
    calibrate b "$target_b" && budget_b=$budget
    [[ -n ${budget_a:-} ]] || fail "not one frame could be flown: see above"
}

# Shares of the time that is left; each step takes its own of those still to come.
weights_left=100
step() { # WEIGHT; the seconds in $share
    share=$(calc "$(left) * $1 / ($weights_left > $1 ? $weights_left : $1)")
    weights_left=$((weights_left - $1))
}

fly_all() {
    local path most=1000
    local most_of_path=300
    [[ $quick == 1 ]] && most=20 most_of_path=20
    step 20 && fly_for "$share" a-compare $most --path walk --budget "$budget_a" --compare --no-hash
    # Whether all strategies draw the same; hashing reads everything back, so its times are not told.
    step 5 && fly_for "$share" a-identity 20 --path walk --budget "$budget_a" --compare
    step 8 && fly_for "$share" a-walk $most --path walk --budget "$budget_a" --no-hash
    if [[ -n ${budget_b:-} ]]; then
        step 24 && fly_for "$share" b-compare $most --path walk --budget "$budget_b" --compare --no-hash
        step 9 && fly_for "$share" b-walk $most --path walk --budget "$budget_b" --no-hash
    fi
    step 10 && fly_live
    step 5 && fly_for "$share" a-walk-cpu $most --path walk --budget "$budget_a" --select cpu --no-hash
    for path in orbit through still teleport; do
        step 4 && fly_for "$share" "a-$path" $most_of_path --path "$path" --budget "$budget_a" --no-hash
    done
    step 3 && fly_for "$share" a-orbit-cpu $most_of_path --path orbit --budget "$budget_a" --select cpu --no-hash
}

# Live with a tenth of the file in memory: from a cold page cache if possible, and then the same again.
fly_live() {
    local cap frames most=1000
    [[ $quick == 1 ]] && most=20
    cap=$(calc "$model_bytes / 10" %.0f)
    local live=(--path walk --budget "$budget_a" --live --memory "$cap" --no-hash)
    drop_cache
    fly_for "$(calc "$share / 3")" live-first $most "${live[@]}" || { cache_state="" && return; }
    frames=$(first_summary live-first frames)
    # fly_for has read the start of it once already, for its few frames.
    drop_cache
    fly "$(calc "$share + 20")" live-first "$frames" "${live[@]}"
    fly "$(calc "$share + 20")" live-again "$frames" "${live[@]}" && flights+=(live-again)
    note "live: $cache_state"
    publish
}

# Asks the system to forget the pages of the model, which needs no rights; the word for what came of it in $cache_state.
drop_cache() {
    local file=$work/$model.clps pages
    cache_state="warm, the page cache could not be dropped"
    sync "$file" 2>/dev/null
    dd if="$file" iflag=nocache count=0 status=none 2>/dev/null || return
    if command -v fincore >/dev/null; then
        pages=$(fincore -bno RES "$file" 2>/dev/null | tr -d ' ')
        holds "${pages:-1} > 0.02 * $model_bytes" && return
        cache_state="cold before live-first, checked"
    else
        cache_state="cold before live-first as far as the system did what it was asked (no fincore to check)"
    fi
}

# ---------------------------------------------------------------------------------------------------- the record

# Every flight with the folder of its summary: `a-compare/coherent` for one of three.
summaries() {
    local label strategy
    for label in ${flights[@]+"${flights[@]}"}; do
        [[ -s $work/$label/frames.csv ]] && echo "$label"
        for strategy in coherent whole per-part; do
            [[ -s $work/$label/$strategy/frames.csv ]] && echo "$label/$strategy"
        done
    done
}

publish() {
    write_json >"$out/summary.json" && thin_frames >"$out/frames.csv" && write_table >"$out/table.txt"
}

quoted() { awk -v text="$1" 'BEGIN { gsub(/\\/, "\\\\", text); gsub(/"/, "\\\"", text); printf "\"%s\"", text }'; }

write_json() {
    local flight separator="" line
    echo '{'
    echo '"run": {'
    printf '  "date": "%s",\n  "seconds": %s,\n  "quick": %s,\n  "commit": %s,\n  "page_cache": %s,\n  "notes": [' \
        "$(date +%F)" "$(now)" "$([[ $quick == 1 ]] && echo true || echo false)" "$(quoted "$commit")" "$(quoted "${cache_state:-}")"
    for line in ${notes[@]+"${notes[@]}"}; do
        printf '%s\n    %s' "$separator" "$(quoted "$line")"
        separator=,
    done
    printf '\n  ]\n},\n"machine":\n'
    cat "$work/machine.json"
    printf ',\n"model":\n'
    cat "$work/model.json"
    printf ',\n"flights": {\n'
    separator=""
    while read -r flight; do
        printf '%s%s:\n' "$separator" "$(quoted "$flight")"
        cat "$work/$flight/summary.json"
        separator=,
    done < <(summaries)
    echo '}}'
}

# At most 60 lines a flight: of each band of frames the slowest. First line and column say which.
thin_frames() {
    local flight header=1
    while read -r flight; do
        awk -F, -v flight="$flight" -v header=$header -v most=60 -v frames="$(value "$work/$flight/summary.json" frames)" '
            BEGIN {
                split("frame instances_visible active_vertices active_triangles active_ecol streamed_vertices streamed_triangles bytes_sent misses boxes disk_bytes major_faults memory_bytes gpu_bytes select_ms residency_ms delta_ms gather_ms upload_ms grant_ms prefix_sum_ms defragment_ms reform_ms draw_ms frame_ms", kept, " ")
                band = int((frames + most - 1) / most); if (band < 1) band = 1
            }
            function cells(   i, text) { for (i = 1; i in kept; i++) text = text "," (NR == 1 ? kept[i] : $at[kept[i]]); return text }
            NR == 1 { for (i = 1; i <= NF; i++) at[$i] = i; if (header) print "flight" cells(); next }
            !held || $at["frame_ms"] > slowest { slowest = $at["frame_ms"]; line = flight cells(); held = 1 }
            (NR - 1) % band == 0 { print line; held = 0 }
            END { if (held) print line }' "$work/$flight/frames.csv"
        header=0
    done < <(summaries)
}

write_table() {
    local line
    [[ $is_software == true ]] && warn_of_software
    [[ $quick == 1 ]] && printf 'QUICK: a tiny model, to prove that the script works; nothing here is worth keeping.\n\n'
    flatten "$work/machine.json" | awk -F '\t' '{ v[$1] = $2 } END {
        r = "bytes_per_second."
        printf "adapter    %s (%s, %s)\n", v["adapter"], v["driver"], v["kind"]
        printf "machine    %s, %s threads, %.0f GiB\n", v["cpu"], v["cores"], v["memory_bytes"] / 2^30
        printf "bandwidth  copy %.1f GB/s (bytes read and written), upload %.1f GB/s, write to mapped memory %.1f GB/s; best of %s\n", v[r "copy_best"] / 1e9, v[r "upload_best"] / 1e9, v[r "write_best"] / 1e9, v[r "runs"]
        printf "timed by   %s\n", v["gpu_timestamps"] == "true" ? "timestamps on the GPU" : "the clock of the CPU around a wait for each pass" }'
    flatten "$work/model.json" | awk -F '\t' '{ v[$1] = $2 } END {
        printf "model      synth, %s: %.2f M triangles (%.2f M placed), %d parts, %d instances, %.1f MB\n", v["layout"], v["triangles"] / 1e6, v["triangles_placed"] / 1e6, v["parts"], v["instances"], v["file_bytes"] / 1e6
        printf "           made at %.0f k triangles/s, %.1f bytes a triangle, peak memory %.0f MiB\n", v["triangles_per_second"] / 1e3, v["file_bytes"] / v["triangles"], v["peak_rss_bytes"] / 2^20 }'
    strategies_table
    passes_table
    paths_table
    live_table
    if [[ ${#notes[@]} -gt 0 ]]; then
        printf '\nNotes\n'
        for line in "${notes[@]}"; do printf '  %s\n' "$line"; done
    fi
    printf '\n%s of at most %s s; commit %s\n' "$(now)" "$total_seconds" "$commit"
}

strategies_table() {
    local flight shown=0
    while read -r flight; do
        case $flight in a-compare/* | b-compare/*) ;; *) continue ;; esac
        ((shown++)) || printf '\nStrategies on the path walk; means a frame, ms, but for the median\n%-7s %-9s %6s %9s %9s %9s %9s %9s %9s %9s %10s %9s %10s\n' \
            camera strategy frames median select collect upload defrag reform draw active sent streamed
        flatten "$work/$flight/summary.json" | awk -F '\t' -v camera="(${flight:0:1})" '{ v[$1] = $2 } END {
            s = "stage_ms."
            printf "%-7s %-9s %6d %9.2f %9.2f %9.2f %9.2f %9.2f %9.2f %9.2f %8.2f M %6.2f MB %8.4f %%\n", camera, v["strategy"], v["frames"], v["frame_ms_p50"], v[s "select"] + v[s "residency"], v[s "delta"] + v[s "gather"], v[s "upload"], v[s "defragment"], v[s "reform"], v[s "draw"], v["active_triangles_mean"] / 1e6, v["bytes_sent_total"] / v["frames"] / 1e6, 100 * (v["steady_share"] == "null" ? 0 : v["steady_share"]) }'
    done < <(summaries)
    ((shown)) && printf '%s\n' "Means are of all frames; the first makes pipelines and buffers, and sends everything.  select: with residency.  collect: finding and gathering what is lacking.  defrag: with grants and prefix sums." \
        "streamed: bytes sent after the first frame over those that whole sends (the paper: 0.04 % of the triangles)."
    same_frames
}

# Whether the hashes of the comparison that has them agree: fly ends with an error if they do not.
same_frames() {
    local hash
    hash=$(value "$work/a-identity/coherent/summary.json" index_hash)
    [[ -z $hash ]] || echo "all strategies drew the same frames, camera (a), $(value "$work/a-identity/coherent/summary.json" frames) frames: index hash $hash"
}

# One line a pass: bytes that must be moved, over the measured rate, beside the measured time; means of the frames in
# which the pass ran, without the first, whose time is that of making pipelines and buffers.
passes_table() {
    local flight shown=0
    while read -r flight; do
        case $flight in a-walk | b-walk | a-orbit | a-compare/whole | b-compare/whole) ;; *) continue ;; esac
        ((shown++)) || printf '\nPasses beside their floor: bytes that must be moved, and the time that this takes at the measured bandwidth\n%-7s %-6s %-9s %-11s %11s %10s %11s %12s %8s %8s\n' \
            camera path strategy pass ran,frames MB floor,us time,us x,floor GB/s
        awk -F, -v camera="(${flight:0:1})" -v path="$(value "$work/$flight/summary.json" path)" -v strategy="$(value "$work/$flight/summary.json" strategy)" \
            -v copy="$copy_rate" -v upload="$upload_rate" -v host="$write_rate" '
            function add(pass, bytes, ms) { if (bytes > 0 && ms > 0) { ran[pass]++; moved[pass] += bytes; took[pass] += ms } }
            function pass_of(pass, ms) { add(pass, $at[pass "_floor_bytes"], ms) }
            function row(pass, rate,   n, floor, us) {
                printf "%-7s %-6s %-9s %-11s %11s ", camera, path, strategy, pass, sprintf("%d of %d", ran[pass], frames)
                if (!(n = ran[pass])) { printf "%10s %11s %12s %8s %8s\n", "-", "-", "-", "-", "-"; return }
                floor = 1e6 * moved[pass] / rate / n
                us = 1e3 * took[pass] / n
                printf "%10.4f %11.3f %12.1f %8.1f %8.2f\n", moved[pass] / n / 1e6, floor, us, us / floor, moved[pass] / took[pass] / 1e6
            }
            NR == 1 { for (i = 1; i <= NF; i++) at[$i] = i; next }
            NR == 2 { next }
            {
                frames++
                add("gather *", $at["bytes_sent"], $at["gather_ms"])
                add("upload *", $at["bytes_sent"], $at["upload_ms"])
                pass_of("grant", $at["grant_ms"])
                pass_of("prefix_sum", $at["prefix_sum_ms"])
                pass_of("defragment", $at["defragment_ms"] - $at["grant_ms"] - $at["prefix_sum_ms"])
                pass_of("reform", $at["reform_ms"])
                pass_of("draw", $at["draw_ms"])
            }
            END {
                row("gather *", host); row("upload *", upload)
                row("grant", copy); row("prefix_sum", copy); row("defragment", copy); row("reform", copy); row("draw", copy)
            }' "$work/$flight/frames.csv"
    done < <(summaries)
    ((shown)) && printf '%s\n' "* by the CPU: gather writes into mapped memory, upload is the transfer until the GPU has it; the others by the copy bandwidth." \
        "  draw: indices, vertices, instances and the picture once; no depth, no samples, no arithmetic." \
        "  Means of the frames in which a pass ran, the first frame apart: it makes pipelines and buffers, and sends everything."
}

paths_table() {
    local flight shown=0
    while read -r flight; do
        case $flight in a-walk* | a-orbit* | a-through | a-still | a-teleport | b-walk) ;; *) continue ;; esac
        ((shown++)) || printf '\nPaths, strategy coherent; ms\n%-7s %-9s %-7s %6s %9s %9s %9s %9s %11s %10s\n' \
            camera path select frames median p99 p99.9 select,ms sent/frame streamed
        flatten "$work/$flight/summary.json" | awk -F '\t' -v camera="(${flight:0:1})" '{ v[$1] = $2 } END {
            printf "%-7s %-9s %-7s %6d %9.2f %9.2f %9.2f %9.2f %8.3f MB %8.4f %%\n", camera, v["path"], v["select"], v["frames"], v["frame_ms_p50"], v["frame_ms_p99"], v["frame_ms_p999"], v["stage_ms.select"], v["bytes_sent_total"] / v["frames"] / 1e6, 100 * (v["steady_share"] == "null" ? 0 : v["steady_share"]) }'
    done < <(summaries)
    ((shown)) && echo "p99 of fewer than 100 frames, and p99.9 of fewer than 1,000, is the slowest frame: mostly the first, which sends everything."
}

# The nearest-rank percentiles of the frames of a flight after the first, in milliseconds.
percentiles() { # FLIGHT PERCENT...
    local flight=$1
    shift
    awk -F, 'NR == 1 { for (i = 1; i <= NF; i++) if ($i == "frame_ms") at = i } NR > 2 { print $at }' "$work/$flight/frames.csv" |
        sort -n | awk -v wanted="$*" '{ ms[NR] = $1 } END {
            n = split(wanted, percent, " ")
            for (i = 1; i <= n; i++) { rank = percent[i] * NR / 100; if (rank > int(rank)) rank = int(rank) + 1; printf "%s ", ms[rank < 1 ? 1 : rank] + 0 }
        }'
}

live_table() {
    local flight shown=0 csv median p99 p999 slowest
    while read -r flight; do
        case $flight in live-*) ;; *) continue ;; esac
        csv=$work/$flight/frames.csv
        ((shown++)) || printf '\nLive, memory capped at %s MB, a tenth of the file; ms, without the first frame (%s)\n%-11s %6s %9s %9s %9s %9s %12s %11s %11s %13s\n' \
            "$(calc "$model_bytes / 1e7" %.1f)" "${cache_state:-}" flight frames median p99 p99.9 slowest misses/frame read peak,held major,faults
        read -r median p99 p999 slowest < <(percentiles "$flight" 50 99 99.9 100)
        flatten "$work/$flight/summary.json" | awk -F '\t' -v flight="$flight" -v memory="$(column "$csv" memory_bytes most)" -v faults="$(column "$csv" major_faults sum)" \
            -v median="$median" -v p99="$p99" -v p999="$p999" -v slowest="$slowest" '{ v[$1] = $2 } END {
            printf "%-11s %6d %9.2f %9.2f %9.2f %9.2f %12.1f %8.1f MB %8.1f MB %13d\n", flight, v["frames"], median, p99, p999, slowest, v["misses_total"] / v["frames"], v["disk_bytes_total"] / 1e6, memory / 1e6, faults }'
    done < <(summaries)
    ((shown > 1)) && echo "p99.9 of live-first over that of live-again: $(calc "$(percentiles live-first 99.9) / $(percentiles live-again 99.9)" %.2f)"
    ((shown)) && echo "major faults: pages that the thread of the frame waited for."
}

# ---------------------------------------------------------------------------------------------------- all of it

finish() {
    local status=$?
    trap - EXIT
    if [[ -n ${out:-} && -s $work/model.json ]]; then
        publish
        echo
        cat "$out/table.txt"
        echo "record: $out"
    fi
    if [[ $keep == 1 ]]; then
        echo "models and flights: $work"
    else
        rm -rf "$work"
    fi
    exit $status
}

[[ -z $work ]] || mkdir -p "$work" || fail "cannot make the work folder: $work"
# A folder of its own in either case, which can be removed whatever else is there.
work=$(cd "${work:-${TMPDIR:-/tmp}}" && mktemp -d "$PWD/collapsar-gpu.XXXXXX") || fail "cannot make a folder for models and flights"
mkdir -p "$work/log"
trap finish EXIT
trap 'note "interrupted"; exit 130' INT TERM
commit=$(git -C "$root" describe --always --dirty=+changes --exclude "*" 2>/dev/null || echo unknown)

find_program
measure_machine
open_record
make_model
aim
fly_all
[[ $failures == 0 ]] || { note "$failures commands failed: see above" && exit 1; }
