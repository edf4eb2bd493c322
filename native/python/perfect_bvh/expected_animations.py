"""What a scene may be told of the frames to come, for trees that serve all of them."""

from __future__ import annotations

import numpy.typing as npt

from . import _core
from ._arrays import as_steps, check_count, check_id

_SHAPES = (2, 64)
_MOST_FRAMES = 1_000_000


class ExpectedAnimations:
    """Edits of a `Scene`."""

    __slots__ = ()
    _scene: _core.Scene

    def expect_animation(self, mesh: int, positions: npt.ArrayLike, frames: int) -> None:
        """Tells which shapes a mesh will take, so that one tree may be built for all of them.

        positions: (S, V, 3), S shapes from 2 to 64, each with as many rows as the mesh. They lie at equal intervals of
            the frames to come, the first and the last frame among them. All of them tell how fast a tree decays, which
            needs one every few frames where the motion is quick; the tree is built for 8 of them at most.
        frames: how many commits of this mesh are to come, from 2 to 1,000,000; each may then move the mesh to any
            shape, known or not, by `update_mesh`.

        The next commit that builds or updates the mesh, and knows how many rays to expect (`expected_rays`, of each
        frame), weighs one tree for all frames (T-SAH: Bittner and Meister 2015, "T-SAH: Animation optimized bounding
        volume hierarchies") against refitting, and rebuilding every so many frames. It takes 6 to 13 times as long to
        build as a tree of one frame (where all flies apart 100 times): it pays where hundreds of frames sway, walk or
        turn back and forth, and rays are too few to repay a new tree every few frames. To weigh it takes as long as 4
        to 11 trees of one frame with 64 shapes, and less with fewer. The report's `alternatives` and `reason` tell,
        whether it is built (`action` "animated") or not. Later commits refit it, until it costs a ray a tenth more than
        at the worst of the shapes, the frames are over, or the mesh rests for long.

        It is told once, and forgotten when it was weighed, after `frames` commits, or by `replace_mesh`. Until then
        the engine holds a copy of the shapes. No query's answer changes by it, so that none is stale. The policy
        "governed" weighs it, "animate" builds it always, others do not.

        Raises ValueError for an unknown mesh, for curves and points, for positions of other counts or not finite, for
        other numbers of shapes and frames, and for a mesh that was added with a builder other than "auto", which
        stays; what was told before holds then.
        """
        name = "expect_animation"
        shapes, rows = as_steps(name, "positions", positions, 3, _SHAPES)
        count = check_count(name, "frames", frames, 2, _MOST_FRAMES)
        self._scene.expect_animation(check_id(name, "mesh", mesh), rows, shapes, count)
