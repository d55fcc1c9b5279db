"""The life of a program on a controller, through the real tool and the real runtime: build, flash, use, stop, reset."""

import json
import random

import pytest


def test_flash_starts_the_program_and_it_counts(tool, plcrt, counter, eventually):
    flashed = tool.ok("flash", "--port", plcrt.port, str(counter))
    assert flashed["bytes"] == counter.stat().st_size
    assert tool.ok("status", "--port", plcrt.port)["state"] == "run"
    assert eventually(lambda: tool.ok("read", "--port", plcrt.port, "Main.count")["values"]["Main.count"] > 3)


def test_status_of_an_empty_device_is_none(tool, plcrt):
    status = tool.ok("status", "--port", plcrt.port)
    assert status["state"] == "none" and status["exception"] is None


def test_no_start_leaves_the_program_stopped(tool, plcrt, counter):
    tool.ok("flash", "--port", plcrt.port, str(counter), "--no-start")
    assert tool.ok("status", "--port", plcrt.port)["state"] == "stop"
    values = tool.ok("read", "--port", plcrt.port, "Main.count", "Main.kept", "Main.name")["values"]
    assert values == {"Main.count": 0, "Main.kept": 7, "Main.name": "first"}


def test_written_values_are_read_back_and_used(tool, plcrt, counter, eventually):
    tool.ok("flash", "--port", plcrt.port, str(counter))
    tool.ok("write", "--port", plcrt.port, "Main.step=1000", "Main.name=second", "Main.elapsed=T#1h")
    values = tool.ok("read", "--port", plcrt.port, "Main.step", "Main.name")["values"]
    assert values == {"Main.step": 1000, "Main.name": "second"}
    assert eventually(lambda: tool.ok("read", "--port", plcrt.port, "Main.count")["values"]["Main.count"] > 5000)


def test_stop_stops_and_start_goes_on(tool, plcrt, counter, eventually):
    tool.ok("flash", "--port", plcrt.port, str(counter))
    count = lambda: tool.ok("read", "--port", plcrt.port, "Main.count")["values"]["Main.count"]  # noqa: E731
    assert eventually(lambda: count() > 0)
    tool.ok("stop", "--port", plcrt.port)
    stopped_at = count()
    assert count() == stopped_at
    tool.ok("start", "--port", plcrt.port)
    assert eventually(lambda: count() > stopped_at)


@pytest.mark.parametrize(
    ("option", "total", "state"), [("warm", "kept", "stop"), ("cold", 0, "stop"), ("origin", None, "none")]
)
def test_reset_keeps_what_it_should(tool, plcrt, counter, eventually, option, total, state):
    tool.ok("flash", "--port", plcrt.port, str(counter))
    read = lambda: tool.ok("read", "--port", plcrt.port, "Main.count", "Main.total")["values"]  # noqa: E731
    assert eventually(lambda: read()["Main.total"] > 0)
    tool.ok("stop", "--port", plcrt.port)
    before = read()
    tool.ok("reset", option, "--port", plcrt.port)
    assert tool.ok("status", "--port", plcrt.port)["state"] == state
    if total is not None:
        after = read()
        assert after["Main.count"] == 0
        assert after["Main.total"] == (before["Main.total"] if total == "kept" else total)


def test_flash_of_the_same_image_is_skipped(tool, plcrt, counter):
    assert tool.ok("flash", "--port", plcrt.port, str(counter))["skipped"] is False
    assert tool.ok("flash", "--port", plcrt.port, str(counter))["skipped"] is True


def test_watch_prints_the_samples_asked_for(tool, plcrt, counter):
    tool.ok("flash", "--port", plcrt.port, str(counter))
    done = tool("watch", "--port", plcrt.port, "Main.count", "--count", "3", "--interval", "0.1", "--json")
    counts = [json.loads(line)["values"]["Main.count"] for line in done.out.splitlines()]
    assert len(counts) == 3 and counts == sorted(counts)


def test_tasks_show_cycles_and_times(tool, plcrt, counter, eventually):
    tool.ok("flash", "--port", plcrt.port, str(counter))
    tasks = eventually(lambda: [t for t in tool.ok("tasks", "--port", plcrt.port)["tasks"] if t["cycles"] > 5])
    assert len(tasks) == 1
    assert tasks[0]["min_us"] <= tasks[0]["avg_us"] <= tasks[0]["max_us"]


def test_the_shell_stops_and_starts_the_program(tool, plcrt, counter):
    tool.ok("flash", "--port", plcrt.port, str(counter))
    answers = [
        tool.ok("shell", "--port", plcrt.port, command)["answer"]
        for command in ("applist", "stopprg", "getprgstat", "startprg", "getprgstat")
    ]
    assert answers == ["Application", "stopprg: done", "stop", "startprg: done", "run"]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("nix", "plctool: There is no such command; ? lists them.\n"),
        ("startprg now", "plctool: There is no such command; ? lists them.\n"),
        ("startprg", "plctool: There is no application on the device; flash one first.\n"),
    ],
)
def test_what_the_shell_refuses_is_an_error(tool, plcrt, words, message):
    done = tool("shell", "--port", plcrt.port, *words.split())
    assert (done.status, done.out, done.err) == (1, "", message)


def test_scan_finds_the_device(tool, plcrt, eventually):
    found = eventually(lambda: (done := tool("scan", "--port", plcrt.port, "--json")).status == 0 and done.json)
    assert len(found["devices"]) == 1


def test_reading_with_the_symbols_of_another_image_is_refused(tool, plcrt, counter):
    tool.ok("flash", "--port", plcrt.port, str(counter))
    other = tool.build("other", "PROGRAM Main VAR x : INT; END_VAR x := x + 1; END_PROGRAM")
    tool.ok("flash", "--port", plcrt.port, str(other))
    (tool.folder / "other.sym").unlink()
    for cached in (tool.folder / "cache").rglob("*.sym"):
        cached.unlink()
    done = tool("read", "--port", plcrt.port, "Main.count", "--json")
    assert done.status == 2 and "symbols" in done.json["error"]["message"]


def test_division_by_zero_is_reported_with_task_pou_file_and_line(tool, plcrt, eventually):
    text = "\n".join(
        (
            "PROGRAM Main",
            "VAR",
            "  a : INT := 5;",
            "  b : INT;",
            "  n : INT;",
            "END_VAR",
            "  n := n + 1;",
            "  IF n > 3 THEN",
            "    a := a / b;",
            "  END_IF;",
            "END_PROGRAM",
        )
    )
    image = tool.build("divide", text)
    tool.ok("flash", "--port", plcrt.port, str(image))
    status = eventually(lambda: (s := tool.ok("status", "--port", plcrt.port))["state"] == "exception" and s)
    exception = status["exception"]
    assert exception["name"] == "DIVIDEBYZERO" and exception["pou"] == "Main" and exception["line"] == 9
    assert exception["file"].endswith("divide.st") and exception["task"]
    assert tool("start", "--port", plcrt.port).status == 1  # reset first
    tool.ok("reset", "warm", "--port", plcrt.port)
    assert tool.ok("status", "--port", plcrt.port)["state"] == "stop"


def test_index_out_of_bounds_is_reported_with_its_value_and_the_bounds(tool, plcrt, eventually):
    text = "PROGRAM Main VAR list : ARRAY[1..4] OF INT; i : INT; END_VAR\ni := i + 1;\nlist[i] := i;\nEND_PROGRAM"
    tool.ok("flash", "--port", plcrt.port, str(tool.build("outside", text)))
    status = eventually(lambda: (s := tool.ok("status", "--port", plcrt.port))["state"] == "exception" and s)
    said = "the index of Main.list is 5, outside 1..4"
    assert status["exception"]["name"] == "ARRAYBOUNDS" and status["exception"]["detail"] == said
    entries = tool.ok("log", "--port", plcrt.port)["entries"]
    assert said in [entry.get("detail") for entry in entries]
    assert said in tool("status", "--port", plcrt.port).out and said in tool("log", "--port", plcrt.port).out


def test_endless_loop_is_broken_out_of_and_the_device_answers(tool, plcrt, eventually):
    text = """
    PROGRAM Main VAR n : DINT; END_VAR
    WHILE TRUE DO n := n + 1; END_WHILE;
    END_PROGRAM
    CONFIGURATION c RESOURCE r ON PLC
    TASK t(INTERVAL := T#10ms, PRIORITY := 1);
    PROGRAM Main WITH t : Main;
    END_RESOURCE END_CONFIGURATION
    """
    image = tool.build("endless", text)
    tool("flash", "--port", plcrt.port, str(image))
    status = eventually(lambda: (s := tool.ok("status", "--port", plcrt.port))["state"] == "exception" and s)
    assert status["exception"]["name"] == "WATCHDOG"


def random_program(seed: int) -> tuple[str, int]:
    """A program no test knows beforehand, and what its result must be after one cycle."""
    rng = random.Random(seed)
    value, lines = 0, []
    for _ in range(rng.randrange(20, 200)):
        op, number = rng.choice(["+", "-", "*", "XOR"]), rng.randrange(1, 1 << 31)
        value = {"+": value + number, "-": value - number, "*": value * number, "XOR": value ^ number}[op] % (1 << 32)
        lines.append(f"x := x {op} {number};")
    body = "\n".join(lines)
    declaration = "PROGRAM Main VAR x : UDINT; done : BOOL; END_VAR"
    return f"{declaration}\nIF NOT done THEN\n{body}\ndone := TRUE;\nEND_IF;\nEND_PROGRAM\n", value


@pytest.mark.parametrize("seed", range(3))
def test_random_programs_compute_the_right_value(tool, plcrt, eventually, seed):
    text, expected = random_program(random.randrange(1 << 30) + seed)
    image = tool.build("unknown", text)
    tool.ok("flash", "--port", plcrt.port, str(image))
    assert eventually(lambda: tool.ok("read", "--port", plcrt.port, "Main.done")["values"]["Main.done"]), text
    assert tool.ok("read", "--port", plcrt.port, "Main.x")["values"]["Main.x"] == expected, text


def test_bits_at_addresses_and_of_words_are_written_alone(tool, plcrt, eventually):
    text = """
    PROGRAM Main
    VAR
        a AT %MX4.0 : BOOL; b AT %MX4.3 : BOOL; all AT %MB4 : BYTE := 16#F0;
        word : WORD := 16#0101; same : BYTE;
    END_VAR
    same := all;
    END_PROGRAM
    """
    tool.ok("flash", "--port", plcrt.port, str(tool.build("bits", text)))
    tool.ok("write", "--port", plcrt.port, "Main.a=TRUE", "Main.b=TRUE", "Main.word.1=TRUE", "Main.word.8=FALSE")
    values = tool.ok("read", "--port", plcrt.port, "Main.a", "Main.b", "Main.word", "Main.all")["values"]
    assert values == {"Main.a": True, "Main.b": True, "Main.word": 3, "Main.all": 0xF9}
