#!/usr/bin/env bash
# Fetches Open Image Denoise for the tests, once, as the wheel `pyoidn` carries it; prints the path of the library. The
# folder CACHE keeps it. The wheel is for Linux on x86-64; elsewhere, LUMIRIS_OIDN names a library.
set -euo pipefail
version=2.5.1.0
sha256=32ad13368f8de1ef63001942ad05b02a00cd732d1206d97f352d3a3f606d823e
cache=$(realpath -m "${CACHE:-target/open-image-denoise}")/$version
library=$cache/pyoidn/oidn/lib/libOpenImageDenoise.so.2

if [ ! -e "$library" ]; then
  rm -rf "$cache.new"
  mkdir -p "$cache.new"
  python3 -m venv "$cache.new/venv"
  "$cache.new/venv/bin/pip" download --quiet --disable-pip-version-check --no-deps --only-binary=:all: \
    --dest "$cache.new" "pyoidn==$version" >&2
  echo "$sha256  $(echo "$cache.new"/pyoidn-*.whl)" | sha256sum --check --quiet >&2
  python3 -m zipfile -e "$cache.new"/pyoidn-*.whl "$cache.new"
  rm -rf "$cache.new"/venv "$cache.new"/pyoidn-*.whl "$cache"
  mv "$cache.new" "$cache"
fi
echo "$library"
