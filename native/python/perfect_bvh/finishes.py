"""Finishes of surfaces: layers on top, brushed and rough structure, distributions of facets."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ._checks import check_column

Float32Array = npt.NDArray[np.float32]

FACET_KINDS = ("ggx", "beckmann", "ashikhmin_shirley")


@dataclass(frozen=True, slots=True)
class FinishTable:
    """F finishes: properties that few surfaces have. None in a column: the neutral value.

    Attributes:
        sheens: (F, 3) float32, 0 or more: the colour of fibers on top, as of cloth.
        sheen_roughnesses: (F,) float32, 0 to 1; None: 0.5.
        sheen_covers: (F,) float32, 0 to 1: the share of the light reflected by fibers that does not reach the layers
            below, as in Blender's Principled BSDF; None: all.
        coats: (F,) float32, 0 to 1: the weight of a clear coat below the sheen.
        coat_roughnesses: (F,) float32, 0 to 1; None: 0.03.
        coat_iors: (F,) float32, 1 or more; None: 1.5.
        coat_tints: (F, 3) float32: the coat's transmittance, seen from straight above.
        stretches: (F,) float32, more than 0: widens the slopes of facets along the tangent and narrows them across it
            by this factor.
        rotations: (F,) float32, of the tangent about the normal, in turns. A program sets the tangent ("TANGENT"), and
            the coat's normal ("COAT_NORMAL") if it differs from the mesh's.
        diffuse_roughnesses: (F,) float32, 0 to 1.
        absorptions: (F, 3) float32, 0 or more: the absorption of light inside closed meshes, by length: of light
            that enters through the surface, exp(-absorption * length) reaches the surface from inside.
        distributions: (F,) float32, rows of FACET_KINDS: the distribution of the slopes of facets. Except for GGX,
            light that facets scatter at each other is correct with `MaterialTable.lossy_facets` 1.
    """

    sheens: Float32Array | None = None
    sheen_roughnesses: Float32Array | None = None
    sheen_covers: Float32Array | None = None
    coats: Float32Array | None = None
    coat_roughnesses: Float32Array | None = None
    coat_iors: Float32Array | None = None
    coat_tints: Float32Array | None = None
    stretches: Float32Array | None = None
    rotations: Float32Array | None = None
    diffuse_roughnesses: Float32Array | None = None
    distributions: Float32Array | None = None
    absorptions: Float32Array | None = None


# In the order of the engine's `Finish`: the width, the value for None, the minimum and the maximum of each column.
_FINISH_COLUMNS: dict[str, tuple[int, float, float, float]] = {
    "sheens": (3, 0.0, 0.0, np.inf),
    "sheen_roughnesses": (1, 0.5, 0.0, 1.0),
    "sheen_covers": (1, 1.0, 0.0, 1.0),
    "coats": (1, 0.0, 0.0, 1.0),
    "coat_roughnesses": (1, 0.03, 0.0, 1.0),
    "coat_iors": (1, 1.5, 1.0, np.inf),
    "coat_tints": (3, 1.0, 0.0, np.inf),
    "stretches": (1, 1.0, 1e-2, 1e2),
    "rotations": (1, 0.0, -np.inf, np.inf),
    "diffuse_roughnesses": (1, 0.0, 0.0, 1.0),
    "distributions": (1, 0.0, 0.0, len(FACET_KINDS) - 1.0),
    "absorptions": (3, 0.0, 0.0, np.inf),
}


def finish_arguments(function: str, finish: FinishTable) -> npt.NDArray[np.float32]:
    """(F, 18): all columns side by side."""
    given = {name: getattr(finish, name) for name in _FINISH_COLUMNS if getattr(finish, name) is not None}
    count = max((len(column) for column in given.values()), default=0)
    columns = []
    for name, (width, neutral, least, most) in _FINISH_COLUMNS.items():
        column = np.full((count, width), neutral, np.float32)
        if name in given:
            column = check_column(
                function, f"appearance.finish.{name}", given[name], np.float32, (3,) if width == 3 else ()
            )
            if len(column) != count:
                raise ValueError(f"{function}: appearance.finish.{name} has {len(column)} rows, another column {count}")
            if not ((column >= least) & (column <= most)).all():
                raise ValueError(f"{function}: appearance.finish.{name} must be {least:g} to {most:g}")
        columns.append(column.reshape(count, width))
    return np.concatenate(columns, axis=1)
