"""A project of 10 000 lines in 100 files, for what measures the compiler and the language server."""

from __future__ import annotations

from pathlib import Path

BLOCKS = 98

NETWORKS = (
    "m{k} := (m{a} OR m{k}) AND NOT in{b};",
    "IF in{b} AND NOT m{a} THEN\n    n{c} := n{c} + {k};\nELSE\n    n{c} := n{d} - 1;\nEND_IF;",
    "r{c} := r{d} * 0.5 + INT_TO_REAL(n{c});",
    "CASE n{c} OF\n    0: n{c} := {k};\n    1..9: n{c} := n{d} / 3;\nELSE\n    n{c} := 0;\nEND_CASE;",
    "FOR j := 0 TO 9 DO\n    a[j] := a[j] + n{c};\nEND_FOR;",
)


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
