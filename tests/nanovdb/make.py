# Makes the files of this folder: `python3 make.py`, with pyopenvdb 10.0 and nanovdb_convert 32.4.2 (on Debian 12: the
# packages python3-openvdb and libnanovdb-tools).
import subprocess
import numpy as np
import pyopenvdb as vdb

# A box of known values at negative indices, tiles of 8 and of 128 voxels along each axis, and two distant voxels
size = (20, 13, 9)
i, j, k = np.indices(size)
values = (((i * 37 + j * 11 + k * 5) % 16) / 16).astype(np.float32)
density = vdb.FloatGrid(0.0)
density.name, density.gridClass = "density", vdb.GridClass.FOG_VOLUME
density.copyFromArray(values, ijk=(-11, -5, -30))
density.fill((40, 40, 40), (63, 55, 47), 0.75)
density.fill((512, 0, 0), (639, 127, 127), 0.5)
accessor = density.getAccessor()
accessor.setValueOn((-4000, 3, 77), 0.375)
accessor.setValueOn((9000, -9000, 123), 0.875)
density.transform = vdb.createLinearTransform([[0.1, 0.02, 0, 0], [-0.03, 0.2, 0.01, 0], [0, 0.05, 0.3, 0], [1, 2, 3, 1]])

temperature = vdb.FloatGrid(0.0)
temperature.name, temperature.gridClass = "temperature", vdb.GridClass.FOG_VOLUME
temperature.copyFromArray(values * np.float32(2000), ijk=(-11, -5, -30))
temperature.transform = vdb.createLinearTransform(0.5)

vdb.write("two.vdb", [density, temperature])
for name, options in [("zip", ["-z"]), ("blosc", ["-b"]), ("fpn", ["--fpN", "-a", "0.001", "-b"])]:
    subprocess.run(["nanovdb_convert", "-f", *options, "two.vdb", f"{name}.nvdb"], check=True)

sphere = vdb.createLevelSetSphere(radius=1.0, voxelSize=0.5, halfWidth=2.0)
sphere.name = "surface"
vdb.write("two.vdb", [sphere])
subprocess.run(["nanovdb_convert", "-f", "-z", "two.vdb", "level-set.nvdb"], check=True)
subprocess.run(["rm", "two.vdb"], check=True)
