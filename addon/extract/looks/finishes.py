"""Finishes of surfaces: sheen, coat, brushed and rough structure, distributions of facets.

Each number and colour may be another one from place to place. See `perfect_bvh.FinishTable` for what they mean.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from perfect_bvh.finishes import FACET_KINDS
from perfect_bvh.nodes import Operand

from ...sync.look_records import FinishRecord
from .node_graph import Scope, is_fed
from .node_places import radial_tangent
from .node_values import ValueReader
from .values import Nodes, constant, is_number

# The slots of programs that set the fields of a finish.
FINISH_SLOTS = {
    "sheen": "SHEEN",
    "sheen_roughness": "SHEEN_ROUGHNESS",
    "coat": "COAT",
    "coat_roughness": "COAT_ROUGHNESS",
    "coat_ior": "COAT_IOR",
    "coat_tint": "COAT_TINT",
    "stretch": "STRETCH",
    "rotation": "ROTATION",
    "diffuse_roughness": "DIFFUSE_ROUGHNESS",
}
_NEUTRAL = FinishRecord()


@dataclass(frozen=True, slots=True)
class Finish:
    """The fields of `FinishRecord`, from place to place. tangent, coat_normal: None for those of the mesh."""

    sheen: Operand = _NEUTRAL.sheen
    sheen_roughness: Operand = _NEUTRAL.sheen_roughness
    sheen_cover: float = _NEUTRAL.sheen_cover
    coat: Operand = _NEUTRAL.coat
    coat_roughness: Operand = _NEUTRAL.coat_roughness
    coat_ior: Operand = _NEUTRAL.coat_ior
    coat_tint: Operand = _NEUTRAL.coat_tint
    stretch: Operand = _NEUTRAL.stretch
    rotation: Operand = _NEUTRAL.rotation
    diffuse_roughness: Operand = _NEUTRAL.diffuse_roughness
    distribution: float = _NEUTRAL.distribution
    tangent: Operand | None = None
    coat_normal: Operand | None = None


NO_FINISH = Finish()
_SHEEN = ("sheen_roughness", "sheen_cover")
_COAT = ("coat_roughness", "coat_ior", "coat_tint", "coat_normal")
_BRUSHED = ("stretch", "rotation", "distribution", "tangent")


def mix_finishes(
    nodes: Nodes, weight: Operand, finishes: Sequence[Finish], shiny: Sequence[Operand], rests: Sequence[Operand]
) -> Finish:
    """Mix two finishes; what belongs to a layer counts where that layer is.

    Args:
        nodes: Takes the instructions.
        weight: Of the second one, 0 to 1.
        finishes: Both.
        shiny: How much of the mix the facets of each are.
        rests: How much of the mix the diffuse base of each is.
    """
    first, second = finishes
    if first == second:
        return first

    def pair(name: str) -> tuple[Any, Any]:
        return getattr(first, name), getattr(second, name)

    def mean(name: str, weights: Sequence[Operand]) -> Any:
        values = pair(name)
        if None in values or name in {"distribution", "sheen_cover"}:  # no mean of these, or of one number a material
            return values[1] if values[0] is None or is_number(weights[0], 0.0) else values[0]
        return nodes.weighted((weights[0], weights[1]), values, weight)

    def amounts(name: str) -> list[Operand]:
        """Returns the approximate amounts of a layer; colours count alike."""
        return [0.0 if is_number(value, 0.0) else share for value, share in zip(pair(name), shares, strict=True)]

    shares = nodes.less(1.0, weight), weight
    return Finish(
        sheen=nodes.mix(weight, *pair("sheen")),
        coat=nodes.mix(weight, *pair("coat")),
        diffuse_roughness=mean("diffuse_roughness", rests),
        **{name: mean(name, amounts("sheen")) for name in _SHEEN},
        **{name: mean(name, amounts("coat")) for name in _COAT},
        **{name: mean(name, shiny) for name in _BRUSHED},
    )


def add_sheen(nodes: Nodes, finish: Finish, more: Finish) -> Finish:
    """Add the sheen of another surface, which covers nothing."""
    if is_number(more.sheen, 0.0):
        return finish
    own = more if is_number(finish.sheen, 0.0) else finish
    fields = {name: getattr(finish, name) for name in Finish.__slots__}
    fields.update({name: getattr(own, name) for name in _SHEEN}, sheen=nodes.plus(finish.sheen, more.sheen))
    return Finish(**fields)


class FinishReader:
    """Reads the inputs of shader nodes that make finishes."""

    def __init__(self, values: ValueReader) -> None:
        self._values = values
        self._nodes = values.nodes

    def principled(self, node: Any, inputs: Mapping[str, Any], scope: Scope | None) -> Finish:
        """Read a Principled BSDF. inputs: by identifier."""
        fields: dict[str, Any] = {}
        if _is_on(inputs["Sheen Weight"]):
            tint = self._color(inputs["Sheen Tint"], scope)
            fields["sheen"] = self._nodes.times(tint, self._number(inputs["Sheen Weight"], 0.0, scope, most=None))
            fields["sheen_roughness"] = self._number(inputs["Sheen Roughness"], 0.5, scope)
        if _is_on(inputs["Coat Weight"]):
            fields["coat"] = self._number(inputs["Coat Weight"], 0.0, scope)
            fields["coat_roughness"] = self._number(inputs["Coat Roughness"], 0.03, scope)
            fields["coat_ior"] = self._number(inputs["Coat IOR"], 1.5, scope, 1.0, None)
            fields["coat_tint"] = self._color(inputs["Coat Tint"], scope)
            if is_fed(inputs["Coat Normal"], scope):
                fields["coat_normal"] = self._values.normal(inputs["Coat Normal"], scope)
        if "Diffuse Roughness" in inputs and _is_on(inputs["Diffuse Roughness"]):
            fields["diffuse_roughness"] = self._number(inputs["Diffuse Roughness"], 0.0, scope)
        is_clear = is_number(self._values.number(inputs["Transmission Weight"], 0.0, scope), 1.0)
        if not is_clear or _is_on(inputs["Metallic"]):  # glass is never brushed
            names = ("Anisotropic", "Anisotropic Rotation")
            fields.update(self._brushed(*(inputs[name] for name in names), inputs["Tangent"], scope))
        return Finish(**fields)

    def of_facets(self, node: Any, scope: Scope | None) -> Finish:
        """Read a Glossy, Metallic, Glass or Refraction BSDF."""
        kind = node.distribution.lower()
        fields: dict[str, Any] = {"distribution": float(FACET_KINDS.index(kind)) if kind in FACET_KINDS else 0.0}
        sockets = [node.inputs.get(name) for name in ("Anisotropy", "Rotation", "Tangent")]
        if None not in sockets:
            fields.update(self._brushed(*sockets, scope, is_signed=node.type != "BSDF_METALLIC"))
        return Finish(**fields)

    def of_diffuse(self, node: Any, scope: Scope | None) -> Finish:
        """Read a Diffuse BSDF."""
        roughness = node.inputs["Roughness"]
        return Finish(diffuse_roughness=self._number(roughness, 0.0, scope)) if _is_on(roughness) else NO_FINISH

    def of_sheen(self, node: Any, base: Operand, scope: Scope | None) -> Finish:
        """Read a Sheen BSDF of this colour, which covers nothing."""
        if node.distribution != "MICROFIBER":
            self._values.omissions.note(f"the distribution Ashikhmin of {node.bl_label}", "Microfiber is used")
        return Finish(base, self._number(node.inputs["Roughness"], 0.5, scope), sheen_cover=0.0)

    def _brushed(
        self, anisotropy: Any, rotation: Any, tangent: Any, scope: Scope | None, is_signed: bool = False
    ) -> dict[str, Operand]:
        """is_signed: as of a Glossy BSDF, the amount may be below 0."""
        if not _is_on(anisotropy):
            return {}
        nodes = self._nodes
        amount = self._number(anisotropy, 0.0, scope, -0.99 if is_signed else 0.0, 0.99 if is_signed else 1.0)
        if is_signed:
            one, other = (nodes.add("math", amount, 0.0, 0.0, mode=mode) for mode in ("MAXIMUM", "MINIMUM"))
            stretch = nodes.over(nodes.less(1.0, one), nodes.plus(other, 1.0))
        else:
            stretch = nodes.add("math", nodes.less(1.0, nodes.times(amount, 0.9)), 0.0, 0.0, mode="INVERSE_SQRT")
        along = self._values.read(tangent, scope) if is_fed(tangent, scope) else None
        return {
            "stretch": stretch,
            "rotation": self._values.number(rotation, 0.0, scope),
            "tangent": radial_tangent(self._values) if along is None or along.is_guess else along.operand,
        }

    def _number(
        self, socket: Any, unknown: float, scope: Scope | None, least: float = 0.0, most: float | None = 1.0
    ) -> Operand:
        number = self._values.number(socket, unknown, scope)
        if most is not None:
            return self._nodes.clamp(number, least, most)
        if isinstance(number, float):
            return max(number, least)
        return self._nodes.add("math", number, least, 0.0, mode="MAXIMUM")

    def _color(self, socket: Any, scope: Scope | None) -> Operand:
        """White where it cannot be known."""
        white = constant(1.0, 1.0, 1.0)
        return self._values.read_or(white, f"{socket.name} white is used", socket, scope).operand


# Of light that walks at random below a surface, in parts of the colour that its nodes ask for: `_WALK[0]` at black,
# rising by `_WALK[1]` to white, and by how much scattering forward changes both; no more than `_MOST_WALKED`, as walks
# end early. Measured on a sphere in Cycles 5.0 under an even sky: within 2 % of it for colours from .02 to .97, and 4 %
# where light scatters forward.
_WALK, _WALK_FORWARD, _MOST_WALKED = (0.842, 0.18), (-0.26, 0.42), 0.91


def walked(reader: ValueReader, color: Operand, method: str, anisotropy: Any, scope: Scope | None) -> Operand:
    """Read the colour of the diffuse surface that replaces subsurface scattering.

    Christensen and Burley's scattering and that of skin reflect the colour itself, for any radii, and so
    does a diffuse surface, which needs no further rays. Only "Random Walk" is darker.

    Args:
        reader: Of the nodes.
        color: The colour that the nodes set.
        method: BURLEY, RANDOM_WALK or RANDOM_WALK_SKIN.
        anisotropy: The input socket.
        scope: The group that contains the node.
    """
    if method != "RANDOM_WALK":
        return color
    nodes, forward = reader.nodes, min(max(reader.even_number(anisotropy, 0.0, scope), 0.0), 0.9)
    least, rise = (walk + forward * change for walk, change in zip(_WALK, _WALK_FORWARD, strict=True))
    return nodes.clamp(nodes.times(color, nodes.plus(nodes.times(color, rise), least)), 0.0, _MOST_WALKED)


def _is_on(socket: Any) -> bool:
    return bool(socket.is_linked or socket.default_value)
