#!/usr/bin/env bash
# Times the four scenes of ../shared/peers with gnomon and with OGRE's stencil shadows, in turn and in one run, for
# absolute times swing with whatever else the machine does. Ratios are taken round by round; the table has their medians.
#   tools/bench_volumes.sh [ROUNDS] [FRAMES]     default: 5 rounds of 100 frames
# Each program's own GPU driver is Mesa's software one where there is no other: OpenGL there, Vulkan here.
set -euo pipefail
cd "$(dirname "$0")/.."
rounds=${1:-5}
frames=${2:-100}
peers=../shared/peers
# Where shadow_peers.sh builds them.
built=/tmp/gnomon-peers
warm_up=10

if [ ! -x "$peers/shadow_peers.sh" ]; then
    echo "bench: no $peers: nothing to compare with; timing gnomon alone" >&2
    exec cargo bench --quiet --bench volumes -- --frames "$frames"
fi
scenes=(torus2500 bunny5k nefertiti10k torus40k)
if [ ! -x "$built/ogre" ] || [ ! -f "$built/torus40k.txt" ]; then
    echo "bench: building the peers" >&2
    # In a folder of their own: OGRE leaves a log where it runs.
    (peers=$(realpath "$peers") && mkdir -p "$built" && cd "$built" && "$peers/shadow_peers.sh" 12 >/dev/null)
fi
cargo bench --quiet --no-run --bench volumes
told=$(cargo bench --quiet --bench volumes -- --frames 1 --scene torus2500)
adapter=${told%%$'\n'*}

figures=$(mktemp)
trap 'rm -f "$figures"' EXIT
ogre() { # SCENE MODE: the median, ms
    (cd "$built" && xvfb-run -a timeout 300 ./ogre "$1.txt" "$2" $((frames + warm_up)) - move 2>/dev/null) |
        sed -n 's/^ogre.* median \([0-9.]*\) ms.*/\1/p'
}
gnomon() { # SCENE: the median, ms
    local csv
    csv=$(mktemp)
    cargo bench --quiet --bench volumes -- --scene "$1" --frames "$frames" --csv "$csv" >/dev/null
    tail -n 1 "$csv" | cut -d , -f 8
    rm -f "$csv"
}
for round in $(seq "$rounds"); do
    for scene in "${scenes[@]}"; do
        echo "bench: round $round of $rounds, $scene" >&2
        echo "$scene $(gnomon "$scene") $(ogre "$scene" stencil_mod) $(ogre "$scene" stencil_add)" >>"$figures"
    done
done

echo "$adapter"
awk -v scenes="${scenes[*]}" -v rounds="$rounds" -v frames="$frames" '
    function median(list,   values, count, i, j, swap) {
        count = split(list, values, " ")
        for (i = 2; i <= count; i++)
            for (j = i; j > 1 && values[j] + 0 < values[j - 1] + 0; j--) {
                swap = values[j]; values[j] = values[j - 1]; values[j - 1] = swap
            }
        return count % 2 ? values[(count + 1) / 2] : (values[count / 2] + values[count / 2 + 1]) / 2
    }
    NF != 4 { print "bench: a program gave no time: " $0 > "/dev/stderr"; failed = 1; exit }
    {
        ours[$1] = ours[$1] " " $2; mod[$1] = mod[$1] " " $3; add[$1] = add[$1] " " $4
        to_mod[$1] = to_mod[$1] " " $2 / $3; to_add[$1] = to_add[$1] " " $2 / $4
    }
    END {
        if (failed) exit 1
        printf "%d rounds of %d frames, 640x480, one sample, the caster turns; medians, ms\n", rounds, frames
        printf "%-14s %8s %12s %12s %10s %10s   ours/mod, round by round\n", "scene", "gnomon", "stencil_mod", "stencil_add", "ours/mod", "ours/add"
        count = split(scenes, names, " ")
        for (i = 1; i <= count; i++) {
            s = names[i]
            list = ""
            n = split(to_mod[s], each, " ")
            for (j = 1; j <= n; j++) list = list sprintf(" %.2f", each[j])
            printf "%-14s %8.2f %12.2f %12.2f %10.2f %10.2f  %s\n", s, median(ours[s]), median(mod[s]), median(add[s]), median(to_mod[s]), median(to_add[s]), list
        }
    }' "$figures"
