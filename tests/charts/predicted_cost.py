"""(f) The predicted cost of a tree, against the measured cost of rays in it: every builder on every mesh."""

from __future__ import annotations

from itertools import product

import numpy as np
import numpy.typing as npt
from charts.chart import Axis, Chart, Key, Mark, Panel, Series
from charts.figures import Figures, footer, load, rounds_of

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
    built_by = np.array([tree["name"] for _, tree in rows])
    return Chart(
        "Predicted cost tells bad trees from good ones, and good ones from one another less surely",
        f"{len(rows)} trees: {len(meshes)} meshes, each built by {', '.join(TREES)}. Nanoseconds of a diffuse ray on "
        "one thread, against a linear function of the predictors whose weights come from the other "
        f"{len(meshes) - 1} meshes: each mesh's points are predicted without having seen it. On the line this is "
        "exact. R²: of all trees; r: correlation, with its sign, of each mesh's. Bars: quartiles "
        f"of {rounds_of(meshes)}.",
        [
            _panel("SAH alone", sah, time, spread, names, built_by, looks),
            _panel("SAH and end-point overlap", both, time, spread, names, built_by, looks),
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
    built_by: npt.NDArray[np.str_],
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
    slowest = names[np.argmax(time)]
    others = names != slowest
    within = [correlation(predicted, time, names == name) for name in looks]
    good = [correlation(predicted, time, (names == name) & (built_by != "median")) for name in looks]
    notes = [
        (0.03, 0.94, f"R² {determination(time, predicted):.2f}"),
        (0.03, 0.88, f"R² {determination(time[others], predicted[others]):.2f} without {slowest}"),
        (0.03, 0.82, f"r {np.median(within):.2f} within a mesh (median)"),
        (0.03, 0.76, f"r {np.median(good):.2f} without the trees of median"),
        (0.03, 0.70, f"({min(good):.2f} to {max(good):.2f} by mesh)"),
    ]
    axes = (Axis("predicted: nanoseconds a ray", log=True), Axis("measured: nanoseconds a ray", log=True))
    return Panel(title, *axes, series, notes)


def predict_each_without_its_mesh(predictors: Floats, time: Floats, names: npt.NDArray[np.str_]) -> Floats:
    """Predicts each mesh by a linear fit with an offset to all other meshes. predictors: (N, P); time, names: (N,)."""
    predicted = np.empty_like(time)
    for name in np.unique(names):
        out = names == name
        predicted[out] = _fit(predictors[~out], time[~out], predictors[out])
    return predicted


def determination(measured: Floats, predicted: Floats) -> float:
    """R squared: the share of the variance that the prediction explains; below 0 if the mean would do better."""
    return float(1.0 - np.sum((measured - predicted) ** 2) / np.sum((measured - measured.mean()) ** 2))


def _fit(predictors: Floats, time: Floats, wanted: Floats) -> Floats:
    """Fits by least squares of relative errors, so that slow trees do not outweigh the others; predicts `wanted`."""
    columns = np.column_stack([np.ones(len(time)), predictors])
    weights, *_ = np.linalg.lstsq(columns / time[:, None], np.ones(len(time)), rcond=None)
    return np.asarray(np.column_stack([np.ones(len(wanted)), wanted]) @ weights)


def correlation(predicted: Floats, time: Floats, rows: npt.NDArray[np.bool_]) -> float:
    """Returns the correlation for these trees, with its sign: a prediction in the wrong order is no prediction."""
    return float(np.corrcoef(predicted[rows], time[rows])[0, 1])
