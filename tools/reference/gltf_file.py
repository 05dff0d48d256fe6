"""Reads of a glTF 2.0 file what a path tracer needs of models at rest: triangles by material, in metres with z up, and the materials
with their pictures as linear numbers. Skins, morph targets, sparse accessors and compressed meshes are not read."""
import base64
import json
import struct
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from scene_file import SceneError

COMPONENTS = {5120: np.int8, 5121: np.uint8, 5122: np.int16, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
# glTF's y is up.
UPRIGHT = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]], float)


@dataclass
class Material:
    """Linear numbers; a picture is an array of rows, 3 channels (or 1 for numbers), the first row where v is 0."""

    color: np.ndarray
    opacity: np.ndarray | None
    roughness: np.ndarray
    metallic: np.ndarray
    emission: np.ndarray
    normal: np.ndarray | None
    shows_both_sides: bool


@dataclass
class Part:
    positions: np.ndarray
    normals: np.ndarray | None
    uv: np.ndarray | None
    triangles: np.ndarray
    material: Material


def linear(encoded):
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)


class File:
    def __init__(self, path):
        self.path = Path(path)
        data = self.path.read_bytes()
        self.own = b""
        if data[:4] == b"glTF":
            length = struct.unpack_from("<I", data, 12)[0]
            self.tree = json.loads(data[20:20 + length])
            if len(data) > 20 + length:
                size = struct.unpack_from("<I", data, 20 + length)[0]
                self.own = data[28 + length:28 + length + size]
        else:
            self.tree = json.loads(data)
        required = self.tree.get("extensionsRequired", [])
        if required:
            raise SceneError(f"{path}: {', '.join(required)} is not read here")

    def bytes_of(self, entry):
        uri = entry.get("uri")
        if uri is None:
            return self.own
        if uri.startswith("data:"):
            return base64.b64decode(uri.split(",", 1)[1])
        return (self.path.parent / uri).read_bytes()

    def view(self, index):
        view = self.tree["bufferViews"][index]
        data = self.bytes_of(self.tree["buffers"][view["buffer"]])
        start = view.get("byteOffset", 0)
        return data[start:start + view["byteLength"]], view.get("byteStride")

    def accessor(self, index):
        accessor = self.tree["accessors"][index]
        kind, width = np.dtype(COMPONENTS[accessor["componentType"]]), WIDTHS[accessor["type"]]
        data, stride = self.view(accessor["bufferView"])
        start, count = accessor.get("byteOffset", 0), accessor["count"]
        stride = stride or kind.itemsize * width
        rows = np.lib.stride_tricks.as_strided(
            np.frombuffer(data, np.uint8)[start:], (count, kind.itemsize * width), (stride, 1))
        values = np.ascontiguousarray(rows).view(kind).reshape(count, width)
        if accessor.get("normalized"):
            values = np.maximum(values / np.iinfo(kind).max, -1)
        return values

    def picture(self, texture):
        """RGBA in 0 to 1, as encoded; `None` without one."""
        if texture is None:
            return None
        if texture.get("texCoord", 0) != 0 or texture.get("extensions"):
            raise SceneError(f"{self.path}: a second set of texture coordinates is not read here")
        image = self.tree["images"][self.tree["textures"][texture["index"]]["source"]]
        data = self.view(image["bufferView"])[0] if "bufferView" in image else self.bytes_of(image)
        decoded = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
        if decoded is None:
            raise SceneError(f"{self.path}: a picture cannot be decoded")
        decoded = decoded.astype(np.float32) / np.iinfo(decoded.dtype).max
        if decoded.ndim == 2:
            decoded = np.repeat(decoded[..., None], 3, 2)
        if decoded.shape[2] == 3:
            decoded = np.dstack([decoded, np.ones(decoded.shape[:2], np.float32)])
        return decoded[..., [2, 1, 0, 3]]

    def material(self, index):
        given = self.tree["materials"][index] if index is not None else {}
        metal = given.get("pbrMetallicRoughness", {})
        factor = np.array(metal.get("baseColorFactor", [1, 1, 1, 1]), np.float32)
        base = self.picture(metal.get("baseColorTexture"))
        base = np.ones((1, 1, 4), np.float32) if base is None else base
        color, alpha = linear(base[..., :3]) * factor[:3], base[..., 3:] * factor[3]
        both = self.picture(metal.get("metallicRoughnessTexture"))
        both = np.ones((1, 1, 4), np.float32) if both is None else both
        emission = self.picture(given.get("emissiveTexture"))
        emission = np.ones((1, 1, 3), np.float32) if emission is None else linear(emission[..., :3])
        normal = self.picture(given.get("normalTexture"))
        mode = given.get("alphaMode", "OPAQUE")
        opacity = {"OPAQUE": None, "BLEND": alpha}.get(mode, alpha)
        if mode == "MASK":
            # Finer than its texels: the line where opacity passes the cutoff is sharp.
            finer = cv2.resize(alpha[..., 0], None, fx=4, fy=4, interpolation=cv2.INTER_LINEAR)
            opacity = (finer >= given.get("alphaCutoff", 0.5)).astype(np.float32)[..., None]
        return Material(color, opacity, both[..., 1:2] * metal.get("roughnessFactor", 1),
                        both[..., 2:3] * metal.get("metallicFactor", 1),
                        emission * np.array(given.get("emissiveFactor", [0, 0, 0]), np.float32),
                        None if normal is None else normal[..., :3], given.get("doubleSided", False))

    def place(self, node):
        if "matrix" in node:
            return np.array(node["matrix"], float).reshape(4, 4).T
        x, y, z, w = node.get("rotation", [0, 0, 0, 1])
        turn = np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                         [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                         [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])
        place = np.eye(4)
        place[:3, :3] = turn * np.array(node.get("scale", [1, 1, 1]))
        place[:3, 3] = node.get("translation", [0, 0, 0])
        return place

    def parts(self):
        scene = self.tree.get("scenes", [{"nodes": range(len(self.tree["nodes"]))}])[self.tree.get("scene", 0)]
        waiting = [(index, np.eye(4)) for index in scene["nodes"]]
        while waiting:
            index, above = waiting.pop()
            node = self.tree["nodes"][index]
            place = above @ self.place(node)
            waiting += [(child, place) for child in node.get("children", [])]
            if "mesh" in node:
                for primitive in self.tree["meshes"][node["mesh"]]["primitives"]:
                    yield self.part(primitive, place)

    def part(self, primitive, place):
        if primitive.get("mode", 4) != 4:
            raise SceneError(f"{self.path}: only triangles are read here")
        attributes = primitive["attributes"]
        positions = self.accessor(attributes["POSITION"]) @ place[:3, :3].T + place[:3, 3]
        count = len(positions)
        indices = self.accessor(primitive["indices"])[:, 0] if "indices" in primitive else np.arange(count)
        triangles = indices.astype(np.uint32).reshape(-1, 3)
        normals = None
        if "NORMAL" in attributes:
            normals = self.accessor(attributes["NORMAL"]) @ np.linalg.inv(place[:3, :3]) @ UPRIGHT.T
            normals = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-20)
        uv = self.accessor(attributes["TEXCOORD_0"]) if "TEXCOORD_0" in attributes else None
        if np.linalg.det(place[:3, :3]) < 0:
            triangles = triangles[:, ::-1]
        return Part(positions @ UPRIGHT.T, normals, uv, triangles, self.material(primitive.get("material")))


def read_parts(path, fit_m):
    """The parts of a model; its longest side is scaled to `fit_m` if that is given."""
    parts = list(File(path).parts())
    if fit_m is not None:
        seen = np.concatenate([part.positions[part.triangles.ravel()] for part in parts])
        scale = fit_m / (seen.max(0) - seen.min(0)).max()
        for part in parts:
            part.positions = part.positions * scale
    return parts
