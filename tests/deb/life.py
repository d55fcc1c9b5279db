"""Debian packages on a Debian with systemd: `tests/deb/life.py FOLDER ARCHITECTURE PACKAGE...`
(make deb-test-system).

The packages are installed in a virtual machine (machine.py); a controller starts, takes a program, and lives through an
upgrade, a downgrade, power cuts, full disks, a removal and a purge. FOLDER keeps the disk of each architecture.
Exit status 77: it cannot be done here, for the reason that is printed.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from machine import ARCHITECTURES, CannotBeDoneError, Machine
from tried import CAPABILITIES, PROGRAM, SKIPPED, say

PATIENCE = 240.0  # for what an emulated machine beside others does late [s]
UNIT = "/lib/systemd/system/plcrt@.service"
FILES = (
    "/usr/share/man/man1/plcrt.1.gz", "/usr/lib/sysusers.d/plcrt.conf", "/usr/share/doc/plcrt/examples/main.conf",
)  # fmt: skip
TOOL_FILES = (
    "/usr/share/man/man1/plctool.1.gz", "/usr/share/bash-completion/completions/plctool",
    "/usr/share/zsh/vendor-completions/_plctool", "/usr/share/fish/vendor_completions.d/plctool.fish",
)  # fmt: skip
FULL = "No space left on device"


def eventually(question: Callable[[], Any]) -> Any:
    end = time.monotonic() + PATIENCE
    while not (answer := question()):
        if time.monotonic() > end:
            sys.exit("what has to happen did not happen in time")
        time.sleep(0.2)
    return answer


def check(is_right: bool, complaint: str) -> None:
    if not is_right:
        sys.exit(complaint)


class Controller:
    """An instance of the unit, and what this machine's plctool and journalctl in the machine say of it."""

    def __init__(self, machine: Machine, name: str, folder: Path, symbols: str) -> None:
        self.machine, self.name, self.folder, self.symbols = machine, name, folder, symbols
        self.unit = f"plcrt@{name}"
        self.link = ("--tcp", f"127.0.0.1:{machine.ports[name]}")

    def plctool(self, *words: str) -> Any:
        environment = os.environ | {
            "PLCTOOL_PATIENCE": "20", "PLCTOOL_GATEWAY": "off", "XDG_CACHE_HOME": str(self.folder / "cache"),
        }  # fmt: skip
        command = [sys.executable, "-m", "plctool", *words, *self.link, "--json"]
        done = subprocess.run(
            command, cwd=self.folder, env=environment, capture_output=True, text=True, check=False, timeout=PATIENCE
        )
        check(done.returncode == 0, f"{' '.join(command[2:])}: exit {done.returncode}\n{done.stdout}{done.stderr}")
        return json.loads(done.stdout)

    def value(self, name: str) -> int:
        return int(self.plctool("read", "--symbols", self.symbols, name)["values"][name])

    def flash(self, image: str) -> None:
        self.symbols = image.replace(".cdl", ".sym")
        self.plctool("flash", image)

    def systemctl(self, verb: str) -> None:
        self.machine.run("systemctl", verb, self.unit)

    def property(self, name: str) -> str:
        return self.machine.run("systemctl", "show", "--value", "-p", name, self.unit).stdout.strip()

    def journal(self) -> str:
        return self.machine.run("journalctl", "-q", "-o", "cat", "-u", self.unit).stdout

    def check_runs(self, total: int) -> None:
        """The program runs, with at least this value of its retain variable."""
        eventually(lambda: self.property("ActiveState") == "active")
        check(self.plctool("status")["state"] == "run", f"{self.unit}: the program does not run\n{self.journal()}")
        check(self.value("Main.total") >= total, f"{self.unit}: the retain variables were lost")

    def saved(self) -> int:
        """A value of the retain variable that a power cut may not lose: it is saved once a second."""
        before = self.value("Main.total")
        start = time.monotonic()
        eventually(lambda: self.value("Main.total") > before + 400 and time.monotonic() > start + 4)
        return before


# ---- what is tried, in this order ----


def install(main: Controller, tool: bool) -> None:
    machine = main.machine
    if tool:
        apt(machine, "plctool")
    said = apt(machine, "plcrt")
    check("still runs" not in said, "a first installation speaks of controllers that run")
    for path in FILES + (TOOL_FILES if tool else ()):
        check(exists(machine, path), f"{path} is missing")
    check("dialout" in machine.run("id", "-nG", "plcrt").stdout.split(), "user plcrt may not open serial ports")
    unit = "/tmp/plcrt@main.service"
    machine.run("cp", UNIT, unit)
    done = machine.run("systemd-analyze", "verify", "--man=no", unit, check=False)
    complaints = [line for line in (done.stdout + done.stderr).splitlines() if "plcrt" in line]
    check(not complaints, "systemd-analyze verify: " + "\n".join(complaints))
    said = machine.run("systemd-analyze", "security", "--offline=true", unit, check=False).stdout
    level = re.search(r"exposure level for \S+: ([\d.]+)", said)
    print(f"   systemd: exposure level {level[1] if level else 'not known'} of 10")
    for name, port in (("main", 11740), ("small", 11741)):
        put(machine, f"/etc/plcrt/{name}.conf", f"PLCRT_OPTIONS=--tcp 0.0.0.0:{port} --name {name}\n")


def start_and_flash(main: Controller) -> None:
    machine = main.machine
    machine.run("systemctl", "enable", "--now", "--quiet", main.unit)
    check_rights(main)
    main.flash("first.cdl")
    eventually(lambda: 'state="run"} 1' in machine.run("cat", "/run/plcrt/main.prom", check=False).stdout)
    main.check_runs(main.saved())
    entries, journal = main.plctool("log")["entries"], main.journal()
    for entry in entries:
        check(entry["text"] in journal, f"the journal does not have the entry of the log: {entry['text']}")


def check_rights(main: Controller) -> None:
    """The controller is not root, and has the capabilities of its unit and no others."""
    machine, wanted = main.machine, sum(1 << bit for bit in CAPABILITIES.values())
    user = machine.run("id", "-u", "plcrt").stdout.strip()
    status = machine.run("cat", f"/proc/{main.property('MainPID')}/status").stdout
    check(bool(re.search(rf"^Uid:\t{user}\t{user}\t", status, re.MULTILINE)), "the controller runs as another user")
    check(bool(re.search(rf"^CapEff:\t{wanted:016x}$", status, re.MULTILINE)),
          "the controller has other capabilities than its unit says")  # fmt: skip


def use_the_packaged_tool(main: Controller) -> None:
    """The package of the tool, in the machine itself."""
    machine = main.machine
    machine.run("plctool", "build", "/packages/main.st", "-o", "/tmp/own.cdl")
    machine.run("plctool", "flash", "--tcp", "127.0.0.1", "/tmp/own.cdl")
    status = json.loads(machine.run("plctool", "status", "--tcp", "127.0.0.1", "--json").stdout)
    check(status["state"] == "run", "the program of the packaged plctool does not run")
    main.flash("first.cdl")


def hang(main: Controller) -> None:
    """The watchdog of systemd starts a controller again whose main loop hangs."""
    before, total = main.property("MainPID"), main.saved()
    processes = f"/sys/fs/cgroup{main.property('ControlGroup')}/cgroup.procs"
    worker = max(map(int, main.machine.run("cat", processes).stdout.split()))
    main.machine.run("sh", "-c", f"kill -STOP {worker}")
    eventually(lambda: main.property("NRestarts") == "1" and main.property("MainPID") not in (before, "0"))
    main.check_runs(total)


def upgrade(main: Controller) -> None:
    said = change_version(main, "plcrt-newer")
    check(f"systemctl restart {main.unit}" in said, f"the upgrade does not say that the controller runs on:\n{said}")


def change_version(main: Controller, package: str, *options: str) -> str:
    """Another version is installed, the program runs on, and starts again with that version."""
    process, before = main.property("MainPID"), main.value("Main.n")
    said = apt(main.machine, package, *options)
    check(main.property("MainPID") == process, "the change of the version has restarted the controller")
    check(main.value("Main.n") > before, "the change of the version has stopped the program")
    total = main.saved()
    main.systemctl("restart")
    main.check_runs(total)
    return said


def upgrade_on_a_full_disk(main: Controller) -> None:
    """The upgrade says that the disk is full, and can be repeated; the controller runs on, with its old version."""
    machine, process = main.machine, main.property("MainPID")
    fill(machine, "/filler")
    before = main.value("Main.n")
    done = machine.run(*apt_command("plcrt-newer"), check=False)
    said = done.stdout + done.stderr
    check(done.returncode != 0 and FULL in said, f"an upgrade on a full disk does not say why it fails:\n{said}")
    check(main.property("MainPID") == process, "an upgrade that failed has restarted the controller")
    check(main.value("Main.n") > before, "an upgrade that failed has stopped the program")
    total = main.saved()
    main.systemctl("restart")
    main.check_runs(total)
    machine.run("rm", "/filler")


def cut_power(*controllers: Controller) -> None:
    """The programs run again after the machine has lost its power."""
    totals = [controller.saved() for controller in controllers]
    machine = controllers[0].machine
    machine.run("journalctl", "--sync")  # journald itself writes some minutes later
    machine.cut_power()
    machine.power_on()
    for controller, total in zip(controllers, totals, strict=True):
        controller.check_runs(total)
        check(controller.journal().count("plcrt started") > 1, "the journal has lost the entries of earlier starts")


def full_disk_at_the_start(small: Controller) -> None:
    """A controller that finds a full disk says so, and starts by itself when there is room."""
    machine = small.machine
    fill(machine, "/var/lib/plcrt/small/filler")
    machine.run("systemctl", "enable", "--now", "--quiet", small.unit, check=False)
    eventually(lambda: FULL in small.journal())
    machine.run("rm", "/var/lib/plcrt/small/filler")
    eventually(lambda: small.property("ActiveState") == "active")


def full_disk(small: Controller) -> None:
    """A controller whose disk is full takes programs, and has them after a restart."""
    fill(small.machine, "/var/lib/plcrt/small/filler")
    small.flash("first.cdl")
    total = small.saved()
    small.flash("second.cdl")
    small.check_runs(total)
    total = small.saved()
    small.systemctl("restart")
    small.check_runs(total)


def remove(main: Controller, small: Controller) -> None:
    """A removal stops programs that run, and keeps them and the options."""
    machine, total = main.machine, main.saved()
    said = machine.run("apt-get", "remove", "-y", "-qq", "plcrt").stdout
    check(f"Stopping {main.unit}" in said and f"Stopping {small.unit}" in said, f"the removal stops silently:\n{said}")
    check(not exists(machine, "/usr/bin/plcrt"), "the removal leaves the program")
    check(main.property("ActiveState") != "active", "the removal leaves a controller running")
    apt(machine, "plcrt")
    main.systemctl("start")
    main.check_runs(total)
    small.systemctl("start")
    small.check_runs(0)
    small.systemctl("stop")


def purge(main: Controller, tool: bool) -> None:
    """A purge while a program runs leaves nothing, and says what it deletes."""
    machine = main.machine
    machine.run("umount", "/var/lib/plcrt/small")
    said = machine.run("apt-get", "purge", "-y", "-qq", "plcrt", *(["plctool"] if tool else [])).stdout
    check("Deleting the program and the retain variables in /var/lib/plcrt/main" in said, f"purge is silent:\n{said}")
    gone = ("/var/lib/plcrt", "/etc/plcrt", "/usr/lib/plctool", "/run/plcrt", UNIT,
            "/etc/systemd/system/multi-user.target.wants/plcrt@main.service")  # fmt: skip
    left = [path for path in gone if exists(machine, path)]
    check(not left, f"purge leaves {', '.join(left)}")


# ---- with these ----


def apt_command(package: str, *options: str) -> list[str]:
    return ["apt-get", "install", "-y", "-qq", "--no-install-recommends", *options,
            f"/packages/{package}.deb"]  # fmt: skip


def apt(machine: Machine, package: str, *options: str) -> str:
    return machine.run(*apt_command(package, *options)).stdout


def exists(machine: Machine, path: str) -> bool:
    return machine.run("test", "-e", path, check=False).returncode == 0


def put(machine: Machine, path: str, text: str) -> None:
    machine.run("sh", "-c", 'printf %s "$2" >"$1"', "sh", path, text)


def fill(machine: Machine, file: str) -> None:
    """Takes all room that the file system has: most at once, and the last blocks one by one."""
    script = f"""fallocate -l $(($(stat -f -c "%a * %S" "$(dirname "$1")") * 9 / 10)) "$1"
                 dd if=/dev/zero bs=4096 oflag=append conv=notrunc of="$1" 2>&1 | grep -q "{FULL}\""""
    machine.run("sh", "-c", script, "sh", file)


def life(machine: Machine, folder: Path, tool: bool) -> None:
    """The life of an installation."""
    main, small = (Controller(machine, name, folder, "first.sym") for name in ("main", "small"))
    steps: list[tuple[str, Callable[[], None]]] = [
        ("install", lambda: install(main, tool)),
        ("start and flash; the journal has what the log has", lambda: start_and_flash(main)),
        ("a controller that hangs is started again", lambda: hang(main)),
        ("power cut: the program runs again", lambda: cut_power(main)),
        ("upgrade on a full disk: refused, the program runs on", lambda: upgrade_on_a_full_disk(main)),
        ("upgrade: the program runs on", lambda: upgrade(main)),
        ("downgrade: the program runs on", lambda: change_version(main, "plcrt", "--allow-downgrades") and None),
        ("full disk at the start: said, and tried again", lambda: full_disk_at_the_start(small)),
        ("full disk: programs are taken and kept", lambda: full_disk(small)),
        ("power cut on a full disk: the programs run again", lambda: cut_power(main, small)),
        ("remove: programs and options stay", lambda: remove(main, small)),
        ("purge: nothing stays", lambda: purge(main, tool)),
    ]  # fmt: skip
    if tool:
        steps.insert(2, ("plctool of the package builds and flashes", lambda: use_the_packaged_tool(main)))
    for name, step in steps:
        start = time.monotonic()
        say(name)
        step()
        print(f"   {time.monotonic() - start:.0f} s")


def make_newer(package: Path, made: Path) -> None:
    """Makes the same package with another version."""
    with tempfile.TemporaryDirectory() as content:
        subprocess.run(["dpkg-deb", "-R", str(package), content], check=True)
        control = Path(content) / "DEBIAN/control"
        control.write_text(re.sub(r"^Version: .*$", "Version: 99.0", control.read_text(), flags=re.MULTILINE))
        subprocess.run(["dpkg-deb", "-Zgzip", "-b", content, str(made)], check=True, stdout=subprocess.DEVNULL)


def build_programs(folder: Path, target: str) -> None:
    (folder / "main.st").write_text(PROGRAM)
    (folder / "second.st").write_text(PROGRAM.replace("n := n + 1", "n := n + 2"))
    for source, image in (("main.st", "first.cdl"), ("second.st", "second.cdl")):
        command = [sys.executable, "-m", "plctool", "build", source, "--target", target, "-o", image]
        subprocess.run(command, cwd=folder, check=True, stdout=subprocess.DEVNULL)


@contextmanager
def powered(machine: Machine) -> Iterator[Machine]:
    try:
        machine.power_on()
        yield machine
    finally:
        machine.cut_power()


def main() -> None:
    folder, name, packages = Path(sys.argv[1]).resolve(), sys.argv[2], [Path(word).resolve() for word in sys.argv[3:]]
    with tempfile.TemporaryDirectory(prefix="deb-") as temporary:
        work = Path(temporary)
        given = work / "given"
        given.mkdir()
        for package in packages:
            shutil.copy(package, given / f"{package.name.partition('_')[0]}.deb")
        make_newer(given / "plcrt.deb", given / "plcrt-newer.deb")
        build_programs(work, ARCHITECTURES[name].target)
        shutil.copy(work / "main.st", given)
        try:
            machine = Machine(name, folder / name, work, given)
        except CannotBeDoneError as reason:
            print(f"The packages for {name} were not tried: {reason}")
            sys.exit(SKIPPED)
        with powered(machine):
            life(machine, work, (given / "plctool.deb").exists())
    say(f"{name}: all of it works")


if __name__ == "__main__":
    main()
