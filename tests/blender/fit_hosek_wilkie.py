"""Finds Hosek and Wilkie's coefficients in images of Cycles, and writes addon/extract/looks/hosek_wilkie.npy.

PYTHONPATH=tests python tests/blender/fit_hosek_wilkie.py, with `bpy`. May take an hour; the shipped numbers came
from earlier runs of it.

The formula holds for X, Y and Z; its coefficients are Bezier curves of the sun's elevation, and linear in turbidity and
albedo. So the points of one turbidity and albedo are fitted to twelve elevations at once, by Levenberg and Marquardt's
method, beginning with those of a neighbour. Many sets of points give nearly the same images: images at turbidities
and albedos half way between choose among them.
"""

from __future__ import annotations

import math
import sys
from itertools import product
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from oracles.cycles import FILTER_WIDTH, render_image
from perfect_bvh_addon.extract.looks.older_skies import LOWEST_LATITUDE
from perfect_bvh_addon.extract.looks.values import xyz_to_rgb

FILE = Path(__file__).parents[2] / "addon" / "extract" / "looks" / "hosek_wilkie.npy"
WIDTH, HEIGHT, SUNS, SAMPLES = 512, 256, 12, 250
BEGIN = np.array([-1.1, -0.3, 1.0, 1.0, -3.0, 0.3, 0.05, 0.6, 0.5, 1.0])
FROM_RGB = np.linalg.inv(xyz_to_rgb(np.eye(3)))
GOOD = 1e-4
Node = tuple[int, int, int]  # turbidity less one, albedo, channel


def new_sky() -> Any:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    bpy.ops.object.camera_add(rotation=(math.pi / 2, 0.0, 0.0))
    scene.camera = bpy.context.object
    scene.camera.data.type, scene.camera.data.panorama_type = "PANO", "EQUIRECTANGULAR"
    scene.render.resolution_x, scene.render.resolution_y = WIDTH, HEIGHT
    cycles = scene.cycles
    cycles.samples, cycles.use_adaptive_sampling, cycles.use_denoising = 1, False, False
    cycles.filter_width = FILTER_WIDTH
    world = scene.world = bpy.data.worlds.new("World")
    world.use_nodes = True
    sky = world.node_tree.nodes.new("ShaderNodeTexSky")
    sky.sky_type = "HOSEK_WILKIE"
    world.node_tree.links.new(sky.outputs[0], world.node_tree.nodes["Background"].inputs["Color"])
    return sky


def observe(sky: Any, turbidity: float, albedo: float, random: np.random.Generator) -> np.ndarray:
    """(N, 6): cube root of the elevation, cosine from the zenith, angle from the sun, and XYZ, in random directions."""
    latitude, longitude = np.meshgrid(
        (0.5 - (np.arange(HEIGHT) + 0.5) / HEIGHT) * math.pi,
        ((np.arange(WIDTH) + 0.5) / WIDTH - 0.5) * 2.0 * math.pi,
        indexing="ij",
    )
    flat = np.cos(latitude)
    ways = np.stack([flat * np.sin(longitude), flat * np.cos(longitude), np.sin(latitude)], axis=-1)
    sky.turbidity, sky.ground_albedo = turbidity, albedo
    rows = []
    for place in np.linspace(0.0, 1.0, SUNS):
        elevation = place**3 * math.pi / 2
        sun = np.array([0.0, math.cos(elevation), math.sin(elevation)])
        sky.sun_direction = sun
        rgb = render_image(bpy.context.scene, "CYCLES", "Combined", "RGB").reshape(-1, 3)
        angle = np.arctan2(np.linalg.norm(np.cross(ways, sun), axis=-1), ways @ sun).ravel()
        # Sample more near the sun and the horizon. A channel that Cycles clipped carries no information.
        share = (flat * (1.0 + 30.0 * np.exp(-angle.reshape(flat.shape) * 8.0))).ravel()
        share *= (1.0 + 3.0 * np.exp(-np.abs(latitude.ravel()) * 10.0)) * (rgb > 1e-6).all(axis=1)
        chosen = random.choice(share.size, SAMPLES, replace=False, p=share / share.sum())
        up = np.sin(np.maximum(latitude.ravel()[chosen], LOWEST_LATITUDE))
        rows.append(np.column_stack([np.full(SAMPLES, place), up, angle[chosen], rgb[chosen] @ FROM_RGB]))
    return np.concatenate(rows)


def formula(k: np.ndarray, up: np.ndarray, angle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The radiance by (N, 10) coefficients, and its derivatives."""
    a, b, c, d, e, f, g, h, i, factor = k.T
    cosine, root = np.cos(angle), np.sqrt(up)
    spread, sharp = np.exp(b / (up + 0.01)), np.exp(e * angle)
    round_by = np.maximum(1.0 + h * h - 2.0 * h * cosine, 1e-6)
    haze = (1.0 + cosine**2) / round_by**1.5
    low, away = 1.0 + a * spread, c + d * sharp + f * cosine**2 + g * haze + i * root
    by_away = factor * low
    parts = [factor * away * spread, factor * away * a * spread / (up + 0.01), by_away, by_away * sharp]
    parts += [by_away * d * angle * sharp, by_away * cosine**2, by_away * haze]
    parts += [by_away * g * haze / round_by * -3.0 * (h - cosine), by_away * root, low * away]
    return by_away * away, np.stack(parts, axis=-1)


def basis(place: np.ndarray) -> np.ndarray:
    return np.stack([math.comb(5, i) * place**i * (1.0 - place) ** (5 - i) for i in range(6)], axis=-1)


# The observations, a channel, the weight of the sought points in the observations, and the part of the known points.
Block = tuple[np.ndarray, int, float, np.ndarray | float]


def fit(points: np.ndarray, blocks: list[Block], steps: int = 300) -> tuple[np.ndarray, float]:
    """Fit the points; return them and the root mean square of the relative differences."""

    def compare(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        differences, slopes = [], []
        for seen, channel, share, rest in blocks:
            weights, true = basis(seen[:, 0]), seen[:, 3 + channel]
            shown, slope = formula(weights @ (share * points + rest), seen[:, 1], seen[:, 2])
            scale = 1.0 / np.maximum(np.abs(true), 0.02 * np.abs(true).max())
            differences.append((shown - true) * scale)
            slope = slope * (share * scale)[:, None]
            slopes.append((weights[:, :, None] * slope[:, None, :]).reshape(len(true), -1))
        return np.concatenate(differences), np.concatenate(slopes)

    seen_places = np.linspace(0.0, 1.0, SUNS)
    difference, slope = compare(points)
    costs, damping = [difference @ difference], 0.1
    for _ in range(steps):
        lengths = np.linalg.norm(slope, axis=0) + 1e-30
        q, r = np.linalg.qr(slope / lengths)
        u, s, v = np.linalg.svd(r)
        ahead = u.T @ (q.T @ difference)
        for _ in range(8):
            tried = points - ((v.T @ (s / (s * s + damping**2) * ahead)) / lengths).reshape(6, 10)
            with np.errstate(all="ignore"):
                new_difference, new_slope = compare(tried)
                cost = new_difference @ new_difference
            narrow = np.abs(basis(seen_places) @ tried[:, 7]).max() < 0.995  # beyond that the formula has a pole
            if np.isfinite(cost) and cost < costs[-1] and narrow:
                break
            damping *= 2.2
        else:
            break
        points, difference, slope, damping = tried, new_difference, new_slope, max(damping / 2.2, 1e-9)
        costs.append(cost)
        if len(costs) > 40 and costs[-40] - cost < 1e-3 * cost:
            break
    return points, math.sqrt(costs[-1] / len(difference))


def fit_alone(seen: dict[tuple[float, float], np.ndarray], random: np.random.Generator) -> np.ndarray:
    """(10, 2, 3, 6, 10): each turbidity and albedo by its own images, so that the mean of the nine's sum is one."""
    found: dict[Node, np.ndarray] = {}
    nodes = list(product(range(10), range(2), range(3)))
    best: dict[Node, tuple[float, np.ndarray]] = {}
    for turn in range(20):
        for node in sorted(set(nodes) - found.keys(), key=lambda node: (node[1], abs(node[0] - 2), node[2])):
            turbidity, albedo, channel = node
            data = seen[turbidity + 1, albedo]
            near = sorted(found, key=lambda other: sum(abs(a - b) for a, b in zip(other, node, strict=True)))
            begins = [found[other] for other in near[:4]] if turn or near else []
            begins += [np.tile(BEGIN * (1.0 + 0.3 * random.standard_normal(10)), (6, 1)) for _ in range(3)]
            for begin in begins:
                points, weights = begin.copy(), basis(data[:, 0])
                shown = formula(weights @ points, data[:, 1], data[:, 2])[0] / (weights @ points[:, 9])
                points[:, 9] = np.linalg.lstsq(weights * shown[:, None], data[:, 3 + channel], rcond=None)[0]
                points, error = fit(points, [(data, channel, 1.0, 0.0)])
                if error < best.get(node, (1.0,))[0]:
                    best[node] = error, points
                if error < GOOD:
                    found[node] = points
                    break
        sys.stderr.write(f"turn {turn}: {len(found)} of {len(nodes)}\n")
        if len(found) == len(nodes):
            break
    table = np.zeros((10, 2, 3, 6, 10))
    for node in nodes:
        points = best[node][1].copy()
        data = seen[node[0] + 1, node[1]]
        coefficients = basis(data[:, 0]) @ points
        coefficients[:, 9] = 1.0
        mean = formula(coefficients, data[:, 1], data[:, 2])[0].mean()
        points[:, [2, 3, 5, 6, 8]] /= mean
        points[:, 9] *= mean
        table[node] = points
    return table


def fit_between(table: np.ndarray, seen: dict[tuple[float, float], np.ndarray]) -> None:
    """Fit each entry in turn together with its neighbours: observations half way between entries count as well."""
    for turn in range(8):
        worst = 0.0
        for turbidity, albedo, channel in product(range(10), range(2), range(3)):
            blocks: list[Block] = [(seen[turbidity + 1, albedo], channel, 1.0, 0.0)]
            for other in (turbidity - 1, turbidity + 1):
                if 0 <= other < 10:
                    between = seen[(turbidity + other) / 2 + 1, albedo]
                    blocks.append((between, channel, 0.5, 0.5 * table[other, albedo, channel]))
            rest = 0.5 * table[turbidity, 1 - albedo, channel]
            blocks.append((seen[turbidity + 1, 0.5], channel, 0.5, rest))
            table[turbidity, albedo, channel], error = fit(table[turbidity, albedo, channel], blocks, 20)
            worst = max(worst, error)
        sys.stderr.write(f"between, turn {turn}: {worst:.1e}\n")


def main() -> None:
    random = np.random.default_rng(1)
    sky = new_sky()
    halves = [(turbidity + 0.5, albedo) for turbidity in range(1, 10) for albedo in (0, 1)]
    ones = list(product(range(1, 11), (0, 0.5, 1)))
    seen = {at: observe(sky, *at, random) for at in [*ones, *halves]}
    table = fit_alone(seen, random)
    fit_between(table, seen)
    np.save(FILE, table.astype(np.float32))


if __name__ == "__main__":
    main()
