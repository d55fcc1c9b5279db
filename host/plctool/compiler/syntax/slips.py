"""What people write that is no Structured Text, or none for this compiler, and what to write instead.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import re
from dataclasses import dataclass

TYPESET = {
    "≤": ("OP", "<=", "less or equal is written <=, not ≤"),
    "≥": ("OP", ">=", "greater or equal is written >=, not ≥"),
    "≠": ("OP", "<>", "unequal is written <>, not ≠"),
    "×": ("OP", "*", "a product is written *, not ×"),
    "·": ("OP", "*", "a product is written *, not ·"),
    "÷": ("OP", "/", "a division is written /, not ÷"),
    **dict.fromkeys("−–—", ("SIGN", "-", "minus is the - of the keyboard; this is a longer dash")),
}
"""Signs of text processors: the terminal and text they stand for, and what to say."""

QUOTED = """[“”„‘’‚][^“”„‘’‚'"$\\n]*[“”‘’]"""
"""The pattern of a string between their quotes."""

SIGNS = {
    "==": ("EQ", "=", "a comparison is written =, an assignment :=; there is no =="),
    "!=": ("OP", "<>", "unequal is written <>, not !="),
    "&&": ("OP", "AND", "and is written AND, not &&"),
    "||": ("OP", "OR", "or is written OR, not ||"),
    "|": ("OP", "OR", "or is written OR, not |"),
    "!": ("NOT", "NOT", "not is written NOT, not !"),
    "~": ("NOT", "NOT", "not is written NOT, not ~"),
    "%": ("OP", "MOD", "a remainder is written MOD, not %"),
    **TYPESET,
}
"""Operators of other languages, and these, alike."""

UNITS = "ms|us|ns|s|m|h|d"
"""The pattern of a unit of a duration."""

CUT_DURATION = re.compile(rf"[ \t]+(?:{UNITS})\b|,\d+(?:{UNITS})\b|:\d", re.IGNORECASE)
"""The pattern of what follows a duration that ends too early. No such text is a program, so one error is enough."""

COMMA = "a duration is written with a point: T#{number}.{part}"
QUOTE = "a quote within a string is written $'"
CHOICE = "a choice between two values is written SEL(condition, value_if_false, value_if_true)"
CHARACTERS = {"#": "a comment is written // or (* *)", "?": CHOICE}
"""Characters that begin nothing, and what may have been meant."""

BEGINNINGS = (
    (re.compile(r"#define\b", re.IGNORECASE), "constants are declared in VAR CONSTANT ... END_VAR"),
    (re.compile(r"#include\b", re.IGNORECASE), "all sources of a program are compiled together; leave it out"),
    (re.compile(r"#[A-Za-z_]"), "a name is written without it; a comment is // or (* *)"),
    (re.compile(r"%E[XBWDL]?\d", re.IGNORECASE), "inputs (E) are at %I"),
    (re.compile(r"%A[XBWDL]?\d", re.IGNORECASE), "outputs (A) are at %Q"),
    (re.compile(r"(?<=\d)%"), "50 % is written 0.5"),
    (re.compile(r"\\'"), QUOTE),
    (re.compile(r"@\s*%"), "a variable at an address is written name AT %IX0.0 : BOOL;"),
)
"""Beginnings of what is no token, and what may have been meant."""

DECLARED = "variables are declared in VAR ... END_VAR before the statements: {name} : {type};"
"""What to say of a declaration among statements."""

WORDS = {
    **dict.fromkeys(("ELSEIF", "ELIF", "ELSE_IF"), "ELSIF"),
    **dict.fromkeys(("VAR_INOUT", "VARINOUT", "VAR_INPUT_OUTPUT"), "VAR_IN_OUT"),
    **dict.fromkeys(("VARINPUT", "VAR_IN", "VAR_INPUTS"), "VAR_INPUT"),
    **dict.fromkeys(("VAROUTPUT", "VAR_OUT", "VAR_OUTPUTS"), "VAR_OUTPUT"),
    **dict.fromkeys(("VARGLOBAL", "GLOBAL_VAR", "VAR_GLOBALS"), "VAR_GLOBAL"),
    **dict.fromkeys(("VAR_CONSTANT", "VAR_CONST"), "VAR CONSTANT"),
    **dict.fromkeys(("EXTEND", "INHERITS"), "EXTENDS"),
    "VARTEMP": "VAR_TEMP",
    "VAR_STATIC": "VAR_STAT",
    "VAR_RETAIN": "VAR RETAIN",
    "FUNCTIONBLOCK": "FUNCTION_BLOCK",
    **dict.fromkeys(("ENDFUNCTIONBLOCK", "ENDFUNCTION_BLOCK", "END_FUNCTIONBLOCK"), "END_FUNCTION_BLOCK"),
    **{
        f"END{word}": f"END_{word}"
        for word in (
            "IF",
            "CASE",
            "FOR",
            "WHILE",
            "REPEAT",
            "VAR",
            "STRUCT",
            "TYPE",
            "PROGRAM",
            "FUNCTION",
            "CONFIGURATION",
        )
    },
}
"""Keywords spelled wrongly, and rightly."""

TYPES = {
    "BOOLEAN": "BOOL", "FLOAT": "REAL", "FLOAT32": "REAL", "FLOAT64": "LREAL", "DOUBLE": "LREAL", "SINGLE": "REAL",
    "INTEGER": "DINT", "LONG": "DINT", "SHORT": "INT", "INT8": "SINT", "INT16": "INT", "INT32": "DINT", "INT64": "LINT",
    "UINT8": "USINT", "UINT16": "UINT", "UINT32": "UDINT", "UINT64": "ULINT", "INT8_T": "SINT", "INT16_T": "INT",
    "INT32_T": "DINT", "INT64_T": "LINT", "UINT8_T": "USINT", "UINT16_T": "UINT", "UINT32_T": "UDINT",
    "UINT64_T": "ULINT", "STR": "STRING", "TIMER": "TON", "COUNTER": "CTU",
}  # fmt: skip
"""Types of other languages."""

NAMES = {
    "DEFAULT": "the branch for all other values is ELSE",
    "SELF": "write THIS^",
    "BREAK": "EXIT leaves a loop, and a branch of a CASE ends by itself",
    **dict.fromkeys(("NULLPTR", "NIL", "NONE"), "write NULL"),
    "__CURRENTTASK": "a program does not know its task; give the PROGRAM an input, and each instance its number",
    "PI": "write LREAL#3.141592653589793, or declare a constant",
    "ON": "write TRUE", "OFF": "write FALSE", "YES": "write TRUE", "NO": "write FALSE",
}  # fmt: skip
"""Names of other languages."""

FUNCTIONS = {
    **dict.fromkeys(("STRCMP", "EQUALS"), "strings are compared with ="),
    "ASSERT": "in a TEST write ASSERT_TRUE",
    **dict.fromkeys(("FORCE", "UNFORCE"), "only a TEST forces variables"),
    "STRLEN": "write LEN", "STRCAT": "write CONCAT", "STRCPY": "strings are assigned with :=", "STRSTR": "write FIND",
    "SQR": "a square is written a * a; SQRT is the root",
    **dict.fromkeys(("RESET", "CLEAR"), "a BOOL is reset by name := FALSE;"), "SET": "a BOOL is set by name := TRUE;",
    "POWER": "write a ** b", **dict.fromkeys(("STR", "TOSTRING"), "write TO_STRING"),
    "SUBSTR": "write MID", "ATOI": "write STRING_TO_INT", "ATOF": "write STRING_TO_REAL", "POW": "write a ** b",
    "ROUND": "write REAL_TO_INT, which rounds", "MALLOC": "nothing is allocated while a program runs",
    **dict.fromkeys(("PRINTF", "PRINT"), "a program prints nothing; write it into a STRING and watch it"),
    **dict.fromkeys(("SLEEP", "DELAY", "WAIT"), "a program never waits; call a TON in each cycle"),
}  # fmt: skip
"""Functions of other languages."""


@dataclass(frozen=True)
class Refusal:
    """What is said of a word, and up to where the text is left out: a word or sign that is left out as well, or an end
    of a unit, which is not."""

    message: str
    end: str = ""


_GRAPHIC = "this is a diagram; only Structured Text can be compiled"

REFUSED = {
    "VIRTUAL": Refusal("every method can be overridden; leave VIRTUAL out"),
    "_LD_BODY": Refusal(_GRAPHIC),
    "_FBD_BODY": Refusal(_GRAPHIC),
    "_CFC_BODY": Refusal(_GRAPHIC),
    "_SFC_BODY": Refusal(_GRAPHIC),
}
"""Words that begin what this compiler leaves out."""

REFUSED_CALLS = {
    "BITADR": "a bit has no address of its own here; use the variable itself, or ADR and a bit number",
    **dict.fromkeys(
        ("__XADD", "__COMPARE_AND_SWAP", "TEST_AND_SET", "TESTANDSET", "SYSCPUTESTANDSET"),
        "there is no reading and writing in one step that other tasks cannot interrupt; let one task alone write it",
    ),
    "INI": "an instance gets its initial values when the program starts; assign them one by one",
}
"""Functions of other systems that this one has not, and why."""
