"""Requests of browsers and the replies, hostile ones included."""

from __future__ import annotations

import json
from collections.abc import Iterator

import pytest
from conftest import Browser, Page
from websockets.exceptions import ConnectionClosed

from plctool.testing.waiting import PATIENCE


def labels(reply: dict) -> list[str]:
    return [row["label"] for row in reply["result"]["rows"]]


@pytest.fixture(autouse=True)
def as_before(browser: Browser) -> Iterator[None]:
    yield
    browser.ask("unforce_all")
    browser.ask("write", name="Main.still", text="5")


def test_messages_on_loopback_are_not_compressed(page: Page) -> None:
    with page.open(compression="deflate") as socket:
        assert socket.protocol.extensions == []


def test_the_tree_has_programs_variables_members_and_elements(browser: Browser) -> None:
    assert labels(browser.ask("children", path="", start=0)) == ["LIMIT", "Main"]
    rows = {row["label"]: row for row in browser.ask("children", path="Main", start=0)["result"]["rows"]}
    assert (rows["n"]["type"], rows["n"]["opens"], rows["n"]["write"], rows["n"]["plot"]) == ("DINT", False, True, True)
    assert (rows["text"]["force"], rows["text"]["plot"]) == (False, False)
    assert rows["mode"]["choices"] == ["Off", "Automatic", "Manual"]
    assert (rows["point"]["opens"], rows["point"]["value"]) == (True, False)
    assert labels(browser.ask("children", path="Main.point", start=0)) == ["x", "y"]
    assert labels(browser.ask("children", path="Main.next", start=0)) == ["^"]
    constant = browser.ask("children", path="", start=0)["result"]["rows"][0]
    assert (constant["value"], constant["write"]) == (True, False)


def test_long_arrays_come_in_parts(browser: Browser) -> None:
    first = browser.ask("children", path="Main.list", start=0)
    assert (labels(first)[0], labels(first)[-1], first["result"]["more"]) == ("[1]", "[200]", True)
    last = browser.ask("children", path="Main.list", start=800)
    assert (labels(last)[0], labels(last)[-1], last["result"]["more"]) == ("[801]", "[1000]", False)
    assert labels(browser.ask("children", path="Main.list", start=5000)) == []


def test_a_search_finds_all_words_in_any_case(browser: Browser) -> None:
    assert labels(browser.ask("search", text="main POINT x")) == ["Main.point.x"]
    assert labels(browser.ask("search", text="<b>*?[")) == []


def test_values_come_with_their_numbers_and_then_only_changes(browser: Browser) -> None:
    browser.ask("show", names=["Main.n", "Main.still", "Main.mode", "Main.text"], views=[])
    browser.until(lambda b: len(b.values) == 4)
    assert browser.values["Main.still"] == ["5", False, 5, ""]
    assert browser.values["Main.mode"][0] == "Automatic"
    assert browser.values["Main.text"] == ["'<b>bold</b>'", False, None, ""]
    first = browser.values["Main.n"][2]
    for _ in range(3):
        while (message := browser.take())["is"] != "values":
            pass
        assert set(message["content"]) == {"Main.n"}
    assert browser.values["Main.n"][2] > first


def test_two_browsers_each_get_what_they_show(page: Page, browser: Browser) -> None:
    other = Browser(page)
    with other.socket:
        other.ready().ask("show", names=["Main.still"], views=[])
        browser.ask("show", names=["Main.lamp"], views=[])
        other.until(lambda b: b.values)
        browser.until(lambda b: b.values)
        assert (list(other.values), list(browser.values)) == (["Main.still"], ["Main.lamp"])


def test_a_written_value_is_shown(browser: Browser) -> None:
    browser.ask("show", names=["Main.still", "Main.mode"], views=[])
    assert browser.ask("write", name="Main.still", text="77").get("error") is None
    assert browser.ask("write", name="Main.mode", text="Manual").get("error") is None
    browser.until(lambda b: b.values.get("Main.still", [0])[0] == "77" and b.values["Main.mode"][0] == "Manual")


def test_a_forced_value_is_marked_until_it_is_not(browser: Browser) -> None:
    browser.ask("show", names=["Main.still"], views=[])
    assert "error" not in browser.ask("force", name="Main.still", text="9")
    browser.until(lambda b: b.values.get("Main.still") == ["9", True, 9, ""])
    browser.until(lambda b: b.topics["status"]["forced"] == ["Main.still"])
    assert "error" not in browser.ask("unforce", name="Main.still")
    browser.until(lambda b: b.values["Main.still"][1] is False)
    browser.until(lambda b: b.topics["status"]["forced"] == [])


@pytest.mark.parametrize(
    ("verb", "fields", "words"),
    [
        ("write", {"name": "Main.nothing", "text": "1"}, "There is no variable Main.nothing."),
        ("write", {"name": "Main.still", "text": "40000"}, "40000"),
        ("write", {"name": "Main.still", "text": "<b>"}, "<b>"),
        ("write", {"name": "LIMIT", "text": "1"}, "LIMIT is a constant or a READ_ONLY access and cannot be written."),
        ("force", {"name": "Main.text", "text": "'x'"}, "Main.text is a string, which cannot be forced; write it."),
        ("force", {"name": "Main.point", "text": "(x := 1)"}, "force its parts by their names"),
        ("unforce", {"name": "Main.lamp"}, "Main.lamp is not forced"),
        ("children", {"path": "Main.nothing", "start": 0}, "There is no variable Main.nothing."),
        ("start", {}, ""),
    ],
)
def test_what_cannot_be_done_is_refused_in_words(browser: Browser, verb: str, fields: dict, words: str) -> None:
    reply = browser.ask(verb, **fields)
    assert words in reply.get("error", "" if not words else None)


@pytest.mark.parametrize(
    "message",
    [
        "", "nonsense", "[]", "null", "1", "[" * 20000, '{"do": "run"}', '{"do": ["show"]}', "{}",
        '{"do": "show", "names": "Main.n"}', '{"do": "show", "names": [1]}', '{"do": "show", "views": ["shell"]}',
        json.dumps({"do": "show", "names": ["Main.n"] * 401}), json.dumps({"do": "search", "text": "x" * 1001}),
        '{"do": "write", "name": "Main.n"}', '{"do": "write", "name": null, "text": "1"}',
        '{"do": "children", "path": "", "start": -1}', '{"do": "children", "path": "", "start": 1e9}',
        '{"do": "children", "path": "", "start": true}', '{"do": "start", "id": {}}', '{"do": "start", "id": -1}',
        '{"do": "search", "text": "\\ud800"}' + " ",
    ],
)  # fmt: skip
def test_hostile_messages_get_a_sentence_and_do_no_harm(browser: Browser, message: str) -> None:
    browser.socket.send(message)
    while (reply := browser.take())["is"] != "reply":
        pass
    assert reply.get("error", "a search finds nothing") != ""
    assert labels(browser.ask("children", path="Main.point", start=0)) == ["x", "y"]


def test_too_long_messages_and_bytes_end_only_their_own_connection(page: Page, browser: Browser) -> None:
    for message in ("x" * (1 << 20), b"\x00\xff"):
        other = Browser(page)
        with other.socket, pytest.raises(ConnectionClosed):
            other.socket.send(message)
            while True:
                other.take()
    assert "result" in browser.ask("search", text="lamp")


def test_names_that_have_no_value_spoil_no_others(browser: Browser) -> None:
    names = ["Main.still", "%MW9999", "Main.point", "Main.nothing", "Main.list[5000]", "<b>", ""]
    browser.ask("show", names=names, views=[])
    browser.until(lambda b: len(b.values) == len(names))
    assert browser.values["Main.still"][0] == "5"
    assert browser.values["%MW9999"][3] == "The page shows declared variables, not addresses."
    assert all(browser.values[name][3] for name in names[2:])


def test_tasks_log_and_channels_come_when_they_are_shown(browser: Browser) -> None:
    assert "tasks" not in browser.topics
    browser.ask("show", names=[], views=["tasks", "log", "io"])
    browser.until(lambda b: {"tasks", "log", "io"} <= set(b.topics))
    assert [task["name"] for task in browser.topics["tasks"]] == ["Fast"]
    assert browser.topics["log"][-1]["text"]
    assert browser.topics["io"] == {"devices": [], "channels": []}


def test_the_program_stops_and_starts(browser: Browser) -> None:
    browser.ask("stop")
    browser.until(lambda b: b.topics["status"]["state"] == "stop")
    browser.ask("start")
    browser.until(lambda b: b.topics["status"]["state"] == "run")


def test_an_exception_comes_with_its_line_of_source(browser: Browser) -> None:
    browser.ask("write", name="Main.divisor", text="0")
    browser.until(lambda b: b.topics["status"]["exception"])
    exception = browser.topics["status"]["exception"]
    assert (exception["task"], exception["file"]) == ("Fast", "app.st")
    line = next(line for line in exception["source"] if line["line"] == exception["line"])
    assert line["text"] == "ratio := 100 / divisor;"
    assert "error" in browser.ask("start")
    assert "error" not in browser.ask("reset")
    assert "error" not in browser.ask("start")
    browser.until(lambda b: b.topics["status"]["state"] == "run")


def test_a_browser_that_leaves_at_any_time_does_no_harm(page: Page, browser: Browser) -> None:
    for message in (
        '{"do": "show", "names": ["Main.n"], "views": ["log"]}',
        '{"do": "write", "name": "Main.n", "text": "1"}',
    ):
        with page.open() as one:
            one.send(message)
    assert "result" in browser.ask("search", text="lamp")
    assert browser.socket.ping().wait(PATIENCE)
