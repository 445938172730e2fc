"""Prints a scene of 100,000 curves on a ball, or of the number given, of one segment each."""

import math
import random
import sys

count = int(sys.argv[1]) if len(sys.argv) > 1 else 100_000
random.seed(1)
print('''LookAt 0 0 -4  0 0 0  0 1 0
Camera "perspective" "float fov" 40
Film "rgb" "integer xresolution" 256 "integer yresolution" 256
WorldBegin
LightSource "infinite" "rgb L" [ 1 1 1 ]
Material "hair"''')
for _ in range(count):
    z, a = random.uniform(-1, 1), random.uniform(0, 2 * math.pi)
    r = math.sqrt(1 - z * z)
    n = (r * math.cos(a), r * math.sin(a), z)
    bend = [random.uniform(-0.06, 0.06) for _ in range(3)]
    points = [n[c] * (1 + 0.1 * k) + bend[c] * k * k / 9 for k in range(4) for c in range(3)]
    print('Shape "curve" "point3 P" [', *(f"{x:.5f}" for x in points), '] "float width0" 0.004 "float width1" 0.001')
