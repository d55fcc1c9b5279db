"""A plc.toml that cannot be read is an error with its line, whatever is in it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (b"a = 1\nlink = ", "plc.toml:2:7: this is not TOML: invalid value"),
        (b"a = 1\nlink = " + b"9" * 5000, "plc.toml:2:8: this is not TOML: a number has at most 64 bits"),
        (b"a = 1\nlink = " + b"[" * 3000 + b"]" * 3000, "is not TOML: there are more than 100 brackets"),
        (b'link = "\xff"', "is not UTF-8 at byte 8; save it as UTF-8"),
        (b"link = 2020-01-01", "link is not a text"),
        (b"[link]\na = 1", "link is not a text"),
    ],
    ids=lambda value: str(value[:20]),
)
def test_project_that_cannot_be_read_is_an_error_with_its_line(
    tool: Any, scratch: Path, text: bytes, message: str
) -> None:
    (scratch / "plc.toml").write_bytes(text)
    done = tool("status")
    assert (done.status, done.err.count("\n")) == (2, 1)
    assert message in done.err


def test_project_with_a_byte_order_mark_is_read(tool: Any, scratch: Path) -> None:
    (scratch / "plc.toml").write_bytes(b'\xef\xbb\xbflink = "what:/dev/none"')
    assert "what" in tool("status").err
