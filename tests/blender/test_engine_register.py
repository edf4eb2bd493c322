"""Registering: repeatedly, with a second copy installed, and without the native engine."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

bpy = pytest.importorskip("bpy")

import perfect_bvh  # noqa: E402
import perfect_bvh_addon  # noqa: E402
from perfect_bvh_addon import panels  # noqa: E402


@pytest.fixture(autouse=True)
def unregistered() -> Iterator[None]:
    perfect_bvh_addon.unregister()
    yield
    perfect_bvh_addon.unregister()


def engine_names() -> set[str]:
    return {engine.bl_idname for engine in bpy.types.RenderEngine.__subclasses__() if hasattr(engine, "bl_idname")}


def handler_counts() -> list[int]:
    return [len(value) for name in dir(bpy.app.handlers) if isinstance(value := getattr(bpy.app.handlers, name), list)]


def test_registering_leaves_nothing_behind() -> None:
    counts = handler_counts()
    for _ in range(3):
        perfect_bvh_addon.register()
        perfect_bvh_addon.register()
        assert bpy.types.PERFECT_BVH_PT_render.is_registered
        bpy.context.scene.render.engine = "PERFECT_BVH"
        assert bpy.context.scene.perfect_bvh.mode == "PREVIEW"
        perfect_bvh_addon.unregister()
        perfect_bvh_addon.unregister()
        assert not hasattr(bpy.types, "PERFECT_BVH_PT_render")
        assert not hasattr(bpy.types.Scene, "perfect_bvh")
        assert handler_counts() == counts
        assert not any("PERFECT_BVH" in panel.COMPAT_ENGINES for panel in panels.objects.shared_panels())


def test_a_failed_registration_is_undone(monkeypatch) -> None:
    def fail() -> None:
        raise RuntimeError("no panels today")

    counts = handler_counts()
    monkeypatch.setattr(panels, "register", fail)
    with pytest.raises(RuntimeError, match="no panels today"):
        perfect_bvh_addon.register()
    monkeypatch.undo()
    assert not hasattr(bpy.types.Scene, "perfect_bvh")
    assert handler_counts() == counts
    perfect_bvh_addon.register()


def test_blenders_own_panels_stay_usable() -> None:
    perfect_bvh_addon.register()
    for name in ("RENDER_PT_format", "RENDER_PT_color_management", "VIEWLAYER_PT_layer_passes", "DATA_PT_lens"):
        assert "PERFECT_BVH" in getattr(bpy.types, name).COMPAT_ENGINES
    assert "PERFECT_BVH" not in bpy.types.RENDER_PT_freestyle.COMPAT_ENGINES


def test_a_second_copy_is_refused() -> None:
    perfect_bvh_addon.register()
    source = Path(perfect_bvh_addon.__file__)
    name = "bl_ext_copy_of_perfect_bvh"
    spec = importlib.util.spec_from_file_location(name, source, submodule_search_locations=[str(source.parent)])
    copy = importlib.util.module_from_spec(spec)
    sys.modules[name] = copy
    try:
        spec.loader.exec_module(copy)
        with pytest.raises(RuntimeError, match="already registered by 'perfect_bvh_addon'"):
            copy.register()
        copy.unregister()
        assert bpy.types.PERFECT_BVH_PT_render.is_registered
        perfect_bvh_addon.unregister()
        copy.register()
        assert bpy.types.PERFECT_BVH_PT_render.__module__ == f"{name}.panels.render"
        copy.unregister()
    finally:
        for module in [module for module in sys.modules if module == name or module.startswith(f"{name}.")]:
            del sys.modules[module]


WITHOUT_ENGINE = """
import sys
sys.modules["perfect_bvh"] = None  # importing it raises ImportError, as a damaged module would
import bpy, perfect_bvh_addon
from perfect_bvh_addon.settings.preferences import native_error
perfect_bvh_addon.register()
scene = bpy.context.scene
scene.render.engine = "PERFECT_BVH"
assert "could not be loaded" in native_error()
try:
    bpy.ops.render.render()
except RuntimeError as error:
    assert "could not be loaded" in str(error), error
else:
    raise AssertionError("the render did not fail")
perfect_bvh_addon.unregister()
print("survived")
"""


def test_blender_survives_without_the_native_engine() -> None:
    done = subprocess.run([sys.executable, "-c", WITHOUT_ENGINE], capture_output=True, text=True, timeout=300)
    assert "survived" in done.stdout, done.stderr


OTHER_ENGINE = """
import sys, types
import perfect_bvh
from pathlib import Path
perfect_bvh.__version__ = "0.0.9"  # and it lacks what came later
sys.modules["perfect_bvh.bulk"] = None
import bpy, perfect_bvh_addon
from perfect_bvh_addon.settings.preferences import native_error
perfect_bvh_addon.register()
reason = native_error()
folder = Path(perfect_bvh.__file__).parent
for part in ("is version 0.0.9", f"needs {sys.argv[1]}:", "restart Blender", "install the add-on again", str(folder)):
    assert part in reason, (part, reason)
scene = bpy.context.scene
scene.render.engine = "PERFECT_BVH"

class Layout:
    texts = []
    def __getattr__(self, name):
        return lambda **options: [self.texts.append(options.get("text", "")), self][1]

system = types.SimpleNamespace(system=types.SimpleNamespace(ui_scale=1.0))
panel = types.SimpleNamespace(layout=Layout())
context = types.SimpleNamespace(scene=scene, region=types.SimpleNamespace(width=9999), preferences=system)
bpy.types.PERFECT_BVH_PT_render.draw(panel, context)
assert reason in " ".join(Layout.texts), Layout.texts
for operator in (bpy.ops.perfect_bvh.preview, bpy.ops.perfect_bvh.scan, bpy.ops.perfect_bvh.bench):
    assert not operator.poll()
try:
    bpy.ops.render.render()
except RuntimeError as error:
    assert "is version 0.0.9" in str(error), error
else:
    raise AssertionError("the render did not fail")
perfect_bvh_addon.unregister()
print("survived")
"""


def test_an_engine_of_another_version_is_named_and_not_used() -> None:
    """For example an engine that was loaded before an update, whose files Blender could not replace."""
    arguments = [sys.executable, "-c", OTHER_ENGINE, perfect_bvh.__version__]
    done = subprocess.run(arguments, capture_output=True, text=True, timeout=300)
    assert "survived" in done.stdout, done.stderr


def test_the_add_on_needs_no_library_that_blender_lacks() -> None:
    names = ["matplotlib", "tqdm", "plyfile", "laspy", "pyarrow", "h5py", "PIL", "OpenEXR", "pycocotools", "dask"]
    code = f"import sys; sys.modules.update(dict.fromkeys({names})); import perfect_bvh_addon as it; it.register()"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr


def test_importing_the_package_loads_neither_blender_nor_numpy() -> None:
    code = "import sys, perfect_bvh_addon.cli; print(sorted({'bpy', 'numpy', 'perfect_bvh'} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=300)
    assert done.stdout.strip() == "[]", done.stderr


PREFERENCES = """
import bpy
import addon_utils
from perfect_bvh_addon.settings.preferences import cache_byte_limit
assert addon_utils.enable("perfect_bvh_addon", default_set=True) is not None
preferences = bpy.context.preferences.addons["perfect_bvh_addon"].preferences
assert cache_byte_limit() == preferences.cache_size << 20 > 0
preferences.cache_size = 3
assert cache_byte_limit() == 3 << 20
preferences.cache_size = 0
assert cache_byte_limit() is None
preferences.cache_size = 5
import perfect_bvh
preferences.threads = 1
assert perfect_bvh.thread_count() == 1
addon_utils.disable("perfect_bvh_addon")
assert cache_byte_limit() is None
print("fine")
"""


def test_preferences_reach_the_engine() -> None:
    """Enable the add-on as Blender does, so that it has preferences; this runs in a separate process."""
    done = subprocess.run([sys.executable, "-c", PREFERENCES], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert "fine" in done.stdout
