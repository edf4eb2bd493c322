"""Values of nodes at given points, compared with those that Cycles writes: 10,000 points each, 100,000 with --long."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import product
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from blender.node_setups import add  # noqa: E402
from blender.texture_values import cycles_values  # noqa: E402
from perfect_bvh.nodes import Output, channels_of  # noqa: E402
from perfect_bvh_addon.extract.looks.node_colors import read_surface  # noqa: E402, F401 registers the readers
from perfect_bvh_addon.extract.looks.node_values import ValueReader  # noqa: E402
from perfect_bvh_addon.extract.looks.values import Value, constant  # noqa: E402

FAR = 50.0  # points lie in a cube of twice this size
WITHIN = 1e-3
STEPS = 2  # of the points, which may lie on a step where Cycles' last digit is another on another processor


class PointReader(ValueReader):
    """Knows the attributes of points: `p`, a vector, and `w`, a number."""

    def input(self, mode: str, layer: str = "", number: int = 0) -> Value:
        assert mode == "COLOR", f"{mode} is not known of a point"
        given = self.nodes.add("input", mode="GIVEN", numbers=("pw".index(layer),))
        return Value(channels_of(given, 0, 3))


class NoImages:
    def row(self, image: Any, extension: str, interpolation: str) -> int:
        raise AssertionError(image)

    def has_alpha(self, image: Any, row: int) -> bool:
        raise AssertionError(image)

    def mean(self, nodes: Any, value: Value) -> tuple[float, ...]:
        raise AssertionError(value)


def our_values(points: np.ndarray, w: np.ndarray) -> list[np.ndarray]:
    """Return our values of the AOVs of the scene that `cycles_values` leaves, in the same order."""
    tree = bpy.data.materials["Texture"].node_tree
    given = [np.zeros((len(points), 4), np.float32) for _ in "pw"]
    given[0][:, :3], given[1][:] = points, w[:, None]
    found = []
    for target in (node for node in tree.nodes if node.type == "OUTPUT_AOV"):
        socket = next(socket for socket in target.inputs if socket.is_linked)
        reader = PointReader(NoImages(), constant(0.0))
        value = reader.read(socket)
        assert not value.is_guess, socket.links[0].from_node.type
        values = np.array([value.operand])
        if isinstance(value.operand, Output):
            values = reader.nodes.evaluate(value.operand, [], given, len(points))
        found.append(values[:, 0] if socket.type == "VALUE" else np.broadcast_to(values, (len(points), 3)))
    return found


def made(kind: str, properties: dict[str, Any] | None = None, **values: Any) -> Callable[[Any], Any]:
    """Return a function that makes a node with these properties and values of inputs."""

    def make(tree: Any) -> Any:
        node = tree.nodes.new(f"ShaderNode{kind}")
        for name, value in (properties or {}).items():
            setattr(node, name, value)
        for name, value in values.items():
            node.inputs[name.replace("_", " ")].default_value = value
        return node

    return make


def of_points(kind: str, properties: dict[str, Any], *sources: str, **values: Any) -> Callable[[Any], Any]:
    """Makes a node whose enabled inputs get `p`, `q` (`p` moved on), a channel (x, y, z), or nothing ("")."""

    def make(tree: Any) -> Any:
        node = made(kind, properties, **values)(tree)
        place = add(tree, "Attribute")
        place.attribute_name = "p"
        vector = place.outputs["Vector"]
        parts = add(tree, "SeparateXYZ", (vector, 0))
        moved = add(tree, "VectorMath", (vector, 0))
        moved.inputs[1].default_value = (3.0, -5.0, 7.0)
        known = {"p": vector, "q": moved.outputs[0], **{name: parts.outputs[name.upper()] for name in "xyz"}}
        sockets = [socket for socket in node.inputs if socket.enabled]
        for source, socket in zip(sources, sockets, strict=False):
            if source:
                tree.links.new(known[source], socket)
        return node

    return make


def gabor(properties: dict[str, Any], orientation: Any, **values: float) -> Callable[[Any], Any]:
    """A Gabor Texture, whose two inputs Orientation have one name."""

    def make(tree: Any) -> Any:
        node = made("TexGabor", properties, **values)(tree)
        wanted = f"Orientation {node.gabor_type}"
        next(socket for socket in node.inputs if socket.identifier == wanted).default_value = orientation
        return node

    return make


def normal(tree: Any) -> Any:
    node = of_points("Normal", {}, "p")(tree)
    node.outputs["Normal"].default_value = (0.3, -0.5, 0.7)
    return node


def wavelength(tree: Any) -> Any:
    """Wavelengths beyond the visible ones, too."""
    node = made("Wavelength")(tree)
    place = of_points("MapRange", {}, "x", From_Min=-FAR, From_Max=FAR, To_Min=340.0, To_Max=820.0)(tree)
    tree.links.new(place.outputs[0], node.inputs[0])
    return node


def blackbody(tree: Any) -> Any:
    """Temperatures beyond the coldest and the hottest ones, too."""
    node = made("Blackbody")(tree)
    place = of_points("MapRange", {}, "x", From_Min=-FAR, From_Max=FAR, To_Min=500.0, To_Max=13000.0)(tree)
    tree.links.new(place.outputs[0], node.inputs[0])
    return node


Case = tuple[str, Callable[[Any], Any], tuple[str, ...]]
NOISES = ("MULTIFRACTAL", "RIDGED_MULTIFRACTAL", "HYBRID_MULTIFRACTAL", "FBM", "HETERO_TERRAIN")
BLENDS = ("MIX", "DARKEN", "MULTIPLY", "BURN", "LIGHTEN", "SCREEN", "DODGE", "ADD", "OVERLAY", "SOFT_LIGHT")
BLENDS += ("LINEAR_LIGHT", "DIFFERENCE", "EXCLUSION", "SUBTRACT", "DIVIDE", "HUE", "SATURATION", "COLOR", "VALUE")
MATHS = ("ADD", "SUBTRACT", "MULTIPLY", "DIVIDE", "MULTIPLY_ADD", "POWER", "LOGARITHM", "SQRT", "INVERSE_SQRT")
MATHS += ("ABSOLUTE", "EXPONENT", "MINIMUM", "MAXIMUM", "LESS_THAN", "GREATER_THAN", "SIGN", "COMPARE", "SMOOTH_MIN")
MATHS += ("SMOOTH_MAX", "ROUND", "FLOOR", "CEIL", "TRUNC", "FRACT", "MODULO", "FLOORED_MODULO", "WRAP", "SNAP")
MATHS += ("PINGPONG", "SINE", "COSINE", "TANGENT", "ARCSINE", "ARCCOSINE", "ARCTANGENT", "ARCTAN2", "SINH", "COSH")
MATHS += ("TANH", "RADIANS", "DEGREES")
VECTORS = ("ADD", "SUBTRACT", "MULTIPLY", "DIVIDE", "MULTIPLY_ADD", "CROSS_PRODUCT", "PROJECT", "REFLECT", "REFRACT")
VECTORS += ("FACEFORWARD", "SCALE", "NORMALIZE", "ABSOLUTE", "SIGN", "MINIMUM", "MAXIMUM", "FLOOR", "CEIL", "FRACTION")
VECTORS += ("MODULO", "WRAP", "SNAP", "SINE", "COSINE", "TANGENT")


def _fractals() -> Iterator[Case]:
    fractal = {"Detail": 3.5, "Roughness": 0.6, "Lacunarity": 2.1, "Scale": 1.3}
    for kind, size in product(NOISES, "1234"):
        properties = {"noise_type": kind, "noise_dimensions": f"{size}D"}
        values = dict(fractal, Distortion=0.4 if size in "24" else 0.0)
        yield f"noise {kind} {size}", made("TexNoise", properties, **values), ("Fac", "Color")
    metrics = {"1": "EUCLIDEAN", "2": "MANHATTAN", "3": "CHEBYCHEV", "4": "MINKOWSKI"}
    outputs = {"DISTANCE_TO_EDGE": ("Distance",), "N_SPHERE_RADIUS": ("Radius",)}
    for feature, size in product(("F1", "F2", "SMOOTH_F1", *outputs), "1234"):
        properties = {"voronoi_dimensions": f"{size}D", "feature": feature}
        if feature not in outputs:
            properties["distance"] = metrics[size]
        make = made("TexVoronoi", properties, Randomness=0.8, Scale=0.9)
        yield f"voronoi {feature} {size}", make, outputs.get(feature, ("Distance", "Color"))
    for size in "1234":
        yield f"white noise {size}", made("TexWhiteNoise", {"noise_dimensions": f"{size}D"}), ("Value", "Color")


def _patterns() -> Iterator[Case]:
    yield "checker", made("TexChecker", Scale=1.7), ("Color", "Fac")
    yield "brick", made("TexBrick", {"offset_frequency": 3, "squash": 0.7}, Scale=0.7), ("Color", "Fac")
    for kind in ("LINEAR", "QUADRATIC", "EASING", "DIAGONAL", "SPHERICAL", "QUADRATIC_SPHERE", "RADIAL"):
        yield f"gradient {kind}", made("TexGradient", {"gradient_type": kind}), ("Fac",)
    yield "magic", made("TexMagic", {"turbulence_depth": 4}, Distortion=1.5), ("Color", "Fac")
    for bands, profile in (("X", "SIN"), ("Y", "SAW"), ("Z", "TRI"), ("DIAGONAL", "SIN")):
        properties = {"bands_direction": bands, "wave_profile": profile}
        yield f"wave {bands}", made("TexWave", properties, Distortion=2.0, Scale=0.5), ("Fac",)
        rings = {"wave_type": "RINGS", "rings_direction": bands if bands != "DIAGONAL" else "SPHERICAL"}
        yield f"rings {bands}", made("TexWave", rings, Scale=0.3, Phase_Offset=1.0), ("Fac",)


def vector_range(kind: str) -> Callable[[Any], Any]:
    """A range that has no extent along y."""
    ends = {"From_Min": (-20.0, 3.0, -20.0), "From_Max": (30.0, 3.0, 30.0), "To_Min": (2.0,) * 3, "To_Max": (-1.0,) * 3}

    def made(tree: Any) -> Any:
        node = of_points("MapRange", {"data_type": "FLOAT_VECTOR", "interpolation_type": kind}, "p")(tree)
        for socket in node.inputs:
            name = socket.identifier.removesuffix("_FLOAT3")
            if name in ends and name != socket.identifier:
                socket.default_value = ends[name]
        return node

    return made


def _maths() -> Iterator[Case]:
    for mode in MATHS:
        yield f"math {mode}", of_points("Math", {"operation": mode}, "x", "y", "z"), ("Value",)
    for mode in VECTORS:
        sources = ("p", "z") if mode == "SCALE" else ("p", "q", "p")
        yield f"vector {mode}", of_points("VectorMath", {"operation": mode}, *sources), ("Vector",)
    for mode in ("DOT_PRODUCT", "DISTANCE", "LENGTH"):
        yield f"vector {mode}", of_points("VectorMath", {"operation": mode}, "p", "q"), ("Value",)
    for blend in BLENDS:
        properties = {"data_type": "RGBA", "blend_type": blend}
        yield f"mix {blend}", of_points("Mix", properties, "x", "p", "q"), ("Result_Color",)
    for kind in ("LINEAR", "STEPPED", "SMOOTHSTEP", "SMOOTHERSTEP"):
        values = {"From_Min": -20.0, "From_Max": 30.0, "To_Min": 2.0, "To_Max": -1.0}
        make = of_points("MapRange", {"interpolation_type": kind}, "x", **values)
        yield f"map range {kind}", make, ("Result",)
        yield f"vector range {kind}", vector_range(kind), ("Vector",)


def _others() -> Iterator[Case]:
    for kind in ("POINT", "TEXTURE", "VECTOR", "NORMAL"):
        values = {"Rotation": (0.4, -0.7, 1.1), "Scale": (0.5, 2.0, 1.5)}
        yield f"mapping {kind}", of_points("Mapping", {"vector_type": kind}, "p", **values), ("Vector",)
    for kind in ("AXIS_ANGLE", "X_AXIS", "Y_AXIS", "Z_AXIS", "EULER_XYZ"):
        turn = {"Rotation": (0.4, -0.7, 1.1)} if kind == "EULER_XYZ" else {"Angle": 0.7}
        yield f"rotate {kind}", of_points("VectorRotate", {"rotation_type": kind}, "p", **turn), ("Vector",)
    for mode in ("HSV", "HSL"):
        yield f"combine {mode}", of_points("CombineColor", {"mode": mode}, "x", "y", "z"), ("Color",)
        yield f"separate {mode}", of_points("SeparateColor", {"mode": mode}, "p"), ("Red", "Green", "Blue")
    for kind in ("MINMAX", "RANGE"):
        yield f"clamp {kind}", of_points("Clamp", {"clamp_type": kind}, "x", "y", "z"), ("Result",)
    yield "hue", of_points("HueSaturation", {}, "", "", "", "", "p", Hue=0.7, Saturation=1.3), ("Color",)
    yield "gamma", of_points("Gamma", {}, "p", Gamma=1.7), ("Color",)
    yield "contrast", of_points("BrightContrast", {}, "p", Bright=0.1, Contrast=0.3), ("Color",)
    yield "invert", of_points("Invert", {}, "", "p", Fac=0.6), ("Color",)
    yield "grey", of_points("RGBToBW", {}, "p"), ("Val",)
    for kind, turn in product(("2D", "3D"), (0.0, 0.6, 1.0)):
        values = {"Scale": 0.7, "Frequency": 1.7, "Anisotropy": turn}
        make = gabor({"gabor_type": kind}, 0.7 if kind == "2D" else (0.3, -0.8, 0.5), **values)
        yield f"gabor {kind} {turn}", make, ("Value", "Phase", "Intensity")
    yield "normal", normal, ("Normal", "Dot")
    yield "wavelength", wavelength, ("Color",)
    yield "blackbody", blackbody, ("Color",)
    yield "ramp", of_points("ValToRGB", {}, "x"), ("Color",)


CASES = [*_fractals(), *_patterns(), *_maths(), *_others()]
# Nodes that are asked for numbers of about 0 to 1, as colours are; the others for numbers of -50 to 50.
OF_COLORS = ("mix", "combine", "separate", "hue", "gamma", "contrast", "invert", "ramp", "gradient")
OF_COLORS += ("math EXP", "math SINH", "math COSH", "math POW", "math ARC", "math TAN")


@pytest.mark.parametrize(("name", "make", "outputs"), CASES, ids=[name for name, _, _ in CASES])
def test_nodes_have_the_values_of_cycles(
    request, name: str, make: Callable[[Any], Any], outputs: tuple[str, ...]
) -> None:
    is_long = request.config.getoption("--long")
    count = 100_000 if is_long else 10_000
    draws = np.random.default_rng(7)
    low, high = (-0.2, 1.2) if name.startswith(OF_COLORS) else (-FAR, FAR)
    points = draws.uniform(low, high, (count, 3)).astype(np.float32)
    w = draws.uniform(-FAR, FAR, count).astype(np.float32)
    theirs = cycles_values(make, points, w, *outputs)
    for output, expected, found in zip(outputs, theirs, our_values(points, w), strict=True):
        unlike = np.abs(found - expected) / np.maximum(1.0, np.abs(expected))
        jumps = int((unlike > WITHIN).sum())
        assert jumps <= (0 if is_long else STEPS), f"{output}: {jumps} of {count}, the worst by {unlike.max()}"
