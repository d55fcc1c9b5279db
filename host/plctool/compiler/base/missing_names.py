"""Names that a program uses and nothing declares: from which library they come, and how often they are used.

The library is recognised by the name alone, so it is a hint to where to look, no more.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache

from plctool.errors import counted, did_you_mean

_UNKNOWN = "no library known here"
_SHOWN = 8  # names of a library that are listed; the rest is counted

_NAMES = {
    "TcUnit": "TCUNIT FB_TESTSUITE TEST TEST_FINISHED TEST_ORDERED ASSERTEQUALS* ASSERTTRUE ASSERTFALSE ASSERTARRAY*",
    "Tc2_MC2 or SM3_Basic (motion)": "MC_* AXIS_REF* _AXIS_REF* NCTOPLC_* PLCTONC_* ST_MC* E_MC* SMC_* SM3_*",
    "Tc2_TcpIp (sockets)": "FB_SOCKET* T_HSOCKET ST_SOCKET* FB_CLIENTSERVER* FB_SERVERCLIENT* T_HSERVER",
    "Tc3_EventLogger": "TCEVENT* FB_TCALARM* FB_TCMESSAGE* FB_TCEVENT* FB_TCSOURCE* I_TCALARM* I_TCMESSAGE* I_TCEVENT*",
    "Tc3_JsonXml": "FB_JSON* FB_XML* SJSON*",
    "Tc3_IotBase (MQTT)": "FB_IOT* E_IOT* ST_IOT*",
    "Tc2_System": "TC2_SYSTEM ADS* FB_FILE* FB_CREATEDIR FB_REMOVEDIR FB_SIMPLEADSLOG* F_GETSYSTEMTIME TC_* OTCID "
    "T_AMSNETID* T_AMSPORT T_MAXSTRING T_IPV4ADDR ST_LIBVERSION* STLIBVERSION* E_OPENPATH GETCURTASKINDEX* "
    "F_GETCURTASKINDEX* TWINCAT_SYSTEMINFOVARLIST PLCTASKSYSTEMINFO PLCAPPSYSTEMINFO _TASKINFO TASKINFO _APPINFO",
    "Tc2_Utilities": "TC2_UTILITIES NT_* FB_LOCALSYSTEMTIME FB_FORMATSTRING* F_TRANSLATEFILETIME* FB_TIMEZONE* T_ARG "
    "F_BOOL F_INT F_DINT F_REAL F_LREAL F_STRING F_UDINT F_WORD F_DWORD TIMESTRUCT FB_GETADAPTERSBYNAME* FB_ENUMFIND* "
    "DRAND FB_CSVMEMBUFFER* SYSTEMTIME_TO_* FILETIME_TO_* DT_TO_SYSTEMTIME FB_REGQUERY* FB_MEMRINGBUFFER* T_FILETIME* "
    "LREAL_TO_FMTSTR",
    "Tc2_EtherCAT": "FB_EC* ST_EC* E_EC*",
    "Tc2_ModbusSrv or ModbusFB": "FB_MB* MB_* MODBUS*",
    "CAA libraries of CODESYS": "CAA CB FILE DTU SER COM NBS TCP_* UDP_* MEM SEGBUFMAN TICKS SEMA",
    "Sys libraries of CODESYS": "SYSFILE* SYSDIR* SYSTIME* SYSMEM* SYSSOCKET* SYSSEM* SYSTASK* SYSPROCESS* SYSCOM* "
    "SYSSHM* SYSEVENT* SYSTARGET* RTS_* CMP* IBASELIBRARY RTCLK",
    "Util of CODESYS": "UTIL BLINK GEN CHARCURVE LIN_TRAFO RAMP_INT RAMP_REAL STATISTICS_* VARIANCE LIMITALARM PD "
    "FREQ_MEASURE",
    "StringUtils of CODESYS": "STU STRLENA STRCPYA STRCONCATA STRCMPA STRFINDA STRDELETEA STRREPLACEA STRMIDA STRTRIMA",
    "OSCAT": "OSCAT* DCF77 SUN_TIME CALENDAR* REAL_TO_STRF FT_* CTRL_* IP_* NETWORK_BUFFER* HTTP_GET",
}
"""Names of the field's libraries; * stands for any ending."""

_DECLARED = re.compile(
    r"\b(?:PROGRAM|FUNCTION_BLOCK|FUNCTION|INTERFACE|CLASS|TYPE|METHOD|PROPERTY|ACTION|NAMESPACE)"
    r"(?:\s+(?:ABSTRACT|FINAL|PUBLIC|INTERNAL|PRIVATE|PROTECTED))*\s+(\w+)|\b(\w++)\s*+(?::(?!=)|,|\bAT\b|\bEXTENDS\b|\))",
    re.IGNORECASE,
)


def declared_names(text: str) -> set[str]:
    """What a text that cannot be parsed may declare, case-folded; rather too much than too little."""
    return {(match[1] or match[2]).casefold() for match in _DECLARED.finditer(text)}


@dataclass(frozen=True)
class Use:
    """A place where a name is used that nothing declares."""

    name: str
    file: str
    line: int


@dataclass
class Missing:
    """A name, where it is first used, how often, and the library that seems to have it; "" for none."""

    name: str
    first: Use
    count: int
    library: str


def missing_names(uses: Iterable[Use]) -> list[Missing]:
    """The names, each once, those of one library together, the most used ones first."""
    found: dict[str, Missing] = {}
    for use in uses:
        entry = found.setdefault(use.name.casefold(), Missing(use.name, use, 0, library_of(use.name)))
        entry.count += 1
    by_library: dict[str, int] = {}
    for entry in found.values():
        by_library[entry.library] = by_library.get(entry.library, 0) + entry.count
    return sorted(found.values(), key=lambda m: (not m.library, -by_library[m.library], m.library, -m.count, m.name))


@cache
def _libraries() -> list[tuple[str, re.Pattern[str]]]:
    return [
        (library, re.compile("|".join(names.replace("*", r"\w*").split()), re.IGNORECASE))
        for library, names in _NAMES.items()
    ]


def library_of(name: str) -> str:
    """The library that seems to have a name; "" when none is known. Of a qualified name the first part says it, else
    the last one."""
    parts = name.split(".")
    found = (library for part in (parts[0], parts[-1]) for library, pattern in _libraries() if pattern.fullmatch(part))
    return next(found, "")


def known_name_like(name: str, candidates: Iterable[str]) -> str:
    """`; did you mean X?` for an unknown name; nothing for one that a library has, which is missing, not misspelt."""
    return "" if library_of(name) else did_you_mean(name, candidates)


def table(uses: Sequence[Use]) -> list[str]:
    """One line for each library, with its names and how often they are used."""
    found = missing_names(uses)
    libraries = list(dict.fromkeys(m.library for m in found))
    lines = [f"The program uses {counted(len(found), 'name')} that nothing declares, in {len(uses)} places:"]
    for library in libraries:
        names = [m for m in found if m.library == library]
        shown = ", ".join(f"{m.name} ({m.count})" for m in names[:_SHOWN])
        more = f", and {len(names) - _SHOWN} more" if len(names) > _SHOWN else ""
        first = names[0].first
        lines.append(f"  {library or _UNKNOWN}: {shown}{more}; first at {first.file}:{first.line}")
    lines.append("Give the sources of these libraries with the program, or declare the names.")
    return lines
