#!/usr/bin/env bash
# Time per camera sample of a box under a sky, with two programs in turn: measure.sh OLD NEW
#
# A box covers one pixel in 13; all other camera rays leave the scene. 256 × 256 pixels, 16 samples, one thread, five turns.
# Prints the median time of the render, the share of "shade" in it, and the difference of the two images.
set -euo pipefail
old=$(realpath "$1") new=$(realpath "$2")
cd "$(mktemp -d)"
trap 'rm -rf "$PWD"' EXIT
"$new" generate sky -o sky.exr >/dev/null

scene() {
  cat >"$1.pbrt" <<PBRT
LookAt 3 -5 2.5  0 0 0.3  0 0 1
Camera "perspective" "float fov" 40
Sampler "zsobol" "integer pixelsamples" 16
Integrator "path" "integer maxdepth" 5
Film "rgb" "integer xresolution" 256 "integer yresolution" 256
WorldBegin
LightSource "infinite" "string filename" "sky.exr"
Material $2
Shape "trianglemesh" "point3 P" [ -.5 -.5 -.5 .5 -.5 -.5 .5 .5 -.5 -.5 .5 -.5 -.5 -.5 .5 .5 -.5 .5 .5 .5 .5 -.5 .5 .5 ]
  "integer indices" [ 0 2 1 0 3 2 4 5 6 4 6 7 0 1 5 0 5 4 1 2 6 1 6 5 2 3 7 2 7 6 3 0 4 3 4 7 ]
PBRT
}
scene diffuse '"diffuse"'
scene medium '"coateddiffuse" "float roughness" 0.2 "rgb albedo" [ 0.5 0.5 0.5 ]'
scene coatedconductor '"coatedconductor"'
scene conductor '"conductor" "float roughness" 0.2'
scene dielectric '"dielectric" "float roughness" 0.3'

for name in diffuse medium coatedconductor conductor dielectric; do
  for turn in 1 2 3 4 5; do
    "$old" render "$name.pbrt" -o old.exr --threads 1 --quiet --stats "old-$turn.json"
    "$new" render "$name.pbrt" -o new.exr --threads 1 --quiet --stats "new-$turn.json"
  done
  python3 - "$name" <<'PYTHON'
import json, statistics, sys
for program in "old", "new":
    runs = [json.load(open(f"{program}-{turn}.json")) for turn in range(1, 6)]
    times = sorted(run["seconds"]["render"] / run["counts"]["camera_rays"] * 1e9 for run in runs)
    shade = statistics.median(run["thread_seconds"]["shade"] / run["seconds"]["render"] for run in runs)
    print(f"{sys.argv[1]:16} {program}: {times[2]:5.0f} ns per camera sample ({times[0]:.0f} to {times[-1]:.0f}), "
          f"shade {shade:.0%}")
PYTHON
  "$new" compare new.exr --reference old.exr --metrics mse | tail -n 1
done
