#!/usr/bin/env bash
# Makes a Python environment with what builds and tests the module, once; prints its path. The folder CACHE keeps it.
set -euo pipefail
packages=(maturin==1.* mypy==1.* numpy pytest typing_extensions)
cache=$(realpath -m "${CACHE:-target/python}")
environment=$cache/environment

if [ "$(cat "$environment/packages" 2>/dev/null)" != "${packages[*]}" ]; then
  rm -rf "$environment"
  python3 -m venv "$environment"
  "$environment/bin/pip" install --quiet --disable-pip-version-check --only-binary=:all: "${packages[@]}" >&2
  echo "${packages[*]}" > "$environment/packages"
fi
echo "$environment"
