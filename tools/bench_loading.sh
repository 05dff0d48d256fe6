#!/usr/bin/env bash
# Reads models with gnomon and with the crate that the viewers of three-d use, in turn and in one run, for absolute times swing
# with whatever else the machine does. Here reading ends when a thing can be drawn and casts shadows: its triangles joined, what
# is open mended, its pictures decoded; there when triangles and pictures are in memory.
#   tools/bench_loading.sh [ROUNDS] [FILE …]     default: 5 rounds of ../shared/models
# Prints a CSV: the file, its bytes and triangles, the median of each, milliseconds, and how many times as long ours takes.
set -euo pipefail
cd "$(dirname "$0")/.."
rounds=${1:-5}
shift || true
if [ $# -eq 0 ]; then
    models=../shared/models
    if [ ! -d "$models" ]; then
        echo "bench: no $models: name the files" >&2
        exit 1
    fi
    set -- "$models"/gltf/*.glb "$models"/{spot,stanford-bunny,torus40000}.obj
fi
echo "bench: building" >&2
cargo build --quiet --release --manifest-path tools/loading_peer/Cargo.toml --target-dir target/loading_peer
cargo bench --quiet --no-run --bench loading
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
median() { sort -g "$1" | awk '{ v[NR] = $1 } END { print v[int((NR + 1) / 2)] }'; }
echo "file,bytes,triangles,gnomon_ms,three_d_asset_ms,ratio"
for model in "$@"; do
    : >"$work/ours"
    : >"$work/theirs"
    for _ in $(seq "$rounds"); do
        # The first reading of a process warms it up.
        cargo bench --quiet --bench loading -- "$model" --rounds 2 | tail -n 1 >>"$work/ours"
        target/loading_peer/release/loading_peer 2 "$model" | tail -n 1 >>"$work/theirs"
    done
    ours=$(median "$work/ours")
    theirs=$(median "$work/theirs")
    echo "$(basename "$model"),$(stat -c %s "$model"),$(awk 'NR == 1 { print $2 }' "$work/ours"),$ours,$theirs,$(awk -v a="$ours" -v b="$theirs" 'BEGIN { printf "%.2f", a / b }')"
done
