"""Record a session at the debugger's prompt as the picture docs/figures/swarm-session.svg.

Usage: `python docs/tools/prompt_sessions.py`. `arena debug` runs on a pseudo terminal, and each line is sent when the
prompt appears. The terminal type is `dumb`, so that no line is redrawn.
"""

from __future__ import annotations

import os
import pty
import re
import subprocess
import sys
import termios
from html import escape
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).resolve().parents[2]
FIGURE: Final = ROOT / "docs" / "figures" / "swarm-session.svg"
COMMAND: Final = "arena debug clustering --robot 2 --tui --brain openswarm --set start.selector=8 --seed 3"
LINES: Final = (
    "break react if running", "continue", "print data->value", "backtrace", "next", "threads", "lastwrite running",
    "reverse-finish", "time", "continue", "list", "quit",
)  # fmt: skip
PROMPT: Final = "(emu) "
WIDTH, ROW, LETTER, MARGIN = 120, 17, 7.25, 14
"""Characters per line; height of a line, width of a character and margin in pixels."""
STYLE: Final = """
  rect { fill: #14212e; rx: 6 } text { font: 12px ui-monospace, Menlo, Consolas, monospace; white-space: pre }
  .typed { fill: #8fd18b } .said { fill: #d5e2ee }
"""


def run_session() -> list[str]:
    """Run the session and return the lines that the terminal shows."""
    main, side = pty.openpty()
    mode = termios.tcgetattr(side)
    mode[3] &= ~termios.ECHO  # the prompt itself echoes its input
    termios.tcsetattr(side, termios.TCSANOW, mode)
    words = COMMAND.split()
    environment = os.environ | {"TERM": "dumb", "XDG_STATE_HOME": os.devnull, "PYTHONPATH": str(ROOT)}
    process = subprocess.Popen([sys.executable, "-m", *words], stdin=side, stdout=side, stderr=side, env=environment,
                               cwd=ROOT)  # fmt: skip
    os.close(side)
    seen, waiting = "", list(LINES)
    while process.poll() is None or waiting:
        try:
            seen += os.read(main, 4096).decode()
        except OSError:
            break
        if seen.endswith(PROMPT) and waiting:
            line = waiting.pop(0)
            os.write(main, f"{line}\r".encode())
    process.wait()
    shown = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]|\r", "", seen).replace(f"{ROOT}/", "")
    return [f"$ {COMMAND}", *(line[:WIDTH].rstrip() for line in shown.splitlines())]


def picture(lines: list[str]) -> str:
    """Return the lines as an SVG picture."""
    height, width = ROW * len(lines) + 2 * MARGIN, LETTER * max(map(len, lines)) + 2 * MARGIN
    rows = [
        f'<text class="{"typed" if line.startswith(("$", PROMPT)) else "said"}" x="{MARGIN}" '
        f'y="{MARGIN + ROW * (n + 0.75):.1f}">{escape(line)}</text>'
        for n, line in enumerate(lines)
    ]
    head = f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:.0f}" height="{height:.0f}">'
    return "\n".join([head, f"<style>{STYLE}</style>", '<rect width="100%" height="100%"/>', *rows, "</svg>", ""])


if __name__ == "__main__":
    FIGURE.write_text(picture(run_session()), encoding="utf-8")
