"""How quickly the language server answers in a project of 10 000 lines in 100 files."""

from __future__ import annotations

import os
import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from large_project import BLOCKS, project

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "lsp"))

from editor import Editor, Json

FILE = "Block50.st"
KEYS = 40
EDITS = 400  # before memory is measured; the figure does not grow after that
BURST = 10


class Session:
    """A server that works on the project; times are milliseconds."""

    def __init__(self, folder: Path, **settings: Json) -> None:
        begin = time.perf_counter()
        self.editor = Editor(folder, settings={"delay": 50} | settings)
        self.initialize, self.processor = time.perf_counter() - begin, self._processor_seconds()
        self.editor.open(FILE)
        self.editor.wait(lambda: bool(self.editor.messages_of(FILE)), "the first diagnostics")
        self.first = time.perf_counter() - begin
        self.editor.wait(lambda: len(self.editor.diagnostics) > BLOCKS - 2, "all diagnostics")
        self.text = self.editor.texts[FILE]

    def _typed(self, statement: str) -> str:
        return self.text.replace("t(IN := in0", f"{statement}\nt(IN := in0")

    def key(self, n: int, statement: str, expected: str) -> float:
        """Types a statement and waits for the diagnostic about it."""
        begin = time.perf_counter()
        self.editor.type(FILE, self._typed(statement.format(n=n)))
        wanted = expected.format(n=n)
        self.editor.wait(lambda: any(wanted in m for m in self.editor.messages_of(FILE)), wanted)
        return 1000 * (time.perf_counter() - begin)

    def request(self, statement: str, ask: Callable[[], object]) -> float:
        """Types a statement and asks at once."""
        self.editor.type(FILE, self._typed(statement))
        begin = time.perf_counter()
        assert ask()
        return 1000 * (time.perf_counter() - begin)

    def burst(self) -> float:
        """Types some letters at once, then asks for a hover."""
        begin = time.perf_counter()
        for n in range(BURST):
            self.editor.type(FILE, self._typed(f"n{'1' * n}"))
        assert self.editor.at("hover", FILE, "other(i", "n0")
        return 1000 * (time.perf_counter() - begin)

    def _processor_seconds(self) -> float:
        """The processor time that the server has taken, which does not grow with the load of the machine."""
        numbers = Path(f"/proc/{self.editor.process.pid}/stat").read_text().rpartition(")")[2].split()
        user, system = numbers[11:13]
        return (int(user) + int(system)) / os.sysconf("SC_CLK_TCK")

    def memory(self) -> float:
        """The megabytes that the server has in memory."""
        status = Path(f"/proc/{self.editor.process.pid}/status").read_text()
        return next(int(line.split()[1]) / 1024 for line in status.split("\n") if line.startswith("VmRSS"))


def spread(times: list[float]) -> str:
    return f"{statistics.median(times):.0f} / {sorted(times)[int(len(times) * 0.95)]:.0f} ms"


def report(line: Callable[..., None]) -> None:
    """Prints a row for each figure: median and the one that 95 % are below."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        project(folder)
        session = Session(folder)
        editor = session.editor
        line("start: reply to initialize", f"{session.initialize:.2f} s")
        line("start: processor time until that reply", f"{session.processor:.2f} s", "goal 1.5 s")
        line("start: first diagnostics", f"{session.first:.2f} s")
        keys = [session.key(n, "q{n} := 1;", "unknown name q{n}") for n in range(KEYS)]
        line("key to diagnostics, with a delay of 50 ms", spread(keys), "goal 200 ms")
        keys = []
        for n in range(KEYS // 4):
            session.key(n, "q{n} := 1;", "unknown name q{n}")
            keys.append(session.key(n, "n1 := (1;", "expected )"))
        line("the same for a syntax error", spread(keys), "goal 200 ms")
        asked = [session.request("other.", lambda: editor.labels(FILE, "\nother.")) for _ in range(KEYS)]
        line("completion of members", spread(asked), "goal 50 ms")
        asked = [session.request("n1 := ", lambda: editor.labels(FILE, "\nn1 := ")) for _ in range(KEYS)]
        line("completion of a value", spread(asked), "goal 50 ms")
        asked = [session.request("other(", lambda: editor.labels(FILE, "\nother(")) for _ in range(KEYS)]
        line("completion of arguments", spread(asked), "goal 50 ms")
        line(f"{BURST} keys at once, then a hover", spread([session.burst() for _ in range(KEYS // 4)]), "goal 100 ms")
        for n in range(EDITS):
            editor.type(FILE, session._typed(f"n{n % 40} := {n};"))
            if n % 20 == 0:
                editor.at("hover", FILE, "other(i", "n0")
                session.key(n, "q{n} := 1;", "unknown name q{n}")
        line(f"memory after {EDITS} edits", f"{session.memory():.0f} MB", "goal 300 MB")
        editor.close()


def main() -> None:
    report(lambda what, figure, beside="": print(f"  {what:<52}{figure:>14}  {beside}", flush=True))


if __name__ == "__main__":
    main()
