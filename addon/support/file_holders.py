"""Which programs have a file open, as Windows' Restart Manager knows it, which installers ask."""

from __future__ import annotations

import ctypes
from pathlib import Path
from typing import Any

from .paths import IS_WINDOWS

_MOST = 8  # programs that are asked for


class Program(ctypes.Structure):
    """RM_PROCESS_INFO; names are UTF-16, with a zero at the end."""

    _fields_ = (
        ("process", ctypes.c_uint32),
        ("started", ctypes.c_uint32 * 2),
        ("name", ctypes.c_uint16 * 256),
        ("service", ctypes.c_uint16 * 64),
        ("kind", ctypes.c_int32),
        ("status", ctypes.c_uint32),
        ("session", ctypes.c_uint32),
        ("is_restartable", ctypes.c_int32),
    )


def programs_with(path: Path, manager: Any = None) -> list[str]:
    """Their names, in no order; empty where nobody knows. manager: the library's functions, or what stands for them."""
    if manager is None:
        if not IS_WINDOWS:
            return []
        try:
            manager = ctypes.CDLL("rstrtmgr")
        except OSError:  # a Windows that was made small
            return []
    session, key = ctypes.c_uint32(), (ctypes.c_uint16 * 33)()
    if manager.RmStartSession(ctypes.byref(session), 0, key):
        return []
    try:
        return _ask(manager, session, path)
    finally:
        manager.RmEndSession(session)


def _ask(manager: Any, session: ctypes.c_uint32, path: Path) -> list[str]:
    files = (ctypes.c_wchar_p * 1)(str(path))
    if manager.RmRegisterResources(session, 1, files, 0, None, 0, None):
        return []
    found = (Program * _MOST)()
    needed, count, reasons = ctypes.c_uint32(), ctypes.c_uint32(_MOST), ctypes.c_uint32()
    if manager.RmGetList(session, ctypes.byref(needed), ctypes.byref(count), found, ctypes.byref(reasons)):
        return []
    names = (bytes(each.name).decode("utf-16-le", "replace").partition("\0")[0] for each in found[: count.value])
    return list(dict.fromkeys(name for name in names if name))
