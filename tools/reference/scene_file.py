"""Reads of a gnomon scene what a renderer needs: things at their places, lights, boards, the camera."""
import json
import tomllib
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np


class SceneError(Exception):
    """What is wrong, for the person who wrote the file."""


@dataclass
class Thing:
    """A phantom or a virtual thing: a mesh file, or a shape by its key in the scene, with its numbers."""

    name: str
    real: bool
    anchor: str
    anchor_from_object: np.ndarray
    albedo: list | None
    roughness: float | None
    metallic: float
    casts: bool
    mesh: Path | None = None
    shape: tuple | None = None
    fit_m: float | None = None


SHAPES = ("rect_m", "box_m", "sphere_m", "cylinder_m")


@dataclass
class Marker:
    family: str
    id: int
    size_m: float
    anchor: str
    anchor_from_marker: np.ndarray
    border_cells: int


@dataclass
class Probe:
    """Light from afar, turned to the left by so much: a panorama, or a picture in latitude and longitude as gnomon has it."""

    image: Path
    exposure: float
    turn_deg: float
    is_panorama: bool


@dataclass
class Scene:
    path: Path
    source: Path | None
    things: list = field(default_factory=list)
    markers: list = field(default_factory=list)
    lights: list = field(default_factory=list)
    ambient: list = field(default_factory=lambda: [0.0] * 3)
    probe: Probe | None = None
    anchors: list = field(default_factory=list)  # the first is the world


def rgb(value):
    """One number stands for three."""
    return [float(value)] * 3 if isinstance(value, (int, float)) else [float(part) for part in value]


def rotation(degrees):
    """Turns about x, then y, then z of the anchor's frame."""
    x, y, z = np.radians(degrees)
    about_x = np.array([[1, 0, 0], [0, np.cos(x), -np.sin(x)], [0, np.sin(x), np.cos(x)]])
    about_y = np.array([[np.cos(y), 0, np.sin(y)], [0, 1, 0], [-np.sin(y), 0, np.cos(y)]])
    about_z = np.array([[np.cos(z), -np.sin(z), 0], [np.sin(z), np.cos(z), 0], [0, 0, 1]])
    return about_z @ about_y @ about_x


def affine(linear, translation):
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = linear, translation
    return matrix


def read_scene(path):
    path = Path(path)
    try:
        tree = tomllib.loads(path.read_text())
    except (OSError, tomllib.TOMLDecodeError) as error:
        raise SceneError(f"{path}: {error}") from error

    def find(name):
        # As gnomon does: beside the scene file, or beside its folder.
        beside = path.parent / name
        return beside if beside.exists() else path.parent.parent / name

    source = find(tree["camera"]["source"]) if "camera" in tree else None
    scene = Scene(path, source if source and source.is_dir() else None)
    for board in tree.get("board", []):
        scene.anchors.append(board["name"])
        for marker in board["markers"]:
            turn = rotation([0, 0, marker.get("rotation_deg", 0)])
            place = affine(turn, [*marker["center_m"], 0])
            scene.markers.append(Marker(board.get("family", "tag36h11"), marker["id"], marker["size_m"], board["name"],
                                        place, board.get("border_cells", 1)))
    for marker in tree.get("marker", []):
        scene.anchors.append(marker["name"])
        scene.markers.append(Marker(marker.get("family", "tag36h11"), marker["id"], marker["size_m"], marker["name"],
                                    np.eye(4), marker.get("border_cells", 1)))
    if not scene.anchors:
        raise SceneError(f"{path}: no [[board]] and no [[marker]]: nothing is the world")
    world = scene.anchors[0]
    if table := tree.get("table"):
        height = affine(np.eye(3), [0, 0, table.get("height_m", 0)])
        scene.things.append(Thing("table", True, world, height, rgb(table.get("albedo", 0.5)), None, 0.0, False,
                                  shape=("rect_m", table["rect_m"])))
    for kind in ("phantom", "virtual"):
        for thing in tree.get(kind, []):
            scale = np.diag(rgb(thing.get("scale", 1)))
            place = affine(rotation(thing.get("rotation_deg", [0, 0, 0])) @ scale, thing.get("position_m", [0, 0, 0]))
            material = thing.get("material", {})
            albedo = rgb(material["albedo"]) if "albedo" in material else None
            on = thing.get("on", world)
            if on not in scene.anchors:
                raise SceneError(f"{path}: {thing['name']} stands on \"{on}\"; there are {', '.join(scene.anchors)}")
            shape = next(((key, thing[key]) for key in SHAPES if key in thing), None)
            if shape is None and "mesh" not in thing:
                raise SceneError(f"{path}: {thing['name']}: of shapes mesh, {', '.join(SHAPES)} are known here")
            scene.things.append(Thing(thing["name"], kind == "phantom", on, place, albedo, material.get("roughness"),
                                      material.get("metallic", 0.0), thing.get("casts", True),
                                      find(thing["mesh"]) if "mesh" in thing else None,
                                      shape, thing.get("fit_m")))
    scene.lights = tree.get("light", [])
    scene.ambient = rgb(tree.get("ambient", {}).get("radiance", 0))
    if probe := tree.get("probe"):
        kind = probe.get("kind", "latitude-longitude")
        if kind not in ("latitude-longitude", "panorama") or tree.get("room"):
            raise SceneError(f"{path}: of probes only light from afar is known here: latitude-longitude or panorama, no [[room]]")
        scene.probe = Probe(find(probe["image"]), probe.get("exposure", 1), probe.get("turn_deg", 0), kind == "panorama")
    return scene


@dataclass
class Camera:
    """A pinhole with OpenCV's five coefficients; a pixel's integer coordinate is its centre."""

    size_px: list
    focal_px: list
    center_px: list
    distortion: list

    @staticmethod
    def read(path):
        text = Path(path).read_text()
        tree = json.loads(text) if str(path).endswith(".json") else tomllib.loads(text)
        missing = [key for key in ("size_px", "focal_px", "center_px") if key not in tree]
        if missing:
            raise SceneError(f"{path}: no {missing[0]}; gnomon's own format is expected (README, Calibrations)")
        return Camera(tree["size_px"], tree["focal_px"], tree["center_px"], tree.get("distortion", [0.0] * 5))

    def to_toml(self):
        return "".join(f"{key} = {json.dumps(list(value))}\n" for key, value in vars(self).items())
