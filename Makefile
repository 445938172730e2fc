# `make run` sets up a fresh Debian machine and renders an image; `make test` sets it up and runs all tests.

CARGO ?= $(shell command -v cargo || echo $(HOME)/.cargo/bin/cargo)
PACKAGES = build-essential pkg-config libembree-dev libopenimageio-dev
# Additional packages of the tests: a browser for the program's pages, and shells for its completions.
TEST_PACKAGES = chromium fish zsh
FARM_PACKAGES = slurm-wlm munge
SCENE = scenes/demo/gallery.pbrt
# All crates with the features of all of them: any other choice compiles dependencies, and so everything, once more. The tests
# of a part are chosen by their names.
WORKSPACE = --workspace --features lumiris-python/module

# Where `make install` puts things: below PREFIX, which a package may have below DESTDIR.
PREFIX ?= /usr/local
BINARY = target/release/lumiris
SHARE = $(DESTDIR)$(PREFIX)/share

.PHONY: run build install uninstall build-tests test test-scalar test-farm test-denoise test-python test-wheel test-power measure-power test-debian13 setup lint doc bindings clean

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

# All tests and the Python module, without running them: at once, crates wait for each other less than step by step.
build-tests: setup
	$(CARGO) build $(WORKSPACE) --lib --bins --tests

test: setup test-scalar
	@.ci/setup.sh $(TEST_PACKAGES)
	$(CARGO) test $(WORKSPACE) --doc
	$(CARGO) test $(WORKSPACE) --no-fail-fast --lib --bins --tests

# The kernels of all instruction sets against those without vectors, as a part of `make test`. Without optimisation, every
# intermediate number of a kernel has a place of its own on the stack: megabytes of them.
test-scalar: setup
	RUST_MIN_STACK=67108864 $(CARGO) test --profile scalar --package lumiris-lanes --features scalar

# Renders on a Slurm cluster of two nodes that this machine plays: picture, requeued tasks, a node that goes down.
test-farm: setup
	@.ci/setup.sh $(FARM_PACKAGES)
	$(CARGO) test $(WORKSPACE) --test it -- --include-ignored --test-threads 1 farm::

# What needs Open Image Denoise: that of LUMIRIS_OIDN, or else one that is fetched once. Skipped where there is none to fetch.
test-denoise: setup
	@[ -n "$$LUMIRIS_OIDN" ] || .ci/setup.sh python3-venv
	@library=$${LUMIRIS_OIDN:-$$(.ci/open-image-denoise.sh)} || library=; \
	if [ -z "$$library" ]; then echo "Open Image Denoise could not be fetched: what needs it is not tested."; exit 0; fi; \
	export LUMIRIS_OIDN="$$library" && \
	  $(CARGO) test $(WORKSPACE) --lib -- --include-ignored imaging::oidn:: && \
	  $(CARGO) test $(WORKSPACE) --test it -- --include-ignored denoise::

# The Python module, as it is built with the tests: no wheel, for which everything is compiled once more. Skipped where what its
# tests take cannot be fetched.
test-python: build-tests
	@.ci/setup.sh python3-venv
	@environment=$$(.ci/python-environment.sh) || environment=; \
	if [ -z "$$environment" ]; then echo "NumPy and pytest could not be fetched: the Python module is not tested."; exit 0; fi; \
	site=$$PWD/target/python/site && rm -rf "$$site" && mkdir -p "$$site" && \
	  cp -r python/lumiris "$$site" && cp target/debug/lib_lumiris.so "$$site/lumiris/_lumiris.abi3.so" && \
	  { [ -n "$$LUMIRIS_OIDN" ] || LUMIRIS_OIDN=$$(.ci/open-image-denoise.sh) || LUMIRIS_OIDN=; } && export LUMIRIS_OIDN && \
	  cd python && export LUMIRIS=../target/debug/lumiris PYTHONPATH="$$site" MYPYPATH="$$site" && \
	  "$$environment/bin/pytest" -q && "$$environment/bin/python" -m mypy "$$site/lumiris" tests

# The wheel, built and installed in an environment of its own, and imported.
test-wheel: setup
	@.ci/setup.sh python3-venv
	environment=$$(.ci/python-environment.sh) && rm -rf target/python/wheels && \
	  PATH="$(dir $(CARGO)):$$PATH" "$$environment/bin/maturin" build --quiet --locked --manifest-path python/Cargo.toml \
	    --out target/python/wheels && \
	  "$$environment/bin/pip" install --quiet --disable-pip-version-check --force-reinstall --no-deps target/python/wheels/*.whl && \
	  cd target && "$$environment/bin/python" -c 'import lumiris; print(lumiris.__version__)'

# Statistical tests at full power (docs/measurements/power): analytic scenes to a bias of 0.5 to 2 %, features to 0.5 % of the image
# and 3 % of its blocks. `make test` does the same with fewer samples.
test-power: setup
	TEST_POWER=1 $(CARGO) test $(WORKSPACE) --lib --test it -- --include-ignored --nocapture --skip farm:: --skip denoise:: --skip oidn::

# The same; determines the number of samples of each row anew, and writes docs/measurements/power/rows.csv, which both
# targets use.
measure-power: setup
	MEASURE_POWER=1 TEST_POWER=1 $(CARGO) test $(WORKSPACE) --test it -- --nocapture every_row_gives_the_known_answer

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
	$(CARGO) clippy $(WORKSPACE) --all-targets -- -D warnings

doc: setup
	RUSTDOCFLAGS="-D warnings -A rustdoc::private-intra-doc-links" $(CARGO) doc $(WORKSPACE) --no-deps --document-private-items

# Checks that the committed Embree bindings are what bindgen makes of the installed headers, and that headers which none
# of them fits are reported.
bindings: setup
	@.ci/setup.sh libclang-dev
	$(CARGO) test --package embree4-sys --features generate-bindings

clean:
	$(CARGO) clean
