# make demo   the whole story on this machine        make test   the tests (ARGS="--jobs 1": one at a time)
# make test-whole  as make test, with all programs on all processors, and more values for each property
# make quick  the tests nearest to what changed since the last commit, in about ten seconds (ARGS="--since main", "--list")
# make lint   style, types, words                    make bench  figures, side by side (ARGS="--programs DIR": more pairs)
# make format gives C and Python their one style
# make wheel  dist/*.whl for this kind of Linux and every Python from 3.11 on, tried in those that are here
# make release  dist/ with the wheel, the sources, the firmware of all boards and their checksums
# make size   flash and RAM of the bare-metal runtime, per component; plcrt of each processor
# make linux-arm  plcrt for Linux on 64-bit and 32-bit Arm: build-aarch64-linux, build-armv7-linux
# make test-linux-arm  the C tests and tests/e2e with these, in QEMU's user mode (ARGS="-k force"); some are in `make test`
# make test-arm-system  plcrt on Debian's kernel for arm64 in a virtual machine, and a power cut
# make deb    dist/*.deb for this architecture (ARCHS="amd64 arm64"); make deb-test tries them in a small Debian
# make deb-test-system  the life of these packages on a Debian with systemd, in a virtual machine (ARCHS="arm64 armhf")
# make test-windows  the simulator for Windows: its C tests, and all programs of tests/st, by Wine
# make wheels-linux  dist/*.whl for 64-bit and 32-bit Arm and for musl; those for Arm are tried in QEMU's user mode
# make wheel-macos  dist/*macosx*.whl for Macs with Arm, which was never run
# make wheel-windows  dist/*win_amd64.whl; what cannot be tried here is said in the README
# make attack all attacks on the promise that no program is lost (ARGS="--replay ID", "--sanitized" ...)
# make soak   clients on all lines at once, 10 000 channels on each (ARGS="--channels 500 --sanitized")
# make changes 10 000 random online changes in a row, each checked (ARGS="--count 500 --seed 7")
# make edits  10 000 random edits in the language server, each compared with a fresh check (ARGS="500 7": edits, seed)
# make habits what the habits of other systems' programs are, and what plctool check says of a program with each
# make fuzz   parsers and stores under random input, FUZZ_SECONDS=60 for each (ARGS="--only tcp,lines --seed 7")
# make mutants  changes one decision of the firmware's checks at a time, and lists the changes that no C test notices
#               (ARGS="--only ModbusClient --sample 50"; how: tests/mutants/run.py --help)
# make vsix   the extension for VS Code, dist/plctool-*.vsix     make test-editors  all tests of editors/
# make tree-sitter generates the parser of editors/tree-sitter-iecst from its grammar.js
# make properties what holds for all values, tried with other ones than `make test` does (ARGS="-k call")
#
# Everything is installed into .venv and built in build*/; Debian packages that are missing are installed when you are root.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
MESON := $(BIN)/meson
export PATH := $(abspath $(BIN)):$(PATH)

# The bare-metal builds need a cross compiler and QEMU; without them their tests are left out, and `make test` says so.
CORTEX_M := $(if $(shell command -v arm-none-eabi-gcc),$(if $(shell command -v qemu-system-arm),build-cm3 build-cm4f build-cm7 build-lm3s6965 build-stm32f405))
RISC_V := $(if $(shell command -v riscv64-unknown-elf-gcc),$(if $(shell command -v qemu-system-riscv32),build-rv32imac))
BOARD_BUILDS := $(CORTEX_M) $(RISC_V)
BUILDS := build build-sanitized $(BOARD_BUILDS)

# The cross compilers are Debian's; without them these builds are left out of `make test`, which says so.
LINUX_ARM := $(if $(shell command -v aarch64-linux-gnu-gcc),build-aarch64-linux) $(if $(shell command -v arm-linux-gnueabihf-gcc),build-armv7-linux)

.PHONY: demo test test-whole test-windows wheel-windows wheel-macos wheels-linux run-wheels-elsewhere quick test-vcan test-kernel linux-arm test-linux-arm test-arm-system lint format bench size wheel release run-release deb deb-test deb-test-system attack soak changes edits fuzz mutants properties habits tree-sitter vsix test-editors all clean
.PHONY: run-test run-all run-bench run-size run-fuzz run-linux-arm run-test-linux-arm run-test-arm-system
VSCODE := editors/vscode
NODE_PACKAGES := $(if $(shell command -v npm),$(VSCODE)/node_modules/.package-lock.json)

demo: $(VENV)/installed
	$(BIN)/plctool demo

# A make of its own, so that BUILDS sees what bootstrapping has just installed.
test all bench size release linux-arm test-linux-arm test-arm-system: $(VENV)/dev
	@$(MAKE) --no-print-directory run-$@

test-whole:
	TEST_WHOLE=1 $(MAKE) --no-print-directory test

run-test: run-all
	$(BIN)/python tests/run_all.py --meson $(MESON) $(ARGS) $(LINUX_ARM:%=--processor %) $(BUILDS)
run-test: run-all $(NODE_PACKAGES)

run-all: $(BUILDS:%=%/build.ninja) $(LINUX_ARM:%=%/build.ninja)
	set -e; for build in $(BUILDS); do $(MESON) compile -C $$build; done
	set -e; for build in $(LINUX_ARM); do $(MESON) compile -C $$build plcrt processor_tests; done

run-linux-arm: $(LINUX_ARM:%=%/build.ninja)
	@[ -n "$(strip $(LINUX_ARM))" ] || { echo "No cross compiler: sudo apt-get install gcc-aarch64-linux-gnu gcc-arm-linux-gnueabihf" >&2; exit 1; }
	set -e; for build in $(LINUX_ARM); do $(MESON) compile -C $$build plcrt; done
	@size $(LINUX_ARM:%=%/firmware/port/linux/plcrt)

# A whole system: Debian's kernel for arm64 in a virtual machine; skipped with the reason where that cannot run.
run-test-arm-system: build/build.ninja build-aarch64-linux/build.ninja
	$(MESON) compile -C build
	$(MESON) compile -C build-aarch64-linux plcrt
	tests/linux_arm/system build-aarch64-linux $(abspath $(BIN)/python) $(ARGS) || [ $$? -eq 77 ]

run-test-linux-arm: build/build.ninja $(LINUX_ARM:%=%/build.ninja)
	set -e; for build in build $(LINUX_ARM); do $(MESON) compile -C $$build; done
	set -e; for build in $(LINUX_ARM); do $(MESON) test -C $$build --no-rebuild --suite c; done
	PYTHONPATH=$(abspath host):$(abspath build/host) $(BIN)/python tests/linux_arm/run.py $(LINUX_ARM) -- $(ARGS)

quick: build/build.ninja
	@ninja --quiet -C build under_attack
	@$(BIN)/python tests/quick.py $(ARGS)

# The simulator for Windows is built by Debian's compiler for it and tried by Wine.
build-windows/build.ninja: $(VENV)/dev
	./bootstrap.sh --windows
	$(MESON) setup build-windows --cross-file cross/x86_64-windows.ini

test-windows: build-windows/build.ninja build/build.ninja
	$(MESON) compile -C build-windows
	$(MESON) test -C build-windows --no-rebuild
	ninja --quiet -C build under_attack
	TEST_WHOLE=1 PYTHONPATH=host:build/host $(BIN)/python -m pytest tests/same_results -k windows $(ARGS)

# For other systems than this one, by their names in packages/make_wheel.py.
run-wheels-elsewhere: $(VENV)/dev
	$(BIN)/pip install --quiet macholib ziglang
	rm -rf dist/local
	$(BIN)/pip wheel --quiet --no-deps --wheel-dir dist/local .
	set -e; for name in $(PLATFORMS); do $(BIN)/python packages/make_wheel.py $$name dist/local/*.whl dist; done
	rm -r dist/local

wheel-windows:
	./bootstrap.sh --windows
	$(MAKE) run-wheels-elsewhere PLATFORMS=x86_64-windows

wheel-macos:
	$(MAKE) run-wheels-elsewhere PLATFORMS=arm64-macos

wheels-linux:
	./bootstrap.sh --tests
	$(MAKE) run-wheels-elsewhere PLATFORMS="aarch64-linux armv7-linux x86_64-musl aarch64-musl"
	$(BIN)/python tests/wheel_elsewhere.py dist/*_aarch64.whl dist/*_armv7l.whl dist/*musllinux*x86_64.whl || [ $$? -eq 77 ]

# CAN of a real kernel, in a small Linux of its own; skipped with the reason where that cannot run.
test-vcan: build/build.ninja
	$(MESON) compile -C build
	tests/vcan/run build $(BIN)/python || [ $$? -eq 77 ]

# Lines and analog values of a real kernel, in a virtual machine; skipped with the reason where that cannot run.
test-kernel: build/build.ninja
	$(MESON) compile -C build
	tests/kernel/run build $(abspath $(BIN)/python) || [ $$? -eq 77 ]

C_FILES = find firmware tests bench examples -name '*.[ch]' -print0

lint: $(VENV)/dev $(NODE_PACKAGES)
	$(C_FILES) | xargs -0 $(BIN)/clang-format --dry-run --Werror
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	MYPYPATH=host $(BIN)/mypy -p plctool
	$(BIN)/python tests/docs/words.py
	test ! -e $(VSCODE)/node_modules/.bin/eslint || npm run --silent --prefix $(VSCODE) lint

format: $(VENV)/dev
	$(C_FILES) | xargs -0 $(BIN)/clang-format -i
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

BENCHED := $(filter build build-cm3 build-cm4f,$(BUILDS))

run-bench: $(BENCHED:%=%/build.ninja)
	set -e; for build in $(BENCHED); do $(MESON) compile -C $$build; done
	$(MESON) compile -C build can_share canopen_share
	PYTHONPATH=host:build/host PLCRT=build/firmware/port/linux/plcrt $(BIN)/python bench/run.py $(ARGS)

run-size: build-cm3/build.ninja $(RISC_V:%=%/build.ninja) build/build.ninja $(LINUX_ARM:%=%/build.ninja)
	set -e; for build in build-cm3 $(RISC_V); do echo "$$build:"; $(MESON) compile -C $$build size; done
	set -e; for build in build $(LINUX_ARM); do $(MESON) compile -C $$build plcrt >/dev/null; done
	@size $(patsubst %,%/firmware/port/linux/plcrt,build $(LINUX_ARM))

# The tag says which C library it needs at least: that of this machine's compiler.
wheel: $(VENV)/dev
	rm -rf dist
	$(BIN)/pip wheel --quiet --no-deps --wheel-dir dist/local .
	$(BIN)/auditwheel repair --wheel-dir dist dist/local/*.whl
	rm -r dist/local
	$(BIN)/python tests/wheel.py dist/*.whl $(PYTHON) python3.11 python3.12 python3.13

run-release: build/build.ninja $(patsubst %,%/build.ninja,$(BOARD_BUILDS)) wheel
	ninja --quiet -C build
	$(BIN)/python tests/release.py $(MESON) $(BOARD_BUILDS)

# Packages of this machine's Debian; lintian looks at them.
deb: build/build.ninja
	./bootstrap.sh --packages
	$(MESON) compile -C build plcrt
	$(BIN)/python packages/make_deb.py --meson $(MESON) --plcrt build/firmware/port/linux/plcrt $(ARCHS:%=--arch %)

# Installed, upgraded and purged in a Debian that debootstrap makes; skipped with the reason where that cannot be.
deb-test: deb
	$(BIN)/python tests/deb/run.py build-deb/debian dist/*_$(shell dpkg --print-architecture).deb || [ $$? -eq 77 ]

# The same and more on a Debian with systemd, in a virtual machine of each architecture; it takes long where the processor
# is emulated, and is skipped with the reason where it cannot run.
deb-test-system: deb
	ninja --quiet -C build under_attack
	set -e; for arch in $(or $(ARCHS),$(shell dpkg --print-architecture)); do \
		PYTHONPATH=$(abspath tests):$(abspath host):$(abspath build/host) \
			$(BIN)/python tests/deb/life.py build-deb/debian $$arch dist/*_$$arch.deb || [ $$? -eq 77 ]; \
	done

ATTACKED := build$(if $(findstring --sanitized,$(ARGS)),-sanitized)

attack: $(ATTACKED)/build.ninja
	$(MESON) configure $(ATTACKED) -Dhost=true
	ninja -C $(ATTACKED) under_attack
	$(BIN)/python tests/attack/run.py $(ARGS)

soak: $(ATTACKED)/build.ninja
	$(MESON) configure $(ATTACKED) -Dhost=true
	ninja -C $(ATTACKED) under_attack
	$(BIN)/python tests/soak/run.py $(ARGS)

changes: build/build.ninja
	$(MESON) configure build -Dhost=true
	ninja -C build under_attack tests/c/test_app_change
	CHANGES=10000 TEST_ONLY=many_changes_in_a_row_go_on build/tests/c/test_app_change
	PYTHONPATH=$(CURDIR):$(CURDIR)/host:$(CURDIR)/tests:$(CURDIR)/build/host $(BIN)/python tests/many_changes.py $(ARGS)

# 10 000 random edits each: the check of bodies alone, and a running server, whose memory is limited.
edits: build/build.ninja
	ninja --quiet -C build under_attack
	PYTHONPATH=.:host:build/host:tests $(BIN)/python tests/lsp/random_edits.py $(ARGS)
	PYTHONPATH=.:host:build/host:tests $(BIN)/python tests/lsp/many_edits.py $(ARGS)

mutants: build/build.ninja
	@$(BIN)/python tests/mutants/run.py $(ARGS)

habits: build/build.ninja
	@ninja --quiet -C build under_attack
	@PYTHONPATH=host:build/host $(BIN)/python tests/corpus/habits.py

# By its own driver; and by libFuzzer, where clang has it.
LIBFUZZER = $(shell echo 'int LLVMFuzzerTestOneInput(void) { return 0; }' | \
	clang -fsanitize=fuzzer -x c - -o /dev/null 2>/dev/null && echo build-libfuzzer)
FUZZED = build build-sanitized $(LIBFUZZER)
FUZZ_SECONDS ?= 60

fuzz: $(VENV)/dev
	$(if $(LIBFUZZER),,./bootstrap.sh --fuzz)
	$(BIN)/pip install --quiet atheris || true
	$(MAKE) --no-print-directory run-fuzz

run-fuzz: $(FUZZED:%=%/build.ninja)
	set -e; ninja --quiet -C build under_attack; for build in $(FUZZED); do ninja --quiet -C $$build fuzz; done
	PYTHONPATH=host:build/host $(BIN)/python tests/fuzz/run.py --seconds $(FUZZ_SECONDS) $(ARGS) $(FUZZED)

PROPERTIES = $(sort $(shell grep -rl --include='test_*.py' 'from hypothesis' tests))

properties: build/build.ninja
	ninja --quiet -C build under_attack
	@TEST_WHOLE=1 PYTHONPATH=.:host:build/host PLCRT=$(abspath build/firmware/port/linux/plcrt) \
		$(BIN)/python -m pytest --quiet -m hypothesis --hypothesis-profile=new $(PROPERTIES) $(ARGS)

# What the tests of the extension need, where npm is. Without it, or where its registry cannot be reached, they are skipped.
$(VSCODE)/node_modules/.package-lock.json: $(VSCODE)/package-lock.json
	npm ci --prefix $(VSCODE) --ignore-scripts --no-audit --no-fund --loglevel=error || \
		echo "The tests of editors/vscode are left out: npm could not install its packages." >&2

test-editors: build/build.ninja
	./bootstrap.sh --editors
	npm ci --prefix $(VSCODE) --ignore-scripts --no-audit --no-fund --loglevel=error
	npm run --prefix $(VSCODE) lint
	ninja --quiet -C build under_attack
	$(MESON) test -C build editors --print-errorlogs

vsix:
	./bootstrap.sh --node
	npm ci --prefix $(VSCODE) --ignore-scripts --no-audit --no-fund --loglevel=error
	npm ci --prefix $(VSCODE)/vsix --ignore-scripts --no-audit --no-fund --loglevel=error
	npm run --prefix $(VSCODE)/vsix package
	mkdir -p dist
	mv $(VSCODE)/plctool-*.vsix dist/

# The parser is kept in the repository: editors need it, and the generator's npm package downloads a program from
# elsewhere, which not every machine may do.
tree-sitter:
	command -v tree-sitter >/dev/null || npm install --prefix editors/tree-sitter-iecst --no-save --no-package-lock tree-sitter-cli
	npm run --prefix editors/tree-sitter-iecst generate
	npm run --prefix editors/tree-sitter-iecst test

build/build.ninja: $(VENV)/dev
	$(MESON) setup build

# Lines are all that a report shows, and compile faster than all of what a debugger knows.
build-sanitized/build.ninja: $(VENV)/dev
	$(MESON) setup build-sanitized -Dhost=false -Doptimization=1 -Ddebug=false -Dc_args=-g1 -Db_sanitize=address,undefined -Db_lundef=false

# Another compiler may warn of what is right.
build-libfuzzer/build.ninja: $(VENV)/dev
	CC=clang $(MESON) setup build-libfuzzer -Dhost=false -Dlibfuzzer=true -Dwerror=false -Doptimization=1 -Ddebug=false -Dc_args=-g1 -Db_sanitize=address,undefined -Db_lundef=false

build-cm%/build.ninja: $(VENV)/dev
	$(MESON) setup build-cm$* --cross-file cross/cortex-m$*.ini

build-lm3s6965/build.ninja build-stm32f405/build.ninja build-rv32imac/build.ninja build-aarch64-linux/build.ninja build-armv7-linux/build.ninja: build-%/build.ninja: $(VENV)/dev
	$(MESON) setup build-$* --cross-file cross/$*.ini

# What a user gets: the package with its two commands; and the plant of the demo speaks Modbus.
$(VENV)/installed: $(VENV)/bootstrapped pyproject.toml meson.build $(shell find firmware host examples -type f -not -path '*/__pycache__/*')
	$(BIN)/pip install --quiet '.[demo]'
	touch $@

# What a developer needs on top.
$(VENV)/dev: $(VENV)/bootstrapped pyproject.toml
	./bootstrap.sh --tests
	$(BIN)/python tests/install_dev.py pyproject.toml
	touch $@

$(VENV)/bootstrapped: bootstrap.sh
	PYTHON=$(PYTHON) ./bootstrap.sh $(VENV)
	touch $@

clean:
	rm -rf build build-*
