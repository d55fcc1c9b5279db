"""Items that are made ahead, in a thread."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from plctool.link.ahead import ahead


@given(st.lists(st.integers(), max_size=20), st.integers(1, 5))
def test_the_items_are_the_same(items: list[int], count: int) -> None:
    assert list(ahead(iter(items), count)) == items


def test_items_are_made_before_they_are_asked_for() -> None:
    made = threading.Semaphore(0)

    def items() -> Iterator[int]:
        for item in range(10):
            made.release()
            yield item

    taken = ahead(items(), 2)
    assert next(taken) == 0
    assert all(made.acquire(timeout=30) for _ in range(3))
    assert list(taken) == list(range(1, 10))


def test_an_error_comes_after_the_items_before_it() -> None:
    def items() -> Iterator[int]:
        yield 1
        raise ValueError("two")

    taken = ahead(items(), 3)
    assert next(taken) == 1
    with pytest.raises(ValueError, match="two"):
        next(taken)


def test_nothing_is_made_after_the_end() -> None:
    ended = threading.Event()

    def items() -> Iterator[int]:
        try:
            while True:
                yield 1
        finally:
            ended.set()

    taken = ahead(items(), 1)
    next(taken)
    taken.close()  # type: ignore[attr-defined]
    assert ended.wait(30)
