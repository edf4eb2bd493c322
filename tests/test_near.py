"""`nox -s quick` finds the tests that are near a change."""

from __future__ import annotations

from near import module_name, near_native_suites, near_python_tests


def test_modules_have_the_names_that_tests_import() -> None:
    assert module_name("addon/image/plan.py") == "perfect_bvh_addon.image.plan"
    assert module_name("addon/extract/__init__.py") == "perfect_bvh_addon.extract"
    assert module_name("native/python/perfect_bvh/queries.py") == "perfect_bvh.queries"
    assert module_name("tests/oracles/brute_force.py") == "oracles.brute_force"
    assert module_name("release/build_wheels.py") is None


def test_what_imports_a_changed_module_is_near() -> None:
    found = near_python_tests(["addon/image/plan.py"])
    assert "tests/blender/test_noise_threshold.py" in found
    assert "tests/engine/test_watertight.py" not in found


def test_what_bears_its_name_comes_before_what_imports_it() -> None:
    found = near_python_tests(["addon/view3d/rendered/viewport.py"])
    assert found.index("tests/blender/test_viewport.py") < found.index("tests/blender/test_viewport_builds.py")


def test_what_imports_it_through_others_is_near_and_comes_later() -> None:
    found = near_python_tests(["addon/extract/looks/sky.py"])
    assert found.index("tests/blender/test_extract_nodes.py") < found.index("tests/blender/test_extract_camera.py")
    assert "tests/engine/test_watertight.py" not in found


def test_a_changed_test_comes_first() -> None:
    found = near_python_tests(["tests/sync/test_state.py", "addon/sync/keys.py"])
    assert found.index("tests/sync/test_state.py") < found.index("tests/sync/test_keys.py")


def test_what_holds_for_all_sources_is_always_near() -> None:
    assert "tests/test_layers.py" in near_python_tests([])


def test_suites_of_a_changed_source_are_those_that_include_its_header() -> None:
    assert "Binned" not in near_native_suites(["native/src/tlas/top_level.cpp"])
    assert near_native_suites(["native/src/tlas/top_level.cpp"])
    assert near_native_suites(["native/tests/test_grid.cpp"])
    assert near_native_suites(["README.md"]) == []


def test_suites_that_include_a_changed_header_through_others_are_near() -> None:
    assert "Builder" in " ".join(near_native_suites(["native/src/core/errors.h"]))
    assert "HardInput" in near_native_suites(["native/tests/mesh_sets.h"])
