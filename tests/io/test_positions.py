"""Every key and value of a TOML text is found where it stands."""

from __future__ import annotations

import json
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from shares import examples

from plctool.io.positions import BadToml, Path, TomlText

KEYS = st.from_regex(r"[A-Za-z0-9_-]{1,6}", fullmatch=True) | st.sampled_from(["a b", "x.y", "=", "[t]", "#"])
SCALARS = (
    st.integers(-99, 99).map(str)
    | st.sampled_from(["true", "1.5", "2024-02-29", "07:32:00", "-inf", "'it''s'[:4]", '"""a\nb"""', "'''[x]\n#'''"])
    | st.text(st.sampled_from("ab []{}=,.#'\\\""), max_size=6).map(json.dumps)
)
SCALARS = SCALARS.filter(lambda text: text != "'it''s'[:4]")


def _key(name: str) -> str:
    return name if name.replace("-", "").replace("_", "").isalnum() else json.dumps(name)


def _inline(value: Any) -> str:
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{_key(k)} = {_inline(v)}" for k, v in value.items()) + " }"
    if isinstance(value, list):
        return "[ # [\n" + ",\n".join(map(_inline, value)) + " ]"
    return str(value)


ONE_LINE = SCALARS.filter(lambda text: "\n" not in text)
INLINE = st.recursive(ONE_LINE, lambda inner: st.dictionaries(KEYS, inner, max_size=3), max_leaves=5)
VALUES = INLINE | SCALARS | st.lists(INLINE, max_size=3)
TABLES = st.dictionaries(KEYS, st.dictionaries(KEYS, VALUES, max_size=3), max_size=3)


def _paths(value: Any, path: Path = ()) -> list[tuple[Path, Any]]:
    found: list[tuple[Path, Any]] = [(path, value)] if path else []
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, inner in items:
        found += _paths(inner, (*path, key))
    return found


@examples(80)
@given(TABLES, st.booleans())
def test_keys_and_values_are_where_they_stand(tables: dict[str, dict[str, Any]], arrays: bool) -> None:
    opening, closing = ("[[", "]]") if arrays else ("[", "]")
    text = "# [head]\n"
    for name, values in tables.items():
        text += f"{opening}{_key(name)}{closing}  # comment = 1\n"
        text += "".join(f"  {_key(k)} = {_inline(v)}\n" for k, v in values.items())
    toml = TomlText("f", text)
    lines = text.split("\n")
    for name, values in tables.items():
        head: Path = (name, 0) if arrays else (name,)
        at = toml.value_pos(head)
        assert lines[at.line - 1][at.column - 1 :].startswith(f"{opening}{_key(name)}")
        for path, value in _paths(values):
            at = toml.value_pos((*head, *path))
            rest = "\n".join([lines[at.line - 1][at.column - 1 :], *lines[at.line :]])
            assert rest.startswith(_inline(value)), path
            if isinstance(path[-1], str):
                at = toml.key_pos((*head, *path))
                assert lines[at.line - 1][at.column - 1 :].startswith(_key(path[-1]))


def test_dotted_keys_and_tables_in_arrays_of_tables() -> None:
    toml = TomlText("f", "a.b.c = 1\n[[d]]\n[d.e]\nx = 2\n[[d]]\n[[d.f]]\n[[d.f]]\ny.z = 3\n")
    found = {p: toml.value_pos(p) for p in [("a", "b", "c"), ("d", 0, "e", "x"), ("d", 1, "f", 1, "y", "z")]}
    assert [(p.line, p.column) for p in found.values()] == [(1, 9), (4, 5), (8, 7)]
    assert toml.key_pos(("d", 1, "f", 1, "y", "z")).column == 3


@pytest.mark.parametrize(("text", "line"), [("a = ", 1), ("\n[t\n", 2), ("a = 1\na = 2", 2), ("x = '''\n", 1)])
def test_what_is_not_toml_has_a_location(text: str, line: int) -> None:
    with pytest.raises(BadToml) as error:
        TomlText("f", text)
    assert error.value.pos.line == line
    assert "line" not in error.value.message
