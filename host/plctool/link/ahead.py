"""Makes the items of an iterator in a thread, a few ahead of the one that is needed."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from queue import Full, Queue
from typing import TypeVar

_T = TypeVar("_T")
_LOOK = 0.1  # how often the thread looks whether it is still needed [s]


class _End:
    """After the last item; with the error that ended it early."""

    def __init__(self, error: BaseException | None) -> None:
        self.error = error


def ahead(items: Iterator[_T], count: int) -> Iterator[_T]:
    """The same items, of which up to `count` are made before they are asked for. An error comes where it would come
    without. The thread ends when the iterator is closed or forgotten."""
    made: Queue[_T | _End] = Queue(count)
    stop = threading.Event()
    threading.Thread(target=_make, args=(items, made, stop), daemon=True).start()
    try:
        while not isinstance(item := made.get(), _End):
            yield item
        if item.error is not None:
            raise item.error
    finally:
        stop.set()


def _make(items: Iterator[_T], made: Queue[_T | _End], stop: threading.Event) -> None:
    end = _End(None)
    try:
        for item in items:
            if not _put(made, item, stop):
                return
    except BaseException as error:  # it belongs to the one that takes the items
        end = _End(error)
    _put(made, end, stop)


def _put(made: Queue[_T | _End], item: _T | _End, stop: threading.Event) -> bool:
    """False if nothing is needed any more."""
    while not stop.is_set():
        try:
            made.put(item, timeout=_LOOK)
            return True
        except Full:
            continue
    return False
