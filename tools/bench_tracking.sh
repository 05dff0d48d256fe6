#!/usr/bin/env bash
# Tracks the sessions of ../shared with gnomon and with the libraries that it is built on (../shared/peers), in turn and
# in one run, for absolute times swing with whatever else the machine does.
#   tools/bench_tracking.sh [ROUNDS]     default: 5 rounds
# Prints a CSV: per session and program the frames of all rounds and those without a pose, the shift of the table in the
# picture, its jitter (rms of the error's change from frame to frame), and the time of a frame, by the peers' own judge.
set -euo pipefail
cd "$(dirname "$0")/.."
rounds=${1:-5}
shared=$(realpath ../shared 2>/dev/null || true)
if [ ! -f "$shared/peers/track_peer.cpp" ]; then
    echo "bench: no ../shared/peers: nothing to compare with" >&2
    exit 1
fi
if ! python3 -c 'import numpy' 2>/dev/null; then
    echo "bench: the peers' judge, pose_error.py, needs numpy (python3-numpy)" >&2
    exit 1
fi
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
echo "bench: building the peers" >&2
g++ -O2 "$shared/peers/track_peer.cpp" -o "$work/track_peer" $(pkg-config --cflags --libs opencv4 apriltag)
cargo build --quiet --release

# The board as the sessions have it, and what is looked for how.
scene() { # SESSION SETTINGS…
    echo "[camera]"
    echo "source = \"$shared/sessions/$1\""
    shift
    echo "[tracking]"
    printf '%s\n' "$@"
    sed -n '/^\[\[board\]\]/,/^\]/p' config/lamp.toml
    echo "[ambient]"
    echo "radiance = [1, 1, 1]"
}
ours() { # NAME -> settings
    case $1 in
    corners) echo 'search = "full"' 'pose_from_pixels = false' 'filter = false' ;;
    pixels) echo 'search = "full"' 'filter = false' ;;
    unfiltered) echo 'filter = false' ;;
    gnomon) echo '' ;;
    esac
}
peers=(apriltag1 apriltag1.5 apriltag2 aruco aruco_contour aruco_apriltag)
mine=(corners pixels unfiltered gnomon)
sessions=(lamp hand room)
for session in "${sessions[@]}"; do
    for name in "${mine[@]}"; do
        mapfile -t settings < <(ours "$name" | sed 's/ \([a-z_]* =\)/\n\1/g')
        scene "$session" "${settings[@]}" >"$work/${session}_$name.toml"
    done
done
# A file's rows go to the end of what earlier rounds gave.
add() { # FILE
    if [ -f "$work/all_$1" ]; then tail -n +2 "$work/new.csv" >>"$work/all_$1"; else cp "$work/new.csv" "$work/all_$1"; fi
}
for round in $(seq "$rounds"); do
    echo "bench: round $round of $rounds" >&2
    for session in "${sessions[@]}"; do
        for peer in "${peers[@]}"; do
            "$work/track_peer" "$shared/sessions/$session" "$peer" >"$work/new.csv"
            add "${session}_$peer.csv"
        done
        for name in "${mine[@]}"; do
            # A peer's rows are no poses of ours, which nothing replaces unasked.
            target/release/gnomon track "$work/${session}_$name.toml" --poses "$work/new.csv" --force 2>"$work/said" ||
                { cat "$work/said" >&2; exit 1; }
            add "${session}_$name.csv"
        done
    done
done
number='\([0-9.]*\)'
echo "session,program,frames,lost,shift_median_px,shift_p95_px,jitter_px,track_median_ms,track_p95_ms"
for session in "${sessions[@]}"; do
    for name in "${peers[@]}" "${mine[@]}"; do
        python3 "$shared/peers/pose_error.py" "$shared/sessions/$session" "$work/all_${session}_$name.csv" |
            sed -n "s|^frames $number lost $number .*shift px $number/$number  jitter px $number  ms $number/$number|$session,$name,\1,\2,\3,\4,\5,\6,\7|p"
    done
done
