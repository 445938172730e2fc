#!/usr/bin/env bash
# Installs the Debian packages named that are missing; checks that there is a Rust toolchain, or installs one where
# Debian has it.
set -euo pipefail

as_root=()
[ "$(id -u)" -eq 0 ] || as_root=(sudo)

missing=()
for package in "$@"; do
  dpkg-query -W -f='${Status}' "$package" 2>/dev/null | grep -q 'ok installed' || missing+=("$package")
done

has_cargo() { command -v cargo >/dev/null || [ -x "$HOME/.cargo/bin/cargo" ]; }

if [ ${#missing[@]} -gt 0 ] || ! has_cargo; then
  "${as_root[@]}" apt-get update -qq
fi
if ! has_cargo; then
  if apt-cache show rustup >/dev/null 2>&1; then
    missing+=(rustup)
  else
    echo "There is no Rust toolchain, and this Debian has none that is new enough: install one from https://rustup.rs" >&2
    exit 1
  fi
fi
if [ ${#missing[@]} -gt 0 ]; then
  echo "Installing: ${missing[*]}"
  DEBIAN_FRONTEND=noninteractive "${as_root[@]}" apt-get install -y -qq --no-install-recommends "${missing[@]}"
fi
if [[ " ${missing[*]} " == *" rustup "* ]]; then
  rustup default stable
fi
