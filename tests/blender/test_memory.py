"""How much memory is left: to the machine, and to whatever limits the process in it."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from perfect_bvh_addon.support.memory import free_bytes

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
    assert free_bytes(make_system(tmp_path, system)) == expected


def test_where_the_system_does_not_tell_nothing_is_known(tmp_path: Path):
    assert free_bytes(tmp_path) is None


@pytest.mark.skipif(sys.platform != "linux", reason="no /proc/meminfo: only Linux tells what memory is free")
def test_this_system_has_something_left():
    free = free_bytes()
    assert free is not None and 1 << 20 < free < 1 << 50
