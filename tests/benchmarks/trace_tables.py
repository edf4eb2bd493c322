"""The rays' figures as tables for the console."""

from __future__ import annotations

from typing import Any

from benchmarks.tables import Cell, format_table


def describe_mesh(result: dict[str, Any]) -> str:
    """Everything about one mesh: in each cell M rays/s, and then the ratio to the first peer's."""
    parts = [f"{result['name']}: {result['triangle_count']:,} triangles"]
    if result["native"]:
        parts.append(
            f"Native, one thread, M rays/s (ratio to {result['native'][0]['competitor']}); "
            "wrong answers per million, of a sample of all kinds:"
        )
        parts.append(_native(result["native"], _wrong_by_competitor(result["from_python"])))
    if result["instances"]:
        rows = [row for row in result["instances"] if "mrays_per_second" in row]
        named = [{**row, "rays": f"{row['kind']} {row['instances']:,}"} for row in rows]
        parts.append("Native, through instances:\n" + _native(named, {}))
    parts.append("From Python, one thread, M rays/s; wrong answers per million, of a sample:")
    parts.append(_from_python(result["from_python"]))
    return "\n\n".join(parts)


def _native(rows: list[dict[str, Any]], wrong: dict[str, float]) -> str:
    kinds = list(dict.fromkeys(row["rays"] for row in rows))
    cells = {}
    sizes = {row["competitor"]: row["bytes_a_triangle"] for row in rows if "bytes_a_triangle" in row}
    for row in rows:
        cells[row["competitor"], row["rays"]] = f"{row['mrays_per_second']:.2f} ({row['ratio']:.2f})"
    lines: list[list[Cell]] = []
    for name in dict.fromkeys(row["competitor"] for row in rows):
        size, wrongs = [sizes.get(name)] if sizes else [], [wrong.get(name)] if wrong else []
        lines.append([name, *(cells.get((name, kind)) for kind in kinds), *size, *wrongs])
    heads = [*kinds, *(["bytes a triangle"] if sizes else []), *(["wrong"] if wrong else [])]
    return format_table(["competitor", *heads], lines)


def _wrong_by_competitor(kinds: list[dict[str, Any]]) -> dict[str, float]:
    """Per million judged rays of all kinds."""
    result = {}
    for name in dict.fromkeys(name for kind in kinds for name in kind["native_wrong"]):
        counts = [kind["native_wrong"][name] for kind in kinds if name in kind["native_wrong"]]
        result[name] = 1e6 * sum(count["wrong"] for count in counts) / sum(count["judged"] for count in counts)
    return result


def _from_python(kinds: list[dict[str, Any]]) -> str:
    names = list(dict.fromkeys(row["name"] for kind in kinds for row in kind["peers"]))
    table: list[list[Cell]] = []
    for name in names:
        line: list[Cell] = [name]
        for kind in kinds:
            row = next((row for row in kind["peers"] if row["name"] == name), None)
            line += [row["mrays_per_second"], row["wrong"]["per_million"]] if row else [None, None]
        table.append(line)
    heads = [head for kind in kinds for head in (kind["name"], "wrong")]
    return format_table(["peer", *heads], table)
