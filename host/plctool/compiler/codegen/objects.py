"""The objects of the parts of a program: from the cache, or made by LLVM, which is loaded only if one is missing.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING

import llvmlite  # its version only: LLVM itself is `llvmlite.binding`

from plctool.compiler.codegen.partition import Part

if TYPE_CHECKING:
    from plctool.compiler.codegen.lower_unit import Options

_LENGTH = 4  # bytes of the length of an object between processes


def emit_objects(parts: Sequence[Part], options: Options, known: Sequence[bytes | None] = ()) -> list[bytes]:
    """The objects of the parts of a program: those that are neither in the cache nor `known` are compiled, several side
    by side in processes of their own where the system can fork. The result is the same either way."""
    kept = None if options.passes.dump_after else options.cache
    found = list(known) if known else [None] * len(parts)
    keys = ["" if kept is None or found[n] is not None else object_key(part, options) for n, part in enumerate(parts)]
    found = [kept.get(key) if kept is not None and key else data for key, data in zip(keys, found, strict=True)]
    missing = [number for number, data in enumerate(found) if data is None]
    made = _compiled([parts[number] for number in missing], options)
    for number, data in zip(missing, made, strict=True):
        found[number] = data
        if kept is not None:
            kept.put(keys[number], data)
    return [data for data in found if data is not None]


def object_key(part: Part, options: Options) -> str:
    """A hash of all that the object of a part depends on."""
    facts = (
        *(llvmlite.__version__, _code_of_emit(), options.target, options.opt_level, options.size),
        *(sorted(options.passes.without), part.large, part.plain),
    )
    return sha256(f"{facts!r}\n{part.text}".encode()).hexdigest()


@cache
def _code_of_emit() -> str:
    """A hash of what decides which passes of LLVM run."""
    return sha256(Path(__file__).with_name("emit.py").read_bytes()).hexdigest()


def _compiled(parts: list[Part], options: Options) -> list[bytes]:
    if not parts:
        return []
    from plctool.compiler.codegen import emit

    alone = bool(options.passes.dump_after)  # or what the others keep would be lost
    workers = min(len(parts), os.cpu_count() or 1)
    if alone or workers < 2 or not hasattr(os, "fork"):
        return [emit.emit_object(part, options) for part in parts]
    emit.initialise()
    shares = _shares(parts, workers)
    children = [_Child([parts[number] for number in share], options) for share in shares[1:]]
    objects = [b""] * len(parts)
    for number in shares[0]:
        objects[number] = emit.emit_object(parts[number], options)
    for share, child in zip(shares[1:], children, strict=True):
        for number, data in zip(share, child.results(), strict=True):
            objects[number] = data or emit.emit_object(parts[number], options)
    return objects


def _shares(parts: list[Part], workers: int) -> list[list[int]]:
    """Numbers of parts for each process, with about the same work: the largest part goes to the one with the least."""
    shares: list[list[int]] = [[] for _ in range(workers)]
    sizes = [0] * workers
    for number in sorted(range(len(parts)), key=lambda n: -len(parts[n].text)):
        least = sizes.index(min(sizes))
        shares[least].append(number)
        sizes[least] += len(parts[number].text)
    return shares


class _Child:
    """A process that emits some of several objects. A process, because llvmlite lets one thread at a time into LLVM."""

    def __init__(self, parts: list[Part], options: Options) -> None:
        from plctool.compiler.codegen.emit import emit_object

        self._count = len(parts)
        read, write = os.pipe()
        self._pid = os.fork()
        if self._pid == 0:
            try:
                os.close(read)
                with open(write, "wb") as pipe:
                    for part in parts:
                        data = emit_object(part, options)
                        pipe.write(len(data).to_bytes(_LENGTH, "little") + data)
            finally:
                os._exit(0)
        os.close(write)
        self._read = read

    def results(self) -> list[bytes]:
        """The objects. Those after a failure of the process are empty: they fail here as well, with a message."""
        with open(self._read, "rb") as pipe:
            data = pipe.read()
        os.waitpid(self._pid, 0)
        found = []
        for _ in range(self._count):
            size = int.from_bytes(data[:_LENGTH], "little")
            whole = len(data) >= _LENGTH + size
            found.append(data[_LENGTH : _LENGTH + size] if whole else b"")
            data = data[_LENGTH + size :] if whole else b""
        return found
