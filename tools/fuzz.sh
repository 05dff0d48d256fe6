#!/bin/sh
# Fuzzes all readers, in turn, for so many minutes together (60 by default): tools/fuzz.sh [MINUTES] [TARGET...]
# Coverage comes from the compiler's own passes, as cargo-fuzz has them, and any Rust that builds gnomon has those: nothing needs
# to be installed. Inputs that crash, take longer than 20 s or more than 256 MB are kept in fuzz/artifacts, and the exit status
# says so; what was learned stays in fuzz/corpus. A line for each target, and its figures in fuzz/artifacts/figures.csv.
set -u
cd "$(dirname "$0")/.."
minutes=${1:-60}
[ $# -gt 0 ] && shift
targets=${*:-$(ls fuzz/seeds)}
count=$(echo "$targets" | wc -w)
seconds=$((minutes * 60 / count))
[ "$seconds" -gt 0 ] || seconds=1
host=$(rustc -vV | sed -n 's/^host: //p')

# Only what reads files is followed: the rest is compiled as fast as can be.
RUSTC_WRAPPER=$PWD/fuzz/compiler.sh "${CARGO:-cargo}" build --release --manifest-path fuzz/Cargo.toml --target "$host" || exit
fuzzer=fuzz/target/$host/release/gnomon-fuzz

# Files in memory, gone afterwards.
TMPDIR=$(mktemp -d -p "$([ -w /dev/shm ] && echo /dev/shm || echo /tmp)") || exit
export TMPDIR
trap 'rm -rf "$TMPDIR"' EXIT
trap 'exit 130' INT TERM

mkdir -p fuzz/artifacts
figures=fuzz/artifacts/figures.csv
[ -f $figures ] || echo "target,seconds,runs,edges,features,corpus_files,peak_mb,findings" >$figures
failed=
for target in $targets; do
    corpus=fuzz/corpus/$target
    kept=fuzz/artifacts/$target
    mkdir -p "$corpus" "$kept"
    before=$(ls "$kept" | wc -l)
    begun=$(date +%s)
    # The heap is limited to 256 MB by the targets themselves; the rest is the program, OpenCV and what the fuzzer keeps.
    # A broken heap may keep it from ending.
    export GNOMON_FUZZ_TARGET="$target"
    timeout -k 5 $((seconds + 60)) "$fuzzer" -max_total_time=$seconds -timeout=20 -rss_limit_mb=768 -max_len=65536 \
        -print_final_stats=1 -verbosity=1 -artifact_prefix="$kept/" "$corpus" "fuzz/seeds/$target" >"$kept.log" 2>&1 || failed="$failed $target"
    ended=$(date +%s)
    # What others reach too is not kept, where finding out takes no longer than the run did.
    mkdir "$TMPDIR/least"
    timeout "$seconds" "$fuzzer" -merge=1 -timeout=20 -rss_limit_mb=768 -artifact_prefix="$TMPDIR/" "$TMPDIR/least" "fuzz/seeds/$target" "$corpus" \
        >"$kept.merge.log" 2>&1 && rm -r "$corpus" && mv "$TMPDIR/least" "$corpus"
    rm -rf "$TMPDIR/least"
    last=$(grep -a '^#[0-9].* cov: ' "$kept.log" | tail -1 | tr '\t' ' ')
    of() { echo "$last" | LC_ALL=C grep -a -o "$1[0-9]*" | head -1 | tr -dc 0-9; }
    stat() { sed -n "s/^stat::$1: *//p" "$kept.log"; }
    runs=$(stat number_of_executed_units)
    echo "$target,$((ended - begun)),${runs:-$(of '^#')},$(of 'cov: '),$(of 'ft: '),$(of 'corp: '),$(stat peak_rss_mb),$(($(ls "$kept" | wc -l) - before))" |
        tee -a $figures
done
if [ -n "$failed" ]; then
    echo "failed:$failed (see fuzz/artifacts)" >&2
    exit 1
fi
