"""Chunks of long work: which count as done, what a folder refuses, leftovers of killed processes, which comes next."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import pytest
from perfect_bvh_addon.cli.farm.run import Costs
from perfect_bvh_addon.pieces import piece as inputs
from perfect_bvh_addon.pieces.piece import (
    OtherInputsError,
    Piece,
    PieceFolder,
    find_difference,
    inputs_of,
    known_checksums,
    learn_checksums,
    runs_of,
)
from perfect_bvh_addon.support.files import find_remainders

INPUTS: dict[str, Any] = {"files": {"a.blend": "1"}, "steps": 1}


def piece_of(*frames: int) -> Piece:
    stem = f"x_{frames[0]}-{frames[-1]}"
    return Piece(frames, stem, (f"{stem}.bin",))


def folder_with(path: Path, *pieces: Piece) -> PieceFolder:
    place = PieceFolder(path, INPUTS, "x_", "test")
    for piece in pieces:
        place.path_of(piece.files[0]).write_bytes(b"content")
        place.finish(piece, seed=3)
    return place


def test_runs_end_where_frames_do_unless_they_may_have_gaps() -> None:
    assert runs_of([9, 1, 2, 3, 1, 7], 2) == [(1, 2), (3,), (7,), (9,)]
    assert runs_of([9, 1, 2, 3, 1, 7], 2, has_gaps=True) == [(1, 2), (3, 7), (9,)]
    assert runs_of([], 2) == []


def test_a_piece_is_done_if_its_files_are_those_of_its_manifest(tmp_path: Path) -> None:
    piece = piece_of(1, 2)
    place = folder_with(tmp_path, piece)
    assert place.is_done(piece)
    assert json.loads((tmp_path / "x_1-2.json").read_text())["seed"] == 3
    assert not PieceFolder(tmp_path, {**INPUTS, "steps": 2}, "x_", "test").is_done(piece)
    assert not place.is_done(Piece(piece.frames, piece.stem, (*piece.files, "more.bin")))
    (tmp_path / "x_1-2.bin").write_bytes(b"kontent")
    assert not place.is_done(piece)
    (tmp_path / "x_1-2.bin").unlink()
    assert not place.is_done(piece)


@pytest.mark.parametrize(
    "text", ["", "{", "[]", "3", '{"inputs": {}, "files": {}, "frames": [1.5]}', '{"inputs": {}, "frames": [1, 2]}']
)
def test_what_is_no_manifest_is_not_trusted(tmp_path: Path, text: str) -> None:
    piece = piece_of(1, 2)
    place = folder_with(tmp_path, piece)
    (tmp_path / "x_1-2.json").write_text(text)
    assert not place.is_done(piece)
    place.check([piece])


@pytest.mark.parametrize("frames", [(1,), (2, 3), (1, 2, 3), (0, 2)])
def test_frames_are_divided_in_one_way(tmp_path: Path, frames: tuple[int, ...]) -> None:
    place = folder_with(tmp_path, piece_of(1, 2))
    with pytest.raises(OtherInputsError, match="differs in the division of frames into chunks"):
        place.check([piece_of(*frames)])
    place.check([piece_of(1, 2), piece_of(3, 4)])


def test_pieces_of_other_inputs_are_refused(tmp_path: Path) -> None:
    folder_with(tmp_path, piece_of(1, 2))
    with pytest.raises(OtherInputsError, match=r"x_1-2\.json differs in 'steps'"):
        PieceFolder(tmp_path, {**INPUTS, "steps": 2}, "x_", "test").check([piece_of(7, 8)])


def test_forgotten_pieces_are_not_done(tmp_path: Path) -> None:
    pieces = [piece_of(1, 2), piece_of(3, 4)]
    place = folder_with(tmp_path, *pieces)
    place.forget(pieces[:1])
    assert [place.is_done(piece) for piece in pieces] == [False, True]


def test_inputs_are_as_json_gives_them_back(tmp_path: Path) -> None:
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "image.png").write_text(name)
    made = inputs_of(
        [tmp_path / "a" / "image.png", tmp_path / "b" / "image.png", tmp_path / "missing.png"], size=(4, 3)
    )
    assert made == json.loads(json.dumps(made))
    assert made["size"] == [4, 3] and list(made["files"]) == ["image.png"]
    assert len(made["files"]["image.png"].split(" ")) == 2


def test_a_file_is_read_once_by_all_processes_of_a_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    read: list[str] = []
    true_checksum = inputs.checksum
    monkeypatch.setattr(inputs, "checksum", lambda path: read.append(path.name) or true_checksum(path))
    monkeypatch.setattr(inputs, "_known", {})
    paths = [tmp_path / "a.png", tmp_path / "b.png"]
    for path in paths:
        path.write_text("one")
    first = inputs_of(paths)
    told = json.loads(json.dumps(known_checksums()))  # as a worker gets it
    inputs._known.clear()
    learn_checksums(told)
    assert inputs_of(paths) == first and read == ["a.png", "b.png"]
    paths[0].write_text("two")  # as many bytes
    os.utime(paths[0], ns=(1, 1))
    assert find_difference(first, inputs_of(paths)) == "'files' (a.png)" and read == ["a.png", "b.png", "a.png"]


def test_differences_are_named() -> None:
    known: dict[str, Any] = {"files": {"a.png": "1", "b.png": "2"}, "blender": "5.0.1", "labels": ["a"]}
    assert find_difference(known, known) is None
    assert find_difference(known, {**known, "more": 1}) is None
    assert find_difference(known, {**known, "blender": "4.2.0"}) == """'blender' ("4.2.0", not "5.0.1")"""
    assert find_difference(known, {**known, "labels": []}) == """'labels' ([], not ["a"])"""
    assert find_difference(known, {**known, "labels": ["a" * 100]}) == "'labels'"
    assert find_difference(known, {**known, "files": {"b.png": "3", "c.png": "4"}}) == "'files' (a.png and 2 more)"
    assert find_difference(known, {**known, "files": []}).startswith("'files' ([], not")


def test_what_killed_processes_leave_is_found_and_nothing_else(tmp_path: Path) -> None:
    left = [".deadbeef", ".x_1-2.01234567.bin", ".x_1-2.89abcdef.json"]
    others = ["x_1-2.bin", ".x_1-2.0123456.bin", ".y.01234567.bin", ".x_1-2.01234567.png", ".deadbeef.png", ".hidden"]
    for name in (*left, *others):
        (tmp_path / name).touch()
    assert [path.name for path in find_remainders(tmp_path, ["x_1-2.bin", "x_1-2.json"])] == left
    place = folder_with(tmp_path)
    place.clear([piece_of(1, 2)])
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(others)


def test_what_killed_processes_leave_in_folders_of_pieces_is_found_and_nothing_else(tmp_path: Path) -> None:
    piece = Piece((1,), "x_1-1", ("x_1/depth.npy", "x_1/label_a.b.npy", "x_2/depth.npy", "x_1.json"))
    left = ["x_1/.01234567", "x_1/.depth.01234567.npy", "x_1/.label_a.b.89abcdef.npy", ".x_1.01234567.json"]
    others = ["x_1/depth.npy", "x_1/.x_1.01234567.json", "x_1/.mine.01234567.npy", "x_1/.hidden", "x_1/notes.txt"]
    others += [".depth.01234567.npy", "mine/.depth.01234567.npy", "mine/.01234567"]
    for folder in ("x_1", "mine"):
        (tmp_path / folder).mkdir()
    for name in (*left, *others):
        (tmp_path / name).touch()
    folder_with(tmp_path).clear([piece])
    assert {path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*") if path.is_file()} == set(others)
    assert not (tmp_path / "x_2").exists()


def test_what_takes_longest_is_not_left_to_the_end() -> None:
    costs = Costs([piece_of(frame) for frame in range(10)], is_in_order=False)
    assert costs.next_of({7, 3, 5}, 2) == 3
    costs.add(0, 1.0)
    costs.add(9, 10.0)
    assert [costs.expected(number) for number in range(10)] == pytest.approx(list(range(1, 11)))
    assert costs.next_of({7, 3, 5}, 2) == 7
    assert costs.next_of(set(range(1, 9)), 1) == 1  # far from the end
    in_order = Costs([piece_of(frame) for frame in range(10)], is_in_order=True)
    in_order.add(9, 10.0)
    assert in_order.next_of({7, 3, 5}, 2) == 3
