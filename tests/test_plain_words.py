"""The words that documents are kept free of."""

from __future__ import annotations

from plain_words import find_words, texts_in


def test_words_are_found_by_line() -> None:
    found = find_words("A piece of it.\nWhoever reads it,\nstands beside it.")
    assert [(line, word) for line, word, _ in found] == [(1, "piece"), (2, "Whoever"), (3, "beside")]


def test_code_links_and_everyday_words_are_left_out() -> None:
    assert not find_words("`piece` and --piece [x](beside.md) say everything\n```\npiece\n```")
    assert not find_words("pieced, nothing, besides the point of standing")


def test_of_sources_comments_docstrings_and_messages_are_read() -> None:
    python = '"""A piece\nof it."""\npiece = "piece"  # a piece\nsay(f"{piece} one piece")\n'
    assert [line for line, text in texts_in("a.py", python) if find_words(text)] == [1, 3, 4]
    header = 'int piece;  // a piece\nthrow Fault("one piece");\n#include "piece.h"\n'
    assert [line for line, text in texts_in("a.h", header) if find_words(text)] == [1, 2]
