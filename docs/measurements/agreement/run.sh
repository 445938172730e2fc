#!/usr/bin/env bash
# Renders the scenes below a folder and compares them with the references in its folder `references`:
#   run.sh SCENES_FOLDER OUTPUT_FOLDER [SAMPLES_PER_PIXEL]
set -euo pipefail
scenes=$1 out=$2 spp=${3:-256}
here=$(dirname "$0")
pairs=()
render() { # name file resolution
  local common=("$scenes/$2" --resolution "$3" --spp "$spp" --box-filter --quiet)
  lumiris render "${common[@]}" --integrator direct -o "$out/$1-direct.exr"
  lumiris render "${common[@]}" --integrator path --max-depth 5 -o "$out/$1-path5.exr"
  pairs+=("$out/$1-direct.exr" "$scenes/references/$1-direct.exr" "$out/$1-path5.exr" "$scenes/references/$1-path5.exr")
}
mkdir -p "$out"
render cornell-box cornell-box/scene-v4.pbrt 256x256
render veach-mis veach-mis/scene-v4.pbrt 320x180
render kitchen kitchen/scene-v4.pbrt 320x180
render staircase2 staircase2/scene-v4.pbrt 256x256
render material-testball material-testball/material-testball.pbrt 320x180
render chess-set chess-set/ChessSet.pbrt 256x256
render armadillo-env armadillo-env/scene-v4.pbrt 256x256
render buddha-fractal buddha-fractal/buddha-fractal-v4.pbrt 150x240
render killeroo-simple killeroos/killeroo-simple.pbrt 256x256
python3 "$here/regions.py" "${pairs[@]}"
