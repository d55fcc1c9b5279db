"""Every command and every Python example in README and docs is run, in the order in which a reader would type them.

`sh` blocks run in a folder of their own with the repository's examples in it. `plcrt` and the plant of an example go on
in the background, as they do for the reader in another terminal, and the port that plcrt prints takes the place of the
one in the text. `make` and `pip` are not run
here: they are what runs this test (see WITHOUT_RUNNING).
"""

from __future__ import annotations

import itertools
import os
import random
import re
import shlex
import shutil
import signal
import subprocess
import sys
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import pytest
from free_ports import free_port
from plctool_commands import run_plctool, run_pytest

from plctool.testing.children import ends_with_us
from plctool.testing.plcrt import find_plcrt

ROOT = Path(__file__).parents[2]
DOCUMENTS = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
BLOCK = re.compile(r"^```(sh|python|(?:iecst|toml|ini|m4) \S+)\n(.*?)^```", re.MULTILINE | re.DOTALL)
SHOWN_PORT = "/dev/pts/4"
SHOWN_MODBUS_PORT = "5020"
SHOWN_ADDRESS, SHOWN_BROADCAST = "192.168.1.5", "192.168.1.255"
BROADCAST = "127.255.255.255"

# Commands that set up what this test runs in, or run it.
WITHOUT_RUNNING = (
    "make ",
    "python3 -m venv",
    "venv/bin/",
    ". .venv/bin/activate",
    "sudo apt-get",
    "git clone",
    "cd ",
    "meson ",
    "ninja ",
    "qemu-",
)


class Reader:
    """Types what a document says, as a user would."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.runtime: subprocess.Popen[str] | None = None
        self.port = SHOWN_PORT
        self.address = f"127.{random.randint(1, 250)}.{random.randint(1, 250)}.1"  # all its ports are free
        self.env = os.environ | {"XDG_CACHE_HOME": str(folder / "cache")}
        self.plant: subprocess.Popen[bytes] | None = None
        self._copy_examples()

    def type(self, line: str) -> None:
        if line.startswith(WITHOUT_RUNNING):
            return
        line = line.replace(SHOWN_BROADCAST, BROADCAST).replace(SHOWN_ADDRESS, self.address)
        words = shlex.split(line.replace(SHOWN_PORT, self.port))
        environment = dict(word.split("=", 1) for word in itertools.takewhile(lambda word: "=" in word, words))
        words = words[len(environment) :]
        if words[0] == "python":
            self.start_plant(words[1:])
            return
        if words[0] == "plcrt":
            self.start_runtime(words[1:])
            return
        if words[:2] == ["plctool", "ui"]:
            self.open_page(words[1:])
            return
        assert words[0] == "plctool", f"this test does not know how to run: {line}"
        done = run_plctool(words[1:], self.folder, self.env | environment, timeout=180)
        assert done.returncode == 0, f"{line}\nexit {done.returncode}\n{done.stdout}{done.stderr}"

    def _copy_examples(self) -> None:
        """With a port that is free here."""
        shutil.copytree(ROOT / "examples", self.folder / "examples", ignore=shutil.ignore_patterns("__pycache__"))
        port = free_port()
        for file in (self.folder / "examples" / "tanks" / name for name in ("tanks.io.toml", "plant_server.py")):
            text = file.read_text()
            assert SHOWN_MODBUS_PORT in text
            file.write_text(text.replace(SHOWN_MODBUS_PORT, str(port)))

    def start_plant(self, command: list[str]) -> None:
        """A process that goes on until the end, and says when it has begun."""
        self.plant = subprocess.Popen(
            ends_with_us([sys.executable, *command]), cwd=self.folder, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE
        )
        assert self.plant.stdout
        assert self.plant.stdout.readline()

    def stop_plant(self) -> None:
        if self.plant:
            assert self.plant.poll() is None
            self.plant.kill()
            self.plant.communicate()

    def open_page(self, words: list[str]) -> None:
        """Opens the address that is printed, and ends the page by Ctrl-C."""
        page = subprocess.Popen(
            ends_with_us([sys.executable, "-m", "plctool", *words]), cwd=self.folder, env=self.env,
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True,
        )  # fmt: skip
        assert page.stdout
        address = page.stdout.readline().strip()
        with urllib.request.urlopen(address, timeout=60) as reply:
            assert b"<title>plctool</title>" in reply.read()
        page.send_signal(signal.SIGINT)
        page.communicate(timeout=60)
        assert page.returncode == 0

    def start_runtime(self, options: list[str]) -> None:
        self.stop_runtime()
        self.runtime = subprocess.Popen(
            ends_with_us([find_plcrt(), *options]), cwd=self.folder, stdout=subprocess.PIPE, text=True
        )
        assert self.runtime.stdout
        kind, _, place = self.runtime.stdout.readline().strip().partition(": ")
        if kind in ("serial", "can"):
            self.port = place

    def stop_runtime(self) -> None:
        if self.runtime:
            self.runtime.send_signal(signal.SIGTERM)
            assert self.runtime.wait(timeout=60) == 0
            assert self.runtime.stdout
            self.runtime.stdout.close()
            self.runtime = None

    def run_python(self, code: str) -> None:
        """A module with test functions goes to pytest, anything else to Python."""
        path = self.folder / "test_example.py"
        path.write_text(code.replace(SHOWN_PORT, self.port))
        if "def test_" in code:
            done = run_pytest(["-q", "-p", "no:cacheprovider", str(path)], self.folder, self.env, timeout=120)
        else:
            done = subprocess.run(
                [sys.executable, str(path)], cwd=self.folder, env=self.env,
                capture_output=True, text=True, timeout=120, check=False,
            )  # fmt: skip
        assert done.returncode == 0, f"{code}\n{done.stdout}{done.stderr}"


@pytest.fixture
def reader(tmp_path: Path) -> Iterator[Reader]:
    typing = Reader(tmp_path)
    yield typing
    typing.stop_runtime()
    typing.stop_plant()


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_what_the_document_says_works(document: Path, reader: Reader) -> None:
    for language, text in BLOCK.findall(document.read_text()):
        if language == "python":
            reader.run_python(text)
            continue
        if language.startswith(
            ("iecst", "toml", "ini", "m4")
        ):  # a file that the reader saves under the name that is said
            path = reader.folder / language.split()[1]
            path.parent.mkdir(exist_ok=True)
            path.write_text(text)
            continue
        for line in text.replace("\\\n", " ").splitlines():
            if line.strip():
                reader.type(line.strip())


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_links_lead_somewhere(document: Path) -> None:
    for link in re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", document.read_text()):
        assert (document.parent / link).exists(), link
