"""EDS and DCF: what is read, and each doubt with file and line."""

from __future__ import annotations

from pathlib import Path

import canopen
import pytest

from plctool.cli import main as cli
from plctool.errors import UsageError
from plctool.io.canopen.data_types import DATA_TYPES, parse_whole, type_named
from plctool.io.canopen.eds import Eds, load_eds, mapping_of, read_eds, setting_of

VALVES = Path(__file__).parents[2] / "examples/canopen/valves.eds"
HEAD = """[FileInfo]
FileName=a.eds
[DeviceInfo]
VendorNumber=1
ProductNumber=2
RevisionNumber=3
BaudRate_500=1
[1000]
ParameterName=Device type
DataType=7
AccessType=ro
[1001]
ParameterName=Error register
DataType=5
AccessType=ro
[MandatoryObjects]
SupportedObjects=2
1=0x1000
2=0x1001
"""
LINES = HEAD.count("\n")


def read(text: str, head: str = HEAD, encoding: str = "utf-8") -> Eds:
    return read_eds("a.eds", (head + text).encode(encoding))


def said(text: str, head: str = HEAD) -> list[str]:
    """The findings; lines count from the first one after HEAD."""
    lines = head.count("\n")
    found = read(text, head).findings.found
    return [f"{f.pos.line - lines}:{f.pos.column}: {f.severity}: {f.message}" for f in found]


def variable(more: str, index: str = "2000", access: str = "rw", data_type: str = "6") -> str:
    words = f"[{index}]\nParameterName=x\nDataType={data_type}\nAccessType={access}\n{more}\n"
    return words + f"[ManufacturerObjects]\nSupportedObjects=1\n1=0x{index}\n"


def test_a_complete_file_has_no_findings() -> None:
    assert load_eds(VALVES).findings.found == []


def test_every_entry_is_as_python_canopen_reads_it() -> None:
    ours, theirs = load_eds(VALVES), canopen.import_od(str(VALVES), node_id=5)
    assert set(ours.objects) == {index for index in theirs if index >= 0x1000}
    for index, found in ours.objects.items():
        for sub, entry in found.entries.items():
            other = (
                theirs[index] if isinstance(theirs[index], canopen.objectdictionary.ODVariable) else theirs[index][sub]
            )
            assert entry.type is not None
            assert (entry.name, entry.type.code, entry.access) == (other.name, other.data_type, other.access_type)
            assert entry.mappable == other.pdo_mappable
            assert setting_of(entry, 5) == other.default, entry.place


def test_lists_of_objects_device_and_dummies_are_read() -> None:
    eds = load_eds(VALVES)
    assert (eds.device.vendor, eds.device.product, eds.device.revision) == (0x319, 0x1008, 0x10002)
    assert eds.device.bit_rates == (125, 250, 500, 1000)
    assert eds.device.lss
    assert eds.dummies == {5, 6, 7}
    assert {o.group for o in eds.objects.values()} == {"mandatory", "optional", "manufacturer"}
    assert [m.place for m in mapping_of(eds, 0x1A00)] == ["6000:01", "6401:01"]


@pytest.mark.parametrize(
    ("text", "value"), [("10", 10), ("0x1F", 31), ("0X1f", 31), ("010", 8), ("0", 0), ("-5", -5), (" 7 ", 7)]
)
def test_numbers_are_decimal_hex_or_octal(text: str, value: int) -> None:
    assert parse_whole(text) == value


@pytest.mark.parametrize("text", ["", "08", "0x", "1.5", "1e3", "--1", "0b1", "x", "\u0661", "9" * 100])
def test_what_is_not_a_number_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="is not a number"):
        parse_whole(text)


@pytest.mark.parametrize(
    "words", ["$NODEID+0x180", "0x180+$NODEID", "$nodeid + 384", "$NODEID+0600", "0x180 + $NodeID"]
)
def test_formulas_add_the_number_of_the_node_in_either_order(words: str) -> None:
    eds = read(variable(f"DefaultValue={words}"))
    assert eds.findings.found == []
    assert setting_of(eds.entry(0x2000), 5) == 0x185


@pytest.mark.parametrize("words", ["$NODEID*2", "$NODEID+$NODEID", "$NODEID+", "$NODEID+1+2", "$NODEID+0xFFFF"])
def test_other_formulas_are_reported_and_ignored(words: str) -> None:
    (found,) = said(variable(f"DefaultValue={words}"))
    assert found.startswith("5:14: warning: DefaultValue: ")
    assert read(variable(f"DefaultValue={words}")).entry(0x2000).default is None  # type: ignore[union-attr]


def test_a_dcf_has_values_and_commissioning() -> None:
    eds = read(
        variable("DefaultValue=1\nParameterValue=7")
        + "[DeviceComissioning]\nNodeID=0x05\nNodeName=Valves\nBaudrate=500\nNetNumber=2\nLSS_SerialNumber=0x10\n"
    )
    assert eds.findings.found == []
    assert setting_of(eds.entry(0x2000), 5) == 7
    assert eds.commissioning is not None
    assert (eds.commissioning.node, eds.commissioning.bit_rate, eds.commissioning.serial) == (5, 500, 16)
    assert read("[DeviceCommissioning]\nNodeID=9\n").commissioning.node == 9  # type: ignore[union-attr]


def test_compact_sub_objects_are_written_out_with_their_names_and_values() -> None:
    eds = read(
        "[2100]\nParameterName=Set\nObjectType=8\nDataType=6\nAccessType=rw\nDefaultValue=3\nCompactSubObj=4\n"
        "[2100Name]\nNrOfEntries=2\n1=First\n3=Third\n[2100Value]\nNrOfEntries=1\n2=9\n"
        "[ManufacturerObjects]\nSupportedObjects=1\n1=0x2100\n"
    )
    assert eds.findings.found == []
    entries = eds.objects[0x2100].entries
    assert [e.name for e in entries.values()] == ["NrOfObjects", "First", "Set2", "Third", "Set4"]
    assert [setting_of(e, 1) for e in entries.values()] == [4, 3, 9, 3, 3]


@pytest.mark.parametrize(
    ("encoding", "prefix"), [("utf-8", ""), ("utf-8", "\ufeff"), ("cp1252", ""), ("utf-16", ""), ("latin-1", "")]
)
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_encodings_and_line_ends_are_recognised(encoding: str, prefix: str, end: str) -> None:
    text = prefix + (HEAD + variable("").replace("=x", "=Überlänge")).replace("\n", end)
    eds = read_eds("a.eds", text.encode(encoding))
    assert eds.findings.found == []
    assert eds.objects[0x2000].name == "Überlänge"


DOUBTS = [
    (
        variable("DefaultValue=08"),
        "5:14: warning: DefaultValue: '08' is not a number (a number with a leading 0 is octal); the value is ignored.",
    ),
    (
        variable("DefaultValue=70000"),
        "5:14: warning: DefaultValue: 70000 is outside UNSIGNED16, 0 to 65535; the value is ignored.",
    ),
    (variable("LowLimit=5\nHighLimit=2"), "5:10: warning: LowLimit 5 is above HighLimit 2; neither is checked."),
    (variable("LowLimit=5\nDefaultValue=2"), "6:14: warning: DefaultValue 2 is below LowLimit 5."),
    (variable("HighLimit=5\nParameterValue=6"), "6:16: warning: ParameterValue 6 is above HighLimit 5."),
    (variable("", access="RX"), "4:12: error: AccessType 'RX' is not ro, wo, rw, rwr, rww or const; rw is assumed."),
    (
        variable("", data_type="0x99"),
        "3:10: warning: DataType 0x0099 is a record or of the manufacturer; values of [2000] are bytes.",
    ),
    (variable("", data_type="hello"), "3:10: error: DataType: 'hello' is not a number."),
    (variable("PDOMaping=1"), "5:11: warning: PDOMaping is unknown and ignored; did you mean PDOMapping?"),
    (variable("PDOMapping=maybe"), "5:12: warning: PDOMapping is 0 or 1, not 'maybe'; 1 is assumed."),
    (variable("ObjectType=77"), "5:12: warning: ObjectType 77 is unknown; a VAR is assumed."),
    (
        variable("", index="3000").replace("0x3000", "0x3001"),
        "8:3: error: object 3001 is listed, but section [3001] is missing.",
    ),
    (variable("", index="6000"), "8:3: warning: object 6000 does not belong to the list of manufacturer objects."),
    ("[2000\nParameterName=x\n", "1:1: error: '[2000' is not a section; write [NAME]. Its lines are ignored."),
    ("[Deviceinfos]\n", "1:1: warning: section [Deviceinfos] is unknown and ignored; did you mean DeviceInfo?"),
    ("[2000sub1]\n", "1:1: warning: [2000sub1] is ignored: section [2000] is missing."),
    ("[DummyUsage]\nDummy9999=1\n", "2:11: warning: Dummy9999 is not the dummy of a data type (Dummy0005)."),
    ("[DeviceComissioning]\nNodeID=128\n", "2:8: error: NodeID is 128; it has to be 1 to 127."),
    ("[FileInfo]\n", "1:1: warning: section [FileInfo] begins at line 1; the two are read as one."),
    ("\n[Comments]\nLines\n", "3:1: warning: 'Lines' is not KEY=VALUE and is ignored."),
    ("[DeviceInfo]\nVendorNumber=9\n", "2:1: warning: VendorNumber has a value at line 4 already; that one is used."),
    ("[OptionalObjects]\nSupportedObjects=3\n", "2:18: warning: SupportedObjects is 3, but 0 are listed."),
    (
        "[OptionalObjects]\nSupportedObjects=1\n1=0x10000\n",
        "3:3: error: 0x10000 is not the index of an object, 0x1000 to 0xFFFF.",
    ),
    (variable("ObjectType=9"), "1:1: warning: [2000] has no SubNumber."),
]


@pytest.mark.parametrize(("text", "message"), DOUBTS, ids=[m for _, m in DOUBTS])
def test_each_doubt_has_its_line_and_says_what_is_assumed(text: str, message: str) -> None:
    assert any(found.startswith(message) for found in said(text)), said(text)


def test_an_empty_vendor_number_is_a_warning() -> None:
    head = HEAD.replace("VendorNumber=1", "VendorNumber=")
    assert said("", head) == [f"{4 - LINES}:14: warning: VendorNumber is empty; any number is accepted."]


def test_missing_sections_are_named() -> None:
    found = [f.message for f in read("[2000]\n", "").findings.found]
    assert "section [FileInfo] is missing." in found
    assert "object 1000 is missing, which every device has." in found
    assert "[2000] has no DataType, so its value cannot be used." in found


PDO = (
    "[1A00]\nParameterName=m\nObjectType=9\nSubNumber=2\n[1A00sub0]\nParameterName=n\nDataType=5\nAccessType=rw\n"
    "DefaultValue=1\n[1A00sub1]\nParameterName=o\nDataType=7\nAccessType=rw\nDefaultValue={}\n"
    "[1800]\nParameterName=p\nObjectType=9\nSubNumber=1\n[1800sub0]\nParameterName=q\nDataType=5\nAccessType=ro\n"
)


@pytest.mark.parametrize(
    ("value", "more", "message"),
    [
        ("0x20010010", "", "the mapped object 2001:00 is not in this file."),
        ("0x20000010", "", "the mapped object 2000:00 has PDOMapping=0."),
        ("0x20000008", "PDOMapping=1", "2000:00 is mapped with 8 bits, but UNSIGNED16 has 16."),
        ("0x20000010", "PDOMapping=1\nAccessType=x", ""),
        ("0x200000FF", "PDOMapping=1", "1A00 maps 255 bits; a PDO has 64."),
    ],
)
def test_mappings_are_checked_against_the_objects(value: str, more: str, message: str) -> None:
    found = said(PDO.format(value) + variable(more))
    assert any(message in f for f in found), found


def test_an_object_that_is_write_only_cannot_be_in_a_tpdo() -> None:
    found = said(PDO.format("0x20000010") + variable("PDOMapping=1", access="wo"))
    assert any("2000:00 is wo and cannot be in a TPDO." in f for f in found), found


@pytest.mark.parametrize("data", [b"", b"\n\n", b"no ini file\n", b"[", b"[]\n=\n", b"\xff\xfe", b"=" * 5000])
def test_files_that_are_no_eds_are_errors(data: bytes) -> None:
    assert read_eds("a.eds", data).has_errors


def test_a_binary_file_is_refused() -> None:
    with pytest.raises(UsageError, match="not a text file; give an EDS or DCF"):
        read_eds("a.eds", b"[A]\n\0\1\2")


def test_a_file_of_doubts_only_reports_a_limited_number() -> None:
    eds = read("[Comments]\n" + "x\n" * 5000)
    assert len(eds.findings.found) == 200
    assert eds.more_findings == 4800


def test_a_large_file_is_read_in_the_time_of_its_length() -> None:
    sections = "".join(f"[{i:04X}]\nParameterName=x\nObjectType=9\nSubNumber=200\n" for i in range(0x2000, 0x3000))
    subs = "".join(f"[2000sub{i:X}]\nParameterName=x\nDataType=5\nAccessType=rw\n" for i in range(200))
    assert len(read(sections + subs * 20).objects) == 0x1002


def test_values_are_the_same_after_encoding_and_decoding() -> None:
    for t in DATA_TYPES.values():
        if t.is_whole:
            for value in t.limits:
                assert t.decode(t.encode(t.parse(str(value)))) == value
    assert type_named("INTEGER24").encode(-2) == b"\xfe\xff\xff"
    assert type_named("udint") is type_named("U32") is DATA_TYPES[7]
    assert type_named("REAL32").decode(type_named("REAL32").encode(1.5)) == 1.5
    assert type_named("REAL32").parse("0x3FC00000") == 1.5
    with pytest.raises(ValueError, match="did you mean UNSIGNED16"):
        type_named("UNSIGNE16")


# ---- the command ----


def test_check_prints_each_finding_with_its_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "a.eds"
    file.write_text(HEAD + variable("DefaultValue=08"))
    assert cli.main(["canopen", "check", str(file)]) == 0
    out = capsys.readouterr().out
    assert f"{file}:{LINES + 5}:14: warning: DefaultValue: '08' is not a number" in out
    assert "DefaultValue=08\n             ^" in out
    assert "3 objects, 0 RPDOs, 0 TPDOs; 0 errors, 1 warning\n" in out


def test_check_fails_for_errors_and_prints_one_document(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    import json

    file = tmp_path / "a.eds"
    file.write_text(HEAD + variable("", access="x"))
    assert cli.main(["canopen", "check", str(file), "--json"]) == 2
    document = json.loads(capsys.readouterr().out)
    assert [d["severity"] for d in document["diagnostics"]] == ["error"]
    assert document["device"]["vendor"] == 1
    assert cli.main(["canopen", "check", str(tmp_path / "none.eds")]) == 2
    assert "cannot be read: No such file" in capsys.readouterr().err


def test_dynamic_channels_may_be_fewer_and_not_others() -> None:  # C405-35
    def warnings(lines: str) -> list[str]:
        text = f"[DeviceInfo]\nVendorNumber=1\n\n[DynamicChannels]\nNrOfSeg=1\n{lines}"
        return [m.message for m in read_eds("x.eds", text.encode()).findings.found if "Range" in m.message]

    assert warnings("Type1=0x02\nDir1=ro\nRange1=0xA000-0xA00F\nPPOffset1=0\n") == []
    assert warnings("Type1=0x02\nDir1=rww\nRange1=0xA480-0xA4BF\nPPOffset1=0\n") == []
    other = "Range1 is not that of CiA 405, which has the area 0xA000 to 0xA03F for this type."
    for range_ in ("0xA040-0xA07F", "0xA000-0xA040", "0xA03F-0xA000", "0x2000-0x2FFF"):
        assert warnings(f"Type1=0x02\nDir1=ro\nRange1={range_}\nPPOffset1=0\n") == [other]
    assert "no area" in warnings("Type1=0x09\nDir1=ro\nRange1=0xA000-0xA00F\n")[0]
    assert "is not a range" in warnings("Type1=0x02\nDir1=ro\nRange1=all\n")[0]
