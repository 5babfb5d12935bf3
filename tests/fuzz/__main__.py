"""`python -m tests.fuzz`: every campaign of this folder, one after the other; ends at the first that fails."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).parent


def main() -> int:
    for script in [*sorted(HERE.glob("fuzz_*.py")), HERE / "csmith_campaign.py"]:
        print(f"{script.name}:", flush=True)
        status = subprocess.run([sys.executable, str(script)], check=False).returncode
        if status:
            return status
    return 0


if __name__ == "__main__":
    sys.exit(main())
