"""A window with a 3D viewport for an operator that waits for clicks into it, without a screen."""

from __future__ import annotations

from types import SimpleNamespace

from blender.long_builds import TIMER, FakeOperator, FakeWindow
from mathutils import Matrix
from perfect_bvh_addon.operators import walk as operators
from perfect_bvh_addon.view3d.rendered import redraws


class Viewport:
    """A window with a 3D viewport that looks down at the scene, and a panel over its right end."""

    def __init__(self) -> None:
        data = SimpleNamespace(
            as_pointer=lambda: 8,
            view_perspective="ORTHO",
            view_matrix=Matrix.Translation((0.0, 0.0, -9.0)),
            window_matrix=Matrix.Diagonal((0.5, 0.5, -0.01, 1.0)),
        )
        space = SimpleNamespace(
            camera=None,
            use_render_border=False,
            local_view=None,
            use_local_collections=False,
            region_3d=data,
            as_pointer=lambda: 7,
        )
        for name in redraws.TYPE_FILTERS:
            setattr(space, name, True)
        main = SimpleNamespace(type="WINDOW", x=100, y=50, width=200, height=200, data=data)
        panel = SimpleNamespace(type="UI", x=260, y=50, width=40, height=200)
        self.area = SimpleNamespace(
            type="VIEW_3D",
            x=100,
            y=50,
            width=200,
            height=200,
            regions=[main, panel],
            spaces=SimpleNamespace(active=space),
        )
        self.cursor = "DEFAULT"
        self.context = FakeWindow()
        screen = SimpleNamespace(areas=[self.area])
        window = SimpleNamespace(screen=screen, cursor_modal_set=self._set, cursor_modal_restore=lambda: self._set(""))
        self.context._known["window"] = window
        self.operator = FakeOperator(operators.PERFECT_BVH_OT_walk_ray)

    def _set(self, cursor: str) -> None:
        self.cursor = cursor or "DEFAULT"

    def start(self) -> None:
        assert self.operator.invoke(self.context, None) == {"RUNNING_MODAL"}

    def send(self, kind: str, x: int = 200, y: int = 150, value: str = "PRESS", *, shift: bool = False) -> set[str]:
        event = SimpleNamespace(type=kind, value=value, mouse_x=x, mouse_y=y, shift=shift)
        return self.operator.modal(self.context, event)

    def click(self, x: int = 200, y: int = 150) -> None:
        assert self.send("LEFTMOUSE", x, y) == {"RUNNING_MODAL"}
        assert self.send("LEFTMOUSE", x, y, "RELEASE") == {"RUNNING_MODAL"}
        for _ in range(2000):
            if self.operator._reading is None:
                return
            self.operator.modal(self.context, TIMER)
        raise AssertionError("the trees do not come")

    @property
    def is_idle(self) -> bool:
        return self.cursor == "DEFAULT" and self.context.status is None and self.context.timers == 0
