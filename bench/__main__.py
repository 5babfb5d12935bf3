"""Run every measurement below this folder in turn: `python -m bench`. Each one receives the arguments."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).parent


def main() -> int:
    for script in sorted(HERE.glob("*/[a-z]*.py")):
        name = f"bench.{script.parent.name}.{script.stem}"
        print(f"{name}:", flush=True)
        status = subprocess.run([sys.executable, "-m", name, *sys.argv[1:]], check=False).returncode
        if status:
            return status
    return 0


if __name__ == "__main__":
    sys.exit(main())
