"""Files that are whole or not there, on every system; on Windows one that is open elsewhere cannot be replaced."""

from __future__ import annotations

import os
import stat
from pathlib import Path

import pytest
from perfect_bvh_addon.support import files
from perfect_bvh_addon.support.files import check_writable, prepare_folder, replacing

needs_windows = pytest.mark.skipif(os.name != "nt", reason="only Windows refuses to replace a file that is open")


def write(path: Path, text: str) -> None:
    with replacing(path) as name:
        name.write_text(text)


def contents(folder: Path) -> dict[str, str]:
    return {path.name: path.read_text() for path in folder.iterdir()}


@pytest.mark.parametrize("folder", ["plain", "Jörg Müller/立方体 1", "/".join(["x" * 60] * 5)])
def test_a_file_is_replaced_at_the_end(tmp_path: Path, folder: str) -> None:
    path = tmp_path / folder / "ä b.txt"
    prepare_folder(path.parent)
    check_writable(path)
    reached = files.reachable(path.parent)
    assert contents(reached) == {}
    write(path, "older")
    with replacing(path) as name:
        name.write_text("newer")
        assert files.reachable(path).read_text() == "older"
        assert name.parent == reached and name.suffix == ".txt"
    check_writable(path)
    assert contents(reached) == {"ä b.txt": "newer"}


def test_a_failure_leaves_the_older_one_alone(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    write(path, "older")

    def fail() -> None:
        with replacing(path) as name:
            name.write_text("half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fail()
    assert contents(tmp_path) == {"a.txt": "older"}


def test_what_others_may_do_with_it_is_as_for_any_file(tmp_path: Path) -> None:
    write(tmp_path / "a.txt", "ours")
    (tmp_path / "b.txt").write_text("any")
    assert (tmp_path / "a.txt").stat().st_mode == (tmp_path / "b.txt").stat().st_mode


def test_a_folder_in_its_place_is_named(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="it is a folder"):
        check_writable(tmp_path)
    with pytest.raises(OSError, match="it is a folder"):
        write(tmp_path, "")
    (tmp_path / "a.txt").touch()
    with pytest.raises(OSError, match="cannot write into"):
        prepare_folder(tmp_path / "a.txt" / "b")


@pytest.fixture
def refusals(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """How often replacing is still refused, as an only element; and Windows' patience without the waiting."""
    left, replace = [0], os.replace

    def refuse(source: Path, target: Path) -> None:
        if left[0]:
            left[0] -= 1
            raise PermissionError(13, "Access is denied")
        replace(source, target)

    monkeypatch.setattr(files.os, "replace", refuse)
    monkeypatch.setattr(files, "_PATIENCE", (0.0, 0.0))
    return left


def test_one_who_only_looks_is_waited_for(tmp_path: Path, refusals: list[int]) -> None:
    refusals[0] = 2
    write(tmp_path / "a.txt", "newer")
    assert contents(tmp_path) == {"a.txt": "newer"}


def test_what_cannot_take_its_place_is_kept_and_named(tmp_path: Path, refusals: list[int]) -> None:
    path = tmp_path / "a.txt"
    write(path, "older")
    for mark in ("new", "new 2"):
        refusals[0] = 3
        with pytest.raises(PermissionError) as caught:
            write(path, mark)
        assert caught.value.strerror == (
            f"cannot write {path}: Access is denied (the new one is {tmp_path / f'a ({mark}).txt'})"
        )
    assert contents(tmp_path) == {"a.txt": "older", "a (new).txt": "new", "a (new 2).txt": "new 2"}


def test_it_is_kept_where_a_longer_name_is_not_to_be_had(tmp_path: Path, refusals: list[int]) -> None:
    path = tmp_path / f"{'x' * 251}.txt"
    refusals[0] = 3
    with pytest.raises(PermissionError, match="the new one is"):
        write(path, "newer")
    assert list(contents(tmp_path).values()) == ["newer"]


@needs_windows
def test_one_that_is_open_is_not_lost_and_the_reason_is_told(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    write(path, "older")
    with path.open() as opened:
        with pytest.raises(
            OSError, match=r"a\.txt: it is open in another program: close it there, or use another name$"
        ):
            check_writable(path)
        with pytest.raises(
            OSError, match=r"it is open in another program: close it there, .* \(the new one is .*a \(new\)\.txt\)"
        ):
            write(path, "newer")
        assert opened.read() == "older"
    assert contents(tmp_path) == {"a.txt": "older", "a (new).txt": "newer"}
    check_writable(path)
    write(path, "newest")
    assert path.read_text() == "newest"


@needs_windows
def test_a_write_protected_one_is_named(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.touch()
    path.chmod(stat.S_IREAD)
    with pytest.raises(OSError, match="it is write-protected: change its properties"):
        check_writable(path)
    path.chmod(stat.S_IREAD | stat.S_IWRITE)


@needs_windows
@pytest.mark.parametrize(("name", "fault"), [("a:b.txt", "cannot hold ':'"), ("nul.txt", "is a device")])
def test_names_that_windows_takes_for_something_else_are_refused(tmp_path: Path, name: str, fault: str) -> None:
    for act in (check_writable, lambda path: write(path, ""), lambda path: prepare_folder(path / "deeper")):
        with pytest.raises(OSError, match=fault):
            act(Path(f"{tmp_path}/{name}"))
    assert contents(tmp_path) == {}
