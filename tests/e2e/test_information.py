"""What plcrt has of its program is what the image says."""

from __future__ import annotations

from pathlib import Path

from plctool.testing.plcrt import Plcrt

PROJECT = """sources = ["main.st"]
[information]
name = "pump"
title = "Pump station"
version = "1.2"
author = "A. N. Other"
description = "two pumps"
profile = "small"
"""
MAIN = "PROGRAM Main\nVAR\n    title : STRING;\nEND_VAR\ntitle := GetTitle();\nEND_PROGRAM\n"


def test_info_of_plcrt_is_that_of_the_image(plcrt: Plcrt, tmp_path: Path, tool) -> None:
    (tmp_path / "plc.toml").write_text(PROJECT)
    (tmp_path / "main.st").write_text(MAIN)
    tool.ok("build")
    plcrt.stop()
    plcrt.options = ("--tcp", "0")
    plcrt.start()
    link = ["--tcp", plcrt.tcp]
    before = tool.ok("info", *link)
    components = {component["name"]: component for component in before["components"]}
    assert components["CmpDevice"]["id"] == "0x0008" and components["CmpDevice"]["vendor"] == ""
    version = tool.ok("scan", *link)["devices"][0]["version"]
    assert components["SysTarget"]["version"] == components["IecSocket"]["version"] == "0.2.0.0", version
    assert "CmpIoKeep" in tool("info", *link).out
    assert before["state"] == "none" and before["info"] == {} and "crc" not in before
    tool.ok("flash", *link, "app.cdl")
    image, device = tool.ok("info", "app.cdl"), tool.ok("info", *link)
    for key in ("size", "crc", "target"):
        assert device[key] == image[key]
    assert device["info"] == {key: text for key, text in image["info"].items() if text}
    assert device["info"].keys() == {"project", "version", "author", "description", "profile"}
    assert "Main.title = 'Pump station'" in tool("read", *link, "Main.title").out
