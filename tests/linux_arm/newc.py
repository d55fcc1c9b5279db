"""Writes the files that stdin names as an archive in the format of an initial RAM file system (cpio newc) to stdout."""

from __future__ import annotations

import os
import stat
import sys


def entry(number: int, name: str) -> bytes:
    info = os.lstat(name)
    data = b""
    if stat.S_ISLNK(info.st_mode):
        data = os.readlink(name).encode()
    elif stat.S_ISREG(info.st_mode):
        with open(name, "rb") as file:
            data = file.read()
    return packed(number, name, info.st_mode, data)


def packed(number: int, name: str, mode: int, data: bytes) -> bytes:
    fields = (number, mode, 0, 0, 1, 0, len(data), 0, 0, 0, 0, len(name) + 1, 0)
    head = b"070701" + b"".join(b"%08X" % field for field in fields) + name.encode() + b"\0"
    return padded(head) + padded(data)


def padded(data: bytes) -> bytes:
    return data + bytes(-len(data) % 4)


if __name__ == "__main__":
    for number, line in enumerate(sys.stdin.read().splitlines(), 1):
        sys.stdout.buffer.write(entry(number, line))
    sys.stdout.buffer.write(packed(0, "TRAILER!!!", 0, b""))
