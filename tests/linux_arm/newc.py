"""Writes the files that stdin names as an archive in the format of an initial RAM file system (cpio newc) to stdout."""

from __future__ import annotations

import os
import stat
import sys
from collections.abc import Iterable
from typing import BinaryIO


def entry(number: int, name: str, folder: str = ".") -> bytes:
    place = os.path.join(folder, name)
    info = os.lstat(place)
    data = b""
    if stat.S_ISLNK(info.st_mode):
        data = os.readlink(place).encode()
    elif stat.S_ISREG(info.st_mode):
        with open(place, "rb") as file:
            data = file.read()
    return packed(number, name, info.st_mode, data)


def packed(number: int, name: str, mode: int, data: bytes) -> bytes:
    fields = (number, mode, 0, 0, 1, 0, len(data), 0, 0, 0, 0, len(name) + 1, 0)
    head = b"070701" + b"".join(b"%08X" % field for field in fields) + name.encode() + b"\0"
    return padded(head) + padded(data)


def padded(data: bytes) -> bytes:
    return data + bytes(-len(data) % 4)


def archive(names: Iterable[str], out: BinaryIO, folder: str = ".") -> None:
    for number, name in enumerate(names, 1):
        out.write(entry(number, name, folder))
    out.write(packed(0, "TRAILER!!!", 0, b""))


if __name__ == "__main__":
    archive(sys.stdin.read().splitlines(), sys.stdout.buffer)
