"""A download looks at PERSISTENT values one by one: what has the same name and type in the new program is kept,
whatever is around it, and only that."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from shares import examples

from plctool.compiler import compile_sources
from plctool.core import lib
from plctool.debug.kept_changes import kept_changes
from plctool.sim import Simulator


@dataclass(frozen=True)
class Scalar:
    type: str
    initial: int = 5


@dataclass(frozen=True)
class Text:
    keyword: str
    length: int


@dataclass(frozen=True)
class Array:
    low: int
    high: int
    element: Scalar


@dataclass(frozen=True)
class Struct:
    members: tuple[tuple[str, Any], ...]
    pack: int = 8


scalars = st.sampled_from(
    ["INT", "DINT", "LINT", "UINT", "REAL", "LREAL", "BYTE", "INT(0..50)", "INT(0..60)", "Colour"]
)
scalar = scalars.map(Scalar)
text = st.builds(Text, st.sampled_from(["STRING", "WSTRING"]), st.integers(1, 6))
array = st.builds(lambda low, more, e: Array(low, low + more, e), st.integers(-2, 2), st.integers(0, 3), scalar)
members = st.dictionaries(st.sampled_from("xyz"), scalar | text | array, min_size=1)
struct = st.builds(lambda m, pack: Struct(tuple(m.items()), pack), members, st.sampled_from([2, 4, 8]))
programs = st.dictionaries(
    st.sampled_from(["a", "b", "c", "d"]),
    st.tuples(scalar | text | array | struct, st.sampled_from(["", "RETAIN", "PERSISTENT"])),
    min_size=1,
)


def source(variables: dict[str, tuple[Any, str]]) -> str:
    types, sections = ["TYPE Colour : (Red, Green, Blue) INT; END_TYPE"], []
    for name, (kind, qualifier) in variables.items():
        if isinstance(kind, Struct):
            lines = " ".join(f"{m} : {declaration(k)};" for m, k in kind.members)
            types.append(f"{{attribute 'pack_mode' := '{kind.pack}'}}")
            types.append(f"TYPE T_{name} : STRUCT {lines} END_STRUCT END_TYPE")
            sections.append(f"VAR {qualifier} {name} : T_{name}; END_VAR")
        else:
            sections.append(f"VAR {qualifier} {name} : {declaration(kind)}; END_VAR")
    return "\n".join([*types, "PROGRAM Main", *sections, "END_PROGRAM"])


def declaration(kind: Any) -> str:
    if isinstance(kind, Scalar):
        return f"{kind.type} := {kind.initial}" if kind.type != "Colour" else "Colour := Colour.Green"
    if isinstance(kind, Text):
        quote = "'" if kind.keyword == "STRING" else '"'
        return f"{kind.keyword}[{kind.length}] := {quote}i{quote}"
    count = kind.high - kind.low + 1
    initial = "Colour.Green" if kind.element.type == "Colour" else str(kind.element.initial)
    return f"ARRAY[{kind.low}..{kind.high}] OF {kind.element.type} := [{count}({initial})]"


def leaves(variables: dict[str, tuple[Any, str]]) -> dict[str, tuple[Any, str]]:
    """Scalars and strings by path, with the qualifier of their variable."""
    found = {}
    for name, (kind, qualifier) in variables.items():
        parts = kind.members if isinstance(kind, Struct) else (("", kind),)
        for member, part in parts:
            path = f"Main.{name}" + (f".{member}" if member else "")
            if isinstance(part, Array):
                found |= {f"{path}[{i}]": (part.element, qualifier) for i in range(part.low, part.high + 1)}
            else:
                found[path] = (part, qualifier)
    return found


def initial_value(kind: Any) -> Any:
    return "i" if isinstance(kind, Text) else "Green" if kind.type == "Colour" else kind.initial


def written_value(kind: Any, number: int) -> Any:
    if isinstance(kind, Text):
        return "written"[: kind.length]
    return "Blue" if kind.type == "Colour" else 9 + number % 40


def expected_values(old: dict[str, tuple[Any, str]], new: dict[str, tuple[Any, str]]) -> dict[str, Any]:
    written = {path: written_value(kind, n) for n, (path, (kind, _)) in enumerate(old.items())}
    expected = {}
    for path, (kind, qualifier) in new.items():
        before, was = old.get(path, (None, ""))
        same = before is not None and type(before) is type(kind)
        if same and isinstance(kind, Text):
            same = before.keyword == kind.keyword and before.length <= kind.length
        elif same:
            same = before.type == kind.type
        if same and was and qualifier == "PERSISTENT":
            expected[path] = written[path]
        else:
            expected[path] = initial_value(kind)
    return expected


@pytest.fixture(scope="module")
def build(tmp_path_factory):
    file = tmp_path_factory.mktemp("changed") / "p.st"

    def compile_text(text: str):
        file.write_text(text)
        return compile_sources([file], level=0)

    return compile_text


@examples(60)
@given(old=programs, new=programs, cut=st.booleans())
def test_only_what_changed_begins_again(build, old, new, cut) -> None:
    before, after = build(source(old)), build(source(new))
    if before.crc == after.crc:
        return
    old_leaves, new_leaves = leaves(old), leaves(new)
    with Simulator(before.image, before.symbols) as plc:
        for number, (path, (kind, _)) in enumerate(old_leaves.items()):
            plc.write({path: written_value(kind, number)})
        plc.flash(after.image, start=False)
        plc.add_symbols(after.symbols)
        if cut:
            assert lib.SimStart() == lib.ERR_OK
        assert plc.read_all(new_leaves) == expected_values(old_leaves, new_leaves)


@examples(40)
@given(old=programs, new=programs)
def test_the_host_names_what_the_device_keeps(build, old, new) -> None:
    changes = kept_changes(build(source(old)).symbols.kept, build(source(new)).symbols.kept)
    old_leaves, new_leaves = leaves(old), leaves(new)
    expected = expected_values(old_leaves, new_leaves)
    for path, (kind, qualifier) in new_leaves.items():
        name = path.split("[")[0] + ("[]" if "[" in path else "")
        assert qualifier == "PERSISTENT" or name not in changes.kept + changes.new
        if expected[path] != initial_value(kind):
            assert name in changes.kept
    for path, (_, qualifier) in old_leaves.items():
        name = path.split("[")[0] + ("[]" if "[" in path else "")
        assert (qualifier == "PERSISTENT") == (name in changes.lost or name in changes.kept) or qualifier == "RETAIN"
    assert not set(changes.kept) & set(changes.lost)


def test_the_reason_of_a_loss_is_reported(build) -> None:
    before = build("PROGRAM Main VAR PERSISTENT a, b, c, d : INT; s : STRING; END_VAR END_PROGRAM").symbols.kept
    persistent = "VAR PERSISTENT a, e : INT; b : DINT; s : STRING[9]; END_VAR"
    text = f"PROGRAM Main {persistent} VAR RETAIN c : INT; END_VAR END_PROGRAM"
    changes = kept_changes(before, build(text).symbols.kept)
    assert changes.kept == ["Main.a"]
    assert sorted(changes.new) == ["Main.b", "Main.e", "Main.s"]
    assert changes.lost == {
        "Main.b": "was INT, is DINT",
        "Main.c": "is RETAIN only",
        "Main.d": "is not there any more",
        "Main.s": "is shorter",
    }
