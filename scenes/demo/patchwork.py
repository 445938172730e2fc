# Makes patchwork.ply and patchwork.ptx: `python3 patchwork.py`. A cushion of quadrilaterals without texture coordinates,
# each of which has a texture of its own, of 1 to 32 × 32 texels.
import math
import random
import struct
import zlib

N = 5  # quadrilaterals along each side of the cube that the cushion was
random.seed(3)
COLORS = [(168, 52, 46), (222, 176, 84), (58, 92, 120), (232, 220, 196), (86, 118, 80), (120, 70, 100)]

# Sides of a cube, as an origin and two edges whose cross product points outwards
SIDES = [
    ((-1, -1, 1), (2, 0, 0), (0, 2, 0)),
    ((1, -1, -1), (-2, 0, 0), (0, 2, 0)),
    ((1, -1, 1), (0, 0, -2), (0, 2, 0)),
    ((-1, -1, -1), (0, 0, 2), (0, 2, 0)),
    ((-1, 1, 1), (2, 0, 0), (0, 0, -2)),
    ((-1, -1, -1), (2, 0, 0), (0, 0, 2)),
]

vertices, index_of, faces = [], {}, []


def vertex(cube):
    key = tuple(round(c * N) for c in cube)
    if key not in index_of:
        # Between the cube and a sphere, flattened
        length = math.sqrt(sum(c * c for c in cube))
        x, y, z = (0.35 * c + 0.9 * c / length for c in cube)
        index_of[key] = len(vertices)
        vertices.append((x, 0.45 * y * (1.25 - 0.25 * max(abs(x), abs(z)) ** 2), z))
    return index_of[key]


for origin, a, b in SIDES:
    at = lambda i, j: vertex([origin[k] + a[k] * i / N + b[k] * j / N for k in range(3)])
    for j in range(N):
        for i in range(N):
            faces.append([at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)])

normals = [[0.0] * 3 for _ in vertices]
for f in faces:
    p = [vertices[v] for v in f]
    d, e = [[q[k] - r[k] for k in range(3)] for q, r in ((p[2], p[0]), (p[3], p[1]))]
    n = (d[1] * e[2] - d[2] * e[1], d[2] * e[0] - d[0] * e[2], d[0] * e[1] - d[1] * e[0])
    for v in f:
        normals[v] = [a + b for a, b in zip(normals[v], n)]

with open("patchwork.ply", "w") as out:
    out.write("ply\nformat ascii 1.0\n")
    out.write(f"element vertex {len(vertices)}\n" + "".join(f"property float {c}\n" for c in ("x", "y", "z", "nx", "ny", "nz")))
    out.write(f"element face {len(faces)}\nproperty list uchar int vertex_indices\nproperty int face_indices\nend_header\n")
    for v, n in zip(vertices, normals):
        length = math.sqrt(sum(c * c for c in n))
        out.write(" ".join(f"{c:.5g}" for c in (*v, *(c / length for c in n))) + "\n")
    for i, f in enumerate(faces):
        out.write(f"4 {f[0]} {f[1]} {f[2]} {f[3]} {i}\n")

# Edge e of a face goes from its corner e to the next one; the face beyond has the same corners in the other order
edge_of = {(f[e], f[(e + 1) % 4]): (i, e) for i, f in enumerate(faces) for e in range(4)}


def pattern(kind, colors, log2):
    """Texels from the lower left; every patch has seams of darker cloth."""
    n = 1 << log2
    for y in range(n):
        for x in range(n):
            u, v = (x + 0.5) / n, (y + 0.5) / n
            second = {
                "plain": False,
                "stripes": int(u * 8) % 2 == 1,
                "checks": (int(u * 4) + int(v * 4)) % 2 == 1,
                "dots": (u * 4 % 1 - 0.5) ** 2 + (v * 4 % 1 - 0.5) ** 2 < 0.08,
            }[kind]
            seam = min(u, v, 1 - u, 1 - v) < 1 / 16
            yield [c // 2 if seam else c for c in colors[second]]


infos, means, sizes, blocks = b"", [b"", b"", b""], b"", b""
for f in faces:
    kind = random.choice(["plain", "stripes", "checks", "dots"])
    log2 = random.choice([4, 5, 5])
    beyond = [edge_of[(f[(e + 1) % 4], f[e])] for e in range(4)]
    constant = random.random() < 0.15
    infos += struct.pack("<4B4I", log2, log2, sum(e << 2 * k for k, (_, e) in enumerate(beyond)), int(constant), *(i for i, _ in beyond))
    colors = random.sample(COLORS, 2)
    texels = [colors[0]] * 4**log2 if constant else list(pattern(kind, colors, log2))
    planes = [bytes(t[c] for t in texels) for c in range(3)]
    for c in range(3):
        means[c] += bytes([round(sum(planes[c]) / len(planes[c]))])
    planar = b"".join(planes)
    packed = [(1, zlib.compress(planar, 9)), (2, zlib.compress(bytes((b - a) % 256 for a, b in zip(b"\0" + planar, planar)), 9))]
    encoding, block = (0, b"") if constant else min(packed, key=lambda p: len(p[1]))
    sizes += struct.pack("<I", encoding << 30 | len(block))
    blocks += block

infos, means, sizes = zlib.compress(infos), zlib.compress(b"".join(means)), zlib.compress(sizes)
level = len(sizes) + len(blocks)
with open("patchwork.ptx", "wb") as out:
    out.write(b"Ptex" + struct.pack("<4I2H", 1, 1, 0, 0xFFFFFFFF, 3, 1))
    out.write(struct.pack("<6IQ2I", len(faces), 40, len(infos), len(means), 16, 4, level, 0, 0))
    out.write(bytes(40) + infos + means + struct.pack("<Q2I", level, len(sizes), len(faces)) + sizes + blocks + bytes(8))
