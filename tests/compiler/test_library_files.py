"""Libraries that are given as sources: where they are found, what they need, and what is refused."""

from __future__ import annotations

import os
import struct
import zipfile
from pathlib import Path

import pytest
from library_support import check, library, manifest, messages, zipped

from plctool import archives
from plctool.compiler import load_sources, program_files
from plctool.compiler.front import parse_all
from plctool.compiler.sources import imports
from plctool.compiler.sources.library_files import resolve_libraries
from plctool.errors import UsageError
from plctool.st_tests import run_tests

GET = "FUNCTION Get : INT\nGet := 7;\nEND_FUNCTION\n"
USE = "PROGRAM Main\nVAR n : INT; END_VAR\nn := Lib.Get();\nEND_PROGRAM\n"


def refusal(*paths: Path) -> str:
    """Why libraries are refused."""
    with pytest.raises(UsageError) as refused:
        for found in resolve_libraries(paths):
            _ = found.sources
    return refused.value.message


# ---- where they are ----


@pytest.mark.parametrize("top", ["", "lib-1.0/", "lib-1.0/inner/"])
def test_zip_is_read_in_place(tmp_path: Path, top: str) -> None:
    files = {f"{top}library.toml": manifest("Lib"), f"{top}src/get.st": GET, f"{top}README.md": "x"}
    path = zipped(tmp_path / "lib.zip", files)
    if top.count("/") > 1:
        assert "has no library.toml, neither at its top nor in its only folder" in refusal(path)
        return
    assert messages(check(tmp_path, USE, path)) == []
    (found,) = resolve_libraries([path])
    assert [s.path for s in found.sources] == [str(path / "src/get.st")]


def test_what_macos_adds_to_a_zip_is_no_part_of_it(tmp_path: Path) -> None:
    files = {"lib/library.toml": manifest("Lib"), "lib/get.st": GET, "__MACOSX/lib/._get.st": "\0\1", ".": ""}
    assert messages(check(tmp_path, USE, zipped(tmp_path / "lib.zip", files))) == []


def test_mistake_in_a_zip_has_its_line_and_is_quoted(tmp_path: Path) -> None:
    from plctool.compiler import CompileError, compile_sources

    path = zipped(tmp_path / "lib.zip", {"library.toml": manifest("Lib"), "get.st": GET.replace("7", "nonsense")})
    (tmp_path / "main.st").write_text(USE)
    with pytest.raises(CompileError) as refused:
        compile_sources([tmp_path / "main.st"], libraries=[path])
    assert f"{path}/get.st:2:8: error: unknown name nonsense\nGet := nonsense;\n" in refused.value.message


def test_folder_of_libraries_stands_for_all_of_them(tmp_path: Path) -> None:
    library(tmp_path / "libs", "Lib", {"get.st": GET})
    zipped(tmp_path / "libs/other.zip", {"library.toml": manifest("Other"), "o.st": "TYPE Speed : INT; END_TYPE"})
    (tmp_path / "libs/notes").mkdir()
    text = USE.replace("n : INT", "n : INT; s : Speed; t : Other.Speed")
    assert messages(check(tmp_path, text, tmp_path / "libs")) == []


def test_library_below_the_sources_is_not_part_of_them(tmp_path: Path) -> None:
    (tmp_path / "main.st").write_text(USE)
    library(tmp_path / "libs", "Lib", {"get.st": GET})
    assert [Path(s.path).name for s in load_sources([tmp_path])] == ["main.st"]
    assert [Path(s.path).name for s in load_sources([tmp_path / "libs/Lib"])] == ["get.st"]


def test_library_is_read_in_every_format_of_sources(tmp_path: Path) -> None:
    declaration = "<Declaration><![CDATA[FUNCTION Get : INT]]></Declaration>"
    body = "<Implementation><ST><![CDATA[Get := 7;]]></ST></Implementation>"
    twincat = f'<TcPlcObject><POU Name="Get">{declaration}{body}</POU></TcPlcObject>'
    files = {"library.toml": manifest("Lib"), "Get.TcPOU": twincat}
    assert messages(check(tmp_path, USE, zipped(tmp_path / "lib.zip", files))) == []


@pytest.mark.parametrize(
    "name", ["Standard", "Util", "SysMem", "tc2_system", "Tc2_Utilities", "Tc2_Standard, * (System)"]
)
def test_names_of_standard_libraries_need_no_files(tmp_path: Path, name: str) -> None:
    top = library(tmp_path, "Lib", {"get.st": GET})
    (top / "library.toml").write_text(f'name = "Lib"\nversion = "1"\n[dependencies]\n"{name}" = "3.5.17.0"\n')
    assert messages(check(tmp_path, USE, top)) == []
    (tmp_path / "plc.toml").write_text(f'sources = ["program"]\nlibraries = ["{name}"]\n')
    assert program_files([tmp_path]).libraries == []


# ---- what they need ----


def test_what_a_library_needs_is_found_beside_it(tmp_path: Path) -> None:
    library(tmp_path, "Base", {"b.st": GET}, "1.4.0")
    zipped(tmp_path / "deep.zip", {"library.toml": manifest("Deep"), "d.st": "TYPE D : INT; END_TYPE"})
    top = library(tmp_path, "Top", {"t.st": "TYPE T : D; END_TYPE"}, Base="1.2", Deep="*")
    assert [found.name for found in resolve_libraries([top])] == ["Top", "Base", "Deep"]


def test_newest_version_that_fits_is_taken(tmp_path: Path) -> None:
    for folder, version in (("a", "1.2"), ("b", "1.10"), ("c", "1.9.9"), ("d", "2.0")):
        os.rename(library(tmp_path, "Base", {"b.st": GET}, version), tmp_path / folder)
    top = library(tmp_path, "Top", {"t.st": GET}, Base="1.3")
    assert {found.name: found.version for found in resolve_libraries([top])} == {"Top": "1.0.0", "Base": "1.10"}


def test_missing_dependency_is_named_with_its_line(tmp_path: Path) -> None:
    top = library(tmp_path, "Top", {"t.st": GET}, Bsae="1.0")
    found = refusal(top)
    assert (
        f"{top}/library.toml:4:1: error: Top needs the library Bsae, which is not here; give it with --library" in found
    )
    library(tmp_path, "Base", {"b.st": GET})
    assert "did you mean Base?" in refusal(top)


@pytest.mark.parametrize(("wanted", "has", "fits"), [
    ("1.2", "1.2", True), ("1.2", "1.3", True), ("1.2", "1.2.5", True), ("1.10", "1.9", False), ("1.2", "2.0", False),
    ("2.0", "1.9", False), ("*", "0.1", True),
])  # fmt: skip
def test_version_has_to_fit(tmp_path: Path, wanted: str, has: str, fits: bool) -> None:
    library(tmp_path, "Base", {"b.st": GET}, has)
    top = library(tmp_path, "Top", {"t.st": GET}, Base=wanted)
    if fits:
        assert len(resolve_libraries([top])) == 2
    else:
        expected = f"Top needs Base {wanted}, but {tmp_path}/Base is version {has}; give one version that fits all"
        assert f"library.toml:4:1: error: {expected}" in refusal(top)


def test_versions_that_two_libraries_need_are_in_conflict(tmp_path: Path) -> None:
    os.rename(library(tmp_path, "Base", {"b.st": GET}, "1.0"), tmp_path / "one")
    os.rename(library(tmp_path, "Base", {"b.st": GET}, "2.0"), tmp_path / "two")
    a, b = library(tmp_path, "A", {"a.st": GET}, Base="1.0"), library(tmp_path, "B", {"b.st": GET}, Base="2.0")
    assert f"B needs Base 2.0, but {tmp_path}/one is version 1.0, which A 1.0.0 needs" in refusal(a, b)
    assert "There are two libraries Base" in refusal(tmp_path / "one", tmp_path / "two")
    assert len(resolve_libraries([tmp_path / "one", tmp_path / "one"])) == 1


def test_libraries_that_need_each_other_are_refused(tmp_path: Path) -> None:
    library(tmp_path, "A", {"a.st": GET}, B="1.0")
    library(tmp_path, "B", {"b.st": GET}, C="1.0")
    c = library(tmp_path, "C", {"c.st": GET}, A="1.0")
    assert "the libraries need each other: C needs A needs B needs C" in refusal(c)
    own = library(tmp_path, "Own", {"o.st": GET}, Own="1.0")
    assert "Own needs Own" in refusal(own)


def test_two_libraries_with_one_namespace_are_refused(tmp_path: Path) -> None:
    a, b = library(tmp_path, "A", {"a.st": GET}), library(tmp_path, "B", {"b.st": GET})
    (b / "library.toml").write_text('name = "B"\nversion = "1"\nnamespace = "a"\n')
    assert "have the same namespace" in refusal(a, b)


@pytest.mark.parametrize(("here", "named", "folder"), [(".", ".", ".."), ("src", "..", "../..")])
def test_library_that_is_named_as_a_dot_has_what_lies_beside_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, here: str, named: str, folder: str
) -> None:
    monkeypatch.chdir(library(tmp_path, "Top", {"src/t.st": GET}, Base="1") / here)
    assert f"or put it into {folder}\n" in refusal(Path(named))
    library(tmp_path, "Base", {"b.st": GET})
    assert [found.path for found in resolve_libraries([], [Path(named)])] == [Path(folder) / "Base"]


def test_library_that_is_checked_by_itself_has_what_it_needs(tmp_path: Path) -> None:
    library(tmp_path, "Base", {"b.st": GET})
    test = "TEST 'own'\nASSERT_EQ(Top.Twice(), 14);\nASSERT_EQ(Twice(), 14);\nEND_TEST\n"
    top = library(
        tmp_path, "Top", {"t.st": GET.replace("Get", "Twice").replace("7", "2 * Base.Get()") + test}, Base="1"
    )
    assert [outcome.failure for outcome in run_tests([top]).outcomes] == [None]


# ---- library.toml ----


@pytest.mark.parametrize(("text", "found"), [
    ('version = "1"', '1:1: error: library.toml needs name: write for example name = "Util"'),
    ('name = "Lib"', '1:1: error: library.toml needs version: write for example version = "1.0.0"'),
    ('name = "My Lib"\nversion = "1"', "1:8: error: 'My Lib' cannot be the name of a library"),
    ('name = "VAR"\nversion = "1"', "1:8: error: 'VAR' cannot be the name of a library"),
    ('name = "L"\nnamespace = "a.b"\nversion = "1"', "2:13: error: 'a.b' cannot be a namespace"),
    ('name = "L"\nversion = "one"', "2:11: error: 'one' is not a version; write numbers"),
    ('name = "L"\nversion = "1"\nnamspace = "x"', "3:1: error: there is no 'namspace' here; did you mean namespace?"),
    ('name = "L"\nversion = "1"\ndependencies = ["B"]', "3:16: error: dependencies is a list; it has to be a table"),
    ('name = "L"\nversion = "1"\n[dependencies]\nB = 1.2', "4:5: error: the version of B is a text such as"),
    ('name = "L"\nversion = "1"\n[dependencies]\nB = ">=1"', "4:5: error: the version of B is a text such as"),
    ('name = ', "1:7: error: this is not TOML"),
])  # fmt: skip
def test_mistakes_in_library_toml_have_their_line_and_a_hint(tmp_path: Path, text: str, found: str) -> None:
    home = library(tmp_path, "Lib", {"get.st": GET})
    (home / "library.toml").write_text(text)
    assert refusal(home).startswith(f"{home}/library.toml:{found}")
    path = zipped(tmp_path / "lib.zip", {"library.toml": text, "get.st": GET})
    assert refusal(path).startswith(f"{path}/library.toml:{found}")


def test_path_that_is_no_library_is_refused(tmp_path: Path) -> None:
    assert f"There is no library {tmp_path}/x; a library is a folder or .zip with a library.toml." in refusal(
        tmp_path / "x"
    )
    assert "is not a library: it has no library.toml" in refusal(tmp_path)
    assert "has no source file" in refusal(library(tmp_path, "Empty", {}))
    assert "has no source file" in refusal(zipped(tmp_path / "empty.zip", {"library.toml": manifest("Empty")}))
    (tmp_path / "Bad").mkdir()
    (tmp_path / "Bad/library.toml").write_bytes(b"\xff")
    assert "not UTF-8 at byte 0" in refusal(tmp_path / "Bad")


# ---- .zips that cannot be trusted ----


@pytest.mark.parametrize("name", ["../x.st", "a/../../x.st", "/x.st", "C:/x.st", "..\\x.st", "a/.."])
def test_zip_with_a_file_outside_itself_is_refused(tmp_path: Path, name: str) -> None:
    path = zipped(tmp_path / "lib.zip", {"library.toml": manifest("Lib"), "get.st": GET, name: GET})
    assert "which leads out of it; make it again without that" in refusal(path)


def test_zip_with_a_symbolic_link_is_refused(tmp_path: Path) -> None:
    path = zipped(tmp_path / "lib.zip", {"library.toml": manifest("Lib")})
    with zipfile.ZipFile(path, "a") as archive:
        link = zipfile.ZipInfo("x.st")
        link.external_attr = 0o120777 << 16
        archive.writestr(link, "/etc/passwd")
    assert "leads out of it" in refusal(path)


def test_huge_zip_is_refused_before_it_is_unpacked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bomb = {"library.toml": manifest("Lib"), "get.st": " " * (archives.MAX_BYTES + 1)}
    path = zipped(tmp_path / "lib.zip", bomb)
    assert path.stat().st_size < 200_000
    monkeypatch.setattr(zipfile.ZipExtFile, "read", lambda *words: pytest.fail("it is unpacked"))
    found = refusal(path)
    assert "unpacks to 67108" in found and "at most 67108864 bytes (64 MiB)" in found and "give it as a folder" in found
    many = zipped(tmp_path / "many.zip", {f"{n}.st": "" for n in range(archives.MAX_FILES + 1)})
    assert "has 10001 files, of at most 10000; make it again without what is no source" in refusal(many)


def test_zip_that_lies_about_sizes_is_refused(tmp_path: Path) -> None:
    path = zipped(tmp_path / "lib.zip", {"library.toml": manifest("Lib"), "get.st": " " * 1_000_000})
    data = path.read_bytes()
    assert data.count(struct.pack("<I", 1_000_000)) == 2
    path.write_bytes(data.replace(struct.pack("<I", 1_000_000), struct.pack("<I", 10)))
    assert "cannot be read as a .zip" in refusal(path)


@pytest.mark.parametrize("stated", [10, 1 << 20])
def test_bomb_that_states_a_small_size_is_not_unpacked(tmp_path: Path, stated: int) -> None:
    import tracemalloc

    size = 200 << 20
    path = tmp_path / "lib.zip"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("library.toml", manifest("Lib"))
        with archive.open("get.st", "w") as file:
            for _ in range(size >> 20):
                file.write(bytes(1 << 20))
    data = path.read_bytes()
    assert data.count(struct.pack("<I", size)) == 2
    path.write_bytes(data.replace(struct.pack("<I", size), struct.pack("<I", stated)))
    tracemalloc.start()
    try:
        assert "cannot be read as a .zip" in refusal(path)
        assert tracemalloc.get_traced_memory()[1] < 16 << 20
    finally:
        tracemalloc.stop()


def test_zip_with_a_size_that_is_too_large_is_refused(tmp_path: Path) -> None:
    path = zipped(tmp_path / "lib.zip", {"library.toml": manifest("Lib"), "get.st": GET + " " * 100_000})
    size = struct.pack("<I", len(GET) + 100_000)
    path.write_bytes(path.read_bytes().replace(size, struct.pack("<I", 200_000)))
    assert "cannot be read as a .zip" in refusal(path)


@pytest.mark.parametrize("method", [zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_zip_with_another_compression_is_refused_and_says_which_to_use(tmp_path: Path, method: int) -> None:
    path = zipped(tmp_path / "lib.zip", {"library.toml": manifest("Lib")})
    with zipfile.ZipFile(path, "a", method) as archive:
        archive.writestr("get.st", GET)
    found = refusal(path)
    assert "'get.st'" in found and "make it again with 'deflate'" in found


def test_zip_without_compression_is_read(tmp_path: Path) -> None:
    path = tmp_path / "lib.zip"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_STORED) as archive:
        archive.writestr("library.toml", manifest("Lib"))
        archive.writestr("get.st", GET)
    assert messages(check(tmp_path, USE, path)) == []


def test_zip_with_control_characters_in_a_name_is_refused_without_printing_them(tmp_path: Path) -> None:
    path = zipped(tmp_path / "lib.zip", {"library.toml": manifest("Lib"), "\x1b[2Jget.st": GET})
    found = refusal(path)
    assert "\x1b" not in found and "get.st" in found


@pytest.mark.parametrize("name", ["GET.st", "./get.st", ".//get.st"])
def test_zip_with_two_names_of_one_file_is_refused(tmp_path: Path, name: str) -> None:
    path = zipped(tmp_path / "lib.zip", {"library.toml": manifest("Lib"), "get.st": GET, name: GET})
    assert "twice" in refusal(path)


def test_zip_with_an_empty_name_is_refused(tmp_path: Path) -> None:
    path = zipped(tmp_path / "lib.zip", {"library.toml": manifest("Lib"), "x": GET})
    data = bytearray(path.read_bytes())
    data[data.rindex(b"PK\x01\x02") + 28] = 0
    path.write_bytes(data)
    assert str(path) in refusal(path)


@pytest.mark.parametrize("damage", ["empty", "cut", "byte", "text", "encrypted", "method", "twice"])
def test_damaged_zip_is_refused(tmp_path: Path, damage: str) -> None:
    path = zipped(tmp_path / "lib.zip", {"library.toml": manifest("Lib"), "get.st": GET * 50})
    data = bytearray(path.read_bytes())
    if damage == "empty":
        data.clear()
    elif damage == "cut":
        del data[len(data) // 2 :]
    elif damage == "byte":
        data[data.index(b"get.st") + 12] ^= 0xFF
    elif damage == "text":
        data[:] = b"not a zip"
    elif damage == "encrypted":
        at = data.index(b"PK\x01\x02")
        data[at + 8] |= 1
    elif damage == "method":
        at = data.index(b"PK\x01\x02")
        data[at + 10] = 77
    path.write_bytes(data)
    if damage == "twice":
        with zipfile.ZipFile(path, "a") as archive:
            archive.writestr("GET.st", GET)
    assert str(path) in refusal(path)


# ---- no more is parsed than is needed ----


def counted(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The files, other than the program, that are parsed from now on, by part."""
    from plctool.compiler import front

    seen: list[str] = []

    def parse(source, report, *words, **more):  # type: ignore[no-untyped-def]
        seen.append(Path(source.path).name)
        return parse_all(source, report, *words, **more)

    monkeypatch.setattr(front, "parse_all", parse)
    return seen


def test_only_units_that_are_used_are_parsed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    unit = "(* {n} *)\nFUNCTION F{n} : INT\nF{n} := {value};\nEND_FUNCTION\n"
    big = "".join(unit.format(n=n, value=n) for n in range(1000))
    last = unit.format(n="Last", value="F500() + F501()")
    home = library(tmp_path, "Lib", {"big.st": big + last, "other.st": "this is not (* Structured Text"})
    seen = counted(monkeypatch)
    assert messages(check(tmp_path, USE.replace("Get", "FLast"), home)) == []
    assert sorted(seen) == ["big.st"] * 3 + ["main.st"]


def test_unit_that_is_not_used_is_not_checked_nor_compiled(tmp_path: Path) -> None:
    from plctool.compiler import compile_sources

    unused = "FUNCTION_BLOCK Unused\nVAR x : Nowhere; END_VAR\nx.y();\nEND_FUNCTION_BLOCK\n"
    home = library(tmp_path, "Lib", {"get.st": GET + unused + "VAR_GLOBAL big : ARRAY[0..9999] OF LREAL; END_VAR"})
    program = tmp_path / "p"
    program.mkdir()
    (program / "main.st").write_text(USE)
    built = compile_sources([program], libraries=[home])
    assert list(built.symbols.variables) == ["Main.n"]


@pytest.mark.parametrize("text", [
    "(* FUNCTION Wrong (* END_FUNCTION *) *)\nFUNCTION Get : INT\n// END_FUNCTION\nGet := 1;\nEND_FUNCTION",
    "{attribute 'x' := 'FUNCTION'}\nFUNCTION PUBLIC Get : INT\nVAR s : STRING := 'END_FUNCTION'; END_VAR\nEND_FUNCTION",
    "{IF defined(X)}\nFUNCTION Get : INT\nEND_FUNCTION\n{ELSE}\nFUNCTION Get : DINT\nEND_FUNCTION\n{END_IF}",
    "NAMESPACE Get\nFUNCTION Put : INT\nEND_FUNCTION\nEND_NAMESPACE",
    "VAR_GLOBAL Get, Put : INT; END_VAR",
    "VAR_GLOBAL x : (No, Get := 4); END_VAR",
    "TYPE a : (No,\n Get := 4, Yes); b : STRUCT x : INT; END_STRUCT; END_TYPE",
    "TYPE Get : STRUCT Put : INT; END_STRUCT; END_TYPE",
    "function_block Get\nend_function_block\nfunction Put : int\nend_function",
    "FUNCTION_BLOCK Get\nMETHOD M : INT\nEND_METHOD\nEND_FUNCTION_BLOCK\nMETHOD N : INT\nEND_METHOD",
    "CLASS Get\nEND_CLASS",
])  # fmt: skip
def test_part_that_declares_a_name_is_found(text: str) -> None:
    from plctool.compiler.base.source import Source

    other = "FUNCTION Other : INT\nEND_FUNCTION\n"
    for source in (text, other + text, f"{text}\n{other}"):
        parts = imports.parts_of(Source("x.st", source))
        assert "".join(source[p.start : p.end] for p in parts).strip() == source.strip()
        assert any("get" in map(str.casefold, p.names) for p in parts), parts
