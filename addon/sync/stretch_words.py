"""What a scan does not follow between two of its key moments, in words that are the same however often it happens."""

from __future__ import annotations

from .moments import BARE
from .motion_words import MotionWords, row_of
from .not_shown import NotShown
from .records import ObjectRecord

_OF_ORDER = "Give the points ids, by Set ID, before nodes change their order"
_ADVICE = "Raise Steps per Frame: there is less time between two key moments then"


class StretchWords(MotionWords):
    """Of a stretch from one key moment to the next. Without numbers, which differ from stretch to stretch."""

    def _missing_row(self, owner: ObjectRecord, count: int, is_plain: bool) -> NotShown:
        subject = "it goes" if is_plain else "some of its instances go"
        still = "it stands still, as at the earlier one" if is_plain else "they stand still, as at the earlier one"
        return row_of(owner, f"{subject} between two key moments of the scan; until the later one {still}", _ADVICE)

    def _new_row(self, owner: ObjectRecord, count: int, is_plain: bool) -> NotShown:
        subject, met = ("it comes", "it is") if is_plain else ("some of its instances come", "they are")
        text = f"{subject} between two key moments of the scan; until the later one {met} not met"
        return row_of(owner, text, _ADVICE)

    def _reordered_row(self, owner: ObjectRecord, count: int) -> NotShown:
        text = "instances without ids change places between two key moments of the scan, as if by another order"
        return row_of(owner, f"{text}; until the later one they stand still, as at the earlier one", _OF_ORDER)

    def _flat_row(self, owner: ObjectRecord, count: int, is_plain: bool) -> NotShown:
        whose, subject = (
            ("its scale", "it stands") if is_plain else ("the scale of some of its instances", "they stand")
        )
        text = f"{whose} is zero at a key moment of the scan; from and to that {subject} still, as at the earlier one"
        return row_of(owner, text, _ADVICE)

    def _remade_row(self, owner: ObjectRecord, kind: str, verdict: int) -> NotShown:
        change = f"gets other {kind} between two key moments of the scan"
        if verdict == BARE:
            change = "has points without a radius at one of two key moments of the scan that have one at the other"
        return row_of(owner, f"its shape {change}; until the later one it keeps the earlier one's", _ADVICE)
