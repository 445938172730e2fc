#!/usr/bin/env bash
# Renders the scenes below a folder, with several seeds each, and compares them with the references in its folder `references`:
#   run.sh SCENES_FOLDER OUTPUT_FOLDER [SAMPLES_PER_PIXEL [SEEDS]]
# The samples are those of all seeds together.
set -euo pipefail
scenes=$1 out=$2 spp=${3:-256} seeds=${4:-8}
here=$(dirname "$0")
render() { # name file resolution
  local kind seed
  for kind in direct path5; do
    local settings=(--integrator path --max-depth 5)
    [ "$kind" = direct ] && settings=(--integrator direct)
    for seed in $(seq "$seeds"); do
      lumiris render "$scenes/$2" --resolution "$3" --spp $((spp / seeds)) --seed "$seed" --box-filter --quiet --aov none \
        --estimator mis "${settings[@]}" -o "$out/$1-$kind.$seed.exr"
    done
  done
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
python3 "$here/regions.py" "$scenes/references" "$out"
