#!/usr/bin/env bash
# Runs gnomon on a real V4L2 camera: a small machine in software emulation (../shared/virtual-camera/with-camera) plays
# recordings/lamp into /dev/video9. In each format that ffmpeg can feed it the camera is listed, tracked and recorded, and the session is
# replayed; then the feed is killed while gnomon records, and comes back. Emulation is slow: a quarter of an hour in all.
set -euo pipefail
cd "$(dirname "$0")/.."
with_camera=${WITH_CAMERA:-../shared/virtual-camera/with-camera}
[ -e "$with_camera" ] || { echo "test-camera: there is no $with_camera" >&2; exit 1; }
out=$(realpath -m out/test_camera)
rm -rf "$out"; mkdir -p "$out"
video=recordings/lamp/video.mp4
gnomon=target/release/gnomon

fail() { echo "test-camera: FAILED: $*" >&2; exit 1; }

# Every position of the board in a file of poses is one that the camera had in the recording, to 2 mm.
check_poses() {
    awk -F, -v allowed_m=0.002 '
        FNR == 1 { next }
        NR == FNR { x[NR] = $6; y[NR] = $7; z[NR] = $8; next }
        $4 == "tracked" {
            least = 1e9
            for (k in x) { d = ($6-x[k])^2 + ($7-y[k])^2 + ($8-z[k])^2; if (d < least) least = d }
            if (sqrt(least) > worst) worst = sqrt(least)
            tracked++
        }
        END {
            printf "  %d of %d frames tracked, at most %.2f mm off\n", tracked, FNR - 1, worst * 1000
            exit !(tracked >= 3 && tracked >= 0.9 * (FNR - 1) && worst < allowed_m)
        }' "$out/lamp.csv" "$1" || fail "$1: too few poses, or wrong ones"
}

# The session replays, twice alike, and where the recording was.
check_session() {
    for run in 1 2; do
        "$gnomon" track "$1" --anchors config/lamp.toml --poses "$1.$run.csv" 2>/dev/null || fail "$1 does not replay"
    done
    cmp <(cut -d, -f1-11 "$1.1.csv") <(cut -d, -f1-11 "$1.2.csv") || fail "$1 replays in two ways"
    check_poses "$1.1.csv"
}

"$gnomon" track config/lamp.toml --poses "$out/lamp.csv" 2>/dev/null

for format in yuyv422 mjpeg yuv420p uyvy422 yvyu422 nv12 gray; do
    echo "== $format"
    bash "$with_camera" -o "$out/$format" -t 900 -r 3 -f "$format" "$video" -- tools/test_camera_inside.sh steady ||
        fail "$format (see $out/$format)"
    check_poses "$out/$format/live.csv"
    check_session "$out/$format/session"
done

echo "== the feed is killed"
bash "$with_camera" -o "$out/killed" -t 900 -r 3 -k 90 "$video" -- tools/test_camera_inside.sh killed ||
    fail "the feed is killed (see $out/killed)"
check_session "$out/killed/session"
echo "test-camera: all is well"
