#!/usr/bin/env python3
"""Path-traces a gnomon scene: the video that a camera would have taken of its real things, and at key frames what it
would have seen had the virtual things been there.

The camera moves as the recording's truth.json says, or as `gnomon track SCENE --poses FILE` found (--poses), or else
about the board. What is written is a session as recordings/README.md describes it: gnomon replays it, and
`gnomon chart --sessions` holds gnomon against it where config/ has a scene of its name."""
import argparse
import json
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import cv2
import numpy as np

from film import from_poses, from_truth, orbit
from scene_file import Camera, SceneError, read_scene
from tracer import Set, radiance, roles_and_shadows

DEFAULT_CAMERA = Camera([640, 480], [615.0, 613.0], [321.4, 238.2], [0.08, -0.19, 0.0008, -0.0005, 0.05])


def srgb(linear):
    """8 bits, as displays and cameras encode."""
    held = np.clip(linear, 0, 1)
    encoded = np.where(held <= 0.0031308, 12.92 * held, 1.055 * held ** (1 / 2.4) - 0.055)
    return encoded * 255


def write_png(path, pixels):
    if pixels.ndim == 3:
        pixels = pixels[..., ::-1]
    if not cv2.imwrite(str(path), np.ascontiguousarray(pixels)):
        raise SceneError(f"{path} cannot be written")


def factor(with_virtual, without):
    """What the virtual things leave of a pixel's light, 5 x 5 box-filtered; 32768 is all of it."""
    smooth = lambda light: cv2.blur(light.astype(np.float32), (5, 5))
    part = smooth(with_virtual) / np.maximum(smooth(without), 1e-4)
    return (np.clip(part, 0, 65535 / 32768) * 32768).astype(np.uint16)


def render_truth(scene, camera, moment, samples, folder):
    stage = Set(scene, moment)
    pose = moment.camera_from_world
    with_virtual = radiance(camera, stage.with_virtual(), pose, samples, 7, False)
    without = radiance(camera, stage.without, pose, samples, 7, False)
    roles, masks = roles_and_shadows(camera, stage, pose)
    name = lambda suffix: folder / f"{moment.index:03d}_{suffix}.png"
    write_png(name("with"), (srgb(with_virtual) + 0.5).astype(np.uint8))
    write_png(name("without"), (srgb(without) + 0.5).astype(np.uint8))
    write_png(name("factor"), factor(with_virtual, without))
    write_png(name("ids"), roles)
    for number, mask in enumerate(masks):
        write_png(name(f"mask_{number}"), mask)


def render_video(scene, camera, moments, samples, noise, fps, path):
    width, height = camera.size_px
    encoder = subprocess.Popen(
        ["ffmpeg", "-y", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}", "-r",
         str(fps), "-i", "-", "-c:v", "libx264", "-preset", "slow", "-crf", "16", "-pix_fmt", "yuv420p", str(path)],
        stdin=subprocess.PIPE)
    random = np.random.default_rng(1)
    for number, moment in enumerate(moments):
        stage = Set(scene, moment)
        light = radiance(camera, stage.without, moment.camera_from_world, samples, 1000 + moment.index, True)
        noisy = srgb(light) + random.normal(0, noise, light.shape)
        encoder.stdin.write((np.clip(noisy, 0, 255) + 0.5).astype(np.uint8).tobytes())
        tell(f"video {number + 1}/{len(moments)}")
    encoder.stdin.close()
    if encoder.wait() != 0:
        raise SceneError("ffmpeg failed")


def tell(text):
    end = "\r" if sys.stderr.isatty() else "\n"
    print(text, end=end, file=sys.stderr, flush=True)


def truth_json(scene, moments):
    frames = []
    for moment in moments:
        markers = {}
        for marker in scene.markers:
            frame = moment.world_from_anchor.get(marker.anchor)
            if marker.anchor != scene.anchors[0] and frame is not None:
                markers[str(marker.id)] = (frame @ marker.anchor_from_marker).tolist()
        frames.append({"time_s": moment.time_s, "world_to_camera": moment.camera_from_world.tolist(), "markers": markers})
    return json.dumps({"frames": frames}, indent=1)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene")
    parser.add_argument("--out", required=True, type=Path, help="folder of the session; what is there is replaced")
    parser.add_argument("--calibration", help="camera in gnomon's format; default: the recording's, else 640 x 480")
    parser.add_argument("--poses", help="CSV of gnomon track or replay: where the camera was")
    parser.add_argument("--frames", type=int, default=120, help="of the video at most (default 120)")
    parser.add_argument("--keys", type=int, default=3, help="frames that get their truth (default 3)")
    parser.add_argument("--samples", type=int, default=32, help="a pixel of the video (default 32)")
    parser.add_argument("--truth-samples", type=int, default=256, help="a pixel of the truth (default 256)")
    parser.add_argument("--noise", type=float, default=2.0, help="of the video, levels of 255 (default 2)")
    parser.add_argument("--only-truth", action="store_true", help="no video")
    args = parser.parse_args()
    fps = 30
    scene = read_scene(args.scene)
    calibration = args.calibration or (scene.source and scene.source / "camera.toml")
    camera = Camera.read(calibration) if calibration and Path(calibration).is_file() else DEFAULT_CAMERA
    truth = scene.source and scene.source / "truth.json"
    if args.poses:
        moments = from_poses(scene, args.poses)
    elif truth and truth.is_file():
        moments = from_truth(scene, truth)
    else:
        moments = orbit(scene, args.frames, fps)
    moments = moments[:args.frames]
    # A film's frames are counted from 0 without gaps.
    if not args.only_truth:
        for index, moment in enumerate(moments):
            moment.index = index
    args.out.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=args.out.parent) as folder:
        session = Path(folder) / "session"
        (session / "truth").mkdir(parents=True)
        (session / "camera.toml").write_text(camera.to_toml())
        (session / "truth.json").write_text(truth_json(scene, moments))
        keys = sorted({round(k) for k in np.linspace(0, len(moments) - 1, max(args.keys, 1))})
        for number, key in enumerate(keys):
            render_truth(scene, camera, moments[key], args.truth_samples, session / "truth")
            tell(f"truth {number + 1}/{len(keys)}")
        if not args.only_truth:
            render_video(scene, camera, moments, args.samples, args.noise, fps, session / "video.mp4")
        if args.out.exists():
            shutil.rmtree(args.out)
        session.rename(args.out)
    print(args.out)


if __name__ == "__main__":
    try:
        main()
    except SceneError as error:
        sys.exit(f"error: {error}")
    except KeyboardInterrupt:
        sys.exit(130)
