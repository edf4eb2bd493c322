"""How much memory is left: on the machine, and within the process's limits, as each system reports it."""

from __future__ import annotations

import ctypes
from pathlib import Path
from typing import Any

import pytest
from perfect_bvh_addon.support import memory
from perfect_bvh_addon.support.memory import linux, windows

# Linux ---------------------------------------------------------------------------------------------------------------

MACHINE = "MemTotal:       16000 kB\nMemFree:  3000 kB\nMemAvailable:   8000 kB\n"
VERSION_1 = "9:name=systemd:/\n4:cpu,memory:/job/42\n0::/\n"


def make_system(root: Path, files: dict[str, str]) -> Path:
    for name, text in files.items():
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return root


def group_1(folder: str, limit: int, usage: int, cache: int = 0) -> dict[str, str]:
    place = f"sys/fs/cgroup/memory{folder}"
    return {
        f"{place}/memory.limit_in_bytes": f"{limit}\n",
        f"{place}/memory.usage_in_bytes": f"{usage}\n",
        f"{place}/memory.stat": f"cache 7\ntotal_inactive_file {cache}\n",
    }


def group_2(folder: str, limit: int | str, usage: int, cache: int = 0) -> dict[str, str]:
    place = f"sys/fs/cgroup{folder}"
    return {
        f"{place}/memory.max": f"{limit}\n",
        f"{place}/memory.current": f"{usage}\n",
        f"{place}/memory.stat": f"anon 5\ninactive_file {cache}\nactive_file 9\n",
    }


@pytest.mark.parametrize(
    ("groups", "files", "expected"),
    [
        ("", {}, 8000 << 10),
        ("0::/\n", {}, 8000 << 10),
        ("0::/\n", group_2("", 1000, 300), 700),
        ("0::/\n", group_2("", 1000, 300, cache=100), 800),
        ("0::/\n", group_2("", 1000, 1300), 0),
        ("0::/\n", group_2("", "max", 300), 8000 << 10),
        ("0::/a/b\n", group_2("/a/b", "max", 300) | group_2("/a", 2000, 500) | group_2("", 9000, 8000), 1000),
        ("0::/outside/of/the/container\n", group_2("", 1000, 400), 600),
        ("0::/../../above\n", group_2("", 1000, 400), 600),
        (VERSION_1, group_1("/job/42", 1000, 300, cache=50), 750),
        (VERSION_1, group_1("/job/42", 9223372036854771712, 300) | group_1("/job", 5000, 4000), 1000),
        (VERSION_1, group_1("", 1000, 1), 999),
        (VERSION_1, group_1("/job/42", 9223372036854771712, 300), 8000 << 10),
    ],
)
def test_the_least_of_machine_and_groups_counts(tmp_path: Path, groups: str, files: dict[str, str], expected: int):
    system = {"proc/meminfo": MACHINE, "proc/self/cgroup": groups} | files
    assert linux.free_bytes(make_system(tmp_path, system)) == expected


def test_where_the_system_does_not_tell_nothing_is_known(tmp_path: Path):
    assert linux.free_bytes(tmp_path) is None


# Windows -------------------------------------------------------------------------------------------------------------


class FakeKernel32:
    """Answers as Windows does; None where it does not."""

    def __init__(self, answer: windows.MachineMemory | None) -> None:
        self.answer = answer

    def GlobalMemoryStatusEx(self, pointer: Any) -> int:  # noqa: N802 - Windows' name
        if self.answer is None:
            return 0
        assert pointer._obj.length == ctypes.sizeof(self.answer) == 64
        ctypes.memmove(pointer, ctypes.byref(self.answer), 64)
        return 1


@pytest.mark.parametrize(("available", "committed", "expected"), [(9000, 8000, 8000), (700, 8000, 700)])
def test_the_less_of_memory_and_what_can_be_promised_counts(available: int, committed: int, expected: int):
    answer = windows.MachineMemory(available=available, commit_available=committed)
    assert windows.free_bytes(FakeKernel32(answer)) == expected
    assert windows.free_bytes(FakeKernel32(None)) is None


# Any -----------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("system", "module"), [("win32", windows), ("linux", linux), ("freebsd14", linux)])
def test_each_system_is_asked_in_its_own_way(monkeypatch: pytest.MonkeyPatch, system: str, module: Any):
    monkeypatch.setattr(module, "free_bytes", lambda: 5 << 30)
    monkeypatch.setattr(memory.sys, "platform", system)
    assert memory.free_bytes() == 5 << 30
    with pytest.raises(ValueError, match=r"^It needs about 6\.0 GiB .* 5\.0 GiB are free: make it smaller$"):
        memory.check_fits("It", 6 << 30, "make it smaller")


def test_this_system_has_something_left():
    free = memory.free_bytes()
    assert free is not None and 1 << 20 < free < 1 << 50
