"""Numbers in words: durations, rates, sizes, shares; and the texts of errors.

Does not depend on their meaning.
"""

from __future__ import annotations

# Seconds and minutes from which on the larger unit is clearer.
MOST_SECONDS, MOST_MINUTES = 600.0, 120
# Smaller numbers are below the precision of measurements.
LEAST_MILLISECONDS = 0.005
LEAST_DONE = 0.1  # before the time that remains is estimated


def number(value: float, digits: int = 2) -> str:
    """Formats with this number of digits, at most two of them after the point; digits before it are never rounded away.

    With two: "1,234", "123", "12", "1.2", "0.12"; never a power of ten.
    """
    for decimals in (0, 1):
        if value >= 10.0 ** (digits - 1 - decimals) - 0.5 * 10.0 ** -(decimals + 1):
            return f"{value:,.{decimals}f}"
    return f"{value:.2f}"


def duration(milliseconds: float, digits: int = 2) -> str:
    """Formats a duration, such as "1.2 ms", "0.28 s", "121 s", "12 min" or "3 h 20 min"."""
    if milliseconds < LEAST_MILLISECONDS:
        return "under 0.01 ms" if milliseconds > 0.0 else "0 ms"
    if milliseconds < 99.5:
        return f"{number(milliseconds, digits)} ms"
    seconds = milliseconds / 1e3
    if seconds < MOST_SECONDS - 0.5:
        return f"{number(seconds, digits)} s"
    minutes = round(seconds / 60.0)
    return f"{minutes} min" if minutes < MOST_MINUTES else f"{minutes // 60:,} h {minutes % 60} min"


def clock(seconds: float) -> str:
    """Hours if there are any, minutes and seconds, as Blender writes times: "01:23.45" or "2:01:23.45"."""
    hundredths = round(seconds * 100.0)
    minutes, hundredths = divmod(hundredths, 6000)
    hours, minutes = divmod(minutes, 60)
    time = f"{minutes:02}:{hundredths // 100:02}.{hundredths % 100:02}"
    return f"{hours}:{time}" if hours else time


def times(seconds: float, done: float) -> str:
    """Formats the time so far and, once enough is done, an estimate until the end, as Cycles does. done: 0 to 1."""
    so_far = f"Time: {clock(seconds)}"
    return f"{so_far} | Remaining: {clock(seconds * (1.0 - done) / done)}" if done >= LEAST_DONE else so_far


def rate(rays_per_second: float, digits: int = 2) -> str:
    """Formats a rate, such as "950 rays/s", "24 k rays/s" or "3.1 M rays/s"."""
    for unit, size in (("M ", 1e6), ("k ", 1e3)):
        if rays_per_second >= 0.9995 * size:
            return f"{number(rays_per_second / size, digits)} {unit}rays/s"
    return f"{rays_per_second:.0f} rays/s"


def memory(byte_count: float) -> str:
    """Formats bytes in the unit that has one to four digits before the point."""
    size = float(byte_count)
    for unit in ("B", "KiB", "MiB"):
        if size < 1024.0:
            return f"{size:.0f} {unit}" if unit == "B" else f"{size:.1f} {unit}"
        size /= 1024.0
    return f"{size:.2f} GiB"


def share(part: float) -> str:
    """Formats a share of 1: "45%", and "<1%" for anything small above 0."""
    return "<1%" if 0.0 < part < 0.01 else f"{part:.0%}"


def count_of(count: int, one: str, many: str = "") -> str:
    """Formats a count, such as "1 triangle" and "1,200 triangles". many: a plural other than with an s."""
    return f"{count:,} {one if count == 1 else many or one + 's'}"


# The primitives of a tree, by the kind of its mesh.
_PRIMITIVES = {"triangles": "triangle", "curves": "segment", "points": "point"}


def primitive_of(kind: str) -> str:
    """The noun of one: "triangle", "segment" of curves, "point"."""
    return _PRIMITIVES[kind]


def primitives(count: int, kind: str) -> str:
    """Formats primitives, such as "1,200 triangles", "3,200 segments" of curves and "1 point"."""
    return count_of(count, primitive_of(kind))


def sum_of(triangles: int, segments: int, points: int) -> str:
    """Formats a sum, such as "1,200 triangles, 3,200 segments"; "0 triangles" if all are 0."""
    counts = ((triangles, "triangles"), (segments, "curves"), (points, "points"))
    return ", ".join(primitives(count, kind) for count, kind in counts if count) or "0 triangles"


def sentence(text: str) -> str:
    """Capitalises the first letter. Not for texts that begin with a user's name for something."""
    return text[:1].upper() + text[1:]


def reason_of(problem: BaseException) -> str:
    """Returns an error's text, or the name of its class if it has none, as a `MemoryError` mostly does."""
    return str(problem) or type(problem).__name__
