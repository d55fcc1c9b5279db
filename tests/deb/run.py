"""Debian packages in a small Debian of their own: `tests/deb/run.py FOLDER PACKAGE...` (make deb-test).

It installs them, starts a controller, flashes it, upgrades with a program that goes on, fills the disk, downgrades,
removes and purges. FOLDER keeps the Debian that debootstrap has made. systemd does not run in it: the controller is
started by the command of its unit, with the user, the capabilities and the folders that the unit names, and systemd
checks the unit itself. Exit status 77: it cannot be done here, for the reason that is printed.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from tried import CAPABILITIES, PROGRAM, SKIPPED, say

PATIENCE = 120.0  # for what a busy machine does late [s]
UNIT = "lib/systemd/system/plcrt@.service"
LINK = ("--tcp", "127.0.0.1:11755")
SMALL_DISK = 8 << 20  # [bytes]: the flash file has 5 MiB
MOUNTS = (("proc", "proc"), ("sysfs", "sys"), ("devpts", "dev/pts"))


def skip(reason: str) -> None:
    print(f"make deb-test is left out: {reason}")
    sys.exit(SKIPPED)


class Debian:
    """A chroot."""

    def __init__(self, root: Path) -> None:
        self.root = root

    def run(self, *command: str, check: bool = True) -> subprocess.CompletedProcess[str]:
        environment = {
            "PATH": "/usr/sbin:/usr/bin:/sbin:/bin", "DEBIAN_FRONTEND": "noninteractive", "LC_ALL": "C.UTF-8",
            "HOME": "/root", "PLCTOOL_PATIENCE": "5",
        }  # fmt: skip
        done = subprocess.run(["chroot", str(self.root), *command], env=environment, capture_output=True, text=True,
                              check=False)  # fmt: skip
        if check and done.returncode != 0:
            sys.exit(f"{' '.join(command)}: exit {done.returncode}\n{done.stdout}{done.stderr}")
        return done

    def plctool(self, *words: str) -> Any:
        return json.loads(self.run("plctool", *words, "--json").stdout)

    def install(self, package: Path, *options: str) -> None:
        shutil.copy(package, self.root / "tmp" / package.name)
        self.run("apt-get", "install", "-y", "-qq", "--no-install-recommends", *options, f"/tmp/{package.name}")

    def has(self, path: str) -> bool:
        return os.path.lexists(self.root / path)


def make_base(base: Path) -> None:
    """Fetches a small Debian once."""
    if (base / "complete").exists():
        return
    release = re.search(r"^VERSION_CODENAME=(\w+)", Path("/etc/os-release").read_text(), re.MULTILINE)
    if os.geteuid() != 0 or not shutil.which("debootstrap"):
        skip("it needs root and debootstrap")
    shutil.rmtree(base, ignore_errors=True)
    done = subprocess.run(
        ["debootstrap", "--variant=minbase", "--include=python3", release[1] if release else "stable", str(base)],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    if done.returncode != 0:
        skip(f"debootstrap has failed: {done.stderr.strip() or done.stdout.strip()[-300:]}")
    (base / "complete").touch()


@contextmanager
def debian(folder: Path) -> Iterator[Debian]:
    """A fresh copy, with its file systems."""
    root = folder / "root"
    shutil.rmtree(root, ignore_errors=True)
    subprocess.run(["cp", "-a", str(folder / "base"), str(root)], check=True)
    mounted = []
    try:
        for kind, place in MOUNTS:
            if (root / place).is_symlink():  # in a container debootstrap leads it to that of this machine
                (root / place).unlink()
            (root / place).mkdir(exist_ok=True, parents=True)
            if subprocess.run(["mount", "-t", kind, kind, str(root / place)], check=False).returncode == 0:
                mounted.append(root / place)
        yield Debian(root)
    finally:
        for place in reversed(mounted):
            subprocess.run(["umount", "--lazy", str(place)], check=False)


def unit_settings(system: Debian) -> dict[str, str]:
    """The settings of the unit, of the instance "main"."""
    text = (system.root / UNIT).read_text().replace("%i", "main")
    return dict(line.split("=", 1) for line in text.splitlines() if "=" in line and not line.startswith("#"))


class Service:
    """The controller as its unit says, as far as that goes without systemd."""

    def __init__(self, system: Debian, options: str) -> None:
        self.system = system
        self.settings = unit_settings(system)
        environment = system.root / self.settings["EnvironmentFile"].removeprefix("-").removeprefix("/")
        environment.write_text(f"PLCRT_OPTIONS={options}\n")
        self.process: subprocess.Popen[str] | None = None

    def start(self) -> None:
        settings, user = self.settings, self.settings["User"]
        state, run = f"/var/lib/{settings['StateDirectory']}", f"/run/{settings['RuntimeDirectory']}"
        for place in (state, run):
            self.system.run("install", "-d", "-o", user, "-g", settings["Group"], place)
        capabilities = ",".join(
            f"+{name.removeprefix('CAP_').lower()}" for name in settings["AmbientCapabilities"].split()
        )
        script = (
            f". /etc/plcrt/main.conf 2>/dev/null; umask {settings['UMask']}; STATE_DIRECTORY={state}; "
            f"RUNTIME_DIRECTORY={run}; exec setpriv --reuid {user} --regid {settings['Group']} --init-groups "
            f"--no-new-privs --inh-caps {capabilities} --ambient-caps {capabilities} {settings['ExecStart']}"
        )
        options = (self.system.root / "etc/plcrt/main.conf").read_text().partition("=")[2].strip()
        script = script.replace(". /etc/plcrt/main.conf 2>/dev/null", f"PLCRT_OPTIONS='{options}'")
        self.process = subprocess.Popen(
            ["chroot", str(self.system.root), "sh", "-c", script], stdout=subprocess.PIPE, text=True
        )
        assert self.process.stdout
        line = self.process.stdout.readline()
        if not line.startswith("tcp: "):
            sys.exit(f"the controller did not start: {line}")

    def stop(self) -> None:
        assert self.process
        self.process.send_signal(signal.SIGTERM)
        if status := self.process.wait(PATIENCE):
            sys.exit(f"the controller ended with exit status {status}")

    def check_rights(self) -> None:
        """The controller is not root, and has the capabilities of its unit and no others."""
        assert self.process
        status = Path(f"/proc/{self.process.pid}/status").read_text()
        user = int(self.system.run("id", "-u", self.settings["User"]).stdout)
        wanted = sum(1 << CAPABILITIES[name] for name in self.settings["AmbientCapabilities"].split())
        if not re.search(rf"^Uid:\t{user}\t{user}\t", status, re.MULTILINE):
            sys.exit("the controller runs as another user")
        if not re.search(rf"^CapEff:\t{wanted:016x}$", status, re.MULTILINE):
            sys.exit("the controller has other capabilities than its unit says")

    @property
    def runs(self) -> bool:
        return self.process is not None and self.process.poll() is None


def eventually(question: Callable[[], Any]) -> Any:
    end = time.monotonic() + PATIENCE
    while not (answer := question()):
        if time.monotonic() > end:
            sys.exit("what has to happen did not happen in time")
        time.sleep(0.2)
    return answer


def with_version(package: Path, version: str, folder: Path) -> Path:
    """The same package with another version."""
    content = folder / "content"
    shutil.rmtree(content, ignore_errors=True)
    subprocess.run(["dpkg-deb", "-R", str(package), str(content)], check=True)
    control = content / "DEBIAN" / "control"
    control.write_text(re.sub(r"^Version: .*$", f"Version: {version}", control.read_text(), flags=re.MULTILINE))
    made = folder / f"{package.name.partition('_')[0]}_{version}_all.deb"
    subprocess.run(["dpkg-deb", "-Zgzip", "-z1", "-b", str(content), str(made)], check=True, stdout=subprocess.DEVNULL)
    return made


def value(system: Debian, name: str) -> int:
    return int(system.plctool("read", *LINK, name)["values"][name])


def check_unit(system: Debian) -> None:
    """What systemd says of the unit, and how much an attacker could do from it."""
    if not shutil.which("systemd-analyze"):
        say("systemd-analyze is not installed: the unit was not verified")
        return
    unit = system.root / "tmp" / "plcrt@main.service"
    unit.write_text((system.root / UNIT).read_text().replace("=/usr/bin/plcrt", f"={system.root}/usr/bin/plcrt"))
    done = subprocess.run(
        ["systemd-analyze", "verify", "--man=no", str(unit)], capture_output=True, text=True, check=False
    )
    complaints = [line for line in (done.stdout + done.stderr).splitlines() if "plcrt" in line]
    if complaints:
        sys.exit("systemd-analyze verify: " + "\n".join(complaints))
    done = subprocess.run(["systemd-analyze", "security", "--offline=true", str(unit)], capture_output=True, text=True,
                          check=False)  # fmt: skip
    level = re.search(r"Overall exposure level for \S+: ([\d.]+)", done.stdout + done.stderr)
    say(f"systemd: the unit is valid; exposure level {level[1] if level else 'not known'}, 10 is none at all protected")


def check_files(system: Debian) -> None:
    for path in (
        "usr/share/man/man1/plcrt.1.gz", "usr/share/man/man1/plctool.1.gz", "usr/lib/sysusers.d/plcrt.conf",
        "usr/share/bash-completion/completions/plctool", "usr/share/zsh/vendor-completions/_plctool",
        "usr/share/fish/vendor_completions.d/plctool.fish", "usr/share/doc/plcrt/examples/main.conf",
    ):  # fmt: skip
        if not system.has(path):
            sys.exit(f"{path} is missing")
    if "dialout" not in system.run("id", "-nG", "plcrt").stdout.split():
        sys.exit("user plcrt may not open serial ports")


def check_full_disk(system: Debian) -> None:
    """A controller whose disk is full takes programs, and has them after a restart: the flash file has its size from
    the beginning."""
    service = Service(system, " ".join(LINK))
    service.settings["StateDirectory"] = "plcrt/small"
    disk = system.root / "var/lib/plcrt/small"
    disk.mkdir(parents=True)
    if subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={SMALL_DISK}", "tmpfs", str(disk)], check=False).returncode:
        say("a full disk was not tried: tmpfs cannot be mounted here")
        return
    try:
        service.start()
        with (disk / "filler").open("wb", buffering=0) as filler, contextlib.suppress(OSError):
            while filler.write(bytes(4096)):
                pass
        system.plctool("flash", *LINK, "/tmp/main.cdl")
        start = value(system, "Main.n")
        eventually(lambda: value(system, "Main.n") > start + 400)
        service.stop()
        service.start()
        if system.plctool("status", *LINK)["state"] != "run" or value(system, "Main.total") < start:
            sys.exit("on a full disk the program or its retain variables were lost")
        service.stop()
    finally:
        subprocess.run(["umount", "--lazy", str(disk)], check=False)
        disk.rmdir()


def life(system: Debian, plcrt: Path, plctool: Path, folder: Path) -> None:
    """The life of an installation."""
    say("install")
    system.install(plctool)
    system.install(plcrt)
    check_files(system)
    check_unit(system)
    service = Service(system, " ".join(LINK))
    say("start and flash")
    service.start()
    service.check_rights()
    (system.root / "tmp/main.st").write_text(PROGRAM)
    system.plctool("build", "/tmp/main.st", "-o", "/tmp/main.cdl")
    system.plctool("flash", *LINK, "/tmp/main.cdl")
    metrics = system.root / "run/plcrt/main.prom"
    eventually(lambda: metrics.exists() and 'state="run"} 1' in metrics.read_text())
    time_of_proof = value(system, "Main.n")
    eventually(lambda: value(system, "Main.n") > time_of_proof + 400)  # proven, and saved, after 3 s

    say("upgrade: the program goes on")
    before = value(system, "Main.n")
    system.install(with_version(plcrt, "99.0", folder))
    if not service.runs or value(system, "Main.n") < before:
        sys.exit("the upgrade has stopped the controller")
    total = value(system, "Main.total")
    service.stop()
    service.start()
    if system.plctool("status", *LINK)["state"] != "run" or value(system, "Main.total") < total:
        sys.exit("after the upgrade the new runtime does not run the program with its retain variables")

    say("downgrade: the program goes on")
    system.install(plcrt, "--allow-downgrades")
    total = value(system, "Main.total")
    service.stop()
    service.start()
    if system.plctool("status", *LINK)["state"] != "run" or value(system, "Main.total") < total:
        sys.exit("after the downgrade the program does not run")

    service.stop()
    say("full disk: programs are taken and kept")
    check_full_disk(system)

    say("remove: programs and options stay")
    system.run("apt-get", "remove", "-y", "-qq", "plcrt")
    if system.has("usr/bin/plcrt") or not system.has("var/lib/plcrt/main/plc.flash"):
        sys.exit("remove leaves too much or too little")
    system.install(plcrt)
    service.start()
    if system.plctool("status", *LINK)["state"] != "run":
        sys.exit("after it is installed again the program does not run")
    service.stop()

    say("purge: nothing stays")
    system.run("apt-get", "purge", "-y", "-qq", "plcrt", "plctool")
    left = [path for path in ("var/lib/plcrt", "etc/plcrt", "usr/lib/plctool", "run/plcrt", UNIT) if system.has(path)]
    if left:
        sys.exit(f"purge leaves {', '.join(left)}")


def main() -> None:
    folder, packages = Path(sys.argv[1]).resolve(), [Path(name).resolve() for name in sys.argv[2:]]
    folder.mkdir(exist_ok=True)
    make_base(folder / "base")
    (plcrt,) = [package for package in packages if package.name.startswith("plcrt_")]
    (plctool,) = [package for package in packages if package.name.startswith("plctool_")]
    with debian(folder) as system:
        system.run("apt-get", "update", "-qq")
        life(system, plcrt, plctool, folder)
    say("all of it works")


if __name__ == "__main__":
    main()
