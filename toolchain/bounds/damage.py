"""Damaged debug information: any exception of its reader becomes a `ToolError`."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from toolchain.errors import ToolError


@contextmanager
def refused_if_damaged() -> Iterator[None]:
    """Raise ToolError for an exception in the block, which reads debug information."""
    try:
        yield
    except ToolError:
        raise
    except Exception as error:  # pyelftools checks little: damaged data raises exceptions of any kind
        raise ToolError(f"the image's debug information is damaged: {type(error).__name__}: {error}") from None
