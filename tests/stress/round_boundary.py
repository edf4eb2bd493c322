"""Any bytes as calls that give a scene curves and points, valid or not: a refused call leaves it unchanged."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import perfect_bvh
from perfect_bvh.build_config import BUILDERS

from .arguments import INTEGERS, anything, array, number
from .boundary import Caller
from .bytes import Bytes, Features

KINDS = ("poly", "catmull_rom", "bezier", "b_spline", "nurbs", None)
USAGES = ("static", "deforming", "changing")
COORDINATES = np.float32([0.0, 1.0, -1.0, 0.5, 0.25, 1.0 + 2.0**-23, 1e-7, -1e-3, 3.0, 0.1])
SIZES = np.float32([0.1, 0.0, 0.5, 1e-6, 2.0, 1e-30])
RAYS = 24
FIELDS = ("t_hit", "instance_ids", "mesh_ids", "primitive_ids", "primitive_uvs", "geometric_normals")


class Round:
    """A scene with a mesh of each kind, and the bytes that determine the calls."""

    def __init__(self, data: bytes) -> None:
        self.source, self.caller = Bytes(data), Caller()
        self.random = np.random.default_rng(list(data))
        self.scene = perfect_bvh.Scene()
        triangle = np.float32([(-1, -1, 0), (1, -1, 0), (0, 1, 0)])
        self.scene.add_instance(self.scene.add_mesh(triangle, np.array([[0, 1, 2]])))
        self.scene.add_instance(self.scene.add_points(triangle, 0.25))
        self.scene.add_instance(self.scene.add_curves(triangle, 0.25, [0, 3]))
        self.scene.commit()

    def run(self) -> Features:
        for _ in range(4):
            self.edit(self.source.pick(EDITS))
        return self.caller.features | {("held", str(min(self.scene.mesh_count, 5)))}

    def edit(self, make: Callable[[Round], tuple[str, tuple[Any, ...], dict[str, Any]]]) -> None:
        """One call; then the answers agree, and are as before if it was refused."""
        name, arguments, keywords = make(self)
        origins, directions = self.random.uniform(-2.0, 2.0, (2, RAYS, 3))
        before = self.scene.cast_rays(origins, directions, fields=FIELDS)
        counts = self.scene.mesh_count, self.scene.instance_count
        made = self.caller.ask(getattr(self.scene, name), name, *arguments, **keywords)
        is_taken = not self.scene.is_current or self.scene.mesh_count > counts[0]
        if name.startswith("add") and made is not None:
            self.scene.add_instance(made)
        if is_taken:
            self.scene.commit()
            self.caller.features.add(("taken", name, str(keywords.get("kind", ""))))
        else:
            assert (self.scene.mesh_count, self.scene.instance_count) == counts, name
        hits = self.scene.cast_rays(origins, directions, fields=FIELDS, audit=1.0)
        assert hits.audit is not None  # which judges the triangle
        assert hits.audit.wrong_rows.size == 0, f"{name}: {hits.audit}"
        found, splits = self.scene.list_intersections(origins, directions, fields=FIELDS, max_hits=1)
        assert np.array_equal(np.diff(splits), hits.is_hit), name
        for field in FIELDS:
            assert getattr(found, field).tobytes() == getattr(hits, field)[hits.is_hit].tobytes(), (name, field)
        if not is_taken:
            assert all(getattr(hits, field).tobytes() == getattr(before, field).tobytes() for field in FIELDS), name

    # Arguments ---------------------------------------------------------------------------------------------------

    def places(self) -> Any:
        """Points of the right shape, mostly; the caller's radii fit three of four."""
        if self.source.take(4) == 3:
            return anything(self.source)
        return self.random.choice(COORDINATES, (1 + self.source.take(9), 3))

    def radii(self, places: Any) -> Any:
        kind = self.source.take(4)
        if kind == 3:
            return number(self.source)
        rows = _rows(places)
        return self.random.choice(SIZES, rows) if kind else 0.25

    def offsets(self, places: Any) -> Any:
        """Returns offsets that usually match the number of points, and sometimes do not."""
        kind = self.source.take(6)
        rows = _rows(places)
        if kind == 5:
            return array(self.source, (None,), INTEGERS)
        if kind == 4:
            return np.sort(self.random.integers(-1, rows + 2, self.source.take(5)))
        return np.unique([0, *(2 * self.source.take(4) for _ in range(kind)), rows]).clip(0, rows)

    def mesh(self) -> Any:
        return (0, 1, 2, 3, 1, 2, -1, 99, 1.5, None)[self.source.take(10)]

    def curves(self) -> tuple[tuple[Any, ...], dict[str, Any]]:
        places = self.places()
        keywords: dict[str, Any] = {"kind": self.source.pick(KINDS)}
        if self.source.take(3) == 0:
            keywords["cyclic"] = self.source.pick((True, False, [True], "yes", None, np.nan))
        if self.source.take(3) == 0:
            keywords["tolerance"] = self.source.pick((0.01, 0.0, -1.0, np.nan, np.inf, "fine", 1e-3))
        if self.source.take(3) == 0:
            keywords["segments"] = self.source.pick((1, 3, 0, -1, 1025, 1.5, True))
        return (places, self.radii(places), self.offsets(places)), keywords

    def add_points(self) -> tuple[str, tuple[Any, ...], dict[str, Any]]:
        places = self.places()
        how = {"build": self.build(), "usage": self.source.pick(USAGES)}
        return "add_points", (places, self.radii(places)), how

    def add_curves(self) -> tuple[str, tuple[Any, ...], dict[str, Any]]:
        arguments, keywords = self.curves()
        return "add_curves", arguments, {**keywords, "build": self.build(), "usage": self.source.pick(USAGES)}

    def build(self) -> perfect_bvh.BuildConfig:
        return perfect_bvh.BuildConfig(builder=self.source.pick(BUILDERS))

    def update_points(self) -> tuple[str, tuple[Any, ...], dict[str, Any]]:
        return self._update("update_points")

    def update_curves(self) -> tuple[str, tuple[Any, ...], dict[str, Any]]:
        return self._update("update_curves")

    def _update(self, name: str) -> tuple[str, tuple[Any, ...], dict[str, Any]]:
        mesh, is_fitting = self.mesh(), self.source.take(3) > 0
        places = self.random.choice(COORDINATES, (3, 3)) if is_fitting else self.places()
        radii = None if self.source.take(2) else self.radii(places)
        return name, (mesh, places, radii), {}

    def replace_points(self) -> tuple[str, tuple[Any, ...], dict[str, Any]]:
        places = self.places()
        return "replace_points", (self.mesh(), places, self.radii(places)), {}

    def replace_curves(self) -> tuple[str, tuple[Any, ...], dict[str, Any]]:
        arguments, keywords = self.curves()
        return "replace_curves", (self.mesh(), *arguments), keywords

    def update_mesh(self) -> tuple[str, tuple[Any, ...], dict[str, Any]]:
        """Returns a call of update_mesh for a mesh that may have no triangles."""
        return "update_mesh", (self.mesh(), self.random.choice(COORDINATES, (3, 3))), {}


def _rows(places: Any) -> int:
    return len(places) if np.ndim(places) and not isinstance(places, str) else 1


EDITS = (
    Round.add_points,
    Round.add_curves,
    Round.update_points,
    Round.update_curves,
    Round.replace_points,
    Round.replace_curves,
    Round.update_mesh,
)


def fill_with_curves_and_points(data: bytes) -> Features:
    """A scene that gets curves and points of any kind, and others in their place."""
    return Round(data).run()
