"""The sun's place, tables of its directions, weather files: beside pvlib, closed forms and recorded positions."""

from __future__ import annotations

import copy
import functools
import zoneinfo
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("bpy")  # the room's other files need it

from perfect_bvh_addon.baking import sun
from perfect_bvh_addon.baking.sun import Place

BERLIN = Place(52.52, 13.405, "Europe/Berlin")
# UTC, latitude, longitude, azimuth and elevation without refraction: by pvlib 0.16.1's full algorithm.
RECORDED = [
    ("1900-10-24T04:46:00", -46.32, 108.46, 353.3530, 55.1155),
    ("1910-02-01T06:17:00", 14.46, -146.11, 258.9847, -36.9427),
    ("1921-05-02T06:05:00", -3.69, -122.49, 293.0717, -57.8607),
    ("1931-06-08T02:11:00", 41.29, -139.08, 277.8984, 26.4827),
    ("1942-06-15T00:37:00", 2.95, -24.97, 330.4754, -59.6175),
    ("1952-05-22T19:09:00", 15.28, 85.62, 21.0508, -51.7746),
    ("1963-10-04T05:03:00", -37.98, 53.48, 64.4334, 34.7108),
    ("1973-12-16T00:54:00", 34.53, -74.62, 265.3001, -37.0795),
    ("1984-12-08T15:32:00", 83.33, -72.58, 163.1029, -16.4131),
    ("1994-01-01T13:03:00", -32.74, 141.02, 205.6634, -29.7021),
    ("2005-08-30T20:56:00", -5.05, 98.38, 82.8575, -38.0182),
    ("2015-08-02T14:01:00", -82.66, 74.51, 259.2155, -19.2741),
    ("2026-07-09T16:35:00", -72.01, 57.78, 242.6998, -31.7094),
    ("2036-05-16T14:22:00", 75.94, -105.41, 105.6924, 23.7651),
    ("2047-08-10T23:25:00", -35.52, 87.03, 84.5968, -19.3391),
    ("2057-08-18T23:35:00", 39.1, -101.26, 268.4957, 22.1927),
    ("2068-05-21T13:26:00", 27.75, 65.81, 287.4513, 10.9287),
    ("2078-10-30T21:48:00", 56.33, -25.71, 292.7936, -30.9727),
    ("2089-12-16T07:06:00", 66.61, -143.16, 314.6581, -41.2971),
    ("2100-10-04T22:15:00", 61.56, -38.19, 293.3455, -17.2965),
]
HEADER = "LOCATION,Trial Town,-,-,-,-,{},{},{},10\n" + 7 * "...\n"


def need_pvlib(part: str) -> Any:
    return pytest.importorskip(f"pvlib.{part}", reason="pvlib is not installed: pip install pvlib")


def angles_between(first: Any, second: Any) -> Any:
    """Degrees between unit vectors, also where they are nearly equal."""
    return np.degrees(2.0 * np.arcsin(np.clip(np.linalg.norm(first - second, axis=-1) / 2.0, 0.0, 1.0)))


# Position ------------------------------------------------------------------------------------------------------------


def test_the_position_is_that_of_the_full_algorithm_at_recorded_times() -> None:
    times, latitudes, longitudes, azimuths, elevations = zip(*RECORDED, strict=True)
    found = sun.sun_position(np.array(times, "datetime64[s]"), latitudes, longitudes, refraction=False)
    errors = angles_between(sun.to_directions(*found), sun.to_directions(azimuths, elevations))
    assert errors.max() < 0.01


@pytest.mark.parametrize("refraction", [False, True])
def test_the_position_is_pvlibs_at_ten_thousand_times_and_places(refraction: bool) -> None:
    spa = need_pvlib("spa")
    random = np.random.default_rng(40)
    low, high = (np.datetime64(f"{year}-01-01").astype("datetime64[s]").astype(np.int64) for year in (1900, 2101))
    times = random.uniform(low, high, 10_000)
    latitudes, longitudes = random.uniform(-90, 90, 10_000), random.uniform(-180, 180, 10_000)
    years = 1970.0 + times / (365.2425 * 86400.0)
    ahead = spa.calculate_deltat(np.floor(years), 12.0 * (years % 1.0) + 1.0)
    full = spa.solar_position_numpy(times, latitudes, longitudes, 0.0, 1013.25, 12.0, ahead, 0.5667, 1)
    found = sun.sun_position(times, latitudes, longitudes, refraction=refraction)
    errors = angles_between(sun.to_directions(*found), sun.to_directions(full[4], full[2 if refraction else 3]))
    assert errors.max() < 0.01


def test_times_out_of_range_are_refused() -> None:
    with pytest.raises(ValueError, match="sun_position: times must be of the years 1900 to 2100"):
        sun.sun_position(np.array(["1850-01-01"], "datetime64[s]"), 0.0, 0.0)
    with pytest.raises(ValueError, match="sun_position"):
        sun.sun_position([np.nan], 0.0, 0.0)


def test_north_turns_clockwise_from_y() -> None:
    found = sun.to_directions([0.0, 90.0, 0.0, 0.0], [0.0, 0.0, 90.0, 0.0], np.array([0.0, 0.0, 0.0, 90.0]))
    np.testing.assert_allclose(found, [(0, 1, 0), (1, 0, 0), (0, 0, 1), (1, 0, 0)], atol=1e-15)


# Tables --------------------------------------------------------------------------------------------------------------


def test_a_day_is_as_long_as_its_sun_is_up_with_any_step() -> None:
    totals = [sun.sun_table(BERLIN, date(2026, 3, 21), step=step).weights.sum() for step in (1, 7, 10, 60, 1440)]
    np.testing.assert_allclose(totals, totals[0], atol=1e-6)
    edges = np.arange(np.datetime64("2026-03-20T23:00:00"), np.datetime64("2026-03-21T23:00:00"))
    is_up = sun.sun_position(edges, BERLIN.latitude, BERLIN.longitude)[1] > 0.0
    assert totals[0] == pytest.approx(is_up.sum() / 3600.0, abs=2.0 / 3600.0)


def test_steps_at_sunrise_and_sunset_weigh_less_and_lie_in_the_time_that_is_left() -> None:
    table = sun.sun_table(BERLIN, date(2026, 3, 21), step=60)
    assert (table.weights[1:-1] == pytest.approx(1.0)) and 0.0 < table.weights[0] < 1.0 > table.weights[-1] > 0.0
    assert (table.directions[:, 2] > 0.0).all()
    seconds = (table.times - np.datetime64("2026-03-21")).astype(np.int64)
    assert seconds[0] % 3600 == pytest.approx(3600.0 * (1.0 - table.weights[0] / 2.0), abs=2.0)
    assert seconds[-1] % 3600 == pytest.approx(3600.0 * table.weights[-1] / 2.0, abs=2.0)
    np.testing.assert_allclose(np.linalg.norm(table.directions, axis=1), 1.0, atol=1e-12)


def test_clock_times_know_summer_time_and_days_of_23_and_25_hours() -> None:
    for day, noon in ((date(2026, 3, 28), "12"), (date(2026, 3, 29), "13"), (date(2026, 10, 25), "11")):
        table = sun.sun_table(BERLIN, day, step=1)
        highest = str(table.times[table.directions[:, 2].argmax()])
        assert highest.startswith(f"{day}T{noon}:"), highest
    both = sun.sun_table(BERLIN, date(2026, 3, 28), date(2026, 3, 30)).weights.sum()
    each = [sun.sun_table(BERLIN, date(2026, 3, day)).weights.sum() for day in (28, 29, 30)]
    assert both == pytest.approx(sum(each), abs=1e-6)


def test_a_year_has_half_its_hours_and_a_little_more() -> None:
    table = sun.sun_table(BERLIN, date(2026, 1, 1), date(2026, 12, 31), step=60)
    assert 4380.0 < table.weights.sum() < 4500.0  # refraction lifts the sun
    assert 4500 < len(table.weights) < 5200


def test_polar_night_is_empty_and_named_and_the_midnight_sun_shines_all_day() -> None:
    north = Place(78.2, 15.6, "+1")
    night = sun.sun_table(north, date(2026, 12, 1), date(2026, 12, 31))
    assert night.directions.shape == (0, 3) and night.weights.sum() == 0.0
    assert night.warnings == ("The sun does not rise at latitude 78.2, longitude 15.6 on 2026-12-01 to 2026-12-31",)
    day = sun.sun_table(north, date(2026, 6, 21))
    assert day.weights.sum() == pytest.approx(24.0) and day.warnings == ()


@pytest.mark.parametrize(
    ("zone", "hours"), [("+1", 1.0), ("-3:30", -3.5), ("5.5", 5.5), ("", 1.0), ("-0:30", -0.5), ("Asia/Tokyo", 9.0)]
)
def test_zones_are_names_or_hours(zone: str, hours: float) -> None:
    assert Place(50.0, 13.0, zone).time_zone.utcoffset(sun.EPOCH.replace(tzinfo=None)).total_seconds() == 3600 * hours


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((91.0, 0.0), "Place: latitude must be a number from -90 to 90, got 91"),
        ((float("nan"), 0.0), "Place: latitude"),
        ((0.0, 181.0), "Place: longitude must be a number from -180 to 180, got 181"),
        ((0.0, 0.0, "Mars/Base"), "zone must be a name such as 'Europe/Berlin'.*got 'Mars/Base'.*tzdata"),
        ((0.0, 0.0, "+99"), r"got '\+99'"),
        ((0.0, 0.0, "../../etc"), "got '../../etc'"),
        ((0.0, 0.0, "", float("inf")), "Place: north must be"),
        (("north", 0.0), "Place: latitude must be a number from -90 to 90, got 'north'"),
        ((0.0, 0.0, None), "Place: zone must be of the type str, got None"),
    ],
)
def test_bad_places_are_named(arguments: tuple[Any, ...], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Place(*arguments)


def test_a_system_without_zones_is_told_of_tzdata(monkeypatch: pytest.MonkeyPatch) -> None:
    def find_nothing(name: str) -> Any:
        raise zoneinfo.ZoneInfoNotFoundError(name)

    monkeypatch.setattr(sun, "ZoneInfo", find_nothing)
    with pytest.raises(ValueError, match="pip install tzdata"):
        Place(52.5, 13.4, "Europe/Berlin")
    assert Place(52.5, 13.4, "+1").zone == "+1"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"step": 0}, "step must be an integer from 1 to 1440, got 0"),
        ({"step": 0.5}, "step must be an integer"),
        ({"last": date(2025, 1, 1)}, "dates must be in order.*2026-03-21 to 2025-01-01"),
        ({"last": "2026-03-22"}, "last must be of the type date, got '2026-03-22'"),
        ({"last": date(2101, 1, 1)}, "dates must be in order, from 1900 to 2100"),
    ],
)
def test_bad_steps_and_dates_are_named(arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=f"sun_table: {message}"):
        sun.sun_table(BERLIN, date(2026, 3, 21), **arguments)


# Weather -------------------------------------------------------------------------------------------------------------


@functools.cache
def made_rows() -> list[list[Any]]:
    return make_rows(47.4, 8.5, 1.0)


def make_rows(latitude: float, longitude: float, zone: float) -> list[list[Any]]:
    """The hours of a made-up year: clear and overcast days in turns, by the sun's real elevation."""
    days = np.arange(np.datetime64("2026-01-01"), np.datetime64("2027-01-01"))
    starts = days[:, None] + np.arange(24).astype("timedelta64[h]")
    middles = starts.astype("datetime64[m]") + np.timedelta64(30, "m") - np.timedelta64(int(60 * zone), "m")
    sine = np.maximum(np.sin(np.radians(sun.sun_position(middles, latitude, longitude)[1])), 0.0)
    clear = np.random.default_rng(6).uniform(0.0, 1.0, (365, 1)) * np.ones((1, 24))
    direct, diffuse = np.round(900.0 * clear * sine**0.3), np.round(20.0 + 330.0 * (1.1 - clear) * sine) * (sine > 0)
    rows = []
    for day in range(365):
        year, month, number = str(days[day]).split("-")
        for hour in range(24):
            light = [direct[day, hour], diffuse[day, hour]]
            rows.append([int(year), int(month), int(number), hour + 1, 0, *["-"] * 9, *light, *["-"] * 4])
    return rows


def write_epw(path: Path, rows: list[list[Any]], place: tuple[float, float, float] = (47.4, 8.5, 1.0)) -> Path:
    path.write_text(HEADER.format(*place) + "".join(",".join(map(str, row)) + "\n" for row in rows))
    return path


def lit_planes(table: Any, tilts: Any, azimuths: Any) -> Any:
    """The light of unshaded planes, kWh/m2."""
    normals = sun.to_directions(azimuths, 90.0 - tilts)
    return np.maximum(normals @ table.directions.T, 0.0) @ table.weights


def test_planes_get_the_light_that_pvlibs_perez_gives_them(tmp_path: Path) -> None:
    irradiance = need_pvlib("irradiance")
    weather = sun.read_epw(write_epw(tmp_path / "town.epw", made_rows()))
    table = sun.irradiance_table(weather)
    tilts, azimuths = (part.ravel() for part in np.meshgrid([0.0, 20.0, 45.0, 90.0], [0.0, 90.0, 180.0, 250.0]))
    found = lit_planes(table, tilts, azimuths)
    hours, times = sun._shining(weather.place, weather.hours, 60, np.inf)
    azimuth, elevation = sun.sun_position(times, 47.4, 8.5)
    day_of_year = (times // 86400).astype("datetime64[D]").astype("datetime64[D]") - np.datetime64("2026-01-01")
    space = irradiance.get_extra_radiation(day_of_year.astype(int) + 1)
    air_mass = need_pvlib("atmosphere").get_relative_airmass(90.0 - elevation)
    up = (hours > 0.0) & (weather.diffuse > 0.0)
    for tilt, facing, total in zip(tilts, azimuths, found, strict=True):
        sky = irradiance.perez(
            *(tilt, facing, weather.diffuse[up], weather.direct[up], space[up]),
            *(90.0 - elevation[up], azimuth[up], air_mass[up]),
        )
        beam = weather.direct * np.maximum(irradiance.aoi_projection(tilt, facing, 90.0 - elevation, azimuth), 0.0)
        expected = (sky.sum() + beam[up].sum()) / 1000.0
        assert total == pytest.approx(expected, rel=0.001), (tilt, facing)


def test_the_horizontal_plane_gets_just_what_the_file_has(tmp_path: Path) -> None:
    weather = sun.read_epw(write_epw(tmp_path / "town.epw", made_rows()))
    table = sun.irradiance_table(weather, date(2026, 6, 1), date(2026, 6, 30))
    chosen = (weather.days >= 601) & (weather.days <= 630)
    hours, times = sun._shining(weather.place, weather.hours, 60, np.inf)
    sines = np.sin(np.radians(sun.sun_position(times, 47.4, 8.5)[1]))
    low = sines < np.cos(np.radians(85.0))  # where the model gives less
    beam = (weather.direct * sines)[chosen & (hours > 0.0)].sum() / 1000.0
    (found,) = lit_planes(table, np.array([0.0]), np.array([0.0]))
    assert found == pytest.approx(beam + weather.diffuse[chosen].sum() / 1000.0, rel=0.005)
    assert weather.diffuse[chosen & low].sum() < 0.05 * weather.diffuse[chosen].sum()
    winter = sun.irradiance_table(weather, date(2026, 12, 1), date(2026, 2, 28))
    assert {str(time)[5:7] for time in winter.times[~np.isnat(winter.times)]} == {"12", "01", "02"}
    assert np.isnat(winter.times).sum() == 577 + sun.HORIZON


def test_patches_cover_the_sky() -> None:
    for detail, count in ((1, 145), (2, 577), (4, 2305)):
        directions, solid_angles = sun._sky_patches(detail)
        assert len(directions) == len(solid_angles) == count
        assert solid_angles.sum() == pytest.approx(2.0 * np.pi)
        assert solid_angles @ directions[:, 2] == pytest.approx(np.pi, rel=1e-4)
    with pytest.raises(ValueError, match="detail must be an integer from 1"):
        sun.irradiance_table(sun.Weather("", BERLIN, *[np.zeros(1)] * 3, np.zeros(1, int)), detail=0)


def test_a_day_that_the_weather_lacks_is_named() -> None:
    days = np.array([228, 301])
    weather = sun.Weather("", BERLIN, *[np.zeros(2)] * 3, days)
    with pytest.raises(ValueError, match="irradiance_table: the weather has no day from 2024-02-29"):
        sun.irradiance_table(weather, date(2024, 2, 29))
    with pytest.raises(ValueError, match="irradiance_table: first must be of the type"):
        sun.irradiance_table(weather, "2024")  # type: ignore[arg-type]


def test_there_is_no_sun_beyond_the_poles() -> None:
    with pytest.raises(ValueError, match="sun_position: latitude must be from -90 to 90 degrees, got 91"):
        sun.sun_position(0.0, 91.0, 0.0)


def test_empty_lines_at_the_end_of_weather_are_nothing(tmp_path: Path) -> None:
    path = write_epw(tmp_path / "town.epw", made_rows())
    hours = len(sun.read_epw(path).hours)
    path.write_text(path.read_text("latin-1") + "\n  \n", "latin-1")
    assert len(sun.read_epw(path).hours) == hours


def lose_an_hour(rows: list[list[Any]]) -> None:
    del rows[24 * 31 + 5]


def lose_the_last_day(rows: list[list[Any]]) -> None:
    del rows[-24:]


def lose_a_value(rows: list[list[Any]]) -> None:
    rows[12][14] = 9999


def spoil_a_value(rows: list[list[Any]]) -> None:
    rows[12][15] = "many"


def age_a_row(rows: list[list[Any]]) -> None:
    rows[12][0] = 1700


def cut_a_row(rows: list[list[Any]]) -> None:
    del rows[12][9:]


def repeat_a_row(rows: list[list[Any]]) -> None:
    rows.append(rows[-1])


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lose_an_hour, "line 758: expected month 2, day 1, hour 6: rows are missing"),
        (lose_the_last_day, "line 8745: expected month 12, day 31, hour 1: rows are missing"),
        (lose_a_value, "line 21: direct or diffuse radiation is missing: got \\[9999.0, "),
        (spoil_a_value, "line 21: expected an hour's date and numbers: .*'many'"),
        (age_a_row, "line 21: expected an hour's date and numbers: the year 1700 is not from 1900 to 2100"),
        (cut_a_row, "line 21: expected an hour's date and numbers"),
        (repeat_a_row, "line 8769: expected the end"),
    ],
)
def test_rows_and_values_that_are_missing_are_named(spoil: Any, message: str, tmp_path: Path) -> None:
    rows = copy.deepcopy(made_rows())
    spoil(rows)
    with pytest.raises(ValueError, match=f"read_epw: .*town.epw, {message}"):
        sun.read_epw(write_epw(tmp_path / "town.epw", rows))


def test_a_file_of_something_else_is_refused(tmp_path: Path) -> None:
    for text in ("", "a,b\n", "\x00\xff"):
        path = tmp_path / "other.epw"
        path.write_text(text, encoding="latin-1")
        with pytest.raises(ValueError, match=r"read_epw: .*other\.epw, line 1: expected LOCATION"):
            sun.read_epw(path)
    with pytest.raises(OSError, match=r"none\.epw"):
        sun.read_epw(tmp_path / "none.epw")
