#!/usr/bin/env bash
# What tools/test_camera.sh runs beside the camera. What is to stay goes to /out.
set -euo pipefail
gnomon=target/release/gnomon
calibration=(--calibration recordings/lamp/camera.toml)
log=/out/talk.txt

# Waits until gnomon, the process $2, says $1; the emulated machine takes its time.
wait_for() {
    for _ in $(seq 1200); do
        grep -q -- "$1" "$log" && return
        kill -0 "$2" 2>/dev/null || break
        sleep 0.2
    done
    echo "'$1' was never said; this was:" >&2
    cat "$log" >&2
    return 1
}

stop() {
    kill -INT "$1"
    wait "$1"
}

steady() {
    "$gnomon" cameras
    "$gnomon" track webcam:loopback "${calibration[@]}" --anchors config/lamp.toml --poses /out/live.csv 2> "$log" &
    tracker=$!
    wait_for loopback-camera: "$tracker"
    sleep 20
    stop "$tracker"
    "$gnomon" record /dev/video9 "${calibration[@]}" --out /out/session --seconds 4 2>> "$log"
    cat "$log"
}

# The feed dies some seconds after this has begun.
killed() {
    "$gnomon" record webcam:9 "${calibration[@]}" --out /out/session 2> "$log" &
    recorder=$!
    wait_for 'waiting until it is back' "$recorder"
    cp /out/session/times.csv /out/times_before.csv
    ffmpeg -nostdin -loglevel error -re -stream_loop -1 -i recordings/lamp/video.mp4 -vf scale=640:480,fps=3 \
        -pix_fmt yuyv422 -f v4l2 /dev/video9 &
    feeder=$!
    wait_for ' is back: ' "$recorder"
    sleep 10
    stop "$recorder"
    kill -9 "$feeder"
    cat "$log"
    echo "$(($(wc -l < /out/times_before.csv) - 1)) frames before the feed was killed, \
$(($(wc -l < /out/session/times.csv) - 1)) in all"
    [ "$(wc -l < /out/session/times.csv)" -gt "$(wc -l < /out/times_before.csv)" ]
}

"$1"
