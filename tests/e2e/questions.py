"""What plctool says of a controller."""

from __future__ import annotations

from typing import Any


def status(tool: Any, plcrt: Any) -> Any:
    return tool.ok("status", "--port", plcrt.port)


def read(tool: Any, plcrt: Any, name: str) -> Any:
    return tool.ok("read", "--port", plcrt.port, name)["values"][name]


def log(tool: Any, plcrt: Any) -> str:
    """The messages of its log, one a line."""
    return "\n".join(entry["text"] for entry in tool.ok("log", "--port", plcrt.port)["entries"])
