"""A planetary gear train on a bench: rigid motion of a nested hierarchy, meshes that never change.

Crank -> input gear -> sun shaft -> sun; planets ride on the carrier inside a fixed ring; carrier -> output wheel ->
pinion -> fan. In 48 frames the carrier turns by a third, and every tooth ends where another one began: a loop. Axes lie
along Y; "forward" is -Y, towards the camera. Counter-clockwise is seen from there.
"""

from __future__ import annotations

from math import cos, pi, radians, sin
from typing import Any

import bpy

from .gear_shapes import MODULE, annulus, axle, bearing, circle_like, fan_blade, gear_outline, wheel
from .shapes import Shape, box, joined, lathe, prism
from .stage import (
    add_camera,
    add_light,
    animation_curves,
    bevel,
    light_world,
    make_collection,
    make_mesh,
    make_text,
    open_stage,
    paint,
    place,
    repeat,
)

FRAMES = 48
SUN, PLANET, RING = 18, 12, 42  # RING = SUN + 2 PLANET, and SUN + RING divides by the three planets
DRIVEN, DRIVER, OUTPUT, PINION = 18, 42, 54, 15
CARRIER_TURN = 120.0  # degrees in 48 frames
AXLE_HEIGHT = 3.15

Paints = dict[str, Any]


def make() -> None:
    open_stage("Gears", FRAMES)
    paints = {
        "brass": paint("Brass", (0.78, 0.50, 0.14), 0.32, 0.9),
        "copper": paint("Copper", (0.72, 0.29, 0.14), 0.34, 0.9),
        "steel": paint("Steel", (0.44, 0.48, 0.53), 0.30, 0.9),
        "dark": paint("Gun metal", (0.085, 0.10, 0.12), 0.42, 0.6),
        "enamel": paint("Enamel", (0.035, 0.20, 0.22), 0.35),
        "red": paint("Red enamel", (0.62, 0.05, 0.04), 0.35),
        "wood": paint("Walnut", (0.26, 0.125, 0.06), 0.55),
        "bench": paint("Bench", (0.47, 0.34, 0.21), 0.6),
        "wall": paint("Wall", (0.23, 0.29, 0.31), 0.9),
    }
    machine = make_collection("Machine")
    root = place("Machine", None, machine, (0.0, 0.0, AXLE_HEIGHT))
    build_planetary(machine, paints, root)
    build_input(machine, paints, root)
    build_output(machine, paints, root)
    build_stand(machine, paints)
    light_world((0.52, 0.58, 0.66), 0.55)
    add_light("AREA", "Key", (-4.5, -6.0, 7.5), (0.0, 0.0, 2.4), 520.0, (1.0, 0.92, 0.80), 2.5)
    add_light("AREA", "Rim", (6.0, 1.5, 5.5), (0.0, 0.0, 2.6), 260.0, (0.72, 0.84, 1.0), 2.0)
    add_light("POINT", "Bench lamp", (4.2, -3.0, 3.5), (0.0, 0.0, 2.0), 90.0, (1.0, 0.80, 0.55), 0.2)
    add_camera((2.6, -16.0, 5.6), (-0.35, 0.0, 2.75), 42.0)


def turn_steadily(item: Any, turn: float, phase: float = 0.0) -> None:
    """Turns an object about its Y, `turn` degrees in 48 frames, counter-clockwise seen from -Y, from `phase` on."""
    # Seen from -Y a positive angle about Y runs clockwise: X is right, Z is up, and Y points away.
    for frame, angle in ((1, phase), (FRAMES + 1, phase + turn)):
        item.rotation_euler[1] = -radians(angle)
        item.keyframe_insert("rotation_euler", index=1, frame=frame)
    for curve in animation_curves(item):
        for key in curve.keyframe_points:
            key.interpolation = "LINEAR"
        curve.extrapolation = "LINEAR"


def add_gear(
    name: str,
    form: Shape,
    paints: list[Any],
    machine: Any,
    parent: Any,
    at: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> Any:
    item = place(name, make_mesh(name, form, paints, 30.0), machine, at, parent=parent)
    bevel(item, 0.012, 2, 50.0)
    return item


def build_planetary(machine: Any, paints: Paints, root: Any) -> None:
    """Ring, sun, carrier and planets; the planets turn on pins of the carrier: three levels of parents."""
    hole = gear_outline(RING, -0.006, 0.95)
    ring = annulus(circle_like(hole, MODULE * RING / 2.0 + 0.42), hole, 0.42)
    # The planet on the X axis shows the ring a gap; turned by half a tooth, the ring has a tooth there.
    add_gear("Ring", ring.turned_y(pi / RING), [paints["enamel"]], machine, root)
    bolt = joined([lathe([(0.075, 0.0), (0.075, 0.05), (0.06, 0.065), (0.0, 0.065)], 6).turned_x(pi / 2)])
    bolt_mesh = make_mesh("Bolt", bolt, [paints["steel"]])
    for k in range(12):
        a = 2.0 * pi * (k + 0.5) / 12
        reach = MODULE * RING / 2.0 + 0.27
        place(
            f"Bolt {k}", bolt_mesh, machine, (reach * cos(a), -0.21, reach * sin(a)), (0.0, 15.0 * k, 0.0), parent=root
        )
    sun_turn = CARRIER_TURN * (SUN + RING) / SUN
    sun_shaft = place("Sun shaft", None, machine, parent=root)
    turn_steadily(sun_shaft, sun_turn)
    add_gear("Sun", wheel(SUN, 0.4, 0.3, 0), [paints["steel"]], machine, sun_shaft)
    place("Sun axle", make_mesh("Sun axle", axle(0.17, -0.75, 2.0), [paints["dark"]]), machine, parent=sun_shaft)
    carrier = place("Carrier", None, machine, parent=root)
    turn_steadily(carrier, CARRIER_TURN)
    build_carrier(machine, paints, carrier, sun_turn)


def build_carrier(machine: Any, paints: Paints, carrier: Any, sun_turn: float) -> None:
    reach = MODULE * (SUN + PLANET) / 2.0
    arms = [
        lathe([(0.36, 0.42), (0.4, 0.40), (0.4, 0.30), (0.36, 0.28), (0.2, 0.28), (0.2, 0.42), (0.36, 0.42)][::-1], 40)
    ]
    arms = [arms[0].turned_x(pi / 2)]
    for k in range(3):
        a = 2.0 * pi * k / 3
        bar = prism([(0.3, -0.16), (reach, -0.1), (reach, 0.1), (0.3, 0.16)], 0.1).moved(y=-0.4)
        arms += [bar.turned_y(-a), axle(0.2, -0.43, -0.27).moved(reach * cos(a), 0.0, reach * sin(a))]
    add_gear("Carrier arms", joined(arms), [paints["red"]], machine, carrier)
    gear = wheel(PLANET, 0.38, 0.26, 0)
    mesh = make_mesh("Planet", gear, [paints["brass"]], 30.0)
    pin_mesh = make_mesh("Pin", axle(0.1, -0.5, 0.3), [paints["steel"]])
    for k in range(3):
        a = 120.0 * k
        seat = place(
            f"Planet seat {k}", None, machine, (reach * cos(radians(a)), 0.0, reach * sin(radians(a))), parent=carrier
        )
        place(f"Pin {k}", pin_mesh, machine, parent=seat)
        planet = place(f"Planet {k}", mesh, machine, parent=seat)
        bevel(planet, 0.012, 2, 50.0)
        # The planet's tooth at 180 degrees faces the sun. At frame 1 the sun has a tooth towards every seat
        # (18 divides by 3), so there the planet must show it a gap.
        phase = 180.0 + 180.0 / PLANET + a
        turn_steadily(planet, -(sun_turn - CARRIER_TURN) * SUN / PLANET, phase)
        add_mark(machine, paints, planet, k)


def add_mark(machine: Any, paints: Paints, planet: Any, number: int) -> None:
    """A red dot near a planet's rim, to see it turn: the fourth level of parents."""
    dot = lathe([(0.055, 0.0), (0.055, 0.015), (0.0, 0.02)], 16).turned_x(pi / 2)
    mesh = bpy.data.meshes.get("Dot") or make_mesh("Dot", dot, [paints["red"]])
    place(f"Dot {number}", mesh, machine, (0.38, -0.19, 0.0), parent=planet)


def build_input(machine: Any, paints: Paints, root: Any) -> None:
    """A crank whose big wheel, behind the ring, drives the sun's shaft."""
    sun_turn = CARRIER_TURN * (SUN + RING) / SUN
    sun_shaft = bpy.data.objects["Sun shaft"]
    depth, angle = 1.25, 195.0
    add_gear("Driven", wheel(DRIVEN, 0.3, 0.24, 0), [paints["steel"]], machine, sun_shaft, (0.0, depth, 0.0))
    reach = MODULE * (DRIVEN + DRIVER) / 2.0
    at = (reach * cos(radians(angle)), 0.0, reach * sin(radians(angle)))
    shaft = place("Crank shaft", None, machine, at, parent=root)
    # Along the line of centres a tooth must meet a gap: that sets the phase.
    turn_steadily(shaft, -sun_turn * DRIVEN / DRIVER, angle + 180.0 + 180.0 / DRIVER + angle * DRIVEN / DRIVER)
    add_gear("Driver", wheel(DRIVER, 0.24, 0.28, 5), [paints["copper"]], machine, shaft, (0.0, depth, 0.0))
    place("Crank axle", make_mesh("Crank axle", axle(0.15, -2.0, 2.0), [paints["dark"]]), machine, parent=shaft)
    build_crank(machine, paints, shaft, sun_turn * DRIVEN / DRIVER)


def build_crank(machine: Any, paints: Paints, shaft: Any, turn: float) -> None:
    """The arm, and a handle that stays level while the arm goes round."""
    arm = joined(
        [
            prism([(-0.12, -0.16), (0.95, -0.1), (0.95, 0.1), (-0.12, 0.16)], 0.12).moved(y=-2.02),
            axle(0.2, -2.1, -1.85),
            axle(0.14, -2.06, -1.88).moved(0.95, 0.0, 0.0),
        ]
    )
    item = add_gear("Crank arm", arm, [paints["dark"]], machine, shaft)
    pivot = place("Crank pivot", None, machine, (0.95, -2.04, 0.0), parent=item)
    turn_steadily(pivot, turn)
    knob = [(0.0, 0.0), (0.1, 0.0), (0.12, 0.05), (0.1, 0.2), (0.13, 0.45), (0.12, 0.6), (0.07, 0.66), (0.0, 0.67)]
    place("Knob", make_mesh("Knob", lathe(knob, 24).turned_x(pi / 2), [paints["red"]]), machine, parent=pivot)


def build_output(machine: Any, paints: Paints, root: Any) -> None:
    """The carrier's big wheel in front, a pinion next to it, and on the pinion's shaft a fan."""
    carrier = bpy.data.objects["Carrier"]
    depth = -0.95
    add_gear("Output wheel", wheel(OUTPUT, 0.18, 0.3, 6), [paints["brass"]], machine, carrier, (0.0, depth, 0.0))
    place(
        "Carrier sleeve",
        make_mesh("Carrier sleeve", axle(0.24, -1.3, -0.3), [paints["steel"]]),
        machine,
        parent=carrier,
    )
    distance, angle = MODULE * (OUTPUT + PINION) / 2.0, 32.0
    at = (distance * cos(radians(angle)), 0.0, distance * sin(radians(angle)))
    shaft = place("Fan shaft", None, machine, at, parent=root)
    ratio = OUTPUT / PINION
    phase = angle + 180.0 + 180.0 / PINION + angle * ratio
    turn_steadily(shaft, -CARRIER_TURN * ratio, phase)
    add_gear("Pinion", wheel(PINION, 0.3, 0.24, 0), [paints["steel"]], machine, shaft, (0.0, depth, 0.0))
    place("Fan axle", make_mesh("Fan axle", axle(0.12, -2.04, 0.9), [paints["dark"]]), machine, parent=shaft)
    fan = place(
        "Fan", make_mesh("Fan hub", axle(0.2, -0.2, 0.2), [paints["red"]]), machine, (0.0, -1.8, 0.0), parent=shaft
    )
    blade = make_mesh("Blade", fan_blade(), [paints["copper"]], 180.0)
    for k in range(5):
        place(f"Blade {k}", blade, machine, turn=(0.0, 72.0 * k, 0.0), parent=fan)


def build_stand(machine: Any, paints: Paints) -> None:
    """The static parts: feet of the ring, bearing blocks, a walnut base with a plate, the bench and a wall."""
    foot = prism(
        [(-2.0, 0.0), (2.0, 0.0), (2.0, 0.18), (1.2, 0.3), (0.95, 0.85), (-0.95, 0.85), (-1.2, 0.3), (-2.0, 0.18)], 0.34
    )
    item = place("Ring foot", make_mesh("Ring foot", foot, [paints["enamel"]], 30.0), machine, (0.0, -0.17, 0.12))
    bevel(item, 0.03, 3)
    crank, fan = bpy.data.objects["Crank shaft"].location, bpy.data.objects["Fan shaft"].location
    blocks = [
        (0.0, 1.75, 0.0),
        (crank[0], 1.75, crank[2]),
        (crank[0], -1.45, crank[2]),
        (fan[0], -0.45, fan[2]),
        (fan[0], 0.5, fan[2]),
    ]
    for number, (x, y, z) in enumerate(blocks):
        item = place(
            f"Bearing {number}",
            make_mesh(f"Bearing {number}", bearing(AXLE_HEIGHT + z - 0.12), [paints["dark"]], 30.0),
            machine,
            (x, y, 0.12),
        )
        bevel(item, 0.02, 2)
    base = box((-4.9, -1.85, -0.2), (4.1, 2.6, 0.12))
    bevel(place("Base", make_mesh("Base", base, [paints["wood"]]), machine), 0.07, 4)
    plate = box((-0.75, -1.88, -0.15), (0.75, -1.85, 0.07))
    bevel(place("Plate", make_mesh("Plate", plate, [paints["brass"]]), machine), 0.012)
    text = make_text("Plate text", "18 : 12 : 42", 0.17, 0.006, paints["dark"])
    place("Plate text", text, machine, (0.0, -1.885, -0.04), (90.0, 0.0, 0.0))
    top = make_mesh("Plank", box((-9.0, 0.0, -0.36), (9.0, 0.98, -0.2)), [paints["bench"]])
    planks = place("Bench", top, machine, (0.0, -4.0, 0.0))
    bevel(planks, 0.02, 2)
    repeat(planks, 9, (0.0, 1.0, 0.0))
    wall = box((-14.0, 5.2, -4.0), (14.0, 5.4, 9.0))
    place("Wall", make_mesh("Wall", wall, [paints["wall"]]), machine)
