"""How quickly the language server answers in a project of 10 000 lines in 100 files."""

from __future__ import annotations

import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from compiling import NETWORKS

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "lsp"))

from editor import Editor, Json

BLOCKS = 98
FILE = "Block50.st"
KEYS = 40
EDITS = 400  # before memory is measured; the figure does not grow after that
BURST = 10


def project(folder: Path) -> None:
    """Blocks of 100 lines that call each other, types, a global variable, and Main."""
    names = {prefix: ", ".join(f"{prefix}{x}" for x in range(40)) for prefix in ("in", "m", "n", "r")}
    for n in range(BLOCKS):
        body: list[str] = []
        while len(body) < 86:
            k = len(body)
            network = NETWORKS[k % len(NETWORKS)]
            body += network.format(k=k % 40, a=k * 7 % 40, b=k % 32, c=k * 3 % 40, d=k * 11 % 40).split("\n")
        chained = n % 7
        use = f"   other : Block{n - 1};\n" if chained else ""
        call = "other(in0 := in1, in1 := m3);\nIF other.m0 THEN n1 := 3; END_IF;\n" if chained else ""
        (folder / f"Block{n}.st").write_text(
            f"(* A block. *)\nFUNCTION_BLOCK Block{n}\nVAR_INPUT\n    {names['in']} : BOOL; // inputs\nEND_VAR\n"
            f"VAR_OUTPUT {names['m']} : BOOL; END_VAR\nVAR\n    {names['n']} : INT; {names['r']} : REAL;\n"
            f"   j : INT; a : ARRAY[0..9] OF DINT; mode : Mode; t : TON;\n{use}END_VAR\n"
            f"t(IN := in0, PT := T#{n}ms);\n{call}" + "\n".join(body) + "\nEND_FUNCTION_BLOCK\n"
        )
    (folder / "types.st").write_text(
        "TYPE Mode : (Off, Slow, Fast); END_TYPE\nVAR_GLOBAL\n   gCount : DINT;\nEND_VAR\n"
    )
    ends = [n for n in range(BLOCKS) if n % 7 == 6 or n == BLOCKS - 1]
    declared = "".join(f"b{n} : Block{n};\n" for n in ends)
    calls = "".join(f"b{n}(in0 := TRUE);\n" for n in ends)
    (folder / "main.st").write_text(
        f"PROGRAM Main\nVAR\n{declared}END_VAR\n{calls}gCount := gCount + 1;\nEND_PROGRAM\n"
    )


class Session:
    """A server that works on the project; times are milliseconds."""

    def __init__(self, folder: Path, **settings: Json) -> None:
        begin = time.perf_counter()
        self.editor = Editor(folder, settings={"delay": 50} | settings)
        self.initialize = time.perf_counter() - begin
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
        line("start: reply to initialize", f"{session.initialize:.2f} s", "goal 1.5 s")
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
