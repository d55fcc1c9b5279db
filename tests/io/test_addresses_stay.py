"""Addresses that follow from names: the same in every build, none twice, and a new channel leaves the others alone."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
from shares import examples

from plctool.iec.types import BOOL, ELEMENTARY, Type
from plctool.io.layout import lay_out

TYPES = st.sampled_from([BOOL, *(ELEMENTARY[n] for n in ("BYTE", "INT", "REAL", "LINT"))])
VARIABLES = st.dictionaries(st.from_regex(r"[A-D][a-z]{1,3}", fullmatch=True), TYPES, max_size=40)


@examples(60)
@given(VARIABLES, st.integers(0, 40))
def test_variables_do_not_overlap_and_are_aligned(variables: dict[str, Type], first: int) -> None:
    found = lay_out(variables, first)
    used: set[int] = set()
    for name, offset in found.items():
        places = set(range(offset, offset + variables[name].size))
        assert not places & used
        assert offset % variables[name].align == 0
        assert offset >= first
        used |= places
    assert found.keys() == variables.keys()


@examples(60)
@given(VARIABLES, st.randoms())
def test_order_of_the_description_does_not_matter(variables: dict[str, Type], random: object) -> None:
    names = list(variables)
    random.shuffle(names)  # type: ignore[attr-defined]
    assert lay_out({n: variables[n] for n in names}, 0) == lay_out(variables, 0)


def test_module_that_is_inserted_moves_few_others() -> None:
    before = {f"Line.station{i}.ready": BOOL for i in range(34)}
    moved = 0
    for i in range(20):
        more = {**before, f"New.module{i}": BOOL}
        old, new = lay_out(before, 0), lay_out(more, 0)
        moved += sum(old[name] != new[name] for name in before)
    assert moved <= 20  # of 680: where two names want the same place
