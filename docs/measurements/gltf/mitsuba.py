"""Renders glTF files (.gltf) with Lumiris and with Mitsuba 3, in even white light from the same camera, and compares what both see
of the surfaces. `python mitsuba.py FOLDER_FOR_IMAGES LUMIRIS FILE...`; needs mitsuba, numpy and OpenEXR.

Mitsuba has no importer of glTF: what is compared is read here, independently of Lumiris: meshes with normals and texture
coordinates, nodes, metallic-roughness with its textures, and normal maps. Each file is rendered as it is, by Mitsuba's
`principled`, and once more without specular reflection and metal, which is `diffuse` there.
"""
import base64, json, subprocess, sys
from pathlib import Path
import mitsuba as mi
import numpy as np
import OpenEXR

mi.set_variant("llvm_ad_rgb")
KINDS = {5120: "i1", 5121: "u1", 5122: "i2", 5123: "u2", 5125: "u4", 5126: "f4"}
COUNTS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


class File:
    def __init__(self, path):
        self.folder, self.root = path.parent, json.loads(path.read_bytes())
        self.buffers = [self.bytes_of(b) for b in self.root["buffers"]]

    def bytes_of(self, entry):
        uri = entry["uri"]
        return base64.b64decode(uri.split(",", 1)[1]) if uri.startswith("data:") else (self.folder / uri).read_bytes()

    def view(self, index):
        view = self.root["bufferViews"][index]
        start = view.get("byteOffset", 0)
        return self.buffers[view["buffer"]][start : start + view["byteLength"]], view.get("byteStride")

    def accessor(self, index):
        a = self.root["accessors"][index]
        data, stride = self.view(a["bufferView"])
        kind, width = np.dtype("<" + KINDS[a["componentType"]]), COUNTS[a["type"]]
        stride = stride or kind.itemsize * width
        start = a.get("byteOffset", 0)
        rows = [np.frombuffer(data, kind, width, start + i * stride) for i in range(a["count"])]
        return np.array(rows)

    def image(self, texture, raw):
        """A bitmap of linear floats: red, green, blue and opacity, the colours decoded unless `raw`."""
        entry = self.root["images"][self.root["textures"][texture["index"]]["source"]]
        data = self.view(entry["bufferView"])[0] if "bufferView" in entry else self.bytes_of(entry)
        path = out / "texture"
        path.write_bytes(data)
        bitmap = mi.Bitmap(str(path))
        if raw:
            bitmap.set_srgb_gamma(False)
        return bitmap.convert(mi.Bitmap.PixelFormat.RGBA, mi.Struct.Type.Float32, False)


def local(node):
    if "matrix" in node:
        return np.array(node["matrix"], float).reshape(4, 4).T
    m = np.eye(4)
    x, y, z, w = node.get("rotation", [0, 0, 0, 1])
    m[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    m[:3, :3] *= np.array(node.get("scale", [1, 1, 1]))
    m[:3, 3] = node.get("translation", [0, 0, 0])
    return m


def texture(bitmap, channel=None, factor=1.0):
    data = np.array(bitmap)
    data = data[:, :, :3] if channel is None else data[:, :, channel : channel + 1]
    return {"type": "bitmap", "bitmap": mi.Bitmap(np.ascontiguousarray(data * factor, dtype=np.float32)), "raw": True}


def material(file, index, is_diffuse):
    m = file.root["materials"][index] if index is not None else {}
    pbr = m.get("pbrMetallicRoughness", {})
    factor = np.array(pbr.get("baseColorFactor", [1, 1, 1, 1]))[:3]
    color = {"type": "rgb", "value": factor.tolist()}
    if "baseColorTexture" in pbr:
        color = texture(file.image(pbr["baseColorTexture"], False), None, factor)
    roughness, metallic = pbr.get("roughnessFactor", 1.0), pbr.get("metallicFactor", 1.0)
    if "metallicRoughnessTexture" in pbr:
        bitmap = file.image(pbr["metallicRoughnessTexture"], True)
        roughness, metallic = texture(bitmap, 1, roughness), texture(bitmap, 2, metallic)
    bsdf = {"type": "principled", "specular": 0.5, "base_color": color, "roughness": roughness, "metallic": metallic}
    if is_diffuse:
        bsdf = {"type": "diffuse", "reflectance": color}
    if "normalTexture" in m:
        bsdf = {"type": "normalmap", "bsdf": bsdf, "normalmap": texture(file.image(m["normalTexture"], True))}
    bsdf = {"type": "twosided", "bsdf": bsdf}
    if m.get("alphaMode") == "BLEND":
        opacity = pbr.get("baseColorFactor", [1, 1, 1, 1])[3]
        if "baseColorTexture" in pbr:
            opacity = texture(file.image(pbr["baseColorTexture"], False), 3, opacity)
        bsdf = {"type": "mask", "opacity": opacity, "bsdf": bsdf}
    return bsdf


def shapes(file, is_diffuse):
    found = {}

    def visit(index, parent):
        node = file.root["nodes"][index]
        world = parent @ local(node)
        for primitive in file.root["meshes"][node["mesh"]]["primitives"] if "mesh" in node else []:
            at = primitive["attributes"]
            p = file.accessor(at["POSITION"])
            p = p @ world[:3, :3].T + world[:3, 3]
            faces = file.accessor(primitive["indices"]).ravel() if "indices" in primitive else np.arange(len(p))
            props = mi.Properties()
            props["bsdf"] = mi.load_dict(material(file, primitive.get("material"), is_diffuse))
            has = ["NORMAL" in at, "TEXCOORD_0" in at]
            mesh = mi.Mesh(f"mesh{len(found)}", len(p), len(faces) // 3, props, has[0], has[1])
            params = mi.traverse(mesh)
            params["vertex_positions"] = p.astype(np.float32).ravel()
            params["faces"] = faces.astype(np.uint32)
            if has[0]:
                n = file.accessor(at["NORMAL"]) @ np.linalg.inv(world[:3, :3])
                params["vertex_normals"] = (n / np.linalg.norm(n, axis=1, keepdims=True)).astype(np.float32).ravel()
            if has[1]:
                params["vertex_texcoords"] = file.accessor(at["TEXCOORD_0"]).astype(np.float32).ravel()
            params.update()
            found[f"mesh{len(found)}"] = mesh
        for child in node.get("children", []):
            visit(child, world)

    scene = file.root["scenes"][file.root.get("scene", 0)]
    for index in scene["nodes"]:
        visit(index, np.eye(4))
    return found


def channels(path):
    part = OpenEXR.File(str(path), separate_channels=True)
    return {n: c.pixels for p in part.parts for n, c in p.channels.items()}, part.parts[0].header


out, lumiris = Path(sys.argv[1]), sys.argv[2]
white = out / "white.pfm"
white.write_bytes(b"PF\n4 2\n-1.0\n" + np.ones(24, "<f4").tobytes())
SIZE, SPP, DEPTH = 256, 256, 6


def without_specular(path):
    """A copy of the file, in a folder with what it refers to, whose surfaces are Lambertian."""
    folder = out / path.stem
    folder.mkdir(exist_ok=True)
    for other in path.parent.iterdir():
        if not (folder / other.name).exists():
            (folder / other.name).symlink_to(other.resolve())
    root = json.loads(path.read_bytes())
    for m in root["materials"]:
        pbr = m.setdefault("pbrMetallicRoughness", {})
        pbr.pop("metallicRoughnessTexture", None)
        pbr["metallicFactor"] = 0
        m["extensions"] = {"KHR_materials_specular": {"specularFactor": 0}}
    copy = folder / (path.stem + "_diffuse.gltf")
    copy.write_text(json.dumps(root))
    return copy


files = [Path(name) for name in sys.argv[3:]]
for name in [copy for path in files for copy in (path, without_specular(path))]:
    is_diffuse = name.stem.endswith("_diffuse")
    image = out / (name.stem + ".exr")
    options = f"--camera-auto --environment {white} --resolution {SIZE}x{SIZE} --box-filter --spp {SPP} --max-depth {DEPTH}"
    subprocess.run([lumiris, "render", name, *options.split(), "--estimator", "mis", "--aov", "depth,albedo", "-q", "-o", image], check=True)
    data, header = channels(image)
    ours = np.stack([data[c] for c in "RGB"], -1).astype(float)
    # Matrices of row vectors
    view, ndc = (np.array(header[key], float).reshape(4, 4).T for key in ("worldToCamera", "worldToNDC"))
    projection = ndc @ np.linalg.inv(view)
    # Images are from 0 to 1, and x of Mitsuba's cameras is to the left
    half, to_world = abs(0.5 / projection[1, 1]), np.linalg.inv(view) @ np.diag([-1, 1, 1, 1])
    file = File(name)
    film = {"type": "hdrfilm", "width": SIZE, "height": SIZE, "rfilter": {"type": "box"}, "pixel_format": "rgb"}
    sensor = {
        "type": "perspective", "fov_axis": "y", "fov": 2 * np.degrees(np.arctan(half)), "film": film,
        "to_world": mi.ScalarTransform4f(to_world), "near_clip": 1e-3, "far_clip": 1e5,
        "sampler": {"type": "independent", "sample_count": SPP},
    }
    scene = {"type": "scene", "sensor": sensor, "light": {"type": "constant"}, **shapes(file, is_diffuse)}
    scene["integrator"] = {"type": "path", "max_depth": DEPTH + 1, "rr_depth": 100}
    theirs = np.array(mi.render(mi.load_dict(scene)))[..., :3].astype(float)
    mi.Bitmap(theirs.astype(np.float32)).write(str(out / (name.stem + "_mitsuba.exr")))
    seen = np.isfinite(data[next(c for c in data if c.startswith("depth"))])
    depth = data[next(c for c in data if c.startswith("depth"))]
    seen &= (depth > 0) & (depth < 1e30)
    a, b = ours[seen].mean(0), theirs[seen].mean(0)
    difference = np.abs(ours - theirs)[seen].mean() / theirs[seen].mean()
    print(f"{name.name}: {seen.sum()} pixels; Lumiris {a.round(4)}, Mitsuba {b.round(4)}, ratio {(a / b).round(4)}, mean difference {difference:.3f}")
