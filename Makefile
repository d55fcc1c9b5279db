# make demo   the whole story on this machine        make test   all tests
# make lint   ruff, mypy                             make bench  figures, side by side
#
# Everything is installed into .venv and built in build*/; Debian packages that are missing are installed when you are root.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
BUILD := build
SANITIZED := build-sanitized
MESON := $(BIN)/meson
export PATH := $(abspath $(BIN)):$(PATH)

.PHONY: demo test lint bench build clean

demo: $(VENV)/installed
	$(BIN)/plctool demo

test: build $(SANITIZED)/build.ninja
	$(MESON) compile -C $(SANITIZED)
	$(BIN)/python tests/run_all.py --meson $(MESON) $(BUILD) $(SANITIZED)

lint: $(VENV)/dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	MYPYPATH=host $(BIN)/mypy -p plctool

bench: build
	PYTHONPATH=host:$(BUILD)/host PLCRT=$(BUILD)/firmware/port/linux/plcrt $(BIN)/python bench/run.py

build: $(BUILD)/build.ninja
	$(MESON) compile -C $(BUILD)

$(BUILD)/build.ninja: $(VENV)/dev
	$(MESON) setup $(BUILD)

$(SANITIZED)/build.ninja: $(VENV)/dev
	$(MESON) setup $(SANITIZED) -Dhost=false -Db_sanitize=address,undefined -Db_lundef=false

# What a user gets: the package with its two commands.
$(VENV)/installed: $(VENV)/bootstrapped pyproject.toml meson.build $(shell find firmware host examples -type f -not -path '*/__pycache__/*')
	$(BIN)/pip install --quiet .
	touch $@

# What a developer needs on top.
$(VENV)/dev: $(VENV)/bootstrapped pyproject.toml
	$(BIN)/python tests/install_dev.py pyproject.toml
	touch $@

$(VENV)/bootstrapped: bootstrap.sh
	PYTHON=$(PYTHON) ./bootstrap.sh $(VENV)
	touch $@

clean:
	rm -rf $(BUILD) $(SANITIZED)
