"""The manual in the zip: its links hold, and every panel of the sidebar opens a page and a heading that is there."""

from __future__ import annotations

import posixpath
import re
import sys
from pathlib import Path

import pytest

pytest.importorskip("bpy")
pytest.importorskip("markdown")

from extension.zips import REPOSITORY
from perfect_bvh_addon import panels
from perfect_bvh_addon.panels import common

sys.path.insert(0, str(REPOSITORY / "release"))

from manual import PAGES, write_manual


@pytest.fixture(scope="module")
def manual(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """The text of each page, by its name."""
    folder = tmp_path_factory.mktemp("manual")
    write_manual(folder)
    return {path.relative_to(folder).as_posix(): path.read_text(encoding="utf-8") for path in folder.rglob("*.html")}


def test_links_between_pages_hold(manual: dict[str, str]) -> None:
    assert sorted(manual) == sorted(f"{page}.html" for page in PAGES)
    links = [(name, link) for name, text in manual.items() for link in re.findall(r'href="([^"]+)"', text)]
    assert len(links) > 100
    for name, link in links:
        if link.startswith("https://"):
            continue
        target, _, heading = link.partition("#")
        page = posixpath.normpath(posixpath.join(posixpath.dirname(name), target)) if target else name
        assert page in manual, (name, link)
        assert not heading or f'id="{heading}"' in manual[page], (name, link)
    assert not any("![" in text or "](" in text for text in manual.values())


def test_examples_are_code(manual: dict[str, str]) -> None:
    assert (
        '<pre><code class="language-python">' in manual["how_to/lidar.html"]
        and "```" not in manual["how_to/lidar.html"]
    )


class RecordingLayout:
    def __init__(self) -> None:
        self.made: list[tuple[str, RecordingLayout]] = []
        self.url = ""

    def operator(self, name: str, **_: object) -> RecordingLayout:
        self.made.append((name, RecordingLayout()))
        return self.made[-1][1]


@pytest.mark.parametrize(
    "panel",
    [found for found in panels.CLASSES if issubclass(found, common.SidebarPanel)],
    ids=lambda found: found.bl_label,
)
def test_each_panel_opens_its_page(
    panel: type, manual: dict[str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, text in manual.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text, encoding="utf-8")
    monkeypatch.setattr(common, "MANUAL", tmp_path)
    layout = RecordingLayout()
    common.draw_manual(layout, panel.page)
    ((operator, button),) = layout.made
    assert operator == "perfect_bvh.open_manual" and button.url.startswith(tmp_path.as_uri())
    name, _, heading = button.url.removeprefix(f"{tmp_path.as_uri()}/").partition("#")
    assert name in manual and (not heading or f'id="{heading}"' in manual[name])
    monkeypatch.setattr(common, "MANUAL", tmp_path / "none")
    common.draw_manual(missing := RecordingLayout(), panel.page)
    assert missing.made == []
