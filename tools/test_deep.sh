#!/bin/bash
# What no quick test sees: all that is drawn under Khronos's validation layer, synchronization too, and the C shim of libapriltag
# under Valgrind. Each message of either is a failure: tools/test_deep.sh [FILTER...] (as cargo test takes it, in place of the tests
# that draw).
set -euo pipefail
# Else gnomon starts itself again, out of Valgrind's sight.
export NODEVICE_SELECT=1
cd "$(dirname "$0")/.."
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
failed=0

cat >"$work/vk_layer_settings.txt" <<SETTINGS
khronos_validation.debug_action = VK_DBG_LAYER_ACTION_LOG_MSG
khronos_validation.report_flags = error,warn
khronos_validation.log_filename = $work/messages.txt
khronos_validation.enables = VK_VALIDATION_FEATURE_ENABLE_SYNCHRONIZATION_VALIDATION_EXT
khronos_validation.validate_sync = true
SETTINGS
validated=(env VK_INSTANCE_LAYERS=VK_LAYER_KHRONOS_validation VK_LAYER_SETTINGS_PATH="$work")

no_messages() {
    if [ -s "$work/messages.txt" ]; then
        echo "the validation layer complains of $1:" >&2
        grep -o 'MessageID = [^|]* | .*' "$work/messages.txt" | sort | uniq -c | sort -rn | cut -c1-400 >&2
        rm "$work/messages.txt"
        failed=1
    fi
}

cargo build --release
for scene in config/*.toml; do
    case $scene in */reference.toml) continue ;; esac
    "${validated[@]}" target/release/gnomon replay "$scene" --frames 0,1 --layers role,shadow,gain,depth --out "$work/$(basename "$scene" .toml)"
    no_messages "$scene"
done
# All tests that draw: those of the passes, and the picture's; what tracks or reads says nothing to a GPU. Tests that let the GPU
# fail bring a layer of their own, and the layer takes longer than one test of times allows.
drawing=(render:: picture:: counting:: deforming:: detail:: environment:: final_gather:: motion:: probe_light:: reflections:: shading:: shafts::
    sized_lights:: stability:: translucent:: volumes:: live::)
[ $# -gt 0 ] || set -- "${drawing[@]}"
cargo test --release --lib --test suite --test program --no-run
"${validated[@]}" cargo test --release --no-fail-fast --lib --test suite --test program -- "$@" --skip faults:: --skip a_gpu_that_is_lost \
    --skip a_recording_is_shown_in_time || failed=1
no_messages "the tests"

# The shim and libapriltag at work, from the first picture to the end. What is merely possibly lost belongs to other libraries.
mkdir "$work/clip"
cp recordings/lamp/camera.toml "$work/clip"
ffmpeg -v error -i recordings/lamp/video.mp4 -c copy -frames:v 6 "$work/clip/video.mp4"
for family in tag36h11 tag16h5 tagStandard41h12; do
    valgrind --quiet --error-exitcode=9 --leak-check=full --show-leak-kinds=definite --errors-for-leak-kinds=definite \
        target/release/gnomon track "$work/clip" --size-mm 44 --family $family --poses "$work/$family.csv" || [ $? -ne 9 ] || failed=1
done
exit $failed
