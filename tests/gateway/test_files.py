"""Transfers of files: one at a time for all tools of a gateway, and the device goes on for all else."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

import pytest
from served import PATIENCE, Served

from plctool.errors import LinkError
from plctool.gateway import client, shared
from plctool.gateway.frames import BUSY, FILES_BUSY, Kind, Scope

READING = {"purpose": "reading Source.zip", "scope": Scope.FILES.value}


def test_the_second_tool_waits_until_the_first_one_is_done(served: Served) -> None:
    first, second = served.tool("one"), served.tool("two")
    order: list[str] = []
    begun = threading.Event()

    def transfer() -> None:
        begun.set()
        with second.transferring("reading a"):
            order.append("second")

    thread = threading.Thread(target=transfer)
    with first.transferring("writing a"):
        thread.start()
        assert begun.wait(PATIENCE)
        assert served.connect().read("Main.count") == 0
        order.append("first")
    thread.join(PATIENCE)
    assert order == ["first", "second"]


def test_one_that_waits_too_long_learns_for_whom(served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(client, "_FILES_PATIENCE", 0.0)
    refused = pytest.raises(LinkError, match=r"plctool files get a .* is reading a; try again")
    with served.tool("plctool files get a").transferring("reading a"):
        with refused as caught, served.tool().transferring("reading b"):
            pass
        assert caught.value.code == FILES_BUSY
    with served.tool().transferring("reading b"):
        pass


def test_a_tool_that_leaves_or_falls_silent_gives_the_files_back(
    served: Served, monkeypatch: pytest.MonkeyPatch, eventually: Callable[[Callable[[], Any]], Any]
) -> None:
    leaving, silent, other = served.guest(), served.guest(), served.guest()

    def reserves(pipe: Any) -> bool:
        return served.call(pipe, "claim", **READING).kind is Kind.DONE

    assert reserves(leaving) and not reserves(silent)
    leaving.close()
    eventually(lambda: reserves(silent))
    assert not reserves(other)
    monkeypatch.setattr(shared, "CLAIM_SILENCE", -1.0)
    assert reserves(other)
    eventually(silent.is_gone)


def test_no_tool_waits_for_the_files_during_a_download(served: Served) -> None:
    """It may take minutes; the error comes at once, as for all else."""
    refused = pytest.raises(LinkError, match="downloading")
    with served.tool().exclusive("downloading app.cdl"), refused as caught, served.tool().transferring("reading a"):
        pass
    assert caught.value.code == BUSY


def test_the_files_are_reserved_within_a_download_of_the_same_tool(served: Served) -> None:
    tool, other = served.tool(), served.connect()
    refused = pytest.raises(LinkError, match="downloading")
    with tool.exclusive("downloading app.cdl"), tool.transferring("writing Source.zip"), refused:
        other.status()
    assert other.read("Main.count") == 0
    assert served.gateway.device.claim is None
