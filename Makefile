# `make run` sets up a fresh Debian machine and renders an image; `make test` sets it up and runs all tests.

CARGO ?= $(shell command -v cargo || echo $(HOME)/.cargo/bin/cargo)
PACKAGES = build-essential pkg-config libembree-dev libopenimageio-dev
# Additional packages of the tests: a browser for the program's pages, and shells for its completions.
TEST_PACKAGES = chromium fish zsh
FARM_PACKAGES = slurm-wlm munge
SCENE = scenes/demo/gallery.pbrt

# Where `make install` puts things: below PREFIX, which a package may have below DESTDIR.
PREFIX ?= /usr/local
BINARY = target/release/lumiris
SHARE = $(DESTDIR)$(PREFIX)/share

.PHONY: run build install uninstall build-tests test test-scalar test-farm test-denoise test-python test-power measure-power test-debian13 setup lint doc bindings clean

run: setup
	$(CARGO) build --release
	$(BINARY) render $(SCENE) --spp 12 -o gallery.png -o gallery.exr
	@echo "The image is in gallery.png and gallery.exr."

build: setup
	$(CARGO) build --release

# The program, its completions and its manual pages: `make install PREFIX=$HOME/.local`.
install: build
	install -D -m 755 $(BINARY) $(DESTDIR)$(PREFIX)/bin/lumiris
	install -d $(SHARE)/bash-completion/completions $(SHARE)/zsh/site-functions $(SHARE)/fish/vendor_completions.d
	$(BINARY) completions bash > $(SHARE)/bash-completion/completions/lumiris
	$(BINARY) completions zsh > $(SHARE)/zsh/site-functions/_lumiris
	$(BINARY) completions fish > $(SHARE)/fish/vendor_completions.d/lumiris.fish
	$(BINARY) man --output $(SHARE)/man/man1

uninstall:
	rm -f $(DESTDIR)$(PREFIX)/bin/lumiris $(SHARE)/bash-completion/completions/lumiris \
	  $(SHARE)/zsh/site-functions/_lumiris $(SHARE)/fish/vendor_completions.d/lumiris.fish \
	  $(SHARE)/man/man1/lumiris.1 $(SHARE)/man/man1/lumiris-*.1

# All tests, without running them: at once, crates wait for each other less than step by step.
build-tests: setup
	$(CARGO) test --workspace --no-run --lib --bins --tests

test: setup test-scalar
	@.ci/setup.sh $(TEST_PACKAGES)
	$(CARGO) test --workspace --doc
	$(CARGO) test --workspace --no-fail-fast --lib --bins --tests

# The kernels of all instruction sets against those without vectors, as a part of `make test`.
test-scalar: setup
	$(CARGO) test --profile scalar --package lumiris-lanes --features scalar

# The tests of a part of the workspace are chosen by name here and below: with --package, dependencies have other features,
# so that everything is compiled once more.

# Renders on a Slurm cluster of two nodes that this machine plays: picture, requeued tasks, a node that goes down.
test-farm: setup
	@.ci/setup.sh $(FARM_PACKAGES)
	$(CARGO) test --workspace --test it -- --include-ignored --test-threads 1 farm::

# What needs Open Image Denoise: that of LUMIRIS_OIDN, or else one that is fetched once. Skipped where there is none to fetch.
test-denoise: setup
	@[ -n "$$LUMIRIS_OIDN" ] || .ci/setup.sh python3-venv
	@library=$${LUMIRIS_OIDN:-$$(.ci/open-image-denoise.sh)} || library=; \
	if [ -z "$$library" ]; then echo "Open Image Denoise could not be fetched: what needs it is not tested."; exit 0; fi; \
	export LUMIRIS_OIDN="$$library" && \
	  $(CARGO) test --workspace --lib -- --include-ignored imaging::oidn:: && \
	  $(CARGO) test --workspace --test it -- --include-ignored denoise::

# The Python module: builds its wheel as tests are built, and the program, which its tests compare it with; installs it in an
# environment of its own, and tests it there. Skipped where what that takes cannot be fetched.
test-python: setup
	@.ci/setup.sh python3-venv
	@environment=$$(.ci/python-environment.sh) || environment=; \
	if [ -z "$$environment" ]; then echo "maturin, NumPy and pytest could not be fetched: the Python module is not tested."; exit 0; fi; \
	rm -rf target/python/wheels && \
	  $(CARGO) test --workspace --test it --no-run && \
	  PATH="$(dir $(CARGO)):$$PATH" "$$environment/bin/maturin" build --quiet --profile dev --locked \
	    --manifest-path python/Cargo.toml --out target/python/wheels && \
	  "$$environment/bin/pip" install --quiet --disable-pip-version-check --force-reinstall --no-deps target/python/wheels/*.whl && \
	  { [ -n "$$LUMIRIS_OIDN" ] || LUMIRIS_OIDN=$$(.ci/open-image-denoise.sh) || LUMIRIS_OIDN=; } && export LUMIRIS_OIDN && \
	  cd python && LUMIRIS=../target/debug/lumiris "$$environment/bin/pytest" -q && \
	  "$$environment/bin/python" -m mypy lumiris tests

# Analytic scenes at full power: enough samples to detect a bias of 2 % (0.5 or 1 % where there is little noise), the
# injection of that bias, and the table of what each row detects. `make test` does the same with a twelfth of the
# samples where there is noise.
test-power: setup
	$(CARGO) test -p lumiris --test it -- --ignored --nocapture known_answer_at_full_power

# The same; determines the number of samples of each row anew, and writes docs/measurements/power/rows.csv, which both
# targets use.
measure-power: setup
	MEASURE_POWER=1 $(CARGO) test -p lumiris --test it -- --ignored --nocapture known_answer_at_full_power

# Builds in a fresh Debian 13 (on Debian 13: a fresh Debian 12) and compares images with the committed hashes; needs
# root.
test-debian13: setup
	@.ci/setup.sh debootstrap
	@PACKAGES="$(PACKAGES)" .ci/other-debian.sh

# Installs missing packages; if there are none, does nothing and needs no privileges.
setup:
	@.ci/setup.sh $(PACKAGES)

lint: setup
	$(CARGO) fmt --all --check
	$(CARGO) clippy --workspace --all-targets --features lumiris-python/module -- -D warnings

doc: setup
	RUSTDOCFLAGS="-D warnings -A rustdoc::private-intra-doc-links" $(CARGO) doc --workspace --no-deps --document-private-items

# Checks that the committed Embree bindings are what bindgen makes of the installed headers, and that headers which none
# of them fits are reported.
bindings: setup
	@.ci/setup.sh libclang-dev
	$(CARGO) test --package embree4-sys --features generate-bindings

clean:
	$(CARGO) clean
