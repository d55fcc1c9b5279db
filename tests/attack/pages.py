"""Hostile browsers on the page of plctool: other origins and hosts, a thousand sockets, senseless messages, markup."""

from __future__ import annotations

import json
import random
import socket
import string
import sys
from collections.abc import Callable
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from campaign import NEWEST, Campaign, Case, Fallen
from look import expect_running
from process import Runtime, eventually
from simulated import PLCRT

sys.path.append(str(Path(__file__).resolve().parents[1]))

from page_browsers import Browser, Page
from websockets.exceptions import InvalidStatus, WebSocketException

COUNT = 40
NAME = "good1"
SOCKETS = 1000
HELD = 300  # of them at a time: this process may have few files open
MARKUP = (
    "<script>alert(1)</script>", "'\"><img src=x onerror=alert(1)>", "{{7*7}}", "../../etc/passwd", "\x00", "\u202e",
)  # fmt: skip
VERBS = ("show", "children", "search", "write", "force", "unforce", "unforce_all", "stop", "reset", "operate")
FIELDS = ("name", "names", "text", "path", "start", "views", "element")


@dataclass(frozen=True)
class Attack:
    seed: int
    kind: str


def _other_pages(page: Page, chooser: random.Random) -> None:
    """Requests as the browser of this user sends them for a page of another origin, or by another name."""
    for origin in (
        f"http://evil.example:{page.port}",
        "null",
        f"http://127.0.0.1:{page.port - 1}",
        "".join(MARKUP[:2]),
    ):
        if page.get(page.path, Origin=origin).status != 403:
            raise Fallen(f"a page of {origin} was served")
        with suppress(InvalidStatus), page.open(origin=origin):
            raise Fallen(f"a page of {origin} got the values")
    for host in ("evil.example", f"evil.example:{page.port}", f"127.0.0.1.evil.example:{page.port}"):
        if page.get(page.path, Host=host).status != 403:
            raise Fallen(f"the page was served by the name {host}")
    for _ in range(50):
        token = "".join(chooser.choices(string.ascii_letters + string.digits, k=len(page.path) - 2))
        if page.get(f"/{token}/").status != 403:
            raise Fallen("the page was served without its token")


def _sockets(page: Page, chooser: random.Random) -> None:
    """Connections that say nothing, or something that is no request; some of them ask for a websocket and go."""
    held: list[socket.socket] = []
    with suppress(OSError):  # the server may refuse them
        for _ in range(SOCKETS):
            one = socket.create_connection(("127.0.0.1", page.port), timeout=10)
            held.append(one)
            with suppress(OSError):
                one.sendall(chooser.choice((b"", chooser.randbytes(200), b"GET / HTTP/1.1\r\nX: " + b"a" * 9000)))
            if len(held) == HELD:
                held.pop(0).close()
    for one in held:
        one.close()


def _junk(chooser: random.Random, depth: int = 0) -> Any:
    kinds = 5 if depth > 3 else 7
    kind = chooser.randrange(kinds)
    if kind == 0:
        return chooser.choice((None, True, -1, 1 << 70, 1e308, 0))
    if kind < 3:
        return chooser.choice((*MARKUP, "Main.me", "Main.kept[1]", "Main.kept[99999999999]", "Main.me^^^", "a." * 5000))
    if kind < 5:
        return chooser.choice(VERBS)
    if kind == 5:
        return [_junk(chooser, depth + 1) for _ in range(chooser.randrange(6))]
    return {str(_junk(chooser, 9)): _junk(chooser, depth + 1) for _ in range(chooser.randrange(6))}


def _messages(page: Page, chooser: random.Random) -> None:
    """Messages that the script of the page does not send, from browsers that end in the middle."""
    for _ in range(40):
        with suppress(WebSocketException, OSError, EOFError), page.open() as browser:
            for _ in range(30):
                message = {"do": chooser.choice((*VERBS, _junk(chooser, 9))), "id": chooser.randrange(9)}
                message |= {field: _junk(chooser) for field in chooser.sample(FIELDS, 5)}
                text = json.dumps(message)
                browser.send(chooser.choice((text, text[: chooser.randrange(len(text))], chooser.randbytes(50))))


def _names(page: Page, chooser: random.Random) -> None:
    """Names and values with markup in each request: each is answered in words."""
    browser = Browser(page)
    with browser.socket:
        browser.ready()
        for verb in ("write", "force", "unforce"):
            for text in MARKUP:
                name = chooser.choice((text, "Main.me"))
                reply = browser.ask(verb, name=name, text=text)
                if not isinstance(reply.get("error"), str):
                    raise Fallen(f"{verb} of {name!r} by {text!r} is answered by {reply}")


KINDS: dict[str, Callable[[Page, random.Random], None]] = {
    "asks as a page of another origin": _other_pages,
    "opens 1 000 sockets": _sockets,
    "sends what is no request": _messages,
    "names what has markup": _names,
}


class Pages(Campaign):
    name = "page"
    promise = "the page serves its own browser, the program runs, and what was forced is listed"
    short = 2

    def cases(self) -> list[Case]:
        chooser = random.Random(self.shop.seed)
        kinds = list(KINDS)
        attacks = [Attack(chooser.randrange(1 << 30), kinds[number % len(kinds)]) for number in range(COUNT)]
        return [Case(f"a browser with seed {a.seed} that {a.kind}", a) for a in attacks]

    def run(self, case: Case) -> str:
        attack: Attack = case.data
        flash = self.shop.folder / f"page-{attack.seed}.flash"
        flash.write_bytes(self.shop.history(PLCRT, NAME))
        try:
            with Runtime(self.shop, flash) as runtime, ExitStack() as ending:
                runtime.power_on()
                runtime.look("before the attack")
                page = Page(self.shop.folder, "--port", runtime.port, "--symbols", str(self.shop[NAME].symbols))
                ending.callback(page.process.kill)
                KINDS[attack.kind](page, random.Random(attack.seed))
                self._check(page)
                if page.end() != 0:
                    raise Fallen("plctool ui ended with an error")
                runtime.ask(lambda plc: plc.unforce(), "while forces were ended")
                runtime.ask(lambda plc: (plc.reset("cold"), plc.start()), "while the program was reset")
                expect_running(runtime.look("after the attack"), self.shop, (NAME,))
                return NEWEST
        finally:
            flash.unlink()

    def _check(self, page: Page) -> None:
        if page.process.poll() is not None:
            raise Fallen(f"plctool ui has ended: {page.process.communicate()[1][-500:]}")

        def is_served() -> bool | None:
            try:
                return True if page.get(page.path).status == 200 else None
            except OSError:
                return None

        eventually(is_served, "the page is not served any more")

        def has_values() -> bool | None:
            try:
                browser = Browser(page)
                with browser.socket:
                    browser.until(lambda b: "status" in b.topics)
                return True
            except (OSError, WebSocketException, EOFError):
                return None

        eventually(has_values, "a browser of the page gets no values any more")
