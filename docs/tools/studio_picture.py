"""Make the screenshot docs/figures/studio.png: `python docs/tools/studio_picture.py [--width 1280] [--out FILE]`.

Needs Chromium. A studio runs `clustering` with the real firmware for forty seconds and then until robot 2 reaches a
breakpoint. A headless browser makes the picture.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import tempfile
import threading
import time
from pathlib import Path
from typing import Final

from arena.commands import studio as command
from arena.commands.options.plan import plan_from
from arena.studio.process import Studio

FIGURE: Final = Path(__file__).resolve().parents[1] / "figures" / "studio.png"
WORDS: Final = ("clustering", "--seed", "3", "--minutes", "1")
ROBOT, PLACE, QUANTA, HEIGHT = 2, "Sys_Send_Event", 40_000, 720
SHOWN_MS: Final = 3000
"""Virtual time of the browser in ms, in which the page fetches and shows the state of the robot."""


def run_to_breakpoint(studio: Studio) -> None:
    """Run the trial for forty seconds, then until the robot reaches the breakpoint."""
    studio.ask("step", QUANTA)
    while studio.ask("status")["state"] != "paused":
        time.sleep(0.1)
    studio.ask("toggle_breakpoint", ROBOT, PLACE)
    studio.ask("run", 1.0)
    while not studio.ask("status")["hit"]:
        time.sleep(0.1)


def main() -> None:
    """Take the screenshot."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--width", type=int, default=1280, metavar="PX", help="of the window; default 1280")
    parser.add_argument("--out", type=Path, default=FIGURE, metavar="FILE")
    options = parser.parse_args()
    browser = os.environ.get("CHROMIUM") or shutil.which("chromium") or shutil.which("chromium-browser")
    if browser is None:
        parser.error("there is no Chromium (Debian package chromium); name one by CHROMIUM")
    plan = plan_from(command.parser().parse_args(WORDS), 1)
    studio = Studio(plan, plan.seed)
    try:
        run_to_breakpoint(studio)
        with command.server(studio, 0) as serving, tempfile.TemporaryDirectory() as profile:
            threading.Thread(target=serving.serve_forever, daemon=True).start()
            words = [browser, "--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars",
                     f"--user-data-dir={profile}", f"--window-size={options.width},{HEIGHT}",
                     f"--virtual-time-budget={SHOWN_MS}", f"--screenshot={options.out.resolve()}",
                     f"{serving.address}&robot={ROBOT}"]  # fmt: skip
            subprocess.run(words, check=True, capture_output=True, timeout=120)
            serving.shutdown()
    finally:
        studio.close()


if __name__ == "__main__":
    main()
