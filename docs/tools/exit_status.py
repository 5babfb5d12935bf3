"""Write docs/exit-status.md from `emu/host/exit_status.py`: `python docs/tools/exit_status.py`."""

from __future__ import annotations

from pathlib import Path

from emu.host.exit_status import table

PAGE = Path(__file__).parents[1] / "exit-status.md"
TEXT = f"""# Exit statuses

Exit statuses of `emu`, `toolchain`, `dspic-*`, `arena` and `openswarm`. `python docs/tools/exit_status.py` writes this
page from `emu/host/exit_status.py`.

{table()}

With `emu run --exit-code` every other status is the firmware's own: the low eight bits of what `main` returned.

`-` means standard input for a file that is read as a whole, and standard output for a written one. Exceptions: files \
that
a command reads *and* writes (`--state`, `--update`, `--document`) and videos, whose format follows from the file name.
"""

if __name__ == "__main__":
    PAGE.write_text(TEXT, encoding="utf-8")
