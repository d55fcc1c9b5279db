"""A Debian with systemd in a virtual machine, for each architecture that has packages.

The disk is made once, of Debian's packages. They are unpacked here without their scripts, which need the processor;
this file does what the scripts would do. The kernel is Debian's. Commands go to a small server in the machine, over a
port of its own (virtio-serial), so they need no network.
"""

from __future__ import annotations

import json
import os
import shutil
import socket
import subprocess
import time
import uuid
from dataclasses import dataclass
from pathlib import Path

from debian_kernel import apt_settings, busybox_file, kernel_file, modules
from debian_kernel import fetch as fetch_kernel
from free_ports import free_port
from linux_arm.newc import archive

from plctool.testing.children import ends_with_us

# Time in the machine is the number of instructions, one in 4 ns: on a busy computer no watchdog of its own expires.
INSTRUCTION_TIME = ("-icount", "shift=2,sleep=on")
BOOT = 600.0  # of an emulated machine beside others [s]; about 20 on a quiet one
COMMAND = 600.0  # the longest one, the installation of a package [s]
DISK_SIZE = "1G"
SMALL_DISK_SIZE = "12M"  # the flash file has 5 MiB
SYSTEM = ("?essential", "apt", "systemd", "systemd-sysv", "python3", "libstdc++6", "zlib1g")
CONFIGURED = {
    "usr/share/base-passwd/passwd.master": "etc/passwd",
    "usr/share/base-passwd/group.master": "etc/group",
    "usr/share/libc-bin/nsswitch.conf": "etc/nsswitch.conf",
}
LINKS = {"usr/bin/sh": "dash", "usr/bin/awk": "mawk"}
UNWANTED = ("apt-daily.timer", "apt-daily-upgrade.timer", "dpkg-db-backup.timer", "e2scrub_all.timer", "fstrim.timer")

SERVER = """\
import glob, json, os, subprocess
(place,) = glob.glob("/dev/vport*p1")
port = os.open(place, os.O_RDWR)
for line in os.fdopen(os.dup(port), "rb"):
    done = subprocess.run(json.loads(line), capture_output=True, text=True, errors="replace")
    reply = json.dumps([done.returncode, done.stdout, done.stderr]).encode() + b"\\n"
    while reply:
        reply = reply[os.write(port, reply):]
"""
SERVER_UNIT = """\
[Service]
ExecStart=/usr/bin/python3 /usr/local/sbin/command-server
Environment=LC_ALL=C.UTF-8 DEBIAN_FRONTEND=noninteractive HOME=/root PLCTOOL_PATIENCE=5
Restart=always
[Install]
WantedBy=multi-user.target
"""
INIT = """\
#!/bin/busybox sh
B=/bin/busybox
$B mount -t proc proc /proc
$B mount -t sysfs sys /sys
$B mount -t devtmpfs dev /dev
for m in MODULES; do $B insmod /modules/$m; done
$B ip address add 10.0.2.15/24 dev eth0
$B ip link set eth0 up
$B mount -t ext4 /dev/vda /disk
$B mount -t ext4 /dev/vdb /disk/var/lib/plcrt/small
$B mount -t ext4 -o ro /dev/vdc /disk/packages
$B mount --move /dev /disk/dev
$B umount /proc /sys
exec $B switch_root /disk /lib/systemd/systemd
"""


@dataclass(frozen=True)
class Architecture:
    """A processor for Debian, QEMU and the compiler."""

    target: str  # of the compiler
    qemu: tuple[str, ...]
    console: str


ARCHITECTURES = {
    "amd64": Architecture("x86_64-linux", ("qemu-system-x86_64", "-M", "pc", "-accel", "tcg"), "ttyS0"),
    "arm64": Architecture("aarch64-linux", ("qemu-system-aarch64", "-M", "virt", "-cpu", "cortex-a53"), "ttyAMA0"),
    "armhf": Architecture(
        "armv7-linux", ("qemu-system-arm", "-M", "virt,highmem=off", "-cpu", "cortex-a15"), "ttyAMA0"
    ),
}


class CannotBeDoneError(Exception):
    """Something that the machine needs is not here."""


def need(*programs: str) -> None:
    for program in programs:
        if not shutil.which(program):
            raise CannotBeDoneError(f"it needs {program}")


def make_disk(name: str, disk: Path) -> None:
    """Makes the disk with Debian once."""
    if disk.exists():
        return
    need("apt-get", "dpkg-deb", "mke2fs")
    if os.geteuid() != 0:
        raise CannotBeDoneError("it needs root, for the files of a system")
    root, packages = disk.parent / "root", disk.parent / "packages"
    for folder in (root, packages):
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
    fetch_packages(name, packages)
    unpack(packages, root)
    set_up(root)
    made = disk.with_suffix(".new")
    make_file_system(made, DISK_SIZE, root)
    shutil.rmtree(root)
    made.rename(disk)


def fetch_packages(name: str, folder: Path) -> None:
    """Fetches a small Debian with systemd."""
    environment = os.environ | {"APT_CONFIG": str(apt_settings(name, folder)), "LC_ALL": "C.UTF-8"}
    wanted = ["apt-get", "-qq", "-y", "--no-install-recommends", "--download-only", "install", *SYSTEM]
    for command in (["apt-get", "-qq", "update"], wanted):  # a part of the lists may be enough
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise CannotBeDoneError(f"Debian's packages for {name} cannot be fetched: {done.stderr.strip()}")


def unpack(packages: Path, root: Path) -> None:
    """Unpacks packages, and has dpkg's list say that they are installed."""
    for folder in ("bin", "sbin", "lib", "lib64"):
        (root / "usr" / folder).mkdir(parents=True)
        (root / folder).symlink_to(f"usr/{folder}")
    status, info = [], root / "var/lib/dpkg/info"
    info.mkdir(parents=True)
    for package in sorted((packages / "cache/archives").glob("*.deb")):
        script = 'dpkg-deb --fsys-tarfile "$1" | tar x -v --keep-directory-symlink -C "$2"'
        names = output("sh", "-c", script, "sh", str(package), str(root)).replace("\n./", "\n/")
        fields = output("dpkg-deb", "--field", str(package))
        called = package.name.partition("_")[0]
        if "\nMulti-Arch: same" in fields:
            called += ":" + package.stem.rpartition("_")[2]
        write(info / f"{called}.list", names.removeprefix("./\n"))
        status.append(fields.replace("\n", "\nStatus: install ok installed\n", 1))
    write(root / "var/lib/dpkg/status", "\n".join(status))
    shutil.rmtree(packages)


def output(*command: str) -> str:
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def set_up(root: Path) -> None:
    """Does the work of the packages' scripts that the machine needs; adds the server for commands and a journal that is
    kept."""
    for source, file in CONFIGURED.items():
        shutil.copy(root / source, root / file)
    for name, link in LINKS.items():
        if not (root / name).exists():
            (root / name).symlink_to(link)
    write(root / "etc/machine-id", uuid.uuid4().hex + "\n")
    write(root / "usr/local/sbin/command-server", SERVER)
    write(root / "etc/systemd/system/command-server.service", SERVER_UNIT)
    enabled = root / "etc/systemd/system/multi-user.target.wants/command-server.service"
    enabled.parent.mkdir(parents=True, exist_ok=True)
    enabled.symlink_to("/etc/systemd/system/command-server.service")
    for timer in UNWANTED:
        (root / "etc/systemd/system" / timer).symlink_to("/dev/null")
    write(root / "etc/hostname", "cabinet\n")
    for folder in ("var/log/journal", "var/lib/plcrt/small", "packages"):
        (root / folder).mkdir(parents=True, exist_ok=True)


def write(file: Path, text: str) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(text)


def make_file_system(file: Path, size: str, content: Path | None = None) -> None:
    file.unlink(missing_ok=True)
    from_folder = ["-d", str(content)] if content else []
    subprocess.run(["mke2fs", "-q", "-F", "-t", "ext4", "-m", "0", *from_folder, str(file), size], check=True)


def make_initial(kernel: Path, folder: Path) -> Path:
    """The initial RAM file system, which mounts the disks and starts systemd."""
    shutil.rmtree(folder, ignore_errors=True)
    for name in ("bin", "dev", "proc", "sys", "disk", "modules"):
        (folder / name).mkdir(parents=True)
    shutil.copy(busybox_file(kernel), folder / "bin/busybox")
    loaded = modules(kernel)
    for module in loaded:
        shutil.copy(module, folder / "modules")
    write(folder / "init", INIT.replace("MODULES", " ".join(module.name for module in loaded)))
    (folder / "init").chmod(0o755)
    file = folder.with_suffix(".cpio")
    with file.open("wb") as out:
        archive((str(path.relative_to(folder)) for path in sorted(folder.rglob("*"))), out, str(folder))
    return file


class Machine:
    """A virtual machine; its disks outlive it. `folder` keeps what is made once, `work` is for this run."""

    def __init__(self, name: str, folder: Path, work: Path, packages: Path) -> None:
        self.architecture = ARCHITECTURES[name]
        need(self.architecture.qemu[0])
        folder.mkdir(parents=True, exist_ok=True)
        if reason := fetch_kernel(name, folder / "kernel"):
            raise CannotBeDoneError(reason)
        make_disk(name, folder / "disk")
        self.kernel = kernel_file(folder / "kernel")
        self.initial = make_initial(folder / "kernel", work / "initial")
        self.disks = [work / "disk", work / "small", work / "packages"]
        subprocess.run(["cp", "--sparse=always", folder / "disk", self.disks[0]], check=True)
        make_file_system(self.disks[1], SMALL_DISK_SIZE)
        size = sum(file.stat().st_size for file in packages.iterdir()) >> 20
        make_file_system(self.disks[2], f"{size * 5 // 4 + 8}M", packages)
        self.console, self.socket = work / "console", work / "commands"
        self.ports = {name: free_port() for name in ("main", "small")}
        self.process: subprocess.Popen[bytes] | None = None

    def power_on(self) -> None:
        forwarded = "".join(
            f",hostfwd=tcp:127.0.0.1:{port}-10.0.2.15:{inside}"
            for port, inside in zip(self.ports.values(), (11740, 11741), strict=True)
        )
        command = [
            *self.architecture.qemu, *INSTRUCTION_TIME, "-m", "512", "-smp", "1", "-display", "none",
            "-no-reboot", "-nodefaults", "-serial", "stdio", "-kernel", str(self.kernel), "-initrd", str(self.initial),
            "-append", f"console={self.architecture.console} panic=-1 quiet systemd.getty_auto=no",
            "-netdev", f"user,id=net,restrict=on{forwarded}", "-device", "virtio-net-pci,netdev=net,romfile=",
            "-chardev", f"socket,id=commands,path={self.socket},server=on,wait=off",
            "-device", "virtio-serial-pci", "-device", "virtserialport,chardev=commands",
        ]  # fmt: skip
        for number, disk in enumerate(self.disks):
            command += ["-drive", f"file={disk},format=raw,if=none,id=disk{number},cache=unsafe",
                        "-device", f"virtio-blk-pci,drive=disk{number}"]  # fmt: skip
        self.socket.unlink(missing_ok=True)
        with self.console.open("ab") as console:
            self.process = subprocess.Popen(
                ends_with_us(command), stdin=subprocess.DEVNULL, stdout=console, stderr=subprocess.STDOUT
            )
        end = time.monotonic() + BOOT
        while not self.socket.exists():
            self.check_lives(time.monotonic() < end)
            time.sleep(0.1)
        self.commands = socket.socket(socket.AF_UNIX)
        self.commands.settimeout(BOOT)
        self.commands.connect(str(self.socket))
        self.run("true")  # the server is there
        self.commands.settimeout(COMMAND)

    def check_lives(self, in_time: bool = True) -> None:
        if self.process is None or self.process.poll() is not None or not in_time:
            raise SystemExit(f"The machine has ended. Its console:\n{self.console.read_text(errors='replace')[-3000:]}")

    def cut_power(self) -> None:
        if self.process:
            self.process.kill()
            self.process.wait()
            self.commands.close()

    def run(self, *command: str, check: bool = True) -> subprocess.CompletedProcess[str]:
        """Runs a command in the machine."""
        reply = b""
        try:
            self.commands.sendall(json.dumps(command).encode() + b"\n")
            while not reply.endswith(b"\n"):
                if not (part := self.commands.recv(1 << 16)):
                    self.check_lives(False)
                reply += part
        except OSError:
            self.check_lives(False)
        status, stdout, stderr = json.loads(reply)
        if check and status != 0:
            raise SystemExit(f"{' '.join(command)}: exit {status}\n{stdout}{stderr}")
        return subprocess.CompletedProcess(command, status, stdout, stderr)
