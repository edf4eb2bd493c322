"""How much memory is left: to the machine, and to whatever limits the process in it, as each system tells it."""

from __future__ import annotations

import ctypes
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from child_process import environment_with_paths
from perfect_bvh_addon.support import memory
from perfect_bvh_addon.support.memory import linux, macos, windows

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
    """Answers as Windows does, from `answers`: structures by what is asked for."""

    def __init__(self, **answers: ctypes.Structure) -> None:
        self.answers = answers

    def _answer(self, name: str, pointer: Any, size: int) -> int:
        answer = self.answers.get(name)
        if answer is None:
            return 0
        assert size == ctypes.sizeof(answer) == ctypes.sizeof(pointer._obj)
        ctypes.memmove(pointer, ctypes.byref(answer), size)
        return 1

    def GlobalMemoryStatusEx(self, pointer: Any) -> int:  # noqa: N802 - Windows' names
        return self._answer("machine", pointer, pointer._obj.length)

    def GetCurrentProcess(self) -> int:  # noqa: N802
        return -1

    def K32GetProcessMemoryInfo(self, process: int, pointer: Any, size: int) -> int:  # noqa: N802
        assert process == -1 and size == pointer._obj.size
        return self._answer("process", pointer, size)

    def QueryInformationJobObject(self, job: None, number: int, pointer: Any, size: int, _: None) -> int:  # noqa: N802
        assert job is None
        return self._answer({9: "limits", 28: "usage"}[number], pointer, size)


ROOM = {"machine": windows.MachineMemory(available=9000, commit_available=8000)}
OWN = {"process": windows.ProcessUsage(committed=300)}


@pytest.mark.parametrize(
    ("answers", "expected"),
    [
        ({}, None),
        (ROOM, 8000),
        ({"machine": windows.MachineMemory(available=700, commit_available=8000)}, 700),
        (ROOM | OWN | {"limits": windows.JobLimits(flags=0x2000, process=1000, job=1000)}, 8000),
        (ROOM | OWN | {"limits": windows.JobLimits(flags=0x100, process=1000)}, 700),
        (ROOM | OWN | {"limits": windows.JobLimits(flags=0x100, process=200)}, 0),
        (ROOM | OWN | {"limits": windows.JobLimits(flags=0x200, job=1000)}, 700),
        (ROOM | OWN | {"limits": windows.JobLimits(flags=0x200, job=1000), "usage": windows.JobUsage(now=900)}, 100),
        (ROOM | OWN | {"limits": windows.JobLimits(flags=0x300, job=2000, process=1000)}, 700),
        (ROOM | {"limits": windows.JobLimits(flags=0x100, process=1000)}, 8000),
    ],
)
def test_the_least_of_machine_and_job_counts(answers: dict[str, ctypes.Structure], expected: int | None):
    assert windows.free_bytes(FakeKernel32(**answers)) == expected


def test_structures_are_as_large_as_windows_has_them():
    sizes = {windows.MachineMemory: 64, windows.JobLimits: 144, windows.JobUsage: 16, windows.ProcessUsage: 72}
    assert {each: ctypes.sizeof(each) for each in sizes} == sizes


IN_A_JOB = """
import ctypes
from perfect_bvh_addon.support.memory import free_bytes, windows
system = windows._kernel32()
system.CreateJobObjectW.restype = ctypes.c_void_p
system.SetInformationJobObject.argtypes = (ctypes.c_void_p, ctypes.c_int, ctypes.c_void_p, ctypes.c_uint32)
system.AssignProcessToJobObject.argtypes = (ctypes.c_void_p, ctypes.c_void_p)
job, limits = system.CreateJobObjectW(None, None), windows.JobLimits(flags=0x100, process=1 << 30)
assert system.SetInformationJobObject(job, 9, ctypes.byref(limits), ctypes.sizeof(limits))
assert system.AssignProcessToJobObject(job, system.GetCurrentProcess())
kept = windows._job_information(system, 9, windows.JobLimits())
print(0 if kept is None else kept.process, free_bytes())
"""


@pytest.mark.skipif(os.name != "nt", reason="job objects are Windows' own")
def test_a_job_limits_this_system():
    done = subprocess.run(
        [sys.executable, "-c", IN_A_JOB], env=environment_with_paths(), capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stderr
    limit, free = map(int, done.stdout.split())
    if not limit:
        pytest.skip("this Windows keeps no limits of jobs, as Wine does not")
    assert limit == 1 << 30 and 0 < free < limit


# macOS ---------------------------------------------------------------------------------------------------------------


class FakeLibSystem:
    def __init__(self, found: macos.Statistics | None) -> None:
        self.found = found

    def mach_host_self(self) -> int:
        return 7

    def host_statistics64(self, host: int, number: int, pointer: Any, count: Any) -> int:
        assert (host, number) == (7, 4)
        assert 4 * count._obj.value == ctypes.sizeof(pointer._obj) == 152
        if self.found is None:
            return 5  # KERN_FAILURE
        ctypes.memmove(pointer, ctypes.byref(self.found), 152)
        return 0


def test_what_macos_has_free_or_unused_counts(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(macos, "_page_size", lambda _: 16384)
    found = macos.Statistics(free=100, active=9, inactive=20, wired=8, purgeable=3, speculative=50, external=11)
    assert macos.free_bytes(FakeLibSystem(found)) == 120 * 16384
    assert macos.free_bytes(FakeLibSystem(None)) is None


# Any -----------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("system", "module"), [("win32", windows), ("darwin", macos), ("linux", linux), ("freebsd14", linux)]
)
def test_each_system_is_asked_in_its_own_way(monkeypatch: pytest.MonkeyPatch, system: str, module: Any):
    monkeypatch.setattr(module, "free_bytes", lambda: 5 << 30)
    monkeypatch.setattr(memory.sys, "platform", system)
    assert memory.free_bytes() == 5 << 30
    with pytest.raises(ValueError, match=r"^It needs about 6\.0 GiB .* 5\.0 GiB are free: make it smaller$"):
        memory.check_fits("It", 6 << 30, "make it smaller")


def test_this_system_has_something_left():
    free = memory.free_bytes()
    assert free is not None and 1 << 20 < free < 1 << 50
