"""Programs of shader nodes: how they are built, and how they shade a surface."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from engine.preview_looks import ABOVE, CORNER_UVS, SIZE, floor, materials, one_material
from perfect_bvh import Appearance, MeshAppearance, materials_at, render, render_passes
from perfect_bvh.appearance import World
from perfect_bvh.nodes import NodeBuilder, NodeProgram, Output, channels_of

WHITE = World((1.0, 1.0, 1.0))


def floor_look(program: NodeProgram, **mesh: object) -> Appearance:
    return Appearance(
        meshes={0: MeshAppearance(corner_uvs=CORNER_UVS, **mesh)},  # type: ignore[arg-type]
        instances=one_material(1),
        materials=materials(programs=(program,)),
        world=WHITE,
    )


def test_what_is_made_of_constants_is_worked_out_at_once() -> None:
    nodes = NodeBuilder()
    assert nodes.add("math", 2.0, 3.0, 0.0, mode="POWER") == 8.0
    assert nodes.add("mix", 0.25, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), mode="MIX") == (0.75, 0.25, 0.0)
    hue = nodes.add("convert", (0.2, 0.4, 0.6), mode="RGB_TO_HSV")
    assert nodes.add("convert", hue, mode="HSV_TO_RGB") == pytest.approx((0.2, 0.4, 0.6), abs=1e-6)
    table = [0.0, 0.0, 0.0, 1.0, 1.0, 0.5, 0.0, 0.0]
    assert nodes.add("table", 0.5, mode="LINEAR", numbers=table) == (0.5, 0.25, 0.0, 0.5)
    assert nodes.add("table", 0.999, mode="CONSTANT", numbers=table) == (0.0, 0.0, 0.0, 1.0)


def test_the_same_instruction_is_made_once_and_only_what_is_needed_is_kept() -> None:
    nodes = NodeBuilder()
    first, second = (nodes.add("input", mode="UV") for _ in range(2))
    assert first == second
    nodes.add("noise", first, *[1.0] * 8, mode="FBM", numbers=[3, 1, 0])
    assert isinstance(first, Output)
    plain, other = (nodes.program(ROUGHNESS=channels_of(first, channel)) for channel in (0, 1))
    assert len(plain.codes) == 3 + 5
    assert plain != other
    assert plain == nodes.program(ROUGHNESS=channels_of(first, 0))
    assert plain.layer_names("uvs") == {""}
    assert plain.asks("UV")
    assert not plain.asks("GENERATED")


@pytest.mark.parametrize(
    ("kind", "operands", "given", "message"),
    [
        ("shine", (), {}, "kind must be one of constant, input, .*, got 'shine'"),
        ("math", (1.0, 2.0, 0.0), {"mode": "DOUBT"}, "mode of math must be one of ADD, .*, got 'DOUBT'"),
        ("math", (1.0, 2.0), {"mode": "ADD"}, "math reads 3 operands, got 2"),
        ("math", ((1.0, 2.0, 3.0), 0.0, 0.0), {"mode": "ADD"}, r"math reads a number, got \(1.0, 2.0, 3.0\)"),
        ("luminance", ((1.0, 2.0),), {}, r"luminance reads a number or 3 channels, got \(1.0, 2.0\)"),
        ("image", (1.0,), {"mode": "FLAT"}, "image has 1 numbers, got 0"),
    ],
)
def test_what_is_no_instruction_is_refused(kind: str, operands: tuple, given: dict, message: str) -> None:
    with pytest.raises(ValueError, match=f"NodeBuilder.add: {message}"):
        NodeBuilder().add(kind, *operands, **given)


def test_a_program_has_an_end() -> None:
    nodes = NodeBuilder()
    value = channels_of(nodes.add("input", mode="UV"), 0)
    for _ in range(9_999):
        value = nodes.add("math", value, 1.0, 0.0, mode="ADD")
    with pytest.raises(ValueError, match="at most 10000 instructions"):
        nodes.add("math", value, 1.0, 0.0, mode="ADD")


def test_a_deep_chain_of_nodes_is_followed() -> None:
    nodes = NodeBuilder()
    value = channels_of(nodes.add("input", mode="GIVEN"), 0)
    for _ in range(3000):
        value = nodes.add("math", value, 1.0, 0.0, mode="ADD")
    assert isinstance(value, Output)
    assert nodes.evaluate(value, [], [np.full((2, 4), 0.5, np.float32)], 2) == pytest.approx(3000.5)


def test_an_instances_own_values_are_asked_for() -> None:
    nodes = NodeBuilder()
    own = nodes.add("input", mode="INSTANCE", numbers=[1])
    look = floor_look(nodes.program(EMISSION=channels_of(own, 0, 3)))
    values = np.array([[(9.0, 9.0, 9.0, 9.0), (0.1, 0.2, 0.3, 0.4)]], np.float32)
    look = replace(look, instances=replace(look.instances, values=values), world=World())
    assert render(floor(), ABOVE, "preview", SIZE, 1, look)[16, 16, :3] == pytest.approx((0.1, 0.2, 0.3), abs=1e-6)
    for wrong, message in (
        (values[:, :1], "refers to a row that does not exist"),
        (values[0], r"must have shape \(1, K, 4\), got \(2, 4\)"),
    ):
        bad = replace(look, instances=replace(look.instances, values=wrong))
        with pytest.raises(ValueError, match=message):
            render(floor(), ABOVE, "preview", SIZE, 1, bad)


def test_places_are_those_of_the_surface() -> None:
    """Seen from above, the floor's own place, its texture space and its uvs each give a different colour."""
    space = np.array([(0.25, 0.5, 1.0), (0.5, 0.25, 0.125)], np.float32)
    hits = floor().cast_rays(np.array([(0.25, 0.125, 4.0)], np.float32), np.array([(0.0, 0.0, -1.0)], np.float32))
    for mode, expected in (
        ("POSITION", (0.25, 0.125, 0.0)),
        ("OBJECT", (0.25, 0.125, 0.0)),
        ("GENERATED", (0.5625, 0.3125, 0.125)),
        ("TRUE_NORMAL", (0.0, 0.0, 1.0)),
        ("INCOMING", (0.0, 0.0, 1.0)),
    ):
        nodes = NodeBuilder()
        look = floor_look(nodes.program(COLOR=nodes.add("input", mode=mode)), texture_space=space)
        found = materials_at(floor(), look, hits)
        assert found["colors"][0] == pytest.approx(expected, abs=1e-5), mode


def test_a_bump_bends_what_the_denoiser_is_told_of() -> None:
    """Heights that rise along x by 1 for each unit: the normal leans back by half a right angle."""
    nodes = NodeBuilder()
    height = channels_of(nodes.add("input", mode="POSITION"), 0)
    beside = [nodes.shifted(height, side) for side in (1, 2)]
    ways = [nodes.add("input", mode="SIDE", numbers=[side]) for side in (1, 2)]
    normal = nodes.add("input", mode="NORMAL")
    bent = nodes.add("bump", 1.0, 1.0, height, *beside, normal, *ways)
    look = floor_look(nodes.program(NORMAL=bent))
    passes = render_passes(
        floor(), ABOVE, mode="preview", size=SIZE, samples=4, appearance=look, passes=("denoising_normal", "normal")
    )
    for name, normal in passes.items():
        assert normal[16, 16] == pytest.approx((-(0.5**0.5), 0.0, 0.5**0.5), abs=2e-3), name


def test_hits_of_another_scene_have_no_material() -> None:
    nodes = NodeBuilder()
    look = floor_look(nodes.program(ROUGHNESS=channels_of(nodes.add("input", mode="UV"), 0)))
    hits = floor().cast_rays(np.array([(0.1, 0.1, 4.0)], np.float32), np.array([(0.0, 0.0, -1.0)], np.float32))
    for number in (7, -1):
        hits.instance_ids[:] = number
        with pytest.raises(ValueError, match="materials_at: hits are of another scene"):
            materials_at(floor(), look, hits)
