"""The exceptions of Perfect BVH. Bad arguments are plain `ValueError`s."""

from __future__ import annotations


class EngineError(RuntimeError):
    """The engine refuses to do something, and says why."""


class StaleSceneError(EngineError):
    """A query on a scene whose last edits were not committed, or whose source has changed since."""


class Cancelled(EngineError):  # noqa: N818 - a stop that was asked for is no error
    """A long call was stopped by its `progress` callable. Nothing was changed by it."""
