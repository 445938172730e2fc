# Makes fire.nvdb: `python3 fire.py`, with numpy, pyopenvdb 10.0 and nanovdb_convert 32.4.2 (on Debian 12: the packages
# python3-numpy, python3-openvdb and libnanovdb-tools).
import subprocess
import numpy as np
import pyopenvdb as vdb

size = (72, 144, 72)
rng = np.random.default_rng(5)


def noise(power, stretch):
    """A random field of mean 0 and deviation 1, whose waves of frequency f have an amplitude f^-power."""
    f = np.sqrt(sum((k * s) ** 2 for k, s in zip(np.meshgrid(*[np.fft.fftfreq(n) * 72 for n in size], indexing="ij"), stretch)))
    waves = np.fft.fftn(rng.standard_normal(size)) / np.maximum(f, 1.5) ** power
    field = np.real(np.fft.ifftn(waves))
    return (field - field.mean()) / field.std()


i, j, k = [(c + 0.5) / 72 for c in np.indices(size)]
height = j / 2
# A column that sways and widens, torn by noise
x = i - 0.5 + 0.06 * height * noise(2.5, (1, 0.6, 1))
z = k - 0.5 + 0.06 * height * noise(2.5, (1, 0.6, 1))
radius = np.sqrt(x**2 + z**2) / (0.1 + 0.24 * height)
body = np.clip(1.15 - radius, 0, 1) + 0.16 * noise(2.2, (1, 0.7, 1)) * np.clip(1.6 - radius, 0, 1)
smoke = np.clip(1.6 * body - 0.25, 0, 1) * np.clip(height * 4, 0, 1) * np.clip((1 - height) * 3, 0, 1)
heat = np.clip(1.5 * body, 0, 1) * np.clip(1.25 - 1.7 * height + 0.2 * noise(2, (1, 0.5, 1)), 0, 1)

grids = []
for name, values in [("density", 0.15 * heat + smoke), ("temperature", 2100 * heat**0.5)]:
    grid = vdb.FloatGrid(0.0)
    grid.name, grid.gridClass = name, vdb.GridClass.FOG_VOLUME
    values = np.where(values > 0.02 * values.max(), values, 0)
    grid.copyFromArray(values.astype(np.float32), ijk=(-36, 0, -36))
    grid.transform = vdb.createLinearTransform(1 / 72)
    grids.append(grid)
vdb.write("fire.vdb", grids)
subprocess.run(["nanovdb_convert", "-f", "-z", "--fp4", "fire.vdb", "fire.nvdb"], check=True)
subprocess.run(["rm", "fire.vdb"], check=True)
