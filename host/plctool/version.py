"""Which plctool this is."""

from __future__ import annotations


def plctool_version() -> str:
    """The version of the installed package; "(not installed)" when it runs from a checkout."""
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("plctool")
    except PackageNotFoundError:
        return "(not installed)"
