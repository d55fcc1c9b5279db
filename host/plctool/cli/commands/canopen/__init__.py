"""`plctool canopen`: CANopen devices on a bus, and EDS files. Each module has some of its actions."""

from __future__ import annotations

from plctool.cli.commands.canopen.eds import add_check, add_eds_of_image
from plctool.cli.commands.canopen.exchange import add_export, add_import
from plctool.cli.commands.canopen.lss import add_lss
from plctool.cli.commands.canopen.messages import add_emcy, add_pdo
from plctool.cli.commands.canopen.nodes import add_nmt, add_scan
from plctool.cli.commands.canopen.objects import add_sdo, add_watch
from plctool.cli.commands.canopen.program import add_download
from plctool.cli.parser import Parser


def canopen_arguments(command: Parser) -> None:
    action = command.adder_of_actions()
    offline = (add_check, add_eds_of_image, add_export, add_import)
    for add in (*offline, add_scan, add_nmt, add_sdo, add_emcy, add_pdo, add_watch, add_lss, add_download):
        add(action)
