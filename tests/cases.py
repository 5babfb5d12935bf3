"""Checks many cases in one test and reports each case that fails."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any


def check_all(check: Callable[..., object], cases: Iterable[Any]) -> None:
    """Call `check` with each case, a tuple with its elements; raise AssertionError that lists all failing cases."""
    failed, number = [], 0
    for number, case in enumerate(cases, 1):  # noqa: B007
        try:
            check(*case) if isinstance(case, tuple) else check(case)
        except Exception as error:
            failed.append(f"{case}: {type(error).__name__}: {error}")
    assert number, "there is no case"
    assert not failed, f"{len(failed)} of {number} cases failed\n" + "\n".join(failed)
