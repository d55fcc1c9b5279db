"""What plctool knows of boards without their firmware: all boards of this repository, with each configuration."""

from __future__ import annotations

import re
from pathlib import Path

from test_firmware_layers import FIRMWARE

from plctool.image.board import known_boards

BAREMETAL = FIRMWARE / "port/baremetal"
BOARDS = [path.parent for path in (BAREMETAL / "boards").glob("*/meson.build")]


def configurations(board: Path) -> set[str]:
    """Those that baremetal/meson.build makes of a board."""
    build = (BAREMETAL / "meson.build").read_text()
    match = re.search(r"configs = \[(.*?)\] \+ \(board_has_second_uart \? \[(.*?)\] : \[\]\)", build)
    assert match
    text = (board / "meson.build").read_text()
    own_can = {"can", "canopen", "canopen-manager"} if "board_can_sources = " in text else set()
    return own_can | set(
        re.findall(r"'([\w-]+)'", match[1] + (match[2] if "board_has_second_uart = true" in text else ""))
    )


def test_all_boards_are_known_with_their_configurations() -> None:
    known: dict[str, set[str]] = {}
    for board in known_boards():
        if board.config:
            known.setdefault(board.name, set()).add(board.config)
    names = {
        folder: re.search(r'BOARD_DEVICE_NAME "(.*)"', (folder / "rts_config_port.h").read_text()) for folder in BOARDS
    }
    assert known == {match[1]: configurations(folder) for folder, match in names.items() if match}
    assert len(known) == len(BOARDS) > 1
