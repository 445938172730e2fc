"""Measured BSDFs of Lumiris against Mitsuba 3, and both against the BRDF that was measured.

    python docs/measurements/measured-bsdf.py --lumiris target/release/examples/measured_bsdf --out DIR

Makes files of a metal over a Lambertian in the form of the RGL database, by code that shares nothing with Lumiris; evaluates and
samples them at random directions with Mitsuba's `measured` and with Lumiris; and prints the differences as a table. Needs NumPy
and `pip install mitsuba==3.9.1`. `--write FILE` makes the isotropic file only, without Mitsuba.
"""
import argparse
import os
import struct
import subprocess

import numpy as np

PI = np.pi
WAVELENGTHS = np.arange(380.0, 781.0, 20.0, dtype=np.float32)


def to_theta(x):
    return x * x * PI / 2


def direction(theta, phi):
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], -1)


class Sample:
    """GGX of a colour by Schlick's Fresnel over a Lambertian; colours are by channel or by wavelength."""

    def __init__(self, ax, ay, f0, diffuse):
        self.ax, self.ay, self.f0, self.diffuse = ax, ay, np.asarray(f0), np.asarray(diffuse)

    def d(self, m):
        x, y, z = m[..., 0] / self.ax, m[..., 1] / self.ay, m[..., 2]
        return 1 / (PI * self.ax * self.ay * np.maximum(x * x + y * y + z * z, 1e-30) ** 2)

    def lam(self, w):
        t = ((self.ax * w[..., 0]) ** 2 + (self.ay * w[..., 1]) ** 2) / np.maximum(w[..., 2], 1e-6) ** 2
        return (np.sqrt(1 + t) - 1) / 2

    def sigma(self, w):
        return np.maximum(w[..., 2], 1e-6) * (1 + self.lam(w))

    def f(self, wo, wi):
        m = wo + wi
        m = m / np.linalg.norm(m, axis=-1, keepdims=True)
        g = 1 / (1 + self.lam(wo) + self.lam(wi))
        c = (1 - np.sum(wo * m, -1))[..., None]
        fresnel = self.f0 + (1 - self.f0) * c**5
        return fresnel * (self.d(m) * g / (4 * wo[..., 2] * wi[..., 2]))[..., None] + self.diffuse / PI


def linear(a, b, integral):
    """The t with ∫ from 0 to t of what goes from a to b."""
    if abs(b - a) < 1e-12 * (a + b):
        return integral / a if a > 0 else 0.0
    return (np.sqrt(max(a * a + 2 * integral * (b - a), 0)) - a) / (b - a)


def warp(table, u):
    """The point of a random number by a bilinear density, rows first."""
    rows, columns = table.shape
    along = np.concatenate([np.zeros((rows, 1)), np.cumsum((table[:, 1:] + table[:, :-1]) / 2, 1)], 1)
    total = along[:, -1]
    above = np.concatenate([[0], np.cumsum((total[1:] + total[:-1]) / 2)])
    target = u[1] * above[-1]
    y = min(max(np.searchsorted(above, target) - 1, 0), rows - 2)
    t = min(linear(total[y], total[y + 1], target - above[y]), 1)
    row = (1 - t) * along[y] + t * along[y + 1]
    target = u[0] * row[-1]
    x = min(max(np.searchsorted(row, target) - 1, 0), columns - 2)
    values = (1 - t) * table[y] + t * table[y + 1]
    s = min(linear(values[x], values[x + 1], target - row[x]), 1)
    return (x + s) / (columns - 1), (y + t) / (rows - 1)


def grid(columns, rows):
    x, y = np.meshgrid(np.linspace(0, 1, columns), np.linspace(0, 1, rows))
    return x, y


def measure(sample, phis, thetas, normals, colors, weights, jacobian=1):
    """Fields of a file; `weights` makes luminance of the channels."""
    x, y = grid(128, 33)
    ndf = sample.d(direction(to_theta(x), (2 * y - 1) * PI))
    sigma = sample.sigma(direction(to_theta(x), (2 * y - 1) * PI))
    x, y = grid(normals, normals)
    isotropic = len(phis) <= 2
    shape = (len(phis), len(thetas))
    vndf = np.zeros(shape + (normals, normals))
    channels = len(weights)
    values = np.zeros(shape + (channels, colors, colors))
    for i, phi in enumerate(phis):
        for j, theta in enumerate(thetas):
            wo = direction(np.float64(theta), np.float64(phi))
            m = direction(to_theta(x), (2 * y - 1) * PI + (phi if isotropic else 0))
            vndf[i, j] = sample.d(m) * np.maximum(m @ wo, 0) * x * np.sin(to_theta(x))
            for a in range(colors):
                for b in range(colors):
                    px, py = warp(vndf[i, j], (b / (colors - 1), a / (colors - 1)))
                    m = direction(to_theta(px), (2 * py - 1) * PI + (phi if isotropic else 0))
                    wi = 2 * (m @ wo) * m - wo
                    if wi[2] > 0:
                        value = sample.f(wo, wi) * wi[2]
                        values[i, j, :, a, b] = value * 4 * sample.sigma(wo) / sample.d(m) if jacobian else value
    return {
        "description": np.frombuffer(b"metal over a Lambertian", np.uint8),
        "jacobian": np.array([jacobian], np.uint8),
        "phi_i": phis, "theta_i": thetas, "ndf": ndf, "sigma": sigma, "vndf": vndf,
        "luminance": np.einsum("ptcyx,c->ptyx", values, weights),
    }, values


def write(path, fields):
    fields = {k: v if v.dtype == np.uint8 else np.ascontiguousarray(v, np.float32) for k, v in fields.items()}
    offset = 18 + sum(13 + len(k) + 8 * v.ndim for k, v in fields.items())
    with open(path, "wb") as f:
        f.write(b"tensor_file\0" + struct.pack("<BBI", 1, 0, len(fields)))
        for name, v in fields.items():
            f.write(struct.pack("<H", len(name)) + name.encode() + struct.pack("<HBQ", v.ndim, 1 if v.dtype == np.uint8 else 10, offset))
            f.write(struct.pack(f"<{v.ndim}Q", *v.shape))
            offset += v.nbytes
        for v in fields.values():
            f.write(v.tobytes())


RGB = np.array([0.2126, 0.7152, 0.0722])
COPPER, CLAY = [0.95, 0.64, 0.54], [0.12, 0.07, 0.03]


def angles(n):
    return ((1 - (1 - np.linspace(0, 1, n)) ** 1.3) * PI / 2 * 0.97).astype(np.float32)


def small():
    """A file small enough to be kept."""
    fields, values = measure(Sample(0.3, 0.3, [c * 0.8 for c in COPPER], CLAY), np.zeros(1, np.float32), angles(8), 32, 20, RGB)
    return {**fields, "rgb": values}


def of_wavelengths():
    """Colours that differ by wavelength."""
    red = 1 / (1 + np.exp((590 - WAVELENGTHS.astype(np.float64)) / 25))
    sample = Sample(0.35, 0.35, 0.1 + 0.8 * red, 0.05 + 0.1 * (1 - red))
    weights = np.exp(-(((WAVELENGTHS - 555) / 60) ** 2))
    fields, values = measure(sample, np.zeros(1, np.float32), angles(8), 48, 16, weights / weights.sum())
    return "isotropic, 21 wavelengths", sample, {**fields, "wavelengths": WAVELENGTHS, "spectra": values}


def cases():
    iso = Sample(0.3, 0.3, COPPER, CLAY)
    aniso = Sample(0.5, 0.25, COPPER, CLAY)
    circle = np.linspace(-PI, PI, 13).astype(np.float32)
    quarter = np.linspace(-PI, -PI / 2, 5).astype(np.float32)
    half = np.linspace(-PI, 0, 9).astype(np.float32)
    # Isotropic ones first: Mitsuba 3.9.1 does not initialise the symmetry of those, and takes that of a material before
    yield of_wavelengths()
    for name, sample, phis, sizes, jacobian in [
        ("isotropic", iso, np.zeros(1, np.float32), (16, 64, 32), 1),
        ("isotropic, without D/(4σ)", iso, np.zeros(1, np.float32), (16, 64, 32), 0),
        ("anisotropic, all azimuths", aniso, circle, (8, 32, 16), 1),
        ("anisotropic, half", aniso, half, (8, 32, 16), 1),
        ("anisotropic, a quarter", aniso, quarter, (8, 32, 16), 1),
    ]:
        fields, values = measure(sample, phis, angles(sizes[0]), sizes[1], sizes[2], RGB, jacobian)
        yield name, sample, {**fields, "rgb": values}


def directions(rng, n):
    u = rng.random((n, 2))
    z = np.sqrt(1 - u[:, 0] * 0.97)
    r = np.sqrt(1 - z * z)
    return np.stack([r * np.cos(2 * PI * u[:, 1]), r * np.sin(2 * PI * u[:, 1]), z], -1).astype(np.float32)


def of_mitsuba(path, wo, wi, u, spectral):
    import mitsuba as mi

    mi.set_variant("scalar_spectral" if spectral else "scalar_rgb")
    bsdf = mi.load_dict({"type": "measured", "filename": path})
    context, out = mi.BSDFContext(), []
    lambdas = np.arange(360.0, 786.0)
    if spectral:
        bars = np.array([[float(c) for c in mi.cie1931_xyz(l)] for l in lambdas])
        d65 = np.array([float(mi.cie_d65(l)) for l in lambdas])
        light = bars * d65[:, None] / np.sum(bars[:, 1] * d65)
        from_xyz = np.array([[3.2404542, -1.5371385, -0.4985314], [-0.9692660, 1.8760108, 0.0415560], [0.0556434, -0.2040259, 1.0572252]])
    for o, i, v in zip(wo, wi, u):
        si = mi.SurfaceInteraction3f()
        si.wi = mi.Vector3f(*map(float, o))
        to = mi.Vector3f(*map(float, i))

        def colour(evaluate):
            if not spectral:
                return [float(c) for c in evaluate(si)]
            values = []
            for k in range(0, len(lambdas), 4):
                chunk = np.resize(lambdas[k : k + 4], 4)
                si.wavelengths = [float(c) for c in chunk]
                values += [float(c) for c in evaluate(si)][: len(lambdas[k : k + 4])]
            return list(from_xyz @ (light * np.array(values)[:, None]).sum(0))

        f = np.array(colour(lambda si: bsdf.eval(context, si, to))) / i[2]
        pdf = float(bsdf.pdf(context, si, to))
        # Mitsuba takes the other number for the rows
        sample, _ = bsdf.sample(context, si, 0.5, mi.Point2f(float(v[1]), float(v[0])))
        s = [float(c) for c in sample.wo] if sample.wo[2] > 0 else [0, 0, 0]
        out.append([*f, pdf, *s, float(sample.pdf) if s[2] > 0 else 0])
    return np.array(out)


def of_lumiris(program, path, wo, wi, u):
    lines = "\n".join(" ".join(repr(float(x)) for x in (*o, *i, *v)) for o, i, v in zip(wo, wi, u))
    answer = subprocess.run([program, path], input=lines, capture_output=True, text=True, check=True).stdout
    rows = np.array([[float(x) for x in line.split()] for line in answer.splitlines()])
    return rows[:, [0, 1, 2, 3, 4, 5, 6, 10]]


def relative(a, b):
    off = np.abs(a - b) / np.maximum(np.abs(b).max(-1, keepdims=True) if b.ndim > 1 else np.abs(b), 1e-6)
    return off.max(-1) if off.ndim > 1 else off


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--lumiris", default="target/release/examples/measured_bsdf")
    parser.add_argument("--out", default="measured-bsdf")
    parser.add_argument("--pairs", type=int, default=400)
    parser.add_argument("--write")
    options = parser.parse_args()
    if options.write:
        return write(options.write, small())
    os.makedirs(options.out, exist_ok=True)
    print("| file | f | density | direction of the sample | its density | f against the BRDF: median | greatest |")
    print("|---|---|---|---|---|---|---|")
    for k, (name, sample, fields) in enumerate(cases()):
        path = os.path.join(options.out, f"{k}.bsdf")
        write(path, fields)
        spectral = "spectra" in fields
        rng = np.random.default_rng(k + 1)
        n = options.pairs if not spectral else options.pairs // 4
        wo, wi, u = directions(rng, n), directions(rng, n), rng.random((n, 2)).astype(np.float32)
        theirs = of_mitsuba(path, wo, wi, u, spectral)
        ours = of_lumiris(options.lumiris, path, wo, wi, u)
        both = (theirs[:, 6] > 0) & (ours[:, 6] > 0)
        one = int(np.sum((theirs[:, 6] > 0) != (ours[:, 6] > 0)))
        columns = [relative(ours[:, :3], theirs[:, :3]), relative(ours[:, 3], theirs[:, 3]),
                   np.linalg.norm(ours[both, 4:7] - theirs[both, 4:7], axis=-1), relative(ours[both, 7], theirs[both, 7])]
        cells = [f"{c.max():.1e}" for c in columns]
        if not spectral:
            exact = relative(ours[:, :3], sample.f(wo.astype(float), wi.astype(float)))
            cells += [f"{np.median(exact) * 100:.2f} %", f"{exact.max() * 100:.1f} %"]
        print(f"| {name} | " + " | ".join(cells) + f" | <!-- {n} pairs, {both.sum()} samples, {one} of one only -->")


if __name__ == "__main__":
    main()
