"""Where the sun is, and tables of directions with weights: hours of sun, or light by a weather file. No Blender.

Angles are degrees, azimuths clockwise from north as seen from above. Directions are in Blender's world axes: Z is up,
and north is +Y turned clockwise by `north`, as in the add-on Sun Position.
"""

from __future__ import annotations

import csv
import math
import re
from dataclasses import dataclass
from datetime import UTC, date, datetime, timedelta, timezone, tzinfo
from pathlib import Path
from typing import Any
from zoneinfo import ZoneInfo

import numpy as np
import numpy.typing as npt
from perfect_bvh._checks import check_column, check_count, check_number

Float64Array = npt.NDArray[np.float64]

YEARS = (1900, 2100)  # for which the position was compared with the full algorithm
EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
# Amplitude in 1e-8 radians, phase, and rate in a millennium of the earth's heliocentric longitude: the largest terms of
# Reda and Andreas, "Solar position algorithm for solar radiation applications", Solar Energy 76 (2004). The terms left
# out add up to less than .005 degrees.
LONGITUDE_TERMS = (
    "175347046 0 0, 3341656 4.6692568 6283.07585, 34894 4.6261 12566.1517, 3497 2.7441 5753.3849, 3418 2.8289 3.5231, "
    "3136 3.6277 77713.7715, 2676 4.4181 7860.4194, 2343 6.1352 3930.2097, 1324 0.7425 11506.7698, "
    "1273 2.0371 529.691, 1199 1.1096 1577.3435, 990 5.233 5884.927, 902 2.045 26.298, 857 3.508 398.149",
    "628331966747 0 0, 206059 2.678235 6283.07585, 4303 2.6351 12566.1517",  # times the millennia since 2000
    "52919 0 0, 8720 1.0721 6283.0758",  # times their square
)


@dataclass(frozen=True)
class Place:
    """A place on the earth, and how the scene lies there.

    latitude, longitude: degrees, positive to the north and east.
    zone: a time zone's name, such as "Europe/Berlin", which includes summer time; or hours ahead of UTC, as "+5:30"; or
        "" for the whole hours of the longitude.
    north: degrees by which the scene's north is turned clockwise from +Y.

    Raises ValueError for angles out of range and unknown time zones.
    """

    latitude: float
    longitude: float
    zone: str = ""
    north: float = 0.0

    def __post_init__(self) -> None:
        check_number("Place", "latitude", self.latitude, -90, 90)
        check_number("Place", "longitude", self.longitude, -180, 180)
        check_number("Place", "north", self.north)
        _check_kind("Place", "zone", self.zone, str)
        _ = self.time_zone

    @property
    def time_zone(self) -> tzinfo:
        """The time zone as Python has it."""
        text = self.zone.strip() or f"{round(self.longitude / 15.0)}"
        hours = re.fullmatch(r"([+-]?)(\d+(?:\.\d+)?)(?::(\d\d))?", text)
        try:
            if hours is None:
                return ZoneInfo(text)
            ahead = timedelta(hours=float(hours[2]), minutes=int(hours[3] or 0))
            return timezone(-ahead if hours[1] == "-" else ahead)
        except (KeyError, ValueError, OSError) as error:
            raise ValueError(
                f"Place: zone must be a name such as 'Europe/Berlin', or hours from UTC such as '+1': got {text!r}. "
                "On systems without time zones, such as Windows, names need `pip install tzdata`"
            ) from error


@dataclass(frozen=True, eq=False)
class DirectionTable:
    """Directions towards light, with a weight each. A face gets the sum of the weights from which it is not shaded.

    directions: (N, 3) float64 unit vectors. weights: (N,) float64, in `unit`; without any, 1 each.
    times: (N,) datetime64[s] clock time of each; not-a-time for the sky. None if they have none.
    unit: "h", or "kWh/m2". has_cosine: whether a face gets a weight times the cosine of its incidence.
    warnings: why the table is not as expected.

    Raises ValueError for directions that are no unit vectors, and weights that are no finite numbers, one for each.
    """

    directions: Float64Array
    weights: Float64Array | None = None
    times: npt.NDArray[np.datetime64] | None = None
    unit: str = "h"
    has_cosine: bool = False
    warnings: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        directions = check_column("DirectionTable", "directions", self.directions, np.float64, (3,))
        off = np.flatnonzero(~(np.abs(np.linalg.norm(directions, axis=1) - 1.0) <= 1e-6))
        if len(off):
            wrong = directions[off[0]].tolist()
            raise ValueError(f"DirectionTable: directions must be unit vectors, got {wrong} in row {off[0]}")
        given = np.ones(len(directions)) if self.weights is None else self.weights
        weights = check_column("DirectionTable", "weights", given, np.float64, ())
        if len(weights) != len(directions) or not np.isfinite(weights).all():
            raise ValueError(f"DirectionTable: weights must be {len(directions)} finite numbers, got {given!r}")
        _check_kind("DirectionTable", "unit", self.unit, str)
        object.__setattr__(self, "directions", directions)
        object.__setattr__(self, "weights", weights)


# Sun -----------------------------------------------------------------------------------------------------------------


def sun_position(
    times: npt.ArrayLike, latitude: npt.ArrayLike, longitude: npt.ArrayLike, *, refraction: bool = True
) -> tuple[Float64Array, Float64Array]:
    """Compute the sun's azimuth and elevation in degrees, to .01 degrees of the full algorithm by Reda and Andreas.

    times: datetime64 in UTC, or seconds since 1970, of the years 1900 to 2100. latitude, longitude: degrees.
    All three broadcast. refraction: whether the elevation is that through the air, at 1013 hPa and 12 degrees Celsius.

    Raises ValueError for times and latitudes out of range.
    """
    given = np.asarray(times)
    if np.issubdtype(given.dtype, np.datetime64):
        given = given.astype("datetime64[ms]").astype(np.int64) / 1000.0
    days = given.astype(np.float64) / 86400.0 - 10957.5  # since noon of 1 January 2000
    low, high = ((year - 2000) * 365.25 for year in (YEARS[0], YEARS[1] + 1))
    if not ((days > low - 1.0) & (days < high + 1.0)).all():
        raise ValueError(f"sun_position: times must be of the years {YEARS[0]} to {YEARS[1]}, in UTC")
    century = (days + 64.0 / 86400.0) / 36525.0  # of the earth's even time, which is about a minute ahead
    sun = _earth_longitude(century / 10.0) + math.pi
    mean, node = np.radians(280.4665 + 36000.7698 * century), np.radians(125.04452 - 1934.136261 * century)
    nutation = (-17.2 * np.sin(node) - 1.32 * np.sin(2.0 * mean) + 0.21 * np.sin(2.0 * node)) / 3600.0
    tilt = 23.4392911 - 0.0130042 * century + (9.2 * np.cos(node) + 0.57 * np.cos(2.0 * mean)) / 3600.0
    sidereal = 280.46061837 + 360.98564736629 * days + nutation * np.cos(np.radians(tilt))
    sun, tilt = sun + np.radians(nutation - 20.49 / 3600.0), np.radians(tilt)
    ascension = np.arctan2(np.sin(sun) * np.cos(tilt), np.cos(sun))
    sine = np.sin(tilt) * np.sin(sun)  # of the declination
    cosine = np.sqrt(1.0 - sine * sine)
    hour = np.radians(sidereal + np.asarray(longitude, np.float64)) - ascension
    phi = np.radians(np.asarray(latitude, np.float64))
    if not (np.abs(phi) <= math.pi / 2.0).all():
        raise ValueError(f"sun_position: latitude must be from -90 to 90 degrees, got {latitude!r}")
    up = np.sin(phi) * sine + np.cos(phi) * cosine * np.cos(hour)
    south = np.sin(phi) * cosine * np.cos(hour) - np.cos(phi) * sine
    azimuth = np.degrees(np.arctan2(cosine * np.sin(hour), south)) + 180.0
    elevation = np.degrees(np.arcsin(np.clip(up, -1.0, 1.0)))
    elevation = elevation - 8.794 / 3600.0 * np.cos(np.radians(elevation))  # seen from the surface
    if refraction:
        bent = np.maximum(elevation, -1.0)
        air = 1013.25 / 1010.0 * 283.0 / 285.0 * 1.02 / 60.0
        lifted = elevation + air / np.tan(np.radians(bent + 10.3 / (bent + 5.11)))
        elevation = np.where(elevation > -0.8333, lifted, elevation)
    return azimuth % 360.0, elevation


def to_directions(azimuth: npt.ArrayLike, elevation: npt.ArrayLike, north: float = 0.0) -> Float64Array:
    """Return (..., 3) unit vectors in world axes. azimuth, elevation: degrees. north: as `Place` has it."""
    around, above = np.radians(np.asarray(azimuth) + north), np.radians(np.asarray(elevation))
    across = np.cos(above)
    return np.stack(np.broadcast_arrays(np.sin(around) * across, np.cos(around) * across, np.sin(above)), axis=-1)


def sun_table(place: Place, first: date, last: date | None = None, *, step: int = 10) -> DirectionTable:
    """List the sun's directions on the days from `first` to `last`, with the hours that each lasts.

    The sun counts while its middle is above the horizon, as seen through the air: steps at sunrise and sunset weigh
    less, and have the direction in the middle of the time that is left.

    Args:
        place: where, in which time zone, and where the scene's north is.
        first, last: dates of the place's calendar, both included; without `last` one day.
        step: minutes from one direction to the next, 1 to 1440, counted from the first midnight.

    Returns: a table in hours; empty, with a warning, if the sun does not rise.

    Raises ValueError for a step or dates out of range.
    """
    last = first if last is None else last
    _check_kind("sun_table", "place", place, Place)
    _check_kind("sun_table", "first", first, date)
    _check_kind("sun_table", "last", last, date)
    check_count("sun_table", "step", step, 1, 1440)
    if not YEARS[0] <= first.year <= last.year <= YEARS[1] or last < first:
        raise ValueError(f"sun_table: dates must be in order, from {YEARS[0]} to {YEARS[1]}: got {first} to {last}")
    zone = place.time_zone
    start, end = (
        datetime(day.year, day.month, day.day, tzinfo=zone).timestamp() for day in (first, last + timedelta(days=1))
    )
    hours, times = _shining(place, np.arange(start, end, 60.0 * step), int(step), end)
    is_up = hours > 0.0
    hours, times = hours[is_up], times[is_up]
    directions = to_directions(*sun_position(times, place.latitude, place.longitude), place.north)
    warnings = ()
    if not len(hours):
        days = str(first) if first == last else f"{first} to {last}"
        warnings = (f"The sun does not rise at latitude {place.latitude:g}, longitude {place.longitude:g} on {days}",)
    return DirectionTable(directions, hours, _clock_times(times, zone), warnings=warnings)


def _check_kind(function: str, name: str, value: object, kind: Any) -> None:
    if not isinstance(value, kind):
        raise ValueError(f"{function}: {name} must be of the type {getattr(kind, '__name__', kind)}, got {value!r}")


def _earth_longitude(millennium: Float64Array) -> Float64Array:
    """The heliocentric longitude, in radians."""
    total = np.zeros_like(millennium)
    for power, terms in enumerate(LONGITUDE_TERMS):
        for term in terms.split(","):
            amplitude, phase, rate = map(float, term.split())
            total += 1e-8 * amplitude * np.cos(phase + rate * millennium) * millennium**power
    return total


def _shining(place: Place, starts: Float64Array, minutes: int, end: float) -> tuple[Float64Array, Float64Array]:
    """The hours that the sun is up in each step, and the middle of that time, as seconds since 1970.

    starts: of the steps, the same. minutes: their length. end: steps stop there.
    """
    edges = np.minimum(starts[:, None] + 60.0 * np.arange(minutes + 1), end)
    elevation = sun_position(edges, place.latitude, place.longitude)[1]
    before, after = elevation[:, :-1], elevation[:, 1:]
    high = np.maximum(before, after)
    up = np.diff(edges) * np.clip(high / np.maximum(np.abs(after - before), 1e-12), 0.0, 1.0)
    middles = np.where(after > before, edges[:, 1:] - up / 2.0, edges[:, :-1] + up / 2.0)
    total = up.sum(axis=1)
    return total / 3600.0, (up * (middles - starts[:, None])).sum(axis=1) / np.maximum(total, 1e-12) + starts


def _clock_times(seconds: Float64Array, zone: tzinfo) -> npt.NDArray[np.datetime64]:
    clocks = [(EPOCH + timedelta(seconds=float(second))).astimezone(zone).replace(tzinfo=None) for second in seconds]
    return np.array(clocks, "datetime64[s]")


# Weather -------------------------------------------------------------------------------------------------------------


# Perez, Ineichen, Seals, Michalsky and Stewart, "Modeling daylight availability and irradiance components from direct
# and global irradiance", Solar Energy 44 (1990): for each bin of the sky's clearness F11, F12, F13, F21, F22, F23.
CLEARNESS = (1.065, 1.23, 1.5, 1.95, 2.8, 4.5, 6.2)
PEREZ = """
-.0083117 .5877277 -.0620636 -.0596012 .0721249 -.0220216
.1299457 .6825954 -.1513752 -.0189325 .0659650 -.0288748
.3296958 .4868735 -.2210958 .0554140 -.0639588 -.0260542
.5682053 .1874525 -.2951290 .1088631 -.1519229 -.0139754
.8730280 -.3920403 -.3616149 .2255647 -.4620442 .0012448
1.1326077 -1.2367284 -.4118494 .2877813 -.8230357 .0558651
1.0601591 -1.5999137 -.3589221 .2642124 -1.1272340 .1310694
.6777470 -.3272588 -.2504286 .1561313 -1.3765031 .2506212
"""
PATCHES = (30, 30, 24, 24, 18, 12, 6)  # Tregenza's rows of 12 degrees; the zenith is one more
HORIZON = 72  # directions along the horizon
MISSING = 9999.0
DATE_COLUMNS, DIRECT_COLUMN, DIFFUSE_COLUMN = slice(0, 4), 14, 15


@dataclass(frozen=True)
class Weather:
    """A typical year of a weather file. name: the town's. hours: (H,) the start of each hour, in seconds since 1970.

    direct, diffuse: (H,) W/m2 in the hour, of the sun on a plane that faces it, and of the sky on the horizontal.
    days: (H,) the month times 100 plus the day.
    """

    name: str
    place: Place
    hours: Float64Array
    direct: Float64Array
    diffuse: Float64Array
    days: npt.NDArray[np.int64]


def read_epw(path: Path | str, *, north: float = 0.0) -> Weather:
    """Read a weather file of EnergyPlus (EPW) with an hour in each row. north: as `Place` has it.

    Raises ValueError, which names the line, for hours and values that are missing or no numbers; OSError.
    """
    with Path(path).open(encoding="latin-1", newline="") as file:
        rows = list(csv.reader(file))
    while rows and not "".join(rows[-1]).strip():
        del rows[-1]
    try:
        latitude, longitude, zone = (float(text) for text in rows[0][6:9])
        place = Place(latitude, longitude, f"{zone:g}", north)
    except (IndexError, ValueError) as error:
        raise ValueError(f"read_epw: {path}, line 1: expected LOCATION with numbers in fields 7 to 9") from error
    starts, stamps, numbers = [], [], []
    for line, row in enumerate(rows[8:], 9):
        try:
            year, month, day, hour = (int(text) for text in row[DATE_COLUMNS])
            if not YEARS[0] <= year <= YEARS[1]:
                raise ValueError(f"the year {year} is not from {YEARS[0]} to {YEARS[1]}")
            start = datetime(year, month, day, tzinfo=UTC) + timedelta(hours=hour - 1 - zone)
            values = [float(row[column]) for column in (DIRECT_COLUMN, DIFFUSE_COLUMN)]
        except (IndexError, ValueError) as error:
            raise ValueError(f"read_epw: {path}, line {line}: expected an hour's date and numbers: {error}") from error
        if not all(0.0 <= value < MISSING for value in values):
            raise ValueError(f"read_epw: {path}, line {line}: direct or diffuse radiation is missing: got {values}")
        starts.append(start.timestamp())
        stamps.append((month, day, hour))
        numbers.append(values)
    year = 2004 if (2, 29, 1) in stamps else 2005
    days = [date(year, 1, 1) + timedelta(days=number) for number in range(366 if year == 2004 else 365)]
    hours = [(day.month, day.day, hour) for day in days for hour in range(1, 25)]
    if stamps != hours:
        place_of = next(
            (k for k, (a, b) in enumerate(zip(stamps, hours, strict=False)) if a != b), min(len(stamps), len(hours))
        )
        wanted = "the end" if place_of >= len(hours) else "month {}, day {}, hour {}".format(*hours[place_of])
        raise ValueError(f"read_epw: {path}, line {place_of + 9}: expected {wanted}: rows are missing or too many")
    direct, diffuse = np.array(numbers).T
    return Weather(rows[0][1], place, np.array(starts), direct, diffuse, np.array([100 * m + d for m, d, _ in stamps]))


def irradiance_table(
    weather: Weather, first: date | None = None, last: date | None = None, *, detail: int = 2
) -> DirectionTable:
    """List the light of a weather file on the days from `first` to `last`: of the sun, then of the sky.

    The sky is Perez': an even one in Reinhart's patches, a bright horizon, and light round the sun, which is added to
    the sun's own. Tilted planes get what Perez' formulas say to .1 per cent. Light from the ground is not included.

    Args:
        weather: of `read_epw`.
        first, last: both included, whose years are ignored; last before first goes over New Year. None: the whole year.
        detail: into how many a patch of Tregenza is split each way; 2 makes 577 patches.

    Returns: a table in kWh/m2, with cosines. The sky's rows have no time; those along the horizon, the last ones, have
        negative weights if it was mostly overcast.
    """
    _check_kind("irradiance_table", "weather", weather, Weather)
    for name, day in (("first", first), ("last", last)):
        _check_kind("irradiance_table", name, day, date | None)
    check_count("irradiance_table", "detail", detail, 1)
    low, high = (100 * day.month + day.day if day else other for day, other in ((first, 101), (last or first, 1231)))
    after, before = weather.days >= low, weather.days <= high
    chosen = after & before if low <= high else after | before
    if not chosen.any():
        raise ValueError(f"irradiance_table: the weather has no day from {first} to {last or first}: it has 365")
    direct, diffuse, place = weather.direct[chosen], weather.diffuse[chosen], weather.place
    hours, times = _shining(place, weather.hours[chosen], 60, math.inf)
    azimuth, elevation = sun_position(times, place.latitude, place.longitude)
    is_up = hours > 0.0
    shares = _perez(direct, diffuse, np.where(is_up, 90.0 - elevation, 90.0), times)
    around_sun, horizon = (np.where(is_up, diffuse * share, 0.0) for share in shares)
    beams = direct + around_sun / np.maximum(np.sin(np.radians(elevation)), math.cos(math.radians(85.0)))
    shines = is_up & (beams > 0.0)
    patches, solid_angles = _sky_patches(detail)
    even = float((diffuse - around_sun).sum()) / math.pi * solid_angles
    rim = np.full(HORIZON, float(horizon.sum()) * math.pi / HORIZON)
    ring = to_directions(np.arange(HORIZON) * 360.0 / HORIZON, 0.0)
    suns = to_directions(azimuth[shines], elevation[shines], place.north)
    directions, weights = np.concatenate([suns, patches, ring]), np.concatenate([beams[shines], even, rim]) / 1000.0
    clocks = np.full(len(weights), "NaT", "datetime64[s]")
    clocks[: len(suns)] = _clock_times(times[shines], place.time_zone)
    return DirectionTable(directions, weights, clocks, "kWh/m2", has_cosine=True)


def _perez(
    direct: Float64Array, diffuse: Float64Array, zenith: Float64Array, times: Float64Array
) -> tuple[Float64Array, Float64Array]:
    """Perez' F1 and F2: the shares of the diffuse light that come from round the sun and from the horizon."""
    angle = np.radians(zenith)
    day = 2.0 * math.pi * (times / 86400.0 % 365.25) / 365.0
    space = 1366.1 * (1.00011 + 0.034221 * np.cos(day) + 0.00128 * np.sin(day) + 0.000719 * np.cos(2.0 * day))
    air_mass = 1.0 / (np.cos(angle) + 0.50572 * (96.07995 - zenith) ** -1.6364)
    brightness = diffuse * air_mass / space
    cube = 1.041 * angle**3
    clearness = ((diffuse + direct) / np.maximum(diffuse, 1e-9) + cube) / (1.0 + cube)
    rows = np.array(PEREZ.split(), np.float64).reshape(-1, 6)
    f11, f12, f13, f21, f22, f23 = rows[np.searchsorted(CLEARNESS, clearness, side="right")].T
    return np.maximum(f11 + f12 * brightness + f13 * angle, 0.0), f21 + f22 * brightness + f23 * angle


def _sky_patches(detail: int) -> tuple[Float64Array, Float64Array]:
    """(P, 3) directions of patches, and (P,) their solid angles, which add up to 2 pi."""
    directions, solid_angles = [], []
    sines = np.sin(np.radians(np.append(np.arange(len(PATCHES) * detail + 1) * 12.0 / detail, 90.0)))
    for row, count in enumerate((*np.repeat(PATCHES, detail) * detail, 1)):
        # The mean of the sine over the patch, so that patches light a horizontal plane exactly.
        elevation = math.degrees(math.asin((sines[row] + sines[row + 1]) / 2.0)) if count > 1 else 90.0
        directions.append(to_directions((np.arange(count) + 0.5) * 360.0 / count, elevation))
        solid_angles += [2.0 * math.pi * (sines[row + 1] - sines[row]) / count] * int(count)
    return np.concatenate(directions), np.array(solid_angles)
