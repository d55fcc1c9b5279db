"""Mistakes that the text around a syntax error gives away, and what to write instead.

A parser knows what it expected; that `ARRAY[10]` was meant as ten elements, or `{1, 2}` as a list, it cannot know.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import re
from collections.abc import Callable

from plctool.compiler.syntax import slips
from plctool.compiler.syntax.plain_text import is_in_comment
from plctool.records import dataclass

_TYPE = (
    r"(?P<type>(?:STRING|WSTRING)(?:\s*[\[(]\s*\w+\s*[\])])?|BOOL|BYTE|[LD]?WORD|U?[SDL]?INT|L?REAL|L?TIME|L?DATE|L?TOD|L?DT|"
    r"W?CHAR|" + "|".join(slips.TYPES) + r")(?![\w#])"
)
_TYPE_FIRST = rf"(?:^|;|\bVAR)[ \t]*(?P<here>{_TYPE}[ \t]+(?P<name>[A-Za-z_]\w*)[ \t]*)(?=[;:\[,=])"
_UNIT = rf"[ \t]*(?P<unit>{slips.UNITS})\b"
_IN_VARIABLES = "a variable is declared with its name first: {name} : {type};"
_IN_BODY = slips.DECLARED
_TASKS = "tasks and what they run stand in CONFIGURATION C RESOURCE R ON PLC ... END_RESOURCE END_CONFIGURATION"
_TRY = "exceptions are caught by __TRY ... __CATCH(e) ... __ENDTRY"
_CHOICE = "a choice is written CASE a OF 1: ...; ELSE ...; END_CASE"
_CONSTANT = "constants are declared in VAR CONSTANT ... END_VAR"
_POINTER = "a pointer is declared POINTER TO {name}"
_NAME = r"[A-Za-z_]\w*"
_FAR = 1000  # characters of a line before and after a mistake that are looked at
_REPEAT = "a loop that tests at its end is written REPEAT ... UNTIL condition END_REPEAT"
_LABEL = "a branch has values or a range: 6..100: ...; for comparisons write IF ... ELSIF"
_RANGE = "a range of values is written {low}..{high}"
_LOOP = "a loop is written FOR i := 0 TO 9 DO ... END_FOR"
_VALUE = r"[A-Za-z_][\w.^]*(?:\[[^\]]*\])?"
_STRUCT = "a structure is declared TYPE {name} : STRUCT ... END_STRUCT; END_TYPE"
_INSTANCE = "an instance of a program is declared PROGRAM {instance} WITH {task} : {type};"
_ENDS = {"FI": "END_IF", "WEND": "END_WHILE", "ESAC": "END_CASE", "NEXT": "END_FOR"}
_NO_IMPORT = "all sources and libraries of a program are compiled together; nothing is imported"


@dataclass(frozen=True)
class _Hint:
    """`pattern` is looked for around an error, from the line of the last good word on. `at`: the group the error has to
    stand in; `where`: in a body, in a declaration, or both (""). `ends`: nothing of this statement can be read."""

    pattern: str
    message: str | Callable[[re.Match[str]], str]
    at: str = ""
    where: str = ""
    ends: bool = False


@dataclass(frozen=True)
class Said:
    """What to say at an offset, and whether the statement is left out."""

    offset: int
    message: str
    ends: bool


def _count(match: re.Match[str]) -> str:
    return f"an array has its first and its last index in brackets: ARRAY[0..{int(match['count']) - 1}] OF ..."


def _array(match: re.Match[str], element: str = "") -> str:
    of = element or match["type"]
    return f"an array is declared {match['name']} : ARRAY[0..{int(match['count']) - 1}] OF {of};"


def _list(match: re.Match[str]) -> str:
    values = ", ".join(part.strip() for part in match["values"].split(","))
    if ":=" in values:
        return f"the members of a structure are written in parentheses: ({values})"
    return f"the values of an array are written in brackets: [{values}]"


def _typed(message: str) -> Callable[[re.Match[str]], str]:
    """`message` with the name of the type as it is here."""
    return lambda m: message.format(name=m["name"], type=slips.TYPES.get(m["type"].upper(), m["type"]))


def _stepped(match: re.Match[str]) -> str:
    sign, name = match["sign"], match["name"]
    return f"there is no {sign}{sign}; write {name} := {name} {sign} 1"


def _member(match: re.Match[str]) -> str:
    kind, head = match["kind"].upper(), " ".join(match["head"].split())
    article = "an" if kind[0] in "AEIO" else "a"
    return f"{article} {kind} stands in its FUNCTION_BLOCK, or right after it without its name: {head} {match['name']}"


def _located(match: re.Match[str]) -> str:
    return f"AT comes after the name: {match['name']} AT {match['place']} : {match['type'].strip()};"


_HINTS = (
    _Hint(rf"^\s*PROGRAM\s+{_NAME}\s+(?P<here>WITH\s+{_NAME}\s*:\s*{_NAME})", _TASKS, "here",
          ends=True),
    _Hint(rf"^\s*(?P<head>(?P<kind>METHOD|PROPERTY|ACTION)\b(?:\s+(?:PUBLIC|PRIVATE|PROTECTED|INTERNAL|FINAL|ABSTRACT))*)"
          rf"\s+(?P<here>{_NAME}\.(?P<name>{_NAME})[^;\n]*\s*)", _member, "here", ends=True),
    _Hint(rf"(?:^|;)[ \t]*(?P<here>WITH\s+(?P<name>{_VALUE})[^;\n]*?\bDO\b\s*)",
          "there is no WITH; write the name in front of each member: {name}.x := ...", "here", "body"),
    _Hint(r"(?:^|;)[ \t]*(?P<here>END_WITH\b\s*)", "there is no WITH; leave out END_WITH", "here", "body"),
    _Hint(rf"^\s*TEST\s+(?P<here>(?P<name>{_NAME}))", "the name of a test is a text: TEST '{name}'", "here"),
    _Hint(r"(?:^|;)[ \t]*(?P<here>(?:TRY|CATCH|FINALLY|END_?TRY)\b(?!\s*(?:[-+:.,\[(^]|\d))[^;]*)", _TRY, "here",
          "body"),
    _Hint(r"(?P<here><-)", "an assignment is written :=, not <-", "here"),
    _Hint(r":=[^;]*?(?P<here>\bIF\b[^;]*\bELSE\b)", slips.CHOICE, "here", "body"),
    _Hint(r":=[^;]*?(?P<here>\bIF\s*\()", slips.CHOICE, "here", "body", ends=True),
    _Hint(rf"(?P<name>{_VALUE})\s*(?P<here>(?P<sign>[-+*/])=\s*(?P<value>[^;\n=]+))",
          "there is no {sign}=; write {name} := {name} {sign} {value}", "here", "body"),
    _Hint(rf"(?P<name>{_VALUE})(?P<here>(?P<sign>[-+])(?P=sign))\s*(?:;|$)", _stepped, "here", "body"),
    _Hint(rf"(?:^|;)[ \t]*(?P<here>(?P<sign>[-+])(?P=sign)(?P<name>{_VALUE}))\s*(?:;|$)", _stepped, "here"),
    _Hint(rf"(?P<name>{_NAME})(?P<here>->\s*(?P<member>{_NAME}))", "-> is written ^. here: {name}^.{member}", "here",
          "body"),
    _Hint(r"^\s*(?P<here>(?:void|int|def)\s+main\s*\()", "a program is written PROGRAM Main ... END_PROGRAM", "here"),
    _Hint(rf"^\s*(?P<here>(?:def|void|func)\s+(?P<name>{_NAME})\s*\()",
          "a function is declared FUNCTION {name} : INT ... END_FUNCTION, outside of the PROGRAM", "here"),
    _Hint(r"^\s*(?P<here>(?:import|from)\s+[\w.]+\s*)", _NO_IMPORT, "here"),
    _Hint(r"\b(?P<word>IF|ELSIF)\b[^;:]*?(?P<here>:)(?!=)", "the condition of {word} ends with THEN, not with a colon",
          "here", "body"),
    _Hint(r"\bWHILE\b[^;:]*?(?P<here>:)(?!=)", "the condition of WHILE ends with DO, not with a colon", "here", "body"),
    _Hint(r"\bUNTIL\b[^;]*?(?P<here>\bDO\b\s*)", "the condition of UNTIL ends with END_REPEAT, without DO", "here"),
    _Hint(rf'(?P<here>"(?P<name>{_NAME})")\s*(?::=|\()', "a name is written without quotes: {name}", "here"),
    _Hint(r"^\s*(?P<here>(?:END_)?REGION\b[^\n]*\s*)", "there is no REGION; write a comment", "here", "body"),
    _Hint(rf"(?:^|;)[ \t]*(?P<here>(?P<word>SET|RESET)\s+(?P<name>{_VALUE})\s*)(?=;|$)",
          lambda m: f"write {m['name']} := {'TRUE' if m['word'].upper() == 'SET' else 'FALSE'};", "here", "body"),
    _Hint(r"(?:^|;)[ \t]*(?P<here>(?P<word>FI|WEND|ESAC|NEXT(?:\s+\w+)?)\s*)(?=;|END|$)",
          lambda m: f"{m['word']} is written {_ENDS[m['word'][:4].upper()]}", "here", "body"),
    _Hint(rf"^\s*(?P<here>LOOP\b\s*(?:{_NAME}\s*)?)",
          "a task runs its program again and again; a loop within one cycle is FOR or WHILE", "here", "body"),
    _Hint(rf":\s*(?P<here>(?:REF|PTR)\s+(?:TO\s+)?(?P<name>{_NAME}))",
          "a pointer is declared POINTER TO {name}, a reference REFERENCE TO {name}", "here", "declaration"),
    _Hint(rf":\s*{_NAME}\s+(?P<here>(?P<word>RETAIN|PERSISTENT|CONSTANT)\s*)[;:]",
          "variables of this kind are declared in VAR {word} ... END_VAR", "here", "declaration"),
    _Hint(rf"(?:^|;|\bVAR)[ \t]*(?P<here>{_TYPE}[ \t]+(?P<name>{_NAME})[ \t]*\[(?P<count>\d+)\])",
          lambda m: _array(m, slips.TYPES.get(m["type"].upper(), m["type"])), "here"),
    _Hint(r"\bARRAY\s*\[(?P<first>[^\[\]]*)\](?P<here>\s*\[(?P<second>[^\[\]]*)\])",
          "an array of two dimensions is declared ARRAY[{first}, {second}]", "here"),
    _Hint(r"^\s*(?P<here>WHEN\s+(?P<value>[^:;\n]+))\s*:", "a branch of a CASE begins with its value: {value}: ...",
          "here", "body"),
    _Hint(r":\s*(?P<here>STRING\s+(?P<count>\d+))", "the length of a STRING is written STRING[{count}]", "here",
          "declaration"),
    _Hint(r":\s*(?P<here>\{(?P<values>[^{};:]*)\}\s*);", "an enumeration is written ({values})", "here"),
    _Hint(rf"^\s*(?P<here>typedef\s+(?P<type>[\w ]+?)\s+(?P<name>{_NAME})\s*;)",
          "a type is declared TYPE {name} : {type}; END_TYPE", "here"),
    _Hint(rf"^\s*(?P<here>class\s+(?P<name>{_NAME})\s*(?:\([^)]*\))?\s*[:{{])",
          "a class is written FUNCTION_BLOCK {name} ... END_FUNCTION_BLOCK", "here"),
    _Hint(rf"^\s*(?P<here>(?:PROCEDURE|SUB)\s+(?P<name>{_NAME}))",
          "a procedure is written FUNCTION {name} ... END_FUNCTION", "here"),
    _Hint(rf"\bFUNCTION\s+{_NAME}\s*(?P<here>\(\s*(?P<name>{_NAME})\s*:)",
          "inputs are declared after the first line: VAR_INPUT {name} : ... END_VAR", "here"),
    _Hint(r"\w\[\s*[-\w]+\s*(?P<here>\.\.)\s*[-\w]+\s*\]",
          "an index is one number; for several elements write a loop", "here", "body"),
    _Hint(rf"\bFUNCTION_BLOCK\s+(?P<name>{_NAME})\s*"
          rf"(?P<here>\(\s*(?P<base>{_NAME})[ \t]*\)?\s*)",
          "a block that is derived is written FUNCTION_BLOCK {name} EXTENDS {base}", "here"),
    _Hint(rf"\bMETHOD\s+(?P<here>{_TYPE}\s+(?P<name>{_NAME})\s*(?:\([^)\n]*\))?\s*)",
          _typed("the type of the result follows the name: METHOD {name} : {type}"), "here"),
    _Hint(rf"\bFUNCTION\s+(?P<here>BLOCK\s+{_NAME}\s*)", "FUNCTION BLOCK is written FUNCTION_BLOCK", "here"),
    _Hint(rf"(?P<here>\bFUNCTION\s+(?P<name>{_NAME})\s+{_TYPE}\s*(?:{_NAME}\s*)?)",
          _typed("the type of the result follows a colon: FUNCTION {name} : {type}"), "here"),
    _Hint(rf"\bTYPE\s+(?P<here>STRUCT\s+(?P<name>{_NAME}))", _STRUCT, "here"),
    _Hint(rf"\bTYPE\s+(?P<name>{_NAME})\s*:\s*\n\s*{_NAME}\s*(?P<here>:)", _STRUCT, "here"),
    _Hint(rf"^\s*(?P<here>ENUM\s+(?P<name>{_NAME}))",
          "an enumeration is declared TYPE {name} : (A, B); END_TYPE", "here"),
    _Hint(r"^\s*(?P<here>typedef\s+struct\b)", _STRUCT.format(name="Name"), "here"),
    _Hint(rf":\s*\(\s*{_NAME}(?P<here>\s*;\s*){_NAME}", "the values of an enumeration are separated by commas", "here"),
    _Hint(rf"(?P<name>{_NAME})(?P<here>::(?P<member>{_NAME}))",
          "a value of an enumeration is written {name}.{member}, as is a member", "here", "body"),
    _Hint(rf"^\s*(?P<here>STRUCT\s+(?P<name>{_NAME}))",
          _STRUCT, "here"),
    _Hint(r"(?P<here>\b(?P<word>CONSTANT|RETAIN|PERSISTENT)\s+(?P<var>VAR\w*))",
          "{word} comes after {var}: {var} {word}", "here"),
    _Hint(rf"(?P<here>(?:DIM\s+)?(?P<name>{_NAME})\s+AS\s+(?P<type>{_NAME}))", _typed(_IN_VARIABLES), "here"),
    _Hint(r"^\s*(?P<here>(?P<word>RETAIN|PERSISTENT)\s+\w+\s*)(?=[:,])",
          "variables of this kind are declared in VAR {word} ... END_VAR", "here", "declaration"),
    _Hint(rf"\bPROGRAM\s+(?P<type>{_NAME})\s+WITH\s+(?P<task>{_NAME})\s*(?P<here>;)",
          lambda m: _INSTANCE.format(instance=f"{m['type']}1", task=m["task"], type=m["type"]), "here"),
    _Hint(rf"\bPROGRAM\s+(?P<instance>{_NAME})\s*:\s*(?P<type>{_NAME})\s+(?P<here>WITH\s+(?P<task>{_NAME}))",
          _INSTANCE, "here"),
    _Hint(rf"(?:^|;)[ \t]*(?P<here>TASK\s+{_NAME}\s*\()",
          "a task is declared in CONFIGURATION ... END_CONFIGURATION, outside of the PROGRAM", "here", "body"),
    _Hint(r"\bAT\s+(?P<here>(?P<address>[IQM][XBWDL]?\d+(?:\.\d+)*))", "an address begins with %: %{address}", "here"),
    _Hint(rf"\w#[ \t]*(?P<number>[\d.]+)(?P<here>[ \t]+(?P<unit>{slips.UNITS})\b\s*)",
          "a duration has no blank: T#{number}{unit}", "here"),
    _Hint(rf"\w#(?P<number>\d+)(?P<here>,(?P<part>\d+(?:{slips.UNITS}))\b)", slips.COMMA, "here"),
    _Hint(r"\bT(?:IME)?#\d+(?P<here>:\d+(?::\d+)*)", "a duration is written with its units: T#1h30m5s", "here"),
    _Hint(r"(?:^|;)[ \t]*(?P<here>REM[ \t][^\n]*\n?\s*)", "a comment is written // or (* *)", "here"),
    _Hint(r"(?P<name>[\w.]+)\s*(?:<>|[<>]=?|=)\s*[\w.]+\s+(?P<word>AND|OR|XOR)\s+(?P<here>(?P<sign><>|[<>]=?|=)\s*"
          r"(?P<value>[\w.]+))", "{word} joins two comparisons: ... {word} {name} {sign} {value}", "here", "body"),
    _Hint(rf"{_NAME}\(\s*\w+\s*:=[^();]+(?P<here>;\s*)\w+\s*:=[^();]*\)", "inputs are separated by commas", "here"),
    _Hint(rf"{_NAME}\s*\([^();]*:=[^();,]*?(?P<here>\s+){_NAME}\s*(?::=|=>)", "inputs are separated by commas", "here",
          "body"),
    _Hint(rf"{_NAME}\([^();:\n]+(?P<here>;\s*)[^();:\n]+\)", "arguments are separated by commas", "here", "body",
          ends=True),
    _Hint(rf"(?P<here>\bCALL\s+(?P<name>{_NAME}))", "there is no CALL; write {name}(...)", "here", "body"),
    _Hint(r"\bFOR\b[^;]*?:=[^;]*?(?P<here>,)", _LOOP, "here"),
    _Hint(r"(?P<here>\bSTEP\s+(?P<value>[-\w.]+))", "the step of a loop is written BY {value}", "here", "body"),
    _Hint(r"(?P<here>\bDOWNTO\s+(?P<value>[-\w.]+))", "a loop that counts down is written TO {value} BY -1", "here"),
    _Hint(r"(?:^|;)[ \t]*(?P<here>DO\b)", _REPEAT, "here"),
    _Hint(r"\bWHILE\b[^;]*?(?P<here>END_REPEAT)", _REPEAT, "here"),
    _Hint(r"\bELSE\s*(?P<here>:)(?!=)", "ELSE has no colon", "here", "body"),
    _Hint(r"^\s*(?P<here>(?:[<>]=?)\s*[-\w]+\s*):", _LABEL, "here", "body"),
    _Hint(r"^\s*(?P<low>[-\w]+)\s+(?P<here>TO)\s+(?P<high>[-\w]+)\s*:", _RANGE, "here", "body"),
    _Hint(rf"\b(?P<name>LEN|ABS|SQRT|SIN|COS|TAN|LN|LOG|EXP|TRUNC|ADR|SIZEOF)\s+(?P<here>(?P<value>{_NAME}))",
          "a function is called with parentheses: {name}({value})", "here", "body"),
    _Hint(r"(?P<name>[\w.]+)\s*(?P<here><\s?<|>\s?>)\s*(?P<value>\w+)",
          lambda m: f"a shift is written {'SHL' if '<' in m['here'] else 'SHR'}({m['name']}, {m['value']})", "here"),
    _Hint(r":=[^;/]*\w\s*(?P<here>//\s*[\w.]+\s*;[^\n]*\n\s*)",
          "// begins a comment; a division is written /", "here", "body"),
    _Hint(r"(?:^|;)[ \t]*(?P<here>THEN\b)", "THEN without an IF", "here"),
    _Hint(rf"(?:^|;)[ \t]*(?P<here>(?:LET|CONST)\s+(?P<name>{_NAME})\s*)",
          "variables are declared in VAR ... END_VAR before the statements: {name} : INT;", "here", "body"),
    _Hint(rf"^\s*(?P<here>(?P<name>{_NAME})\s*:=\s*(?P<value>[^;]*))",
          "a variable is declared with its type: {name} : INT := {value};", "here", "declaration"),
    _Hint(r"\bARRAY\s*\[\s*(?P<here>(?P<low>\w+)\s*(?:-|:|\.|\.\.\.|…|\bTO\b)\s*(?P<high>\w+)\s*\])",
          "the bounds of an array are written {low}..{high}", "here"),
    _Hint(r"\bARRAY\s*(?P<here>\(\s*(?P<low>[-\w]+)\s*\.\.\s*(?P<high>[-\w]+)\s*\))",
          "the bounds of an array stand in brackets: ARRAY[{low}..{high}]", "here"),
    _Hint(r"\bARRAY\s+(?P<here>OF)\b", "an array has its first and its last index in brackets: ARRAY[0..9] OF ...",
          "here"),
    _Hint(rf"^\s*(?P<name>{_NAME})\s*(?P<here>\[(?P<count>\d+)\]\s*):\s*(?P<type>\w+)", _array, "here", "declaration"),
    _Hint(rf":\s*\w+\s*(?P<here>,)\s*{_NAME}\s*:", "a declaration ends with ;, not with a comma", "here",
          "declaration"),
    _Hint(rf":\s*(?P<here>\*\s*(?P<name>{_NAME}))", _POINTER, "here", "declaration"),
    _Hint(rf":\s*(?P<name>{_NAME})\s*(?P<here>\*)", _POINTER, "here", "declaration"),
    _Hint(r":\s*(?P<here>CONST(?:ANT)?\s+\w+[^;]*)", _CONSTANT, "here", "declaration"),
    _Hint(r"^\s*(?P<here>CONST(?:ANT)?\s+\w+\s*)(?=:)", _CONSTANT, "here", "declaration"),
    _Hint(rf"^\s*(?!VAR)(?P<a>{_NAME})(?P<here>-|[ \t]+)(?P<b>{_NAME})\s*:(?!=)",
          "a name has no blank and no -: {a}_{b}", "", "declaration"),
    _Hint(r"(?P<name>\w+)\s+REF\s*=\s*(?P<value>[\w.\[\]]+)\s*[,)]",
          "an input that is a reference is given with :=, as others are: {name} := {value}", "", "body"),
    _Hint(r"\bARRAY\s*\[\s*(?P<count>\d+)\s*\]", _count),
    _Hint(r":=\s*(?P<here>\{(?P<values>[^{};']*)\}\s*)", _list, "here"),
    _Hint(r"[^'\s(,=](?P<here>'(?='))", slips.QUOTE, "here"),
    _Hint(r"\\(?P<here>'[ \t]*)", slips.QUOTE, "here", ends=True),
    _Hint(r"'[^'\n]*'(?P<here>[A-Za-z][^'\n]*)'", slips.QUOTE, "here", ends=True),
    _Hint(rf"(?:\b|_)STEP\s+{_NAME}\s*:\s*(?P<here>(?P<name>{_NAME})\s*:=)",
          "a step names actions: write this into ACTION A: ... END_ACTION, and A; into the step", "here"),
    _Hint(rf"(?P<here>\b(?:__)?NEW\s+(?P<name>{_NAME})\s*(?:\([^;)]*\))?)",
          "an instance is taken from its pool by __NEW({name})", "here", "body"),
    _Hint(rf"(?P<here>\b(?P<word>__DELETE|DELETE)\s+(?P<name>{_VALUE})\s*)", "what __NEW gave is given back by "
          "__DELETE({name})", "here", "body"),
    _Hint(r"\bFOR\s*\(.*", _LOOP),
    _Hint(r"\bFOR\s+(?:EACH\s+)?\w+\s+IN\b", _LOOP),
    _Hint(r"\bSWITCH\b[^;]*", _CHOICE),
    _Hint(r"\bCASE\s+\w+\s*:(?!=)", _CHOICE),
    _Hint(r"\bBEGIN\s+\w+\s*", "there is no BEGIN; the statements follow END_VAR"),
    _Hint(r"\bGOTO\s+(?P<name>\w+)\s*", "a jump is written JMP {name}; and its label {name}:"),
    _Hint(rf"(?<![\w.])(?P<name>{_NAME})\s*:\s+(?P<here>=)", "an assignment is written {name} := ..., without a blank",
          "here", "body"),
    _Hint(rf"(?:^|;)[ \t]*(?P<name>{_NAME})\s*:\s+(?P<here>[-+\d'(])", "an assignment is written {name} := ...", "here",
          "body"),
    _Hint(r":\s*(?P<here>(?:unsigned|signed|long|short)\s+\w+)",
          "there is no unsigned; write UINT, UDINT ... for a type without negative numbers", "here", "declaration"),
    _Hint(_TYPE_FIRST, _typed(_IN_VARIABLES), "here", "declaration"),
    _Hint(_TYPE_FIRST, _typed(_IN_BODY), "here", "body"),
    _Hint(rf"(?<![\w.])(?P<name>[A-Za-z_]\w*)\s*:(?!=)\s*{_TYPE}", _typed(_IN_BODY), "", "body"),
    _Hint(r"(?<![\w.])(?P<name>[A-Za-z_]\w*)\s*:(?!=)\s*(?P<type>[A-Za-z_]\w*)\s*;", _typed(_IN_BODY), "", "body"),
    _Hint(rf"\(\s*{_TYPE}\s*\)\s*(?P<name>\w+)",
          lambda m: f"a conversion is written TO_{m['type'].upper()}({m['name']}), not ({m['type']})"),
    _Hint(r"\w\s*(?P<here>\^\s*(?:\d+|\w+(?=\s*;)))",
          lambda m: f"a power is written a ** {m['here'][1:].strip()}; ^ follows a pointer", "here"),
    _Hint(r"(?<![\w.,])(?P<whole>\d+),(?P<part>\d+)(?![\w,])", "a real number is written with a point: {whole}.{part}"),
    _Hint(r"(?<![\w\])^.])\.(?P<part>\d+)", "a number begins with a digit: 0.{part}"),
    _Hint(rf"(?<![\w#.])(?P<number>\d+(?:\.\d+)?){_UNIT}",
          "a duration is written T#{number}{unit}, not {number}{unit}"),
    _Hint(r"(?<![\w)\]^])\*\s*(?P<name>[A-Za-z_]\w*)", "what {name} points to is written {name}^"),
    _Hint(r"&\s*(?P<name>[A-Za-z_]\w*)", "the address of {name} is written ADR({name})"),
    _Hint(r"(?P<name>\w+)\s*:(?!=)\s*(?P<type>\w+(?:\s*\[[^\]]*\])?\s+)AT\s+(?P<place>%[\w.*]+)", _located),
    _Hint(r"\b(?P<word>REFERENCE|POINTER)_TO\s+\w+\s*", "{word}_TO is written {word} TO"),
    _Hint(rf"^\s*(?P<here>TASK)\s+{_NAME}\s*\(", _TASKS, "here"),
    _Hint(r"(?:^|;)[ \t]*(?P<here>--.*)", "a comment is written // or (* *)", "here"),
)  # fmt: skip


def hint(text: str, begin: int, pos: int, where: str) -> Said | None:
    """What to say of a mistake at offset `pos` of `text`; None when it is not one of these. `begin`: the
    offset of the last word but one that was fine; `where`: body, declaration or ""."""
    start = max(text.rfind("\n", 0, begin) + 1, begin - _FAR)
    end = text.find("\n", pos, pos + _FAR)
    window = text[start : pos + _FAR if end < 0 else end]
    column = pos - start
    for known in _HINTS:
        if known.where not in ("", where):
            continue
        for match in re.finditer(known.pattern, window, re.IGNORECASE | re.MULTILINE):
            around = match.start(known.at or 0) <= column <= match.end(known.at or 0)
            if around and not is_in_comment(text, start + match.start()):
                said = known.message
                message = said(match) if callable(said) else said.format(**match.groupdict())
                return Said(start + match.start(known.at or 0), message, known.ends)
    return None
