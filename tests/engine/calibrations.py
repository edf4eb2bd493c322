"""A calibration in round numbers, so that tests can predict the governor's decisions."""

from __future__ import annotations

from perfect_bvh.calibration import BuilderCost, Calibration

MACHINE = Calibration(
    node_nanoseconds=20.0,
    leaf_nanoseconds=15.0,
    refit_nanoseconds=10.0,
    rotate_nanoseconds=12.0,
    rebuild_parts_nanoseconds=60.0,
    rotation_gain=0.4,
    builders={
        "fast": BuilderCost(150.0, 220.0),
        "binned": BuilderCost(600.0, 200.0),
        "spatial": BuilderCost(3000.0, 180.0),
    },
)
