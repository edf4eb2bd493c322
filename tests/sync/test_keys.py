"""Names and orders of instances: distinct, stable, and the same however the scene came about."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from perfect_bvh_addon.sync.keys import instance_keys, instance_orders, match_keys
from sync.fakes import Shown, mesh, record


def grid(count: int, uid: int = 5, parent: int = 9) -> list[Shown]:
    return [Shown("a", uid, parent=parent, persistent_id=(index, 0)) for index in range(count)]


def test_keys_and_orders_are_distinct() -> None:
    shown = [
        *grid(1000),
        *grid(1000, uid=6),
        *grid(1000, parent=10),
        *(Shown("a", 7, parent=9, persistent_id=(i, j, k)) for i in range(8) for j in range(8) for k in range(8)),
        Shown("a", 11),
        Shown("a", 12),
    ]
    made = record([mesh("a")], shown)
    assert len(np.unique(instance_keys(made))) == len(shown)
    assert len(np.unique(instance_orders(made))) == len(shown)


def test_what_nothing_tells_apart_is_numbered() -> None:
    twins = [Shown("a", 1), Shown("a", 2), Shown("a", 1), Shown("a", 1)]
    keys = instance_keys(record([mesh("a")], twins))
    assert len(np.unique(keys)) == 4
    np.testing.assert_array_equal(keys, instance_keys(record([mesh("a")], twins)))
    single = instance_keys(record([mesh("a")], twins[:2]))
    np.testing.assert_array_equal(keys[:2], single)


def test_keys_and_orders_depend_on_nothing_else() -> None:
    shown = grid(50) + grid(50, uid=6)
    first = record([mesh("a")], shown)
    others = [Shown("b", 3), *reversed(shown), Shown("b", 77)]
    second = record([mesh("b", 5), mesh("a")], others)
    np.testing.assert_array_equal(instance_keys(first), instance_keys(second)[1:-1][::-1])
    np.testing.assert_array_equal(instance_orders(first), instance_orders(second)[1:-1][::-1])


def test_orders_sort_by_object_then_instancer_then_persistent_id() -> None:
    shown = [Shown("a", 1), Shown("a", 2), *grid(3), *grid(3, parent=11), *grid(2, uid=6), Shown("a", 8)]
    orders = instance_orders(record([mesh("a")], shown))
    np.testing.assert_array_equal(np.argsort(orders, kind="stable"), np.arange(len(shown)))
    assert (orders >= 0).all()


def test_ids_that_differ_in_high_bits_alone_have_orders_of_their_own() -> None:
    """Like the ids of points, which nodes give 32 bits."""
    ids = [(5 + 2**21,), (5,), (6,), (5 - 2**21,), (5, 0), (7,), (5 + 2**22,)]
    shown = [Shown("a", 3, parent=9, persistent_id=item) for item in ids]
    orders = instance_orders(record([mesh("a")], shown))
    assert len(np.unique(orders)) == len(ids)
    reversed_orders = instance_orders(record([mesh("a")], shown[::-1]))
    np.testing.assert_array_equal(orders, reversed_orders[::-1])


def test_orders_of_what_nothing_tells_apart_are_distinct() -> None:
    made = record([mesh("a")], [Shown("a", 1), *[Shown("a", 2, parent=9, persistent_id=(4,))] * 3, Shown("a", 3)])
    np.testing.assert_array_equal(np.diff(instance_orders(made)[1:4]), [1, 1])


def test_orders_are_relative_to_the_session() -> None:
    """Loading the same file later in a session gives higher uids, and the same picture."""
    shown = [Shown("a", 3), *grid(5), *grid(5, uid=6)]
    later = [Shown("a", item.uid + 4000, parent=item.parent and item.parent + 4000, persistent_id=item.persistent_id)
             for item in shown]  # fmt: skip
    first = instance_orders(record([mesh("a")], shown))
    second = instance_orders(record([mesh("a")], later))
    np.testing.assert_array_equal(np.argsort(first), np.argsort(second))


# However busy the machine is.
@settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.lists(st.integers(0, 60), unique=True), st.lists(st.integers(0, 60), unique=True))
def test_matching_finds_each_key_where_it_is(old: list[int], new: list[int]) -> None:
    rows = match_keys(np.array(old, np.uint64), np.array(new, np.uint64))
    assert rows.dtype == np.int32
    assert [old[row] if row >= 0 else None for row in rows] == [key if key in old else None for key in new]


@pytest.mark.parametrize("count", [0, 1])
def test_few_instances(count: int) -> None:
    made = record([mesh("a")], [Shown("a", 1)][:count])
    assert instance_keys(made).shape == instance_orders(made).shape == (count,)
