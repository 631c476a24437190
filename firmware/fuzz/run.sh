#!/usr/bin/env bash
# Fuzzes every target at once for some seconds, from the kept corpus on. Usage: run.sh BUILD-FOLDER SECONDS [keep]
# What is new stays in the build folder; `keep` merges what reaches new code into the kept corpus.
set -euo pipefail
build=$1 seconds=$2 keep=${3:-}
kept=$(dirname "${BASH_SOURCE[0]}")/corpus
declare -A runs
for target in fuzz_packets fuzz_cable fuzz_imus; do
    mkdir -p "$build/corpus/$target"
    "$build/$target" -max_total_time="$seconds" -max_len=512 -timeout=10 -print_final_stats=1 \
        -artifact_prefix="$build/$target-" "$build/corpus/$target" "$kept/$target" >"$build/$target.log" 2>&1 &
    runs[$target]=$!
done
failed=0
for target in "${!runs[@]}"; do
    if wait "${runs[$target]}"; then
        awk -v target="$target" '/^Done/ { print "  " target ": " $2 " inputs, none broke anything" }' "$build/$target.log"
    else
        echo "$target broke. The input lies beside its log, $build/$target.log:"
        tail -n 40 "$build/$target.log"
        failed=1
    fi
    if [ -n "$keep" ]; then
        "$build/$target" -merge=1 -use_counters=0 -max_len=512 "$kept/$target" "$build/corpus/$target" 2>/dev/null
    fi
done
exit $failed
