"""The order in which an image is traced, as pure logic: pixels and samples are counted, nothing is timed."""

from __future__ import annotations

import pytest
from perfect_bvh_addon.image.progressive import COARSE_SHARE, TILE_ROWS, Pace, Schedule, Step

WIDTH, HEIGHT = 960, 540
PIXELS = WIDTH * HEIGHT


def steps_of(schedule: Schedule, pace: Pace, first_seconds: float, seconds: float) -> list[Step]:
    """Returns all planned steps, each done at once."""
    steps: list[Step] = []
    while not schedule.is_finished:
        step = schedule.next_step(pace, seconds if steps else first_seconds)
        schedule.note_done(step)
        steps.append(step)
        assert len(steps) < 10_000
    return steps


def coarse_pixels(schedule: Schedule, steps: list[Step]) -> int:
    return sum(schedule.pixels_of(step) for step in steps if step.divisor > 1)


@pytest.mark.parametrize("seconds", [0.02, 0.1, 0.5, 3.0])
@pytest.mark.parametrize("seconds_a_sample", [0.001, 0.3, 1.5, 3.0])
def test_coarse_images_take_no_more_than_their_share(seconds_a_sample: float, seconds: float) -> None:
    schedule = Schedule(WIDTH, (0, HEIGHT), 1)
    steps = steps_of(schedule, Pace(seconds_a_sample / PIXELS), 0.03, seconds)
    assert coarse_pixels(schedule, steps) <= COARSE_SHARE * PIXELS


def test_half_the_resolution_covers_the_rows_that_come_last() -> None:
    schedule = Schedule(WIDTH, (0, HEIGHT), 1)
    steps = steps_of(schedule, Pace(1.5 / PIXELS), 0.03, 0.1)
    assert [step.divisor for step in steps[:4]] == [8, 4, 2, 1]
    assert steps[0].rows == steps[1].rows == (0, HEIGHT)
    first, end = steps[2].rows
    assert end == HEIGHT and first % TILE_ROWS == 0 and 0.2 * HEIGHT < end - first < 0.5 * HEIGHT


def test_a_sample_that_takes_long_has_every_resolution_before_it() -> None:
    schedule = Schedule(WIDTH, (0, HEIGHT), 1)
    steps = steps_of(schedule, Pace(20.0 / PIXELS), 0.03, 0.1)
    assert [(step.divisor, step.rows) for step in steps[:5]] == [(d, (0, HEIGHT)) for d in (32, 16, 8, 4, 2)]


def test_what_nobody_would_see_is_left_out() -> None:
    """The full image is there before the next redraw: coarse ones between would only delay it."""
    steps = steps_of(Schedule(WIDTH, (0, HEIGHT), 1), Pace(0.4 / PIXELS), 0.03, 0.5)
    assert [step.divisor for step in steps] == [4, 1]
    steps = steps_of(Schedule(WIDTH, (0, HEIGHT), 1), Pace(0.02 / PIXELS), 0.03, 0.5)
    assert steps == [Step(1, (0, HEIGHT))]


@pytest.mark.parametrize("rows", [(0, HEIGHT), (37, 411), (500, 540), (13, 14)])
@pytest.mark.parametrize("samples", [1, 2, 7, 64])
def test_each_row_gets_each_sample_once_and_in_order(rows: tuple[int, int], samples: int) -> None:
    done = dict.fromkeys(range(*rows), 0)
    schedule = Schedule(WIDTH, rows, samples)
    for step in steps_of(schedule, Pace(1.0 / PIXELS), 0.03, 0.1):
        if step.divisor > 1:
            continue
        for row in range(*step.rows):
            assert done[row] == step.first_sample
            assert step.first_sample == 0 or step.count in (step.first_sample, samples - step.first_sample)
            done[row] += step.count
    assert set(done.values()) == {samples}
    assert schedule.sample_count == samples


@pytest.mark.parametrize("rows", [(0, HEIGHT), (37, 411)])
def test_progress_grows_with_each_band_and_ends_at_one(rows: tuple[int, int]) -> None:
    schedule, traced, pixels = Schedule(WIDTH, rows, 7), 0, WIDTH * (rows[1] - rows[0])
    while not schedule.is_finished:
        assert schedule.progress == pytest.approx(traced / (7 * pixels), abs=1e-9)
        step = schedule.next_step(Pace(1.0 / PIXELS), 0.1)
        traced += 0 if step.divisor > 1 else schedule.pixels_of(step) * step.count
        schedule.note_done(step)
    assert (schedule.progress, traced) == (1.0, 7 * pixels)


def test_bands_end_with_tiles_and_take_the_time_there_is() -> None:
    schedule = Schedule(WIDTH, (40, HEIGHT), 4)
    bands = [step for step in steps_of(schedule, Pace(2.0 / PIXELS), 0.03, 0.5) if step.divisor == 1]
    assert all(step.rows[1] % TILE_ROWS == 0 or step.rows[1] == HEIGHT for step in bands)
    assert 0.3 * PIXELS / 4 < WIDTH * (bands[0].rows[1] - bands[0].rows[0]) <= PIXELS / 4


def test_an_image_that_is_not_shown_in_parts_has_no_coarse_parts() -> None:
    steps = steps_of(Schedule(WIDTH, (0, HEIGHT), 1, in_parts=False), Pace(1.5 / PIXELS), 0.03, 0.1)
    assert all(step.rows == (0, HEIGHT) for step in steps if step.divisor > 1)


def test_what_is_stopped_says_that_it_takes_longer_only_if_it_did() -> None:
    pace = Pace(1e-6)
    pace.learn_from_stopped(0.001, 10_000)
    assert pace.seconds_per_pixel == 1e-6
    pace.learn_from_stopped(0.1, 10_000)
    assert pace.seconds_per_pixel > 5e-6


def test_nothing_is_planned_without_rows() -> None:
    assert Schedule(WIDTH, (0, 0), 4).is_finished


def test_rows_that_want_no_more_samples_take_no_time() -> None:
    """The schedule skips rows of finished tiles."""
    schedule = Schedule(WIDTH, (0, HEIGHT), 64)
    pace = Pace(1.0 / PIXELS)
    while schedule.sample_count < 16:
        schedule.note_done(schedule.next_step(pace, 1000.0))
    left = [0] * 17
    left[0], left[9], left[10] = 960, 96, 32
    schedule.note_left(left)
    steps = []
    while schedule.sample_count == 16:
        steps.append(schedule.next_step(pace, 1e-9))
        schedule.note_done(steps[-1])
    assert [step.rows for step in steps] == [(0, 288), (288, HEIGHT)]
    assert [schedule.pixels_of(step) for step in steps] == [32 * 960, 32 * 96 + 32 * 32]
    assert all((step.first_sample, step.count) == (16, 16) for step in steps)
    assert schedule.next_step(pace, 1000.0) == Step(1, (0, HEIGHT), 32, 32)


def test_it_is_finished_when_no_row_wants_more_and_the_round_is_over() -> None:
    schedule = Schedule(WIDTH, (40, HEIGHT), 64)
    pace = Pace(1.0 / PIXELS)
    while schedule.sample_count < 16:
        schedule.note_done(schedule.next_step(pace, 1000.0))
    schedule.note_left([0, 960, 960, *[0] * 12, 960, 0])
    step = schedule.next_step(pace, 1e-9)
    assert step.rows[0] == 40 and step.rows[1] < HEIGHT and schedule.pixels_of(step) == 960 * (96 - 40)
    schedule.note_done(step)
    schedule.note_left([0] * 17)
    assert not schedule.is_finished
    step = schedule.next_step(pace, 1e-9)
    assert step.rows[1] == HEIGHT and schedule.pixels_of(step) == 0
    schedule.note_done(step)
    assert schedule.is_finished and schedule.sample_count == 32
