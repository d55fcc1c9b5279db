"""plc.toml, device.toml and descriptions of inputs and outputs: keys, values, and what is wrong."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from editor import Editor

PLC = 'sources = ["src"]\n'


@pytest.fixture
def plain(folder: Path) -> Iterator[Editor]:
    """An editor with a project, whose files a test may change."""
    with Editor(folder) as session:
        yield session


def labels(editor: Editor, name: str, text: str) -> list[str]:
    """Returns what is offered at the end of a text."""
    if name not in editor.texts:
        editor.open(name, text)
    else:
        editor.type(name, text)
    lines = text.split("\n")
    position = {"line": len(lines) - 1, "character": len(lines[-1])}
    params = {"textDocument": {"uri": editor.uri(name)}, "position": position}
    return [item["label"] for item in editor.request("textDocument/completion", params)["items"]]


def test_keys_and_tables_of_plc_toml(plain: Editor) -> None:
    assert {"board", "target", "device", "libraries"} <= set(labels(plain, "plc.toml", PLC + ""))
    assert labels(plain, "plc.toml", PLC + "boa") == ["board"]
    assert {"optimisation", "checks", "dialect"} <= set(labels(plain, "plc.toml", PLC + "[options]\n"))
    assert {"options", "information", "format"} <= set(labels(plain, "plc.toml", PLC + "["))


def test_values_of_plc_toml(plain: Editor) -> None:
    assert "cortex-m3" in labels(plain, "plc.toml", PLC + 'target = "')
    assert {"codesys", "twincat"} <= set(labels(plain, "plc.toml", PLC + "[options]\ndialect = "))
    assert "unused" in labels(plain, "plc.toml", PLC + '[options]\nno-warn = ["un')
    assert labels(plain, "plc.toml", PLC + "[options]\nwerror = ") == ["true", "false"]
    assert labels(plain, "plc.toml", 'sources = ["sr') == ["src"]


def test_mistakes_in_plc_toml_are_shown_while_typing(plain: Editor) -> None:
    plain.open("plc.toml", PLC + 'bord = "x"\n')
    (found,) = plain.expect("plc.toml", "there is no 'bord' here; did you mean board?")
    assert found["range"]["start"] == {"line": 1, "character": 0}
    plain.type("plc.toml", PLC)
    plain.expect("plc.toml")


def test_kinds_keys_and_variables_of_a_description(plain: Editor) -> None:
    assert {"gpio", "sim", "modbus"} <= set(labels(plain, "main.io.toml", "["))
    assert {"name", "in", "out"} <= set(labels(plain, "main.io.toml", "[[sim]]\n"))
    text = '[[sim]]\nname = "rack"\n[sim.in]\nlevel = '
    assert {"Main.n", "gCount"} <= set(labels(plain, "main.io.toml", text))


def test_mistakes_in_a_description_are_shown_while_typing(plain: Editor) -> None:
    plain.open("main.io.toml", "[[simm]]\n")
    plain.expect("main.io.toml", "there is no 'simm' here; did you mean sim?")


def test_device_toml(plain: Editor) -> None:
    assert {"vendor", "target", "limits"} <= set(labels(plain, "device.toml", 'name = "IO"\n'))
    plain.type("device.toml", 'name = "IO"\ntarget = "cortex"\n')
    plain.wait(lambda: "target" in str(plain.messages_of("device.toml")), "a message about the target")


def test_a_file_that_is_not_toml_gets_one_message(plain: Editor) -> None:
    plain.open("plc.toml", "sources = [\n")
    plain.wait(lambda: len(plain.messages_of("plc.toml")) == 1, "one message")
    plain.shut("plc.toml")
    plain.wait(lambda: not plain.messages_of("plc.toml"), "the file on disk counts again")
