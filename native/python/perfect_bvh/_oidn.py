"""OpenImageDenoise 2 by its C interface: where its library is, one device, filters over images.

The library is one that is loaded already (Blender carries and loads it), the system's, or that of the package pyoidn.
Afra et al., "Intel Open Image Denoise"; the networks are part of the library.
"""

from __future__ import annotations

import ctypes
import importlib.util
import os
import sys
import threading
import weakref
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from .errors import Cancelled, EngineError

Image = npt.NDArray[np.float32]
Share = Callable[[float], object]

# As its own releases and Blender name it on each system.
_NAMES = {"win32": "OpenImageDenoise.dll", "darwin": "libOpenImageDenoise.dylib"}
LIBRARY_NAME = _NAMES.get(sys.platform, "libOpenImageDenoise.so.2")
NAME = "OpenImageDenoise"

# The numbers of the C interface.
_CPU_DEVICE = 1
_FLOAT3 = 3
_OUT_OF_MEMORY, _CANCELLED = 4, 6
QUALITIES = {"fast": 4, "balanced": 5, "high": 6}

# The interval at which a waiting caller is asked whether to continue.
_ASKING_SECONDS = 0.02

# Its threads do not live on in a fork, and it would wait for them for ever.
_process = os.getpid()

_Handle, _Name, _Size = ctypes.c_void_p, ctypes.c_char_p, ctypes.c_size_t
_Monitor = ctypes.CFUNCTYPE(ctypes.c_bool, ctypes.c_void_p, ctypes.c_double)
_SIGNATURES: dict[str, tuple[type | None, tuple[type, ...]]] = {
    "oidnNewDevice": (_Handle, (ctypes.c_int,)),
    "oidnSetDeviceInt": (None, (_Handle, _Name, ctypes.c_int)),
    "oidnSetDeviceBool": (None, (_Handle, _Name, ctypes.c_bool)),
    "oidnGetDeviceInt": (ctypes.c_int, (_Handle, _Name)),
    "oidnCommitDevice": (None, (_Handle,)),
    "oidnGetDeviceError": (ctypes.c_int, (_Handle, ctypes.POINTER(_Name))),
    "oidnReleaseDevice": (None, (_Handle,)),
    "oidnNewFilter": (_Handle, (_Handle, _Name)),
    "oidnSetSharedFilterImage": (None, (_Handle, _Name, _Handle, ctypes.c_int, *[_Size] * 5)),
    "oidnSetFilterBool": (None, (_Handle, _Name, ctypes.c_bool)),
    "oidnSetFilterInt": (None, (_Handle, _Name, ctypes.c_int)),
    "oidnSetFilterProgressMonitorFunction": (None, (_Handle, _Monitor, ctypes.c_void_p)),
    "oidnCommitFilter": (None, (_Handle,)),
    "oidnExecuteFilter": (None, (_Handle,)),
    "oidnReleaseFilter": (None, (_Handle,)),
}


@dataclass(frozen=True, slots=True)
class Library:
    """One that works. path: as it was found. version: as it says itself, such as "2.3.3"."""

    calls: ctypes.CDLL
    path: str
    version: str


_found: dict[tuple[str, ...], tuple[Library, tuple[str, ...]]] = {}


def find_library(paths: tuple[str, ...]) -> tuple[Library | None, tuple[str, ...]]:
    """The first that works, None if none does; and of those that are there and do not, a sentence each.

    Args:
        paths: Files to try before all others.
    """
    if has_forked():
        return None, (f"{NAME} does not work in a forked process",)
    if paths in _found:
        return _found[paths]
    reasons: list[str] = []
    for path in (*paths, LIBRARY_NAME, *_package_paths()):
        try:
            library = _load(path)
        except OSError as error:
            if path != LIBRARY_NAME:  # a name alone says only that the system has none
                reasons.append(f"{NAME} cannot be loaded: {_reason(error, path)}")
        except (AttributeError, ValueError, EngineError, MemoryError) as error:
            reasons.append(f"'{path}' is not a usable {NAME}: {error}")
        else:
            _found[paths] = library, tuple(reasons)
            return _found[paths]
    return None, tuple(reasons)


def has_forked() -> bool:
    """Whether this process is a fork of one that had this module: the state of the library is useless here."""
    return os.getpid() != _process


def _package_paths() -> list[str]:
    """Finds the package pyoidn without importing it: it would load its library with names that all others see."""
    found = importlib.util.find_spec("pyoidn")
    folders = [] if found is None else found.submodule_search_locations or []
    place = "bin" if sys.platform == "win32" else "lib"
    paths = [Path(folder) / "oidn" / place / LIBRARY_NAME for folder in folders]
    return [str(path) for path in paths if path.exists()]


def _reason(error: OSError, path: str) -> str:
    """Why a file cannot be loaded, with its path: Windows' words leave it out, or advise programmers instead."""
    if isinstance(error, FileNotFoundError):
        return f"'{path}' is missing, or a library that it needs"
    return str(error) if path in str(error) else f"'{path}': {error}"


def _load(path: str) -> Library:
    with _no_boxes():
        _load_what_it_needs(Path(path))
        calls = ctypes.CDLL(path)
    for name, (result, arguments) in _SIGNATURES.items():
        function = getattr(calls, name)
        function.restype, function.argtypes = result, arguments
    device = Device(Library(calls, path, ""), 1)
    numbers = [device.number(f"version{part}") for part in ("Major", "Minor", "Patch")]
    if numbers[0] != 2:
        raise EngineError(f"its version is {numbers[0]}, and 2 is needed")
    return Library(calls, path, ".".join(map(str, numbers)))


def _load_what_it_needs(path: Path) -> None:
    """On Windows, load tbb12.dll from the library's own folder: its device searches only the program's folder."""
    threads = path.parent / "tbb12.dll"
    if sys.platform == "win32" and path.is_absolute() and threads.is_file():
        ctypes.CDLL(str(threads))


@contextmanager
def _no_boxes() -> Iterator[None]:
    """Keep Windows from showing a message box for a file that is no library, and waiting until it is closed."""
    if sys.platform != "win32":
        yield
        return
    set_mode, before, fail_silently = ctypes.CDLL("kernel32").SetThreadErrorMode, ctypes.c_uint32(), 1
    set_mode(fail_silently, ctypes.byref(before))
    try:
        yield
    finally:
        set_mode(before.value, None)


class Device:
    """The device of filters: the processor, with this many threads. Released when it is dropped."""

    def __init__(self, library: Library, threads: int) -> None:
        self.calls = calls = library.calls
        self.handle = calls.oidnNewDevice(_CPU_DEVICE)
        if not self.handle:
            self.check("a device for this processor")
        # Threads stay where they are: others of this process use them as well.
        weakref.finalize(self, calls.oidnReleaseDevice, self.handle).atexit = False
        calls.oidnSetDeviceInt(self.handle, b"numThreads", threads)
        calls.oidnSetDeviceBool(self.handle, b"setAffinity", False)
        calls.oidnCommitDevice(self.handle)
        self.check("a device for this processor")

    def number(self, name: str) -> int:
        """A property of it."""
        return int(self.calls.oidnGetDeviceInt(self.handle, name.encode()))

    def check(self, what: str) -> None:
        """Raises what went wrong on this thread: Cancelled, MemoryError or EngineError."""
        message = _Name()
        code = self.calls.oidnGetDeviceError(self.handle, ctypes.byref(message))
        if code == 0 and self.handle:
            return
        if code == _CANCELLED:
            raise Cancelled("denoise: cancelled")
        text = (message.value or b"it does not say why").decode(errors="replace")
        if code == _OUT_OF_MEMORY:
            raise MemoryError(f"denoise: {NAME} has no memory left for {what} ({text}): denoise a smaller image")
        raise EngineError(f"denoise: {NAME} failed at {what} ({text}): denoise with backend='joint'")


class _Run:
    """The progress of a filter, which the library reports on any of its threads, and whether it should continue."""

    def __init__(self) -> None:
        self.share = 0.0
        self.shall_stop = False

    def note(self, _: object, share: float) -> bool:
        """Called by the library."""
        self.share = share
        return not self.shall_stop


class Filter:
    """A network over images in memory that the caller keeps; ready to be run again and again.

    Args:
        images: By the library's names, (H, W, 3) float32, C-contiguous. "output" may be one of the others.
    """

    def __init__(self, device: Device, images: dict[str, Image], quality: str, **switches: bool) -> None:
        self._device, self._images = device, images
        calls = device.calls
        self._handle = calls.oidnNewFilter(device.handle, b"RT")
        if not self._handle:
            device.check("a filter")
        weakref.finalize(self, calls.oidnReleaseFilter, self._handle).atexit = False
        for name, image in images.items():
            height, width = image.shape[:2]
            place = (image.ctypes.data, _FLOAT3, width, height, 0, 0, 0)
            calls.oidnSetSharedFilterImage(self._handle, name.encode(), *place)
        for name, value in switches.items():
            calls.oidnSetFilterBool(self._handle, name.encode(), value)
        calls.oidnSetFilterInt(self._handle, b"quality", QUALITIES[quality])
        # The library's callback must not hold the filter: its large memory would wait for the garbage collector.
        self._run = _Run()
        self._monitor = _Monitor(self._run.note)  # as long as the filter may call it
        calls.oidnSetFilterProgressMonitorFunction(self._handle, self._monitor, None)
        calls.oidnCommitFilter(self._handle)
        device.check("a filter")

    def run(self, progress: Share | None) -> None:
        """Filters the current images. progress: called on this thread with 0 to 1, False stops it."""
        if has_forked():
            raise EngineError(f"denoise: {NAME} does not work in a forked process: make a new Denoiser there")
        state = self._run
        state.share, state.shall_stop = 0.0, False
        # On a separate thread, so that this one can ask its caller and can be interrupted; the library's would not.
        work = _Work(self._execute)
        is_wanted = True
        try:
            while not work.has_ended.wait(_ASKING_SECONDS):
                if is_wanted and progress is not None and progress(state.share) is False:
                    is_wanted, state.shall_stop = False, True
        finally:  # Ctrl-C, too: nothing writes into the images once this has returned
            state.shall_stop = True
            work.has_ended.wait()
        if not is_wanted:
            raise Cancelled("denoise: cancelled")
        if work.problem is not None:
            raise work.problem

    def _execute(self) -> None:
        self._device.calls.oidnExecuteFilter(self._handle)
        self._device.check("filtering an image")


class _Work:
    """A call on a separate thread, or on this one if the system has none to spare."""

    def __init__(self, call: Callable[[], None]) -> None:
        self.has_ended = threading.Event()
        self.problem: Exception | None = None
        self._call = call
        try:
            threading.Thread(target=self._run, name=NAME, daemon=True).start()
        except RuntimeError:
            self._run()

    def _run(self) -> None:
        try:
            self._call()
        except Exception as problem:  # noqa: BLE001 - handed on to the waiting caller
            self.problem = problem
        finally:
            self.has_ended.set()
