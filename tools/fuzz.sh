#!/bin/sh
# Fuzzes all readers, in turn, for so many minutes together (60 by default): tools/fuzz.sh [MINUTES] [TARGET...]
# It wants a nightly compiler and cargo-fuzz (cargo install cargo-fuzz). Inputs that crash, hang for 20 s or ask for more than
# 256 MB at once are kept in fuzz/artifacts, and the exit status says so; what was learned stays in fuzz/corpus.
set -u
cd "$(dirname "$0")/.."
minutes=${1:-60}
[ $# -gt 0 ] && shift
targets=${*:-$(cargo +nightly fuzz list)}
count=$(echo "$targets" | wc -w)
cargo +nightly fuzz build --sanitizer none || exit
failed=
for target in $targets; do
    mkdir -p "fuzz/corpus/$target" "fuzz/artifacts/$target"
    # Temporary files in memory.
    TMPDIR=$([ -w /dev/shm ] && echo /dev/shm || echo /tmp) cargo +nightly fuzz run --sanitizer none "$target" \
        "fuzz/corpus/$target" "fuzz/seeds/$target" -- -max_total_time=$((minutes * 60 / count)) -timeout=20 \
        -malloc_limit_mb=256 -rss_limit_mb=2048 -max_len=65536 -print_final_stats=1 \
        >"fuzz/artifacts/$target.log" 2>&1 || failed="$failed $target"
    echo "$target: $(grep -E '^#[0-9]+' "fuzz/artifacts/$target.log" | tail -1 | tr -s '\t ' ' ')"
done
if [ -n "$failed" ]; then
    echo "failed:$failed (see fuzz/artifacts)" >&2
    exit 1
fi
