"""The stress program for a simulated day: `python tests/fuzz/kernel/fuzz_stress.py [--runs N] [--seconds S]`.

firmware/apps/stress runs on the emulated robot for an hour per run, each with another seed of its random numbers. It
starts and kills threads, and registers, sends and waits for events. A run fails if the firmware stops (it asserts that
the heap is unchanged), a message is lost, the heap differs between reports, or the clock misses a millisecond.
"""

from __future__ import annotations

import re
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT))

import emu  # noqa: E402
from tests.firmware.kernel.test_kernel_on_target import FCY, run_to  # noqa: E402
from tests.fuzz.kernel.fuzz_kernel import build  # noqa: E402
from tests.fuzz.seeds import Campaign, parser  # noqa: E402

HOUR = 3600
MINUTE = 60
SPARSE = 30
"""Simulated seconds of a run if the duration is limited by --seconds."""
REPORT = re.compile(rb"(\d+) ms: (\d+) handled\r\n  \d+ waited, \d+ refused\r\n  heap (\d+), peak \d+\r\n  (\d+) lost,")


def stress(path: Path, seed: int, seconds: int) -> int:
    """Run the program for some simulated seconds and return the number of messages handled."""
    machine = emu.load(path, engine="jit")
    said = bytearray()
    machine.uart[1].on_byte = lambda byte, _: said.append(byte)
    run_to(machine, "main")
    machine.poke("lfsr", seed % 0xFFFF + 1)  # the seed must not be 0
    heaps: set[int] = set()
    handled = 0
    for passed in range(0, seconds, MINUTE):
        length = min(MINUTE, seconds - passed)
        stop = machine.run(cycles=length * FCY)
        assert stop.reason == "limit", f"{stop}\n{stop.fault.report() if stop.fault else ''}"
        reports = REPORT.findall(bytes(said))
        del said[: said.rfind(b" ms:") - 8]  # the last report may be incomplete
        assert len(reports) >= length // 2, f"after {passed + length} s: {bytes(said)!r}"
        heaps |= {int(heap) for _, _, heap, _ in reports}
        assert len(heaps) == 1, f"after {passed + length} s: the heap at a report was one of {sorted(heaps)}"
        assert all(int(lost) == 0 for *_, lost in reports), f"after {passed + length} s: messages were lost"
        handled = int(reports[-1][1])
        now = machine.peek("wraps") << 16 | machine.peek("now_ms")
        assert abs(now - (passed + length) * 1000) <= 2, f"after {passed + length} s the clock says {now} ms"
    return handled


def main() -> int:
    campaign = Campaign(parser(__doc__), "runs", 24, "runs of a simulated hour, or of half a minute with --seconds")
    options = campaign.parse()
    handled = 0
    with tempfile.TemporaryDirectory() as folder:
        path = build("stress", Path(folder), "apps")
        for seed in campaign:
            try:
                handled += stress(path, seed, HOUR if options.seconds is None else SPARSE)
            except AssertionError as error:
                return campaign.failed(error)
            print(f"--seed {seed}: {handled:,} messages handled so far, none lost", flush=True)
    return campaign.ended(f"{handled:,} messages handled, none lost")


if __name__ == "__main__":
    sys.exit(main())
