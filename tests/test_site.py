"""The sources of the site: links that hold, and every public name."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "release"))

import perfect_bvh_addon
import site_tables
from plain_words import find_words
from site_sources import exports_of, list_files, with_examples, with_page_links


def test_links_to_pages_stay_and_others_become_paths() -> None:
    pages = {"docs/a.md", "README.md"}
    assert with_page_links("[x](a.md) [y](../README.md#two)", "docs/a.md", pages) == "[x](a.md) [y](../README.md#two)"
    assert with_page_links("[the rules](../x/y.py)", "docs/a.md", pages) == "the rules (`x/y.py`)"
    assert (
        with_page_links("[x/y.py](x/y.py) [web](https://a.org)[z](../../z)", "README.md", pages)
        == "x/y.py [web](https://a.org)z"
    )


def test_a_link_to_an_example_that_is_alone_becomes_its_code(repository: Path) -> None:
    code = (repository / "examples" / "preview.py").read_text(encoding="utf-8")
    link = "[`examples/preview.py`](../../examples/preview.py)"
    shown = with_examples(f"# Job\n\n{link}\n\nSee {link}.\n")
    assert shown == f'# Job\n\n```python title="examples/preview.py"\n{code.strip()}\n```\n\nSee {link}.\n'


def test_every_export_of_the_addon_has_an_entry(repository: Path) -> None:
    assert exports_of(repository / "addon") == perfect_bvh_addon._EXPORTS


def test_tables_have_each_setting_in_plain_words() -> None:
    pytest.importorskip("bpy")
    pages = site_tables.pages()
    in_blender, sensor_files = pages["in_blender.md"], pages["sensor_files.md"]
    assert "| `noise_threshold` | Noise Threshold | 0.01 | 0 to 1 | Noise that may remain" in in_blender
    assert "| `formats` | Formats | `png` | any of `png` PNG, " in in_blender
    assert "\n### `space.shading.perfect_bvh.overlay`\n" in in_blender
    assert "| `level` | Level | 2 | 0 to 64 | " in in_blender
    assert "| `threads` | Threads | 0 | 0 to 1,024 | " in in_blender
    assert "| `scan` | Scan |" in in_blender
    assert '| `kind = "spinning"` | `columns` | 1800 | Shots of each line in one turn. |' in sensor_files
    assert "| `[beam]` | `divergence` | 0 | Full angle of the beam's cone, in milliradians. |" in sensor_files
    for name, text in pages.items():
        assert [(name, *found) for found in find_words(text)] == []
        # No row lacks its description, the last cell.
        assert [line for line in text.splitlines() if line.startswith("| `") and line.endswith("|  |")] == []


@pytest.mark.parametrize(
    "line", (Path(__file__).resolve().parent.parent / "mkdocs.yml").read_text().split("nav:")[1].splitlines()[1:]
)
def test_each_page_of_the_menu_is_there(repository: Path, line: str) -> None:
    page = line.rpartition(": ")[2].strip()
    if page.endswith(".md") and not page.startswith(("reference/", "gallery/")):
        assert page in list_files() and (repository / page).is_file()
