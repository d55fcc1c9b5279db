"""A description as large as a controller takes: its inputs full of coils."""

from __future__ import annotations

from pathlib import Path

from plctool import Simulator

JOBS, PER_JOB, BITS = 9, 30, 64  # with room for growth, plcrt has no more inputs


def test_the_last_of_many_coils_arrives(tmp_path: Path) -> None:
    names = [f"v{i}" for i in range(JOBS)]
    lines = ['[[modbus.tcp]]\nhost = "192.168.0.7"\n[[modbus.tcp.device]]\nname = "Wide"\n']
    for i, name in enumerate(names):
        function, first = (1, 1) if i % 2 else (2, 100001)
        address = first + i // 2 * PER_JOB * BITS
        lines.append(
            f"[[modbus.tcp.device.read]]\nfunction = {function}\naddress = {address}\n"
            f'every = "T#100ms"\nvar = "Main.{name}"\n'
        )
    (tmp_path / "main.io.toml").write_text("".join(lines))
    declared = ", ".join(names)
    (tmp_path / "main.st").write_text(
        f"PROGRAM Main\nVAR {declared} : ARRAY[1..{PER_JOB}] OF LWORD; END_VAR\nEND_PROGRAM\n"
    )
    with Simulator.from_sources(tmp_path / "main.st") as plc:
        values = {name: [(i << 40) + k for k in range(PER_JOB)] for i, name in enumerate(names)}
        for name, value in values.items():
            plc.set_input(f"Main.{name}", value)
        plc.run_for(1000)
        assert {name: plc.read(f"Main.{name}") for name in names} == values
