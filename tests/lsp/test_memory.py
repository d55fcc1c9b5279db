"""The server's memory after many edits."""

from __future__ import annotations

import gc
from collections import Counter
from pathlib import Path

from plctool.lsp.checks import checked
from plctool.lsp.incremental import Kept, Observer
from plctool.lsp.project import Project


def objects() -> Counter[str]:
    """Returns how many objects of each type there are."""
    gc.collect()
    return Counter(type(each).__name__ for each in gc.get_objects())


def test_edits_leave_nothing_behind(folder: Path) -> None:
    """Neither in the trees and names that requests are answered from, nor in what checks keep."""
    open_files: dict[str, str] = {}
    project = Project([folder / "plc.toml"], open_files)
    observer = Observer(lambda: None)
    snapshot = project.snapshot()
    kept = Kept(observer, snapshot.sources, checked(snapshot, None, observer))
    file = str(folder / "src/pump.st")
    text = Path(file).read_text()

    def edit(count: int) -> None:
        for n in range(count):
            open_files[file] = text.replace("running := TRUE;", f"running := level > {n};")
            project.change(file)
            (tree,) = project.trees_of(file)
            assert project.walk(tree).uses
            assert kept.check(tree.source) is not None

    edit(20)
    before = objects()
    edit(200)
    more = objects() - before
    assert sum(more.values()) < 200, more.most_common(10)
