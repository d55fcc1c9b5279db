"""Puts images that the compiler makes into the corpus of the loader."""

from __future__ import annotations

import platform
import tempfile
from pathlib import Path

from plctool.compiler import compile_sources

CORPUS = Path(__file__).parent / "corpus" / "loader"

PROGRAMS = {
    "smallest": "PROGRAM Main VAR n : INT; END_VAR n := n + 1; END_PROGRAM",
    "retain": """
        PROGRAM Main VAR n : INT; END_VAR VAR RETAIN a : DINT; b : STRING(20); c : ARRAY[0..9] OF REAL; END_VAR
        n := n + 1; a := a + n; b := 'kept'; c[3] := 1.5; END_PROGRAM""",
    "externals": """
        PROGRAM Main VAR x : REAL; y : LREAL; END_VAR
        x := SIN(x) + EXP(x); y := ATAN(y) / LOG(y + 1.0); END_PROGRAM""",
    "tasks": """
        VAR_GLOBAL go : BOOL; in AT %IX0.0 : BOOL; out AT %QW2 : WORD; flag AT %MX1.1 : BOOL; END_VAR
        PROGRAM A VAR n : DINT; END_VAR n := n + 1; go := NOT go; out := DINT_TO_WORD(n); END_PROGRAM
        PROGRAM B VAR n : DINT; END_VAR n := n + 1; flag := in; END_PROGRAM
        CONFIGURATION C RESOURCE R ON PLC
            TASK Fast(INTERVAL := T#1ms, PRIORITY := 1, WATCHDOG := T#5ms, SENSITIVITY := 3);
            TASK OnEdge(SINGLE := go, PRIORITY := 2);
            TASK Free(PRIORITY := 9);
            PROGRAM P1 WITH Fast : A; PROGRAM P2 WITH OnEdge : B; PROGRAM P3 WITH Free : B;
        END_RESOURCE END_CONFIGURATION""",
    "blocks": """
        FUNCTION_BLOCK F VAR n : DINT; END_VAR
        METHOD FB_Init : BOOL VAR_INPUT bInitRetains : BOOL; bInCopyCode : BOOL; END_VAR n := 3; END_METHOD
        METHOD FB_Exit : BOOL VAR_INPUT bInCopyCode : BOOL; END_VAR n := 0; END_METHOD
        END_FUNCTION_BLOCK
        PROGRAM Main VAR f : F; t : TON; s : STRING := 'abc'; END_VAR
        t(IN := NOT t.Q, PT := T#1s); s := CONCAT(s, 'd'); END_PROGRAM""",
}


def main() -> None:
    CORPUS.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        for name, text in PROGRAMS.items():
            source = Path(folder) / f"{name}.st"
            source.write_text(text)
            image = compile_sources([source], target=f"{platform.machine()}-linux").image
            (CORPUS / name).write_bytes(image)
            print(f"{name}: {len(image)} bytes")


if __name__ == "__main__":
    main()
