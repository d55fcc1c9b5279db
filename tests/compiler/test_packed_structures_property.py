"""Random structures with {attribute 'pack_mode'}: members are where the rule says, SIZEOF and addresses say the same,
and each member keeps its own value."""

from __future__ import annotations

import random
from dataclasses import dataclass
from pathlib import Path

import pytest
from shares import share

from plctool.compiler import compile_sources
from plctool.sim import Simulator

TYPES = {"BYTE": 1, "BOOL": 1, "SINT": 1, "INT": 2, "WORD": 2, "DINT": 4, "UDINT": 4, "REAL": 4, "LINT": 8, "LREAL": 8}


@dataclass
class Member:
    """`count`: elements of an array, 0 for none."""

    name: str
    type: str
    count: int

    @property
    def spec(self) -> str:
        return f"ARRAY[0..{self.count - 1}] OF {self.type}" if self.count else self.type

    @property
    def size(self) -> int:
        return TYPES[self.type] * max(1, self.count)


def structure(seed: int) -> tuple[int, list[Member]]:
    r = random.Random(seed)
    members = [
        Member(f"m{i}", r.choice([*TYPES]), r.choice([0, 0, 0, r.randint(1, 4)])) for i in range(r.randint(1, 9))
    ]
    return r.choice([0, 1, 1, 2, 4, 8]), members


def layout(pack: int, members: list[Member]) -> tuple[list[int], int]:
    """The offsets, and the size."""
    offsets, end, largest = [], 0, 1
    for m in members:
        step = min(TYPES[m.type], pack or 1)
        end += -end % step
        offsets.append(end)
        end += m.size
        largest = max(largest, step)
    return offsets, end + -end % largest


def value(m: Member, number: int) -> int:
    return number % 2 if m.type == "BOOL" else number % 100 + 1


@pytest.mark.parametrize("level", [0, 2])
@pytest.mark.parametrize("seed", share(range(6), 3))
def test_members_are_where_the_rule_says_and_keep_their_values(seed: int, level: int, tmp_path: Path) -> None:
    types, variables, body, expected = "", "", "", {}
    for k in range(8):
        pack, members = structure(seed * 100 + k)
        offsets, size = layout(pack, members)
        fields = "".join(f"{m.name} : {m.spec}; " for m in members)
        types += f"{{attribute 'pack_mode' := '{pack}'}}\nS{k} : STRUCT {fields}END_STRUCT\n"
        variables += f"a{k} : ARRAY[0..2] OF S{k}; size{k} : DINT; s{k} : S{k};\n"
        body += f"size{k} := SIZEOF(S{k});\n"
        expected[f"size{k}"] = size
        for i, m in enumerate(members):
            where = f"a{k}[1].{m.name}"
            variables += f"o{k}_{i} : LINT;\n"
            body += f"o{k}_{i} := TO_LINT(ADR({where}) - ADR(a{k}));\n"
            expected[f"o{k}_{i}"] = size + offsets[i]
            for n in range(max(1, m.count)):
                element = f"{where}[{n}]" if m.count else where
                v = value(m, 7 * i + n)
                text = ("FALSE", "TRUE")[v] if m.type == "BOOL" else str(v)
                body += f"{element} := {text};\n"
                expected[f"s{k}.{m.name}" + (f"[{n}]" if m.count else "")] = v
        body += f"a{k}[2] := a{k}[1];\na{k}[0] := a{k}[2];\ns{k} := a{k}[0];\n"
    source = tmp_path / "main.st"
    source.write_text(f"TYPE\n{types}END_TYPE\nPROGRAM Main\nVAR\n{variables}END_VAR\n{body}END_PROGRAM\n")
    result = compile_sources([source], level=level)
    with Simulator(result.image, result.symbols) as plc:
        plc.run_cycles(1)
        assert plc.status().exception is None
        found = {name: plc.read(f"Main.{name}") for name in expected}
    assert found == expected
