"""Makes the benchmark 'logic' in both languages: 200 networks of BOOL variables, each a statement of its own."""

from __future__ import annotations

import random

NETWORKS = 200
INPUTS = 32
_OPERATORS = {"and": ("AND", "&&"), "or": ("OR", "||"), "not": ("NOT ", "!"), "xor": ("XOR", "!=")}

_ST = """(* 200 networks of BOOL variables: latches, interlocks, two out of three, exclusive or. *)
PROGRAM Bench
VAR
    chk : DWORD;
    noise : DWORD := 16#9E3779B9;
    packed : DWORD;
    {variables} : BOOL;
END_VAR
noise := noise XOR SHL(noise, 13);
noise := noise XOR SHR(noise, 17);
noise := noise XOR SHL(noise, 5);
{inputs}
{networks}
packed := 0;
{results}
chk := ROL(chk, 1) XOR packed;
END_PROGRAM

CONFIGURATION Config
    RESOURCE Res ON PLC
        TASK Cycle(INTERVAL := T#1ms, PRIORITY := 1);
        PROGRAM Main WITH Cycle : Bench;
    END_RESOURCE
END_CONFIGURATION
"""

_C = """#include <stdbool.h>
#include <stdint.h>
#include <string.h>
uint32_t chk;
static struct {{ uint32_t noise; bool {variables}; }} v;
void scan_init(void) {{ memset(&v, 0, sizeof v); v.noise = 0x9E3779B9; chk = 0; }}
void scan(void)
{{
    uint32_t packed = 0;
    v.noise ^= v.noise << 13;
    v.noise ^= v.noise >> 17;
    v.noise ^= v.noise << 5;
    {inputs}
    {networks}
    {results}
    chk = (chk << 1 | chk >> 31) ^ packed;
}}
"""


def _network(kind: int, own: str, a: str, b: str, c: str) -> str:
    """An expression with {and}, {or}, {not}, {xor} for the operators."""
    return (
        f"({a} {{or}} {own}) {{and}} {{not}}{b}",  # latch
        f"{a} {{and}} {b} {{and}} {{not}}{c}",  # interlock
        f"({a} {{and}} {b}) {{or}} ({b} {{and}} {c}) {{or}} ({a} {{and}} {c})",  # two out of three
        f"({a} {{xor}} {b}) {{or}} ({c} {{and}} {{not}}{a})",
    )[kind]


def texts() -> tuple[str, str]:
    """The program in ST and its twin in C; the same in every run."""
    rng = random.Random("logic")
    inputs = [f"i{k}" for k in range(INPUTS)]
    outputs = [f"m{k}" for k in range(NETWORKS)]
    expressions = []
    for k, own in enumerate(outputs):
        a, b, c = rng.sample(inputs + outputs[:k], 3)
        expressions.append((own, _network(rng.randrange(4), own, a, b, c)))
    picked = [(f"m{k}", rng.getrandbits(32)) for k in range(0, NETWORKS, 8)]
    st_operators = {name: pair[0] for name, pair in _OPERATORS.items()}
    c_operators = {name: pair[1] for name, pair in _OPERATORS.items()}
    st = _ST.format(
        variables=", ".join(inputs + outputs),
        inputs="\n".join(f"i{k} := noise.{k};" for k in range(INPUTS)),
        networks="\n".join(f"{own} := {text.format(**st_operators)};" for own, text in expressions),
        results="\n".join(f"IF {name} THEN packed := packed XOR 16#{bits:08X}; END_IF;" for name, bits in picked),
    )
    qualified = {name: f"v.{name}" for name in inputs + outputs}
    c_networks = [(own, _qualify(text.format(**c_operators), qualified)) for own, text in expressions]
    c = _C.format(
        variables=", ".join(inputs + outputs),
        inputs="\n    ".join(f"v.i{k} = v.noise >> {k} & 1;" for k in range(INPUTS)),
        networks="\n    ".join(f"v.{own} = {text};" for own, text in c_networks),
        results="\n    ".join(f"if (v.{name}) packed ^= 0x{bits:08X}u;" for name, bits in picked),
    )
    return st, c


def _qualify(text: str, names: dict[str, str]) -> str:
    """Replaces whole words."""
    words = text.replace("(", "( ").replace(")", " )").replace("!", "! ").replace("! =", "!=").split(" ")
    return " ".join(names.get(word, word) for word in words)
