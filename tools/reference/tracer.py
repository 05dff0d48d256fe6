"""The scene in Mitsuba 3: light as it travels, and shadows of point-shaped lights pixel by pixel."""
import glob
import math
import os

if "DRJIT_LIBLLVM_PATH" not in os.environ:
    # The newest one that is there: the dynamic loader alone may take one that is too old.
    found = glob.glob("/usr/lib/*/libLLVM-1[7-9]*.so*") + glob.glob("/usr/lib/*/libLLVM.so.[12]*")
    found += glob.glob("/usr/lib/llvm-1[7-9]/lib/libLLVM*.so*")
    if found:
        os.environ["DRJIT_LIBLLVM_PATH"] = sorted(found)[-1]

import cv2
import drjit as dr
import mitsuba as mi
import numpy as np

from gltf_file import read_parts
from scene_file import SceneError

mi.set_variant("llvm_ad_rgb")

PAPER, INK = 0.82, 0.03
# Prints lie so far above what they are glued to, metres.
LIFT_M = 1e-4
REAL, VIRTUAL = 100, 200
IN_REAL_SHADOW, IN_VIRTUAL_SHADOW, FACES_AWAY = 1, 2, 4
# Rays a batch: what fits into memory on small machines.
BATCH = 2**21


def colour(value):
    return {"type": "rgb", "value": list(value)}


def matrix(values):
    return mi.ScalarTransform4f(np.asarray(values, float).tolist())


def surface(thing):
    albedo = thing.albedo or [0.5] * 3
    if thing.metallic:
        # (The principled material squares its roughness, and a metal that says none has 0.25 in gnomon.)
        inner = {"type": "principled", "base_color": colour(albedo), "metallic": float(thing.metallic),
                 "roughness": math.sqrt(thing.roughness or 0.25), "specular": 0.5}
    elif thing.roughness:
        inner = {"type": "roughplastic", "diffuse_reflectance": colour(albedo), "alpha": float(thing.roughness)}
    else:
        inner = {"type": "diffuse", "reflectance": colour(albedo)}
    return {"type": "twosided", "inner": inner}


def rectangle(rect_m, world_from_object, lift_m=0.0):
    (x0, y0, x1, y1) = rect_m
    place = np.eye(4)
    place[0, 0], place[1, 1] = (x1 - x0) / 2, (y1 - y0) / 2
    place[:3, 3] = (x0 + x1) / 2, (y0 + y1) / 2, lift_m
    return {"type": "rectangle", "to_world": matrix(world_from_object @ place)}


def box(numbers, world_from_object):
    """Of three sides, standing on its origin; or between two corners."""
    numbers = np.array(numbers, float)
    low, high = (numbers[:3], numbers[3:]) if len(numbers) == 6 else (numbers * [-0.5, -0.5, 0], numbers * [0.5, 0.5, 1])
    place = np.diag([*(high - low) / 2, 1])
    place[:3, 3] = (low + high) / 2
    return [{"type": "cube", "to_world": matrix(world_from_object @ place)}]


def ball(radius, world_from_object):
    """Lying on its origin."""
    place = np.diag([radius, radius, radius, 1.0])
    place[2, 3] = radius
    return [{"type": "sphere", "to_world": matrix(world_from_object @ place)}]


def cylinder(numbers, world_from_object):
    """Of a radius and a height, standing on its origin, with both ends."""
    radius, height = numbers
    side = np.diag([radius, radius, height, 1.0])
    top, bottom = np.diag([radius, radius, 1.0, 1.0]), np.diag([radius, -radius, -1.0, 1.0])
    top[2, 3] = height
    disks = [{"type": "disk", "to_world": matrix(world_from_object @ place)} for place in (top, bottom)]
    return [{"type": "cylinder", "to_world": matrix(world_from_object @ side)}, *disks]


def sheet(numbers, world_from_object):
    """Between two corners, or of two sides about its origin."""
    corners = numbers if len(numbers) == 4 else [-numbers[0] / 2, -numbers[1] / 2, numbers[0] / 2, numbers[1] / 2]
    return [rectangle(corners, world_from_object)]


SHAPES = {"rect_m": sheet, "box_m": box, "sphere_m": ball, "cylinder_m": cylinder}


def has_normals(path):
    with open(path, errors="replace") as file:
        return any(line.startswith("vn ") for line in file)


def shapes(thing, world_from_anchor):
    """All that a thing is made of, each with a name."""
    place = world_from_anchor @ thing.anchor_from_object
    if thing.mesh is not None and thing.mesh.suffix.lower() in (".glb", ".gltf"):
        if thing.real or thing.albedo or thing.roughness:
            raise SceneError(f"{thing.name}: glTF is known here of virtual things alone, without a material")
        parts = read_parts(thing.mesh, thing.fit_m)
        return {f"{thing.name} {number}": part_of_model(f"{thing.name} {number}", part, place)
                for number, part in enumerate(parts)}
    if thing.fit_m is not None:
        raise SceneError(f"{thing.name}: fit_m is known here of glTF alone")
    if thing.shape is not None:
        key, numbers = thing.shape
        parts = SHAPES[key](numbers, place)
    else:
        flat = thing.real or not has_normals(thing.mesh)
        parts = [{"type": "obj", "filename": str(thing.mesh), "to_world": matrix(place), "face_normals": flat}]
    names = [thing.name] if len(parts) == 1 else [f"{thing.name} {number}" for number in range(len(parts))]
    return {name: {**part, "bsdf": surface(thing)} for name, part in zip(names, parts)}


def picture(values):
    """A texture of linear numbers."""
    bitmap = mi.Bitmap(np.ascontiguousarray(values, np.float32))
    return {"type": "bitmap", "bitmap": bitmap, "raw": True}


def surface_of_model(material):
    """Disney's principled material, whose dielectric and metal are those of glTF; its roughness is squared likewise."""
    made = {"type": "principled", "base_color": picture(material.color), "roughness": picture(np.maximum(material.roughness, 0.1)),
            "metallic": picture(material.metallic), "specular": 0.5}
    if material.normal is not None:
        made = {"type": "normalmap", "normalmap": picture(material.normal), "inner": made}
    made = {"type": "twosided", "inner": made}
    if material.opacity is not None:
        made = {"type": "mask", "opacity": picture(material.opacity), "inner": made}
    return made


def part_of_model(name, part, place):
    properties = mi.Properties()
    properties["bsdf"] = mi.load_dict(surface_of_model(part.material))
    if part.material.emission.any():
        properties["emitter"] = mi.load_dict({"type": "area", "radiance": picture(part.material.emission)})
    made = mi.Mesh(name, len(part.positions), len(part.triangles), has_vertex_normals=part.normals is not None,
                   has_vertex_texcoords=part.uv is not None, props=properties)
    values = mi.traverse(made)
    positions = part.positions @ place[:3, :3].T + place[:3, 3]
    values["vertex_positions"] = np.ascontiguousarray(positions, np.float32).ravel()
    values["faces"] = np.ascontiguousarray(part.triangles, np.uint32).ravel()
    if part.normals is not None:
        normals = part.normals @ np.linalg.inv(place[:3, :3])
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-20)
        values["vertex_normals"] = np.ascontiguousarray(normals, np.float32).ravel()
    if part.uv is not None:
        values["vertex_texcoords"] = np.ascontiguousarray(part.uv, np.float32).ravel()
    values.update()
    return made


def dictionary(family):
    names = {"tag16h5": "DICT_APRILTAG_16h5", "tag25h9": "DICT_APRILTAG_25h9", "tag36h10": "DICT_APRILTAG_36h10",
             "tag36h11": "DICT_APRILTAG_36h11"}
    name = names.get(family, family)
    if not hasattr(cv2.aruco, name):
        raise SceneError(f"no marker family {family}")
    return cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name)), name


def print_of(marker, world_from_anchor):
    """A square of white paper with the marker, a cell of margin around it."""
    codes, name = dictionary(marker.family)
    cells = codes.markerSize + 2 * marker.border_cells
    bits = cv2.aruco.generateImageMarker(codes, marker.id, cells, borderBits=marker.border_cells)
    if "APRILTAG" in name:
        # OpenCV's pictures of these stand on their heads against those that people print.
        bits = np.rot90(bits, 2)
    bits = np.pad(bits, 1, constant_values=255)
    print_ = np.where(np.kron(bits, np.ones((16, 16))) > 127, PAPER, INK).astype(np.float32)
    # A texture's first row lies at the rectangle's lower edge.
    texture = mi.Bitmap(np.ascontiguousarray(np.repeat(print_[::-1, :, None], 3, 2)))
    half_m = marker.size_m * (cells + 2) / cells / 2
    made = rectangle([-half_m, -half_m, half_m, half_m], world_from_anchor @ marker.anchor_from_marker, LIFT_M)
    reflectance = {"type": "bitmap", "bitmap": texture, "raw": True, "filter_type": "nearest"}
    return {**made, "bsdf": {"type": "twosided", "inner": {"type": "diffuse", "reflectance": reflectance}}}


# Distant light of some width shines from a disc so far away, metres.
FAR_M = 1000.0


def emitter(light):
    """A light as Mitsuba has it; one of some size is a surface of the radiance that adds up to its intensity."""
    kind = light["kind"]
    if kind == "point":
        return {"type": "point", "position": light["position_m"], "intensity": colour(_three(light["intensity"]))}
    if kind == "directional" and light.get("angle_deg", 0) > 0:
        sine = math.sin(math.radians(light["angle_deg"]) / 2)
        forth = unit(light["direction"])
        return {"type": "disk", "to_world": facing(-forth * FAR_M, forth, FAR_M * math.tan(math.asin(sine)), [0, 0, 1]),
                "emitter": area(light["irradiance"], math.pi * sine**2)}
    if kind == "directional":
        return {"type": "directional", "direction": light["direction"], "irradiance": colour(_three(light["irradiance"]))}
    if kind == "sphere":
        return {"type": "sphere", "center": light["position_m"], "radius": light["radius_m"],
                "emitter": area(light["intensity"], math.pi * light["radius_m"] ** 2)}
    if kind == "rect":
        width, height = light["size_m"]
        place = facing(np.array(light["position_m"], float), unit(light["direction"]), [width / 2, height / 2],
                       light.get("up", [0, 0, 1]))
        return {"type": "rectangle", "to_world": place, "emitter": area(light["intensity"], width * height)}
    raise SceneError(f"a light of kind {kind} is not known here; allowed: point, directional, sphere, rect")


def surroundings(probe):
    """Light from afar. Mitsuba's own columns go to the right as seen from inside, its y goes up."""
    pixels = np.array(mi.Bitmap(str(probe.image)).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32))
    if probe.is_panorama:
        axes = [[-1, 0, 0], [0, 0, 1], [0, 1, 0]]
    else:
        # Its columns go to the left, and its middle looks along +x.
        pixels, axes = pixels[:, ::-1], [[0, 0, 1], [1, 0, 0], [0, 1, 0]]
    turn = math.radians(probe.turn_deg)
    left = np.array([[math.cos(turn), -math.sin(turn), 0], [math.sin(turn), math.cos(turn), 0], [0, 0, 1]])
    place = np.eye(4)
    place[:3, :3] = left @ np.array(axes)
    return {"type": "envmap", "bitmap": mi.Bitmap(np.ascontiguousarray(pixels)), "scale": float(probe.exposure),
            "to_world": matrix(place)}


def area(power, share):
    return {"type": "area", "radiance": colour(np.array(_three(power)) / share)}


def unit(way):
    return np.array(way, float) / np.linalg.norm(way)


def facing(middle, forth, half_sizes, up):
    """A shape of Mitsuba's, which lies in xy and faces z, where it faces `forth`; its y goes along `up`, as near as may be."""
    sides = [np.cross(unit(way), forth) for way in (up, [0, 1, 0], [1, 0, 0])]
    along = next(unit(side) for side in sides if np.linalg.norm(side) > 1e-6)
    place = np.eye(4)
    place[:3, :3] = np.stack([along, np.cross(forth, along), forth], 1) * np.append(np.broadcast_to(half_sizes, 2), 1)
    place[:3, 3] = middle
    return matrix(place)


def _three(value):
    return [float(value)] * 3 if isinstance(value, (int, float)) else value


class Set:
    """The scene at one moment."""

    def __init__(self, scene, moment):
        self.scene, self.moment = scene, moment
        self.lights = {f"light {k}": emitter(light) for k, light in enumerate(scene.lights)}
        if any(scene.ambient):
            self.lights["ambient"] = {"type": "constant", "radiance": colour(scene.ambient)}
        if scene.probe:
            self.lights["probe"] = surroundings(scene.probe)
        self.real, self.virtual = {}, {}
        casting = {True: {}, False: {}}
        for thing in scene.things:
            frame = moment.world_from_anchor.get(thing.anchor)
            if frame is None:
                continue
            made = shapes(thing, frame)
            (self.real if thing.real else self.virtual).update(made)
            if thing.casts:
                casting[thing.real].update(made)
        for number, marker in enumerate(scene.markers):
            if marker.anchor in moment.world_from_anchor:
                self.real[f"print {number}"] = print_of(marker, moment.world_from_anchor[marker.anchor])
        self.without = mi.load_dict({"type": "scene", **self.lights, **self.real})
        self.casters = {real: mi.load_dict({"type": "scene", **made}) for real, made in casting.items()}

    def with_virtual(self):
        return mi.load_dict({"type": "scene", **self.lights, **self.real, **self.virtual})

    def virtual_alone(self):
        return mi.load_dict({"type": "scene", **self.virtual})


def rays(camera, camera_from_world, x_px, y_px, distorted):
    x = (x_px - camera.center_px[0]) / camera.focal_px[0]
    y = (y_px - camera.center_px[1]) / camera.focal_px[1]
    if distorted:
        k1, k2, p1, p2, k3 = camera.distortion
        target_x, target_y = x, y
        for _ in range(10):
            r2 = x * x + y * y
            radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
            x, y = ((target_x - 2 * p1 * x * y - p2 * (r2 + 2 * x * x)) / radial,
                    (target_y - p1 * (r2 + 2 * y * y) - 2 * p2 * x * y) / radial)
    turn = camera_from_world[:3, :3].T
    eye = -turn @ camera_from_world[:3, 3]
    way = [float(turn[axis, 0]) * x + float(turn[axis, 1]) * y + float(turn[axis, 2]) for axis in range(3)]
    return mi.RayDifferential3f(o=mi.Point3f(*eye.tolist()), d=dr.normalize(mi.Vector3f(*way)))


def radiance(camera, scene, camera_from_world, samples, seed, distorted):
    """Linear RGB, box-filtered over each pixel."""
    width, height = camera.size_px
    pixels = width * height
    # (`path` would take what is half clear for opaque on the way to a lamp. What is clear counts as a bounce.)
    clear = any("mask" in str(shape.bsdf()).lower()[:40] for shape in scene.shapes())
    kind = {"type": "volpath", "max_depth": 12} if clear else {"type": "path", "max_depth": 5}
    integrator = mi.load_dict({**kind, "rr_depth": 100})
    total = np.zeros((pixels, 3))
    part = max(1, min(samples, BATCH // pixels))
    parts = math.ceil(samples / part)
    for number in range(parts):
        sampler = mi.load_dict({"type": "independent"})
        sampler.seed(seed * 10007 + number, pixels * part)
        pixel = dr.arange(mi.UInt32, pixels * part) // part
        jitter = sampler.next_2d()
        seen = rays(camera, camera_from_world, mi.Float(pixel % width) + jitter.x - 0.5,
                    mi.Float(pixel // width) + jitter.y - 0.5, distorted)
        light, _, _ = integrator.sample(scene, sampler, seen)
        total += np.stack([np.array(dr.block_sum(channel, part)) for channel in (light.x, light.y, light.z)], 1)
    return (total / (part * parts)).reshape(height, width, 3)


def centres(camera, camera_from_world):
    width, height = camera.size_px
    pixel = dr.arange(mi.UInt32, width * height)
    return rays(camera, camera_from_world, mi.Float(pixel % width), mi.Float(pixel // width), False)


def opaque_hit(scene, seen):
    """What is first met that is more opaque than clear; its distance counts from where the ray began."""
    hit = scene.ray_intersect(seen)
    if not any("mask" in str(shape.bsdf()).lower()[:40] for shape in scene.shapes()):
        return hit
    origin = seen.o
    for _ in range(12):
        clear = hit.bsdf(seen).eval_null_transmission(hit).x > 0.5
        clear &= hit.is_valid()
        ray = mi.RayDifferential3f(hit.spawn_ray(seen.d))
        beyond = scene.ray_intersect(ray, clear)
        hit[clear] = beyond
    hit.t = dr.select(hit.is_valid(), dr.norm(hit.p - origin), dr.inf)
    return hit


def roles_and_shadows(camera, stage, camera_from_world):
    """What is seen at each pixel's centre, and for each light who takes it away there."""
    width, height = camera.size_px
    seen = centres(camera, camera_from_world)
    # (What is asked is worked out when it is read: the scenes must live as long.)
    whole, alone = stage.with_virtual(), stage.virtual_alone()
    hit = opaque_hit(whole, seen)
    nearest = opaque_hit(alone, seen) if stage.virtual else None
    valid = np.array(hit.is_valid())
    seeming = np.zeros_like(valid)
    if nearest is not None:
        seeming = np.array(nearest.is_valid() & (nearest.t <= hit.t * (1 + 1e-5)))
    roles = np.where(seeming, VIRTUAL, np.where(valid, REAL, 0)).astype(np.uint8)
    masks = []
    for light in stage.scene.lights:
        if "position_m" in light:
            # (Of a light of some size its middle.)
            to_light = mi.Point3f(*light["position_m"]) - hit.p
            reach = dr.norm(to_light)
            to_light /= reach
        else:
            to_light = dr.normalize(-mi.Vector3f(*light["direction"]))
            reach = mi.Float(1e30)
        away = dr.dot(hit.n, to_light) * dr.dot(hit.n, -seen.d) < 0
        bits = FACES_AWAY * np.array(away).astype(np.uint8)
        for real, bit in ((True, IN_REAL_SHADOW), (False, IN_VIRTUAL_SHADOW)):
            ray = hit.spawn_ray(to_light)
            ray.maxt = reach * (1 - 1e-4)
            bits |= bit * np.array(stage.casters[real].ray_test(ray)).astype(np.uint8)
        masks.append(np.where(valid, bits, 0).astype(np.uint8).reshape(height, width))
    return roles.reshape(height, width), masks
