"""The surfaces that rays hit, from the looks that a sync has read. Does not depend on Blender.

In: hits; out: `Surfaces`, their shares at the sensor's wavelength, as the renderer has them. Lights, emission, bent
normals and hair's own scattering are ignored: strands have their base colour.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from perfect_bvh import materials_at
from perfect_bvh.appearance import Appearance

from ..patterns import Float64Array
from .reflectance import Surfaces

if TYPE_CHECKING:
    from perfect_bvh import Hits

    from ...live.scene_sync import SceneSync


class SurfaceReader:
    """Reads surfaces of one update of a sync. spectrum: the weights of red, green and blue."""

    def __init__(self, sync: SceneSync, spectrum: tuple[float, float, float]) -> None:
        self._sync = sync
        self._appearance: Appearance = sync.appearance
        self._spectrum = np.array(spectrum, np.float64) / sum(spectrum)

    def read(self, hits: Hits) -> Surfaces:
        """Returns the surfaces of hits, none of them a miss."""
        found = materials_at(self._sync.scene, self._appearance, hits)
        columns = {name: column.astype(np.float64) for name, column in found.items()}
        metal = columns["metallics"]
        clear = (1.0 - metal) * columns["transmissions"]
        coat = columns["reflectances"] * self._gray(columns["specular_tints"])
        return Surfaces(
            alpha=columns["alphas"],
            diffuse=(1.0 - metal - clear) * (1.0 - columns["translucencies"]),
            metal=metal,
            clear=clear,
            color=self._gray(np.maximum(columns["colors"], 0.0)),
            metal_color=np.clip(self._gray(columns["metals"]), 0.0, 1.0),
            clear_color=np.clip(self._gray(columns["tints"]), 0.0, 1.0),
            coat=np.clip(coat, 0.0, 1.0),
            ior=columns["iors"],
            mirrors=1.0 - columns["plain_refractions"],
            slant=1.0 - columns["even_metals"],
            roughness=columns["roughnesses"],
        )

    def _gray(self, colors: Any) -> Float64Array:
        red, green, blue = self._spectrum.tolist()
        return np.asarray(colors[:, 0] * red + colors[:, 1] * green + colors[:, 2] * blue, np.float64)
