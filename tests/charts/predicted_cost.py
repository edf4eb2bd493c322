"""(f) The cost that a tree is predicted to have, against what rays cost in it: every builder on every mesh."""

from __future__ import annotations

from itertools import product

import numpy as np
import numpy.typing as npt
from charts.figures import Figures, footer, load

from addon.bench.chart import Axis, Chart, Key, Mark, Panel, Series

DATA = "builders"
KIND = "diffuse"
TREES = ("median", "sweep", "binned", "auto", "spatial")  # "fast" makes no binary tree that costs could be of
COLORS = ("blue", "vermilion", "green", "orange", "purple", "sky", "black", "grey")
MARKS: tuple[Mark, ...] = ("circle", "square")
Floats = npt.NDArray[np.float64]


def chart(figures: Figures | None = None) -> Chart:
    """The picture's description; figures: of build.py."""
    figures = figures or load(DATA)
    meshes = figures["meshes"]
    looks = dict(zip((mesh["name"] for mesh in meshes), ((c, m) for m, c in product(MARKS, COLORS)), strict=False))
    rows = [(mesh["name"], tree) for mesh in meshes for tree in mesh["trees"] if tree["name"] in TREES]
    sah = np.array([[tree["sah"]] for _, tree in rows])
    both = np.array([[tree["sah"], tree["epo"]] for _, tree in rows])
    time = np.array([1e3 / tree["rays"][KIND]["mrays_per_second"] for _, tree in rows])
    rounds = [tree["rays"][KIND]["rounds"] for _, tree in rows]
    spread = np.array([[1e3 / each["high"], 1e3 / each["low"]] for each in rounds])
    names = np.array([name for name, _ in rows])
    return Chart(
        "Predicted cost tells trees of one mesh apart; between meshes it tells less",
        f"{len(rows)} trees: {len(meshes)} meshes, each built by {', '.join(TREES)}. Nanoseconds of a diffuse ray on "
        "one thread, against a linear function of the predictors whose weights come from the other "
        f"{len(meshes) - 1} meshes: each mesh's points are predicted without having seen it. On the line this is "
        "exact. Bars: quartiles.",
        [
            _panel("SAH alone", sah, time, spread, names, looks),
            _panel("SAH and end-point overlap", both, time, spread, names, looks),
        ],
        footer(figures),
        panel_height=380,
        legend=tuple(Key(name, color, mark) for name, (color, mark) in looks.items()),
    )


def _panel(
    title: str,
    predictors: Floats,
    time: Floats,
    spread: Floats,
    names: npt.NDArray[np.str_],
    looks: dict[str, tuple[str, Mark]],
) -> Panel:
    predicted = predict_each_without_its_mesh(predictors, time, names)
    ends = [float(min(time.min(), predicted[predicted > 0].min())), float(max(time.max(), predicted.max()))]
    series = [Series("exact", ends, ends, "pale", "", line=True, width=3.0)]
    for name, (color, mark) in looks.items():
        rows = names == name
        low = np.minimum(spread[rows, 0], time[rows]).tolist()
        high = np.maximum(spread[rows, 1], time[rows]).tolist()
        xs, ys = predicted[rows].tolist(), time[rows].tolist()
        series.append(Series(name, xs, ys, color, mark, low=low, high=high, size=8.0))
    own = determination(time, _fit(predictors, time, predictors))
    score = determination(time, predicted)
    slopes = [_slope_within(predictors[names == name], time[names == name]) for name in looks]
    notes = [
        (0.04, 0.93, f"R² {score:.2f} with each mesh left out"),
        (0.04, 0.86, f"R² {own:.2f} if it is fitted to all"),
        (0.04, 0.79, f"R² {float(np.median(slopes)):.2f} within a mesh (median)"),
        (0.04, 0.72, f"wrong by {100.0 * float(np.median(np.abs(predicted / time - 1.0))):.0f} % (median)"),
    ]
    axes = (Axis("predicted: nanoseconds a ray", log=True), Axis("measured: nanoseconds a ray", log=True))
    return Panel(title, *axes, series, notes)


def predict_each_without_its_mesh(predictors: Floats, time: Floats, names: npt.NDArray[np.str_]) -> Floats:
    """Of a linear fit with an offset to all other meshes. predictors: (N, P); time, names: (N,)."""
    predicted = np.empty_like(time)
    for name in np.unique(names):
        out = names == name
        predicted[out] = _fit(predictors[~out], time[~out], predictors[out])
    return predicted


def determination(measured: Floats, predicted: Floats) -> float:
    """R squared: the share of the variance that the prediction explains; below 0 if the mean would do better."""
    return float(1.0 - np.sum((measured - predicted) ** 2) / np.sum((measured - measured.mean()) ** 2))


def _fit(predictors: Floats, time: Floats, wanted: Floats) -> Floats:
    """Least squares of relative errors, so that slow trees do not outweigh the others; what that gives for `wanted`."""
    columns = np.column_stack([np.ones(len(time)), predictors])
    weights, *_ = np.linalg.lstsq(columns / time[:, None], np.ones(len(time)), rcond=None)
    return np.asarray(np.column_stack([np.ones(len(wanted)), wanted]) @ weights)


def _slope_within(predictors: Floats, time: Floats) -> float:
    """R squared of the trees of one mesh: how well the sum of its predictors ranks them."""
    return float(np.corrcoef(predictors.sum(axis=1), time)[0, 1] ** 2)
