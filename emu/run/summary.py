"""Summary of a finished run: why and where it ended, as text or JSON, and the firmware's exit status."""

from __future__ import annotations

import json
import sys
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, Final

from emu.host.exit_status import DONE, FAULT_AS_STATUS, INTERRUPTED, LIMIT_AS_STATUS
from emu.image.model import Image

if TYPE_CHECKING:
    from emu.machine.machine import Machine
    from emu.machine.stops import Stop

EXIT_SYMBOL: Final = "__exit_status"
"""Symbol of the variable in which the start-up code stores main's result before it sleeps forever."""


@dataclass(frozen=True, slots=True)
class RunResult:
    """Result of a run: the stop, the host time, the bytes that each UART lost, and captured UART output."""

    stop: Stop
    host_seconds: float
    lost: dict[int, int]
    captured: dict[int, bytearray]


def report(
    machine: Machine, image: Image, result: RunResult, status: int, *, as_json: bool, with_statistics: bool
) -> None:
    """Print why the run ended: text on standard error, or one JSON object on standard output."""
    facts = _facts(machine, image, result.stop, result.host_seconds)
    if with_statistics:
        facts["stats"] = _statistics(machine, result.host_seconds)
    for number, count in result.lost.items():
        print(f"emu run: UART{number}: {count} bytes lost; the host side did not read them", file=sys.stderr)
    if as_json:
        facts |= {f"uart{number}": bytes(data).decode("latin-1") for number, data in result.captured.items()}
        print(json.dumps(facts | {"status": status}))
    else:
        _print_end(facts, result.stop)


def firmware_status(machine: Machine, image: Image, stop: Stop) -> int:
    """Return the exit status for --exit-code: main's result if the firmware has ended."""
    if stop.reason == "fault":
        return FAULT_AS_STATUS
    if stop.reason == "breakpoint":
        return int(machine.peek("W0")) & 0xFF
    if stop.reason == "halt":
        symbol = image.symbols.find(EXIT_SYMBOL)
        return int(machine.peek(symbol.address)) & 0xFF if symbol is not None else DONE
    return INTERRUPTED if stop.reason == "interrupted" else LIMIT_AS_STATUS


def _facts(machine: Machine, image: Image, stop: Stop, host_seconds: float) -> dict[str, Any]:
    """Return the content of the summary line as data."""
    seconds = machine.peripherals.seconds(stop.cycle)
    facts: dict[str, Any] = {
        "reason": stop.reason,
        "pc": stop.pc,
        **_place(image, stop.pc),
        "cycles": stop.cycle,
        "seconds": seconds,
        "host_seconds": host_seconds,
        "speed": seconds / host_seconds if host_seconds else None,
        "engine": machine.engine,
    }
    if stop.fault is not None:
        facts["fault"] = stop.fault.facts()
    return facts


def _statistics(machine: Machine, host_seconds: float) -> dict[str, Any]:
    """Return the engine's counters, the number of resets, and the host time per activity."""
    runner = machine.runner
    counts = getattr(runner, "counts", None)
    facts = {"engine": machine.engine, "resets": len(machine.resets), **(asdict(counts) if counts else {})}
    seconds: dict[str, float] | None = getattr(runner, "seconds", None)
    if seconds is not None:
        facts["interrupts entered natively"] = getattr(runner, "interrupts", 0)
        facts |= {f"seconds in {activity}": round(spent, 3) for activity, spent in seconds.items()}
        facts["seconds in events and console"] = round(max(host_seconds - sum(seconds.values()), 0.0), 3)
    return facts


def _place(image: Image, pc: int) -> dict[str, str | None]:
    line = image.lines.find(pc)
    return {
        "symbol": image.symbols.text(pc) if image.symbols.code(pc) else None,
        "line": str(line) if line else None,
    }


def _where(place: dict[str, Any]) -> str:
    names = ", ".join(place[key] for key in ("symbol", "line") if place[key])
    return f"{place['pc']:#08x} ({names})" if names else f"{place['pc']:#08x}"


def _print_end(facts: dict[str, Any], stop: Stop) -> None:
    """Print the fault, if any, and the summary line."""
    sys.stdout.flush()
    if stop.fault is not None:
        print(f"emu run: {stop.fault.report()}", file=sys.stderr)
    for name, value in facts.get("stats", {}).items():
        print(f"emu run: {name}: {value}", file=sys.stderr)
    where = stop.fault.where if stop.fault is not None else _where(facts)
    print(
        f"{facts['reason']} at {where} after {facts['cycles']:,} cycles,"
        f" {facts['seconds']:.6f} s simulated, {facts['speed'] or 0:.3g} x real time",
        file=sys.stderr,
    )
