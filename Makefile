# `make run` sets up a fresh Debian machine and renders a picture; `make test` sets it up and runs every test.

CARGO ?= $(shell command -v cargo || echo $(HOME)/.cargo/bin/cargo)
PACKAGES = build-essential pkg-config libembree-dev libopenimageio-dev
# What the tests need besides: a browser for the pages that `compare` writes.
TEST_PACKAGES = chromium
SCENE = scenes/demo/gallery.pbrt

.PHONY: run test test-power measure-power test-debian13 setup lint doc bindings clean

run: setup
	$(CARGO) build --release
	target/release/lumiris render $(SCENE) -o gallery.png -o gallery.exr
	@echo "The picture is in gallery.png and gallery.exr."

test: setup
	@.ci/setup.sh $(TEST_PACKAGES)
	$(CARGO) test --workspace --doc
	$(CARGO) test --workspace --lib --bins --tests

# Scenes with known answers at full power: as many samples as find a bias of 2 % (of 0.5 % in quiet scenes), the injection of
# that bias, and the table of what each row finds. `make test` does the same with a sixth of the samples or less.
test-power: setup
	$(CARGO) test -p lumiris --test it -- --ignored --nocapture known_answer_at_full_power

# The same; counts the samples of each row anew, and writes docs/measurements/power/rows.csv, by which both tests go.
measure-power: setup
	MEASURE_POWER=1 $(CARGO) test -p lumiris --test it -- --ignored --nocapture known_answer_at_full_power

# Builds in a fresh Debian 13 (on Debian 13: a fresh Debian 12) and compares images with the committed hashes; needs root.
test-debian13: setup
	@.ci/setup.sh debootstrap
	@PACKAGES="$(PACKAGES)" .ci/other-debian.sh

# Installs what is missing; does nothing, and needs no rights, where everything is there.
setup:
	@.ci/setup.sh $(PACKAGES)

lint: setup
	$(CARGO) fmt --all --check
	$(CARGO) clippy --workspace --all-targets -- -D warnings

doc: setup
	RUSTDOCFLAGS="-D warnings -A rustdoc::private-intra-doc-links" $(CARGO) doc --workspace --no-deps --document-private-items

# The committed Embree bindings are what bindgen makes of the installed headers, and headers that none fits are told.
bindings: setup
	@.ci/setup.sh libclang-dev
	$(CARGO) test --package embree4-sys --features generate-bindings

clean:
	$(CARGO) clean
