#!/usr/bin/env python3
"""Participating media beside Mitsuba 3: compare.py FOLDER [SAMPLES]

Writes scenes into the folder, renders them with `lumiris` and with Mitsuba (`volpath`), and prints means, and the ratios
of 16 x 16 pixels. Needs the Python packages numpy, OpenEXR and mitsuba.
"""
import subprocess
import sys
from pathlib import Path

import mitsuba as mi
import numpy as np
import OpenEXR

HEAD = """LookAt {look} 0 1 0
Camera "perspective" "float fov" {fov}
Film "rgb" "integer xresolution" 64 "integer yresolution" 64 "string filename" "{name}.exr"
PixelFilter "box" "float xradius" 0.5 "float yradius" 0.5
Integrator "volpath" "integer maxdepth" {depth}
WorldBegin
"""

BOX = [[-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1], [-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]]
BOX_FACES = [0, 2, 1, 0, 3, 2, 4, 5, 6, 4, 6, 7, 0, 1, 5, 0, 5, 4, 3, 7, 6, 3, 6, 2, 0, 4, 7, 0, 7, 3, 1, 2, 6, 1, 6, 5]
ROOM = [
    ([[-1, 0, -1], [-1, 0, 1], [1, 0, 1], [1, 0, -1]], [0.7, 0.7, 0.7]),
    ([[-1, 2, -1], [-1, 2, 1], [1, 2, 1], [1, 2, -1]], [0.7, 0.7, 0.7]),
    ([[-1, 0, -1], [1, 0, -1], [1, 2, -1], [-1, 2, -1]], [0.7, 0.7, 0.7]),
    ([[-1, 0, -1], [-1, 0, 1], [-1, 2, 1], [-1, 2, -1]], [0.6, 0.1, 0.1]),
    ([[1, 0, -1], [1, 0, 1], [1, 2, 1], [1, 2, -1]], [0.1, 0.5, 0.1]),
]
FRONT = [[-1, 0, 1], [1, 0, 1], [1, 2, 1], [-1, 2, 1]]
FLOOR = [[-9, -1.5, 9], [9, -1.5, 9], [9, -1.5, -9], [-9, -1.5, -9]]


def numbers(values):
    return " ".join(f"{v:.7g}" for v in np.ravel(values))


def pbrt_quad(corners):
    return f'Shape "trianglemesh" "point3 P" [ {numbers(corners)} ] "integer indices" [ 0 1 2 0 2 3 ]\n'


def gas_text():
    """A box of homogeneous gas with walls, a glass ball, and a lamp in the gas."""
    text = HEAD.format(look="0 1 6.8  0 1 0 ", fov=19.5, depth=7, name="gas")
    text += 'MakeNamedMedium "gas" "rgb sigma_s" [ 1 0.6 0.3 ] "rgb sigma_a" [ 0.1 0.05 0.3 ] "float g" 0.4\n'
    for corners, reflectance in ROOM:
        text += f'Material "diffuse" "rgb reflectance" [ {numbers(reflectance)} ]\n' + pbrt_quad(corners)
    text += 'AttributeBegin MediumInterface "gas" "" Material "interface"\n' + pbrt_quad(FRONT) + "AttributeEnd\n"
    text += 'AttributeBegin MediumInterface "" "gas" Material "dielectric" Translate -0.3 0.6 0.2\n'
    text += 'Shape "sphere" "float radius" 0.35 AttributeEnd\n'
    text += 'Material "diffuse" "rgb reflectance" [ 0 0 0 ] AreaLightSource "diffuse" "rgb L" [ 12 10 8 ]\n'
    return text + 'Translate 0.2 1.5 0 Shape "sphere" "float radius" 0.2\n'


def smoke_text(density):
    """A grid of smoke in a stretched box above a floor, under a sky and beside a lamp."""
    text = HEAD.format(look="0 0 6  0 0 0 ", fov=30, depth=15, name="smoke")
    text += 'LightSource "infinite" "rgb L" [ 0.3 0.4 0.5 ]\nAttributeBegin Scale 1 1.2 0.8\n'
    text += 'MakeNamedMedium "smoke" "string type" "uniformgrid" "integer nx" 8 "integer ny" 8 "integer nz" 8\n'
    text += '"point3 p0" [ -1 -1 -1 ] "point3 p1" [ 1 1 1 ] "float g" 0.5 "rgb sigma_s" [ 1.8 1.5 1 ]\n'
    text += f'"rgb sigma_a" [ 0.2 0.5 1 ] "float density" [ {numbers(density)} ]\nMaterial "interface"\n'
    text += f'MediumInterface "smoke" "" Shape "trianglemesh" "point3 P" [ {numbers(BOX)} ]\n'
    text += f'"integer indices" [ {numbers(BOX_FACES)} ] AttributeEnd\nAttributeBegin Translate 1.6 1.6 1.6\n'
    text += 'AreaLightSource "diffuse" "rgb L" [ 20 18 15 ] Shape "sphere" "float radius" 0.3 AttributeEnd\n'
    return text + 'Material "diffuse" "rgb reflectance" [ 0.5 0.5 0.5 ]\n' + pbrt_quad(FLOOR)


def ball_text(alpha):
    """A ball of `Material "subsurface"` under a sky, beside a lamp."""
    text = HEAD.format(look="0 0.6 -4.2  0 0 0 ", fov=34, depth=60, name="ball")
    text += 'LightSource "infinite" "rgb L" [ 0.3 0.3 0.3 ]\nAttributeBegin Translate -2.5 2.5 -1.5\n'
    text += 'AreaLightSource "diffuse" "rgb L" [ 8 8 8 ] Shape "sphere" "float radius" 1 AttributeEnd\n'
    text += 'Material "subsurface" "rgb sigma_s" [ 4 3 2 ] "rgb sigma_a" [ 0.05 0.2 0.6 ] "float eta" 1.33 "float g" 0.3\n'
    return text + f'"float roughness" {alpha} "bool remaproughness" false Shape "sphere" "float radius" 1\n'


def rgb(values):
    return {"type": "rgb", "value": values}


def diffuse(reflectance):
    return {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": rgb(reflectance)}}


def quad(folder, name, corners, bsdf, **more):
    mesh = mi.Mesh(name, 4, 2)
    params = mi.traverse(mesh)
    params["vertex_positions"] = np.array(corners, dtype=np.float32).ravel()
    params["faces"] = np.array([0, 1, 2, 0, 2, 3], dtype=np.uint32)
    params.update()
    path = str(folder / f"{name}.ply")
    mesh.write_ply(path)
    return {"type": "ply", "filename": path, "bsdf": bsdf, "face_normals": True, **more}


def frame(origin, target, fov, depth, samples):
    to_world = mi.ScalarTransform4f().look_at(origin=origin, target=target, up=[0, 1, 0])
    film = {"type": "hdrfilm", "width": 64, "height": 64, "rfilter": {"type": "box"}, "pixel_format": "rgb"}
    sampler = {"type": "independent", "sample_count": samples}
    sensor = {"type": "perspective", "fov": fov, "to_world": to_world, "film": film, "sampler": sampler}
    return {"type": "scene", "integrator": {"type": "volpath", "max_depth": depth + 1, "rr_depth": 1000}, "sensor": sensor}


def gas_scene(folder, samples):
    phase = {"type": "hg", "g": 0.4}
    albedo, sigma_t = rgb([1 / 1.1, 0.6 / 0.65, 0.3 / 0.6]), rgb([0.55, 0.325, 0.3])
    gas = mi.load_dict({"type": "homogeneous", "albedo": albedo, "sigma_t": sigma_t, "scale": 2.0, "phase": phase})
    scene = frame([0, 1, 6.8], [0, 1, 0], 19.5, 7, samples)
    for i, (corners, reflectance) in enumerate(ROOM):
        scene[f"wall{i}"] = quad(folder, f"wall{i}", corners, diffuse(reflectance))
    scene["front"] = quad(folder, "front", FRONT, {"type": "null"}, interior=gas)
    glass = {"type": "dielectric", "int_ior": 1.5, "ext_ior": 1.0}
    scene["ball"] = {"type": "sphere", "center": [-0.3, 0.6, 0.2], "radius": 0.35, "bsdf": glass, "exterior": gas}
    lamp = {"type": "area", "radiance": rgb([12, 10, 8])}
    bsdf = diffuse([0, 0, 0])
    scene["lamp"] = {"type": "sphere", "center": [0.2, 1.5, 0], "radius": 0.2, "bsdf": bsdf, "emitter": lamp, "exterior": gas}
    return scene


def smoke_scene(folder, density, samples):
    transform = mi.ScalarTransform4f
    box = transform().scale([1, 1.2, 0.8])
    to_world = box @ transform().translate([-1, -1, -1]) @ transform().scale(2)
    grid = {"type": "gridvolume", "grid": mi.VolumeGrid(density[..., None].astype(np.float32)), "to_world": to_world}
    albedo = {"type": "constvolume", "value": rgb([0.9, 0.75, 0.5])}
    phase = {"type": "hg", "g": 0.5}
    smoke = mi.load_dict({"type": "heterogeneous", "albedo": albedo, "sigma_t": grid, "scale": 2.0, "phase": phase})
    scene = frame([0, 0, 6], [0, 0, 0], 30, 15, samples)
    scene["sky"] = {"type": "constant", "radiance": rgb([0.3, 0.4, 0.5])}
    scene["box"] = {"type": "cube", "to_world": box, "bsdf": {"type": "null"}, "interior": smoke}
    lamp = {"type": "area", "radiance": rgb([20, 18, 15])}
    scene["lamp"] = {"type": "sphere", "center": [1.6, 1.6, 1.6], "radius": 0.3, "bsdf": diffuse([0.5] * 3), "emitter": lamp}
    scene["floor"] = quad(folder, "floor", FLOOR, diffuse([0.5] * 3))
    return scene


def ball_scene(alpha, samples):
    albedo, sigma_t = rgb([4 / 4.05, 3 / 3.2, 2 / 2.6]), rgb([0.81, 0.64, 0.52])
    phase = {"type": "hg", "g": 0.3}
    inside = {"type": "homogeneous", "albedo": albedo, "sigma_t": sigma_t, "scale": 5.0, "phase": phase}
    boundary = {"type": "dielectric", "int_ior": 1.33, "ext_ior": 1.0}
    if alpha > 0:
        boundary |= {"type": "roughdielectric", "distribution": "ggx", "alpha": alpha}
    # Every event of a walk counts there
    scene = frame([0, 0.6, -4.2], [0, 0, 0], 34, 3000, samples)
    scene["sky"] = {"type": "constant", "radiance": rgb([0.3, 0.3, 0.3])}
    lamp = {"type": "area", "radiance": rgb([8, 8, 8])}
    scene["lamp"] = {"type": "sphere", "center": [-2.5, 2.5, -1.5], "radius": 1, "emitter": lamp}
    scene["ball"] = {"type": "sphere", "radius": 1, "bsdf": boundary, "interior": inside}
    return scene


def compare(folder, name, text, scene, samples):
    (folder / f"{name}.pbrt").write_text(text)
    arguments = ["--estimator", "mis", "--spp", str(samples // 4), "--quiet", "-o", str(folder / f"{name}.exr")]
    subprocess.run(["lumiris", "render", str(folder / f"{name}.pbrt"), *arguments], check=True)
    channels = OpenEXR.File(str(folder / f"{name}.exr"), separate_channels=True).channels()
    ours = np.stack([np.asarray(channels[c].pixels, dtype=np.float64) for c in "RGB"], -1)
    # Mitsuba's camera has its x axis to the other side
    theirs = np.array(mi.render(mi.load_dict(scene)))[:, ::-1, :3].astype(np.float64)
    blocks = lambda image: image.reshape(4, 16, 4, 16, 3).mean((1, 3))
    ratio = blocks(ours) / blocks(theirs)
    print(f"| {name} | {numbers(ours.mean((0, 1)) / theirs.mean((0, 1)))} | {ratio.min():.4f} to {ratio.max():.4f} |")


def main():
    folder = Path(sys.argv[1]).resolve()
    samples = int(sys.argv[2]) if len(sys.argv) > 2 else 2048
    folder.mkdir(exist_ok=True)
    mi.set_variant("llvm_ad_rgb")
    # Zeros around, so that it does not matter how a grid goes on beyond its samples
    density = np.zeros((8, 8, 8))
    density[1:7, 1:7, 1:7] = np.random.default_rng(5).random((6, 6, 6)) ** 2 * 3
    print("| scene | means, R G B, relative to Mitsuba | blocks of 16 × 16 pixels |\n|---|---|---|")
    compare(folder, "gas", gas_text(), gas_scene(folder, samples), samples)
    compare(folder, "smoke", smoke_text(density), smoke_scene(folder, density, samples), samples)
    for name, alpha in [("ball", 0), ("rough ball", 0.3)]:
        compare(folder, name, ball_text(alpha), ball_scene(alpha, samples), samples)


main()
