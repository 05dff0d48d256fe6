"""Where the camera and everything that moves is, frame by frame."""
import csv
import json
from dataclasses import dataclass

import cv2
import numpy as np

from scene_file import SceneError


@dataclass
class Moment:
    """A frame: camera_from_world, and world_from_anchor by the anchor's name."""

    index: int
    time_s: float
    camera_from_world: np.ndarray
    world_from_anchor: dict


def from_truth(scene, path):
    """The poses of a session's truth.json."""
    moments = []
    for index, frame in enumerate(json.loads(path.read_text())["frames"]):
        world_from_anchor = {scene.anchors[0]: np.eye(4)}
        for marker in scene.markers:
            if marker.anchor != scene.anchors[0] and str(marker.id) in frame.get("markers", {}):
                world_from_anchor[marker.anchor] = np.array(frame["markers"][str(marker.id)])
        moments.append(Moment(index, frame["time_s"], np.array(frame["world_to_camera"]), world_from_anchor))
    return moments


def from_poses(scene, path):
    """The poses that `gnomon track SCENE --poses FILE` found; frames without the world are left out."""
    frames = {}
    with open(path, newline="") as file:
        for row in csv.DictReader(file):
            frame = frames.setdefault(int(row["frame"]), (float(row["time_s"] or 0), {}))
            if row["tx_m"]:
                turn, _ = cv2.Rodrigues(np.array([float(row[key]) for key in ("rx", "ry", "rz")]))
                pose = np.eye(4)
                pose[:3, :3], pose[:3, 3] = turn, [float(row[key]) for key in ("tx_m", "ty_m", "tz_m")]
                frame[1][row["anchor"]] = pose
    moments = []
    for index, (time_s, poses) in sorted(frames.items()):
        if scene.anchors[0] in poses:
            camera_from_world = poses[scene.anchors[0]]
            world_from_camera = np.linalg.inv(camera_from_world)
            placed = {name: world_from_camera @ pose for name, pose in poses.items()}
            moments.append(Moment(index, time_s, camera_from_world, placed))
    if not moments:
        raise SceneError(f"{path}: no frame has a pose of {scene.anchors[0]}")
    return moments


def orbit(scene, count, fps):
    """A hand that leads the camera about the board; other anchors lie beside it."""
    world = [marker.anchor_from_marker[:2, 3] for marker in scene.markers if marker.anchor == scene.anchors[0]]
    radius = max(max(float(np.linalg.norm(center)) for center in world), 0.1)
    beside = {}
    for number, name in enumerate(scene.anchors[1:]):
        beside[name] = np.eye(4)
        beside[name][:2, 3] = radius * (0.2 + 0.5 * number), -radius * 0.4
    moments = []
    for index in range(count):
        time_s = index / fps
        azimuth = np.radians(-118 + 56 * index / max(count - 1, 1) + 0.5 * np.sin(10.7 * time_s))
        elevation = np.radians(45 + 5 * np.sin(1.9 * time_s) + 0.4 * np.sin(8.2 * time_s))
        eye = 3.2 * radius * np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth),
                                       np.sin(elevation)])
        forward = -eye / np.linalg.norm(eye)
        right = np.cross(forward, [0, 0, 1])
        right /= np.linalg.norm(right)
        pose = np.eye(4)
        pose[:3, :3] = [right, np.cross(forward, right), forward]
        pose[:3, 3] = -pose[:3, :3] @ eye
        moments.append(Moment(index, time_s, pose, {scene.anchors[0]: np.eye(4), **beside}))
    return moments
