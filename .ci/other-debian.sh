#!/usr/bin/env bash
# Builds the renderer in a fresh copy of the other Debian (13 on Debian 12, 12 on Debian 13) and compares the images of its
# tests with the hashes that are committed: Embree 4.3 and Embree 3.13 give the same bits.
#
#   .ci/other-debian.sh [TEST...]    `image_hashes` unless other tests of tests/it are named
#
# Needs root (for chroot and mounts), debootstrap, a Debian mirror, some 4 GB in $TMPDIR or /tmp, and some 10 CPU minutes.
# DEBIAN_MIRROR names a mirror other than that of debootstrap, DEBIAN_SUITE another release. The Rust toolchain is this machine's, mounted read-only: that
# of Debian 13 (1.85) is too old, and with one compiler on both sides only the libraries differ. Everything is mounted in
# a mount namespace of its own, which ends with this script; then the folder is deleted.
set -euo pipefail

PACKAGES=${PACKAGES:?is set by the Makefile: run make test-debian13}

fail() { echo "other-debian.sh: $*" >&2; exit 1; }

# The other one of Debian 12 and 13.
other_suite() {
  case "$(. /etc/os-release && echo "${VERSION_CODENAME:-}")" in
    trixie) echo bookworm ;;
    *) echo trixie ;;
  esac
}

# What renders: the release, and the Embree whose headers and library are installed below the folder.
versions() {
  local embree
  embree=$(dpkg-query --admindir="$1/var/lib/dpkg" -W -f='${Version}' libembree-dev 2>/dev/null || echo none)
  echo "$(. "$1/etc/os-release" && echo "$PRETTY_NAME"), Embree $embree"
}

# Runs inside the mount namespace: installs, and tests in the chroot.
inside() {
  local root=$1 suite=$2
  shift 2
  echo "Installing $suite into $root"
  debootstrap --variant=minbase "$suite" "$root" ${DEBIAN_MIRROR:+"$DEBIAN_MIRROR"} >"$root.log" 2>&1 || { tail -n 20 "$root.log" >&2; fail "debootstrap failed"; }
  mount -t proc proc "$root/proc"
  mount --rbind /dev "$root/dev"
  # shellcheck disable=SC2086 # one word for each package
  DEBIAN_FRONTEND=noninteractive chroot "$root" apt-get install -y -qq --no-install-recommends $PACKAGES >>"$root.log" 2>&1 ||
    { tail -n 20 "$root.log" >&2; fail "apt-get install $PACKAGES failed"; }

  echo "Here:  $(versions "")"
  echo "There: $(versions "$root")"
  for folder in toolchain sources; do mkdir "$root/$folder"; done
  mount --bind "$(rustc --print sysroot)" "$root/toolchain"
  mount --bind "$PWD" "$root/sources"
  for folder in toolchain sources; do mount -o remount,bind,ro "$root/$folder"; done
  mkdir "$root/cargo"
  cargo vendor --quiet --locked "$root/vendor" >/dev/null
  cat >"$root/cargo/config.toml" <<'TOML'
[source.crates-io]
replace-with = "vendored"
[source.vendored]
directory = "/vendor"
TOML
  chroot "$root" /usr/bin/env -i HOME=/root PATH=/toolchain/bin:/usr/bin:/bin CARGO_HOME=/cargo CARGO_TARGET_DIR=/target \
    ${CARGO_BUILD_JOBS:+CARGO_BUILD_JOBS="$CARGO_BUILD_JOBS"} \
    bash -c 'cd /sources && cargo test --offline --locked --test it -- "$@"' bash "$@" | tee "$root/tests.txt"
  grep -q '^test result: ok\. [1-9]' "$root/tests.txt" || fail "no test ran"
}

cd "$(dirname "$0")/.."
if [ "${1:-}" = --inside ]; then
  shift
  inside "$@"
  exit
fi

[ "$(id -u)" -eq 0 ] || fail "must run as root, for chroot and mounts"
for tool in debootstrap unshare cargo rustc; do
  command -v "$tool" >/dev/null || fail "needs $tool"
done
[ $# -gt 0 ] || set -- image_hashes
root=$(mktemp -d)
chmod 755 "$root"
# --one-file-system: were a mount left, what it shows would stay.
trap 'rm -rf --one-file-system "$root" "$root.log"' EXIT
unshare --mount --propagation private "$0" --inside "$root" "${DEBIAN_SUITE:-$(other_suite)}" "$@"
echo "The same bits on both."
