"""Two tools on one serial line transfer files at the same time."""

from __future__ import annotations

import random
from concurrent.futures import ThreadPoolExecutor

import pytest

import plctool
from plctool.testing.plcrt import Plcrt

SIZE = 100_000  # bytes, some messages of the channel
ROUNDS = 5


@pytest.mark.parametrize("link", ["gateway"], indirect=True)
def test_each_gets_and_puts_whole_files(link: list[str], plcrt: Plcrt) -> None:
    def transfer(name: str) -> int:
        with plctool.connect(f"serial:{plcrt.port}") as plc:
            for number in range(ROUNDS):
                data = random.Random(f"{name}{number}").randbytes(SIZE)
                plc.write_file(name, data)
                assert all(plc.read_file(name) == data for _ in range(ROUNDS))
            return len(plc.read_file("PlcLog.txt"))

    with ThreadPoolExecutor(2) as pool:
        assert all(pool.map(transfer, ("one.bin", "two.bin")))
