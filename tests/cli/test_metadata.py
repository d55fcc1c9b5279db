"""What the wheel says of itself, as pip and package indexes read it; made from pyproject.toml without building."""

from __future__ import annotations

import tomllib
from pathlib import Path

from packaging.version import Version
from pyproject_metadata import StandardMetadata

ROOT = Path(__file__).parents[2]


def test_metadata_names_licence_author_and_readme() -> None:
    document = tomllib.loads((ROOT / "pyproject.toml").read_text())
    found = StandardMetadata.from_pyproject(document, ROOT)
    found.version = Version("1.0")
    message = found.as_rfc822()
    assert message["Name"] == "plctool"
    assert message["License-Expression"] == "Apache-2.0"
    assert message.get_all("License-File") == ["LICENSE"]
    assert message["Author"]
    assert message["Requires-Python"] == ">=3.11"
    assert message["Description-Content-Type"] == "text/markdown"
    assert message.get_payload() == (ROOT / "README.md").read_text()
    assert "Typing :: Typed" in message.get_all("Classifier")
    assert (ROOT / "host/plctool/py.typed").exists()
