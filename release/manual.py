"""Write the manual that the extension brings: the pages of docs/ for users, as HTML without pictures.

Blender's *Help* menu and the sidebar's panels open them in the browser, from the disk. Links to other documents of the
repository become their paths.
"""

from __future__ import annotations

import re
from pathlib import Path

import markdown
from site_sources import REPOSITORY, with_examples, with_page_links

PAGES = (
    *("blender", "questions", "preview", "scripts", "command_line", "data_set", "ideas"),
    *(f"how_to/{path.stem}" for path in sorted((REPOSITORY / "docs" / "how_to").glob("*.md"))),
)
PICTURE = re.compile(r"^!\[[^\]]*\]\([^)]*\)$", re.MULTILINE)
TITLE = re.compile(r'^```python title="[^"]*"$', re.MULTILINE)
LINK = re.compile(r"(\]\((?:[\w./]*/)?)(\w+)\.md(?=[)#])")
HTML = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>{title} - Perfect BVH</title><style>
:root {{ color-scheme: light dark; }}
body {{ font: 16px/1.5 sans-serif; max-width: 50em; margin: 2em auto; padding: 0 1em; }}
table {{ border-collapse: collapse; }} td, th {{ border: 1px solid #8888; padding: .2em .6em; text-align: left; }}
pre, code {{ font-size: 14px; background: #8882; }} pre code {{ background: none; }}
pre {{ padding: .6em; overflow: auto; }}
</style></head><body><p>{menu}</p>
{body}</body></html>
"""
MENU = (("blender", "In Blender's windows"), ("how_to/README", "How to"), ("questions", "Questions"))


def write_manual(folder: Path) -> None:
    """Write all pages into a folder, which is made."""
    known = {f"docs/{page}.md" for page in PAGES}
    for page in PAGES:
        text = (REPOSITORY / "docs" / f"{page}.md").read_text(encoding="utf-8")
        text = TITLE.sub("```python", with_examples(PICTURE.sub("", text)))
        text = with_page_links(text, f"docs/{page}.md", known)
        up = "../" * page.count("/")
        menu = " | ".join(f'<a href="{up}{name}.html">{title}</a>' for name, title in MENU)
        body = markdown.markdown(LINK.sub(r"\1\2.html", text), extensions=["tables", "toc", "fenced_code"])
        path = folder / f"{page}.html"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(HTML.format(title=text.splitlines()[0].lstrip("# "), menu=menu, body=body), encoding="utf-8")
