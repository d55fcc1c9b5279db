"""Fetches Debian's kernel and busybox for a processor: `tests/debian_kernel.py [--modules] ARCHITECTURE FOLDER`.

They are unpacked in FOLDER/system and not installed; apt works with lists of its own. --modules prints the files of
the modules for disks, the network and ext4. Exit status 77: the packages cannot be fetched, for the reason that is
printed.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

SKIPPED = 77
KERNELS = {"amd64": "linux-image-amd64", "arm64": "linux-image-arm64", "armhf": "linux-image-armmp"}
PARTS = ("drivers/virtio", "drivers/block", "drivers/net", "drivers/char", "net/core", "fs", "lib", "crypto")
# In the order in which they are loaded. A kernel that has one built in does not have its file.
MODULES = (
    "drivers/virtio/virtio_ring", "drivers/virtio/virtio", "drivers/virtio/virtio_mmio",
    "drivers/virtio/virtio_pci_legacy_dev", "drivers/virtio/virtio_pci_modern_dev", "drivers/virtio/virtio_pci",
    "net/core/failover", "drivers/net/net_failover", "drivers/net/virtio_net", "drivers/block/virtio_blk",
    "drivers/char/virtio_console", "fs/mbcache", "lib/crc16", "crypto/crc32c_generic", "fs/jbd2/jbd2",
    "fs/ext4/ext4",
)  # fmt: skip


def apt_settings(architecture: str, folder: Path) -> Path:
    """Writes the settings of an apt for another processor that changes nothing of this system."""
    for name in ("state/lists/partial", "cache/archives/partial"):
        (folder / name).mkdir(parents=True, exist_ok=True)
    (folder / "status").touch()
    settings = folder / "apt.conf"
    settings.write_text(
        f'APT::Architecture "{architecture}";\nAPT::Architectures {{ "{architecture}"; }};\n'
        f'Dir::State "{folder}/state";\nDir::State::status "{folder}/status";\nDir::Cache "{folder}/cache";\n'
        'Debug::NoLocking "true";\nAPT::Sandbox::User "";\n'
    )
    return settings


def fetch(architecture: str, folder: Path) -> str:
    """Fetches and unpacks the packages once. Returns why it cannot, or ""."""
    if (folder / "ready").exists():
        return ""
    if not shutil.which("apt-get"):
        return f"it needs Debian's {KERNELS[architecture]} and busybox-static"
    packages = folder / "packages"
    shutil.rmtree(packages, ignore_errors=True)
    packages.mkdir(parents=True)
    environment = os.environ | {"APT_CONFIG": str(apt_settings(architecture, folder / "apt")), "LC_ALL": "C.UTF-8"}

    def apt(*command: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(command, cwd=packages, env=environment, capture_output=True, text=True, check=False)

    apt("apt-get", "-qq", "update")  # a part of the lists may be enough
    depends = apt("apt-cache", "depends", KERNELS[architecture]).stdout
    kernel = re.search(r"Depends: (linux-image-\S+)", depends)
    if kernel is None:
        return f"apt knows no {KERNELS[architecture]}"
    done = apt("apt-get", "-qq", "download", kernel[1], "busybox-static")
    if done.returncode != 0:
        return f"Debian's kernel cannot be fetched: {done.stderr.strip()}"
    unpack(packages, folder / "system")
    shutil.rmtree(packages)
    shutil.rmtree(folder / "apt")
    (folder / "ready").touch()
    return ""


def unpack(packages: Path, system: Path) -> None:
    shutil.rmtree(system, ignore_errors=True)
    (busybox,) = packages.glob("busybox-static_*.deb")
    (kernel,) = packages.glob("linux-image-*.deb")
    subprocess.run(["dpkg-deb", "-x", busybox, system], check=True)
    with subprocess.Popen(["dpkg-deb", "--fsys-tarfile", kernel], stdout=subprocess.PIPE) as archive:
        wanted = ["./boot", *(f"./lib/modules/*/kernel/{part}" for part in PARTS)]
        subprocess.run(["tar", "x", "-C", system, "--wildcards", *wanted], stdin=archive.stdout, check=True)


def kernel_file(folder: Path) -> Path:
    (found,) = folder.glob("system/boot/vmlinuz-*")
    return found


def modules(folder: Path) -> list[Path]:
    """The modules for disks, the network and ext4, in the order in which they are loaded."""
    (tree,) = folder.glob("system/lib/modules/*/kernel")
    return [file for name in MODULES if (file := tree / f"{name}.ko").exists()]


def busybox_file(folder: Path) -> Path:
    places = (folder / "system/bin/busybox", folder / "system/usr/bin/busybox")  # the latter in Debian 13
    return next(place for place in places if place.exists())


def main() -> int:
    architecture, folder = sys.argv[-2], Path(sys.argv[-1]).resolve()
    if reason := fetch(architecture, folder):
        print(reason)
        return SKIPPED
    if "--modules" in sys.argv:
        print(*modules(folder), sep="\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
