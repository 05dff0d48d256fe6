# Every target first sets up what it needs (scripts/setup) and uses the release profile, so dependencies compile once.
# With CARGO_INCREMENTAL=1 in the environment small changes compile sooner, and what comes out is slower.
# Mesa's layer that asks the desktop for its favourite card complains on machines without a desktop; gnomon chooses itself.
export NODEVICE_SELECT = 1

.PHONY: demo install uninstall test test-deep test-camera soak fuzz charts reference bench bench-volumes bench-tracking setup setup-tests setup-deep

# (Its files are its own: those of an earlier version bear no mark by which they would be known.)
demo: setup
	cargo build --release
	target/release/gnomon replay config/lamp.toml --out out/lamp.mp4 --sheet out/lamp.png --poses out/lamp_poses.csv --stats out/lamp_stats.json --force
	@echo
	@echo "A virtual torus on a real table:"
	@echo "  out/lamp.mp4         the video"
	@echo "  out/lamp.png         some of its frames on one sheet"
	@echo "  out/lamp_poses.csv   where the camera was"
	@echo "  out/lamp_stats.json  how long each stage took"

# The program, completions for shells, and its manual. `sudo make install` takes the program that was built before, as the
# user's Rust is not root's. DESTDIR is for those who make packages.
PREFIX = /usr/local
BIN = $(DESTDIR)$(PREFIX)/bin
SHARE = $(DESTDIR)$(PREFIX)/share
BASH_COMPLETION = $(SHARE)/bash-completion/completions/gnomon
FISH_COMPLETION = $(SHARE)/fish/vendor_completions.d/gnomon.fish
ZSH_COMPLETION = $(SHARE)/zsh/site-functions/_gnomon
MAN = $(SHARE)/man/man1
PROGRAM = target/release/gnomon

install:
	@[ -x $(PROGRAM) ] && [ "$$(id -u)" = 0 ] || { scripts/setup && cargo build --release; }
	install -d $(BIN) $(MAN) $(dir $(BASH_COMPLETION) $(FISH_COMPLETION) $(ZSH_COMPLETION))
	install -m 755 $(PROGRAM) $(BIN)/gnomon
	$(PROGRAM) completions bash > $(BASH_COMPLETION)
	$(PROGRAM) completions fish > $(FISH_COMPLETION)
	$(PROGRAM) completions zsh > $(ZSH_COMPLETION)
	$(PROGRAM) manual > $(MAN)/gnomon.1
	for command in $$($(PROGRAM) --help | sed -n '/^Commands:/,/^Options:/s/^  \([a-z]\{1,\}\) .*/\1/p' | grep -v help); do \
	    $(PROGRAM) manual $$command > $(MAN)/gnomon-$$command.1 || exit; done
	@command -v gnomon >/dev/null || echo "gnomon is in $(PREFIX)/bin, which is not on your PATH"

uninstall:
	rm -f $(BIN)/gnomon $(BASH_COMPLETION) $(FISH_COMPLETION) $(ZSH_COMPLETION) $(MAN)/gnomon.1 $(MAN)/gnomon-*.1

test: setup-tests
	cargo fmt --check
	cargo clippy --release --all-targets -- -D warnings
	RUSTDOCFLAGS="-D warnings" cargo doc --release --no-deps
	cargo test --release --no-fail-fast

# All that is drawn under Vulkan's validation layer, and the C shim under Valgrind (an hour; not in CI).
test-deep: setup-deep
	tools/test_deep.sh

# On a real camera device in a small emulated machine (minutes; as root; not in CI), where ../shared/virtual-camera is.
test-camera: setup
	cargo build --release
	tools/test_camera.sh

# An hour's worth of frames through the live pipeline, as fast as they go; fails where memory grows.
soak: setup
	cargo test --release --test program soak -- --ignored --nocapture

# Speed against accuracy on this machine: charts/.
charts: setup
	cargo build --release
	target/release/gnomon chart

# All readers, for an hour: what crashes, hangs or fills memory is kept in fuzz/artifacts. Any Rust that builds gnomon will do.
fuzz: setup
	tools/fuzz.sh 60

# What a camera would have seen of a scene of your own, path-traced: make reference SCENE=config/lamp.toml ARGS="--frames 30".
# Nothing else needs it. tools/reference/README.md tells more.
SCENE = config/lamp.toml
reference:
	tools/reference/setup
	tools/reference/venv/bin/python tools/reference/render_session.py $(SCENE) --out out/reference/$(basename $(notdir $(SCENE))) $(ARGS)

# What a frame with shadow volumes costs, and whether silhouettes belong on the CPU: figures in out/.
bench: setup
	mkdir -p out
	cargo bench --bench volumes -- --csv $(CURDIR)/out/volumes.csv
	cargo bench --bench extrusion -- --csv $(CURDIR)/out/extrusion.csv

# Beside what a user would run instead, where ../shared/peers has it.
bench-volumes: setup
	tools/bench_volumes.sh

bench-tracking: setup
	tools/bench_tracking.sh

setup:
	@scripts/setup

setup-tests:
	@scripts/setup tests

setup-deep:
	@scripts/setup deep
