"""Stimulus scripts: external events for the robot, one per line with its time.

    # time  what      arguments
    0.5s    selector  3
    1.2s    remote    ok              or: remote 53 0 (command, address)
    1.5s    ir        0 20            distance in mm in front of sensor 0 (inf = nothing)
    1.5s    light     3 2500          ambient counts at sensor 3
    2.0s    battery   3.3             volts
    2.5s    tilt      0.1 0 0.98      acceleration x y z in g
    3.0s    uart1     "hello\\r"       bytes for UART1 or uart2
    3.5s    uart1     "x" framing     the same with a broken stop bit; also parity, break
    4.0s    pin       RF6 0           any input pin
    5.0s    camera    unplug          or: plug
    5.0s    picture   room.png        scene of the camera; paths are relative to the working folder
    6.0s    lamp      0.5             brightness of the scene, 1 = as in the picture
    7.0s    bluetooth down            or: up
    8.0s    i2c       sda 5           SDA is held low for 5 clocks (0: until `free`); or: scl, free
    0       noise     1               sensor noise: 1 = the reference's deviations, 0 = none

Files called *.vcd and *.csv are waveforms, which stimulus_import.py converts to the same events.

Times are in s, ms or us (`1.5s`) or cycles (`22118400`). Lines may be in any order; lines with equal times keep their
order.
"""

from __future__ import annotations

import ast
import shlex
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Final

from emu.boards.epuck.hardware import EpuckHardware
from emu.boards.epuck.remote import KEYS
from emu.boards.epuck.stimulus_import import WaveformError, parse_time, read_csv, read_vcd
from emu.boards.part import BoardPart
from emu.boards.picture import read_picture
from emu.host.files import read_file
from emu.peripherals.pins import parse_pin
from emu.peripherals.uart.rx_queue import BREAK, FRAMING_ERROR, PARITY_ERROR

Action = Callable[[], None]

_ERRORS: Final = {"framing": FRAMING_ERROR, "parity": PARITY_ERROR, "break": BREAK}
"""Transmission errors of a character by name."""


class StimulusError(ValueError):
    """Invalid stimulus file. The message names the file, the line and what was expected."""


@dataclass(frozen=True, slots=True)
class StimulusStep:
    """One event of a script: an action, the cycle at which it happens, and its line in the file."""

    cycle: int
    line: int
    action: Action


def parse(board: EpuckHardware, text: str, name: str = "stimulus") -> list[StimulusStep]:
    """Parse a script and return its steps sorted by cycle. Raises StimulusError."""
    steps = []
    for number, line in enumerate(text.splitlines(), start=1):
        try:
            words = shlex.split(line, comments=True, posix=False)
            if words:
                steps.append(StimulusStep(_time(board, words[0]), number, _action(board, words[1:])))
        except (ValueError, SyntaxError, LookupError) as error:
            raise StimulusError(f"{name}:{number}: {error}") from None
    return sorted(steps, key=lambda step: step.cycle)


def decode_text(data: bytes, name: str) -> str:
    """Return the text of a stimulus file. Raises StimulusError if it is not UTF-8."""
    try:
        return data.decode()
    except UnicodeDecodeError as error:
        raise StimulusError(f"{name}: offset {error.start}: expected UTF-8 text") from None


def _lines(path: Path) -> Iterator[tuple[int, Fraction, list[str]]]:
    data = read_file(path)
    return read_vcd(data) if path.suffix == ".vcd" else read_csv(decode_text(data, str(path)))


def load_waveform(board: EpuckHardware, path: Path) -> list[StimulusStep]:
    """Read a VCD or CSV file and return its steps sorted by cycle. Raises StimulusError, OSError."""
    steps: list[StimulusStep] = []
    number = 1
    try:
        lines = _lines(path)
        for number, time, words in lines:
            steps.append(StimulusStep(_cycle(board, time), number, _action(board, words)))
    except StimulusError:
        raise
    except WaveformError as error:
        raise StimulusError(f"{path}:{error.line}: {error}") from None
    except (ValueError, LookupError) as error:
        raise StimulusError(f"{path}:{number}: {error}") from None
    return sorted(steps, key=lambda step: step.cycle)


LATEST: Final = 10**18
MOST_CLOCKS: Final = 0xFFFF
"""Maximum number of clocks for which a script holds SDA."""
LARGEST_COUNT: Final = 4095
"""Largest result of the 12-bit converter."""
MOST_G: Final = 100
"""Maximum acceleration in g; the sensor saturates far below."""
_UNITS: Final = {"ms": Fraction(1, 1000), "us": Fraction(1, 1_000_000), "s": Fraction(1)}


def _time(board: EpuckHardware, word: str) -> int:
    """Return the cycle of a written time. Fractions are exact, so 0.1s is the same cycle on every host."""
    unit = next((unit for unit in _UNITS if word.endswith(unit)), "")
    value = parse_time(word.removesuffix(unit))
    if value < 0 or not (unit or value.denominator == 1):
        raise ValueError(f"a line begins with its time, like 1.5s, 200ms, 50us or a number of cycles, not {word!r}")
    return _cycle(board, value * _UNITS[unit]) if unit else int(value)


def _cycle(board: EpuckHardware, seconds: Fraction) -> int:
    """Return the cycle of a time in seconds. Raises ValueError for a cycle after `LATEST`."""
    cycle = round(seconds * Fraction(board.chip.fcy))
    if cycle > LATEST:
        raise ValueError("expected a time of at most 10^18 cycles")
    return cycle


def _action(board: EpuckHardware, words: list[str]) -> Action:
    kinds: dict[str, Callable[[EpuckHardware, list[str]], Action]] = {
        "selector": _selector,
        "remote": _remote,
        "ir": _ir,
        "light": _light,
        "battery": _battery,
        "tilt": _tilt,
        "uart1": lambda b, w: _uart(b, 1, w),
        "uart2": lambda b, w: _uart(b, 2, w),
        "pin": _pin,
        "camera": _camera,
        "picture": _picture,
        "lamp": _lamp,
        "bluetooth": _bluetooth,
        "i2c": _i2c,
        "noise": _noise,
    }
    if not words or words[0] not in kinds:
        raise ValueError(f"expected one of {', '.join(kinds)} behind the time")
    return kinds[words[0]](board, words[1:])


def _count(words: list[str], *allowed: int) -> None:
    if len(words) not in allowed:
        raise ValueError(f"expected {' or '.join(map(str, allowed))} arguments, found {len(words)}")


def _of_sensor(words: list[str]) -> tuple[int, float]:
    """Return the sensor and the value behind it."""
    _count(words, 2)
    number, value = (float(word) for word in words)
    if number not in range(8):
        raise ValueError(f"sensors are 0 to 7, not {number:g}")
    return int(number), value


def _ir(board: EpuckHardware, words: list[str]) -> Action:
    sensor, millimetres = _of_sensor(words)
    if not millimetres >= 0:
        raise ValueError(f"a distance is 0 mm or more (inf: nothing), not {millimetres:g}")
    return lambda: board.ir.set_distance(sensor, millimetres)


def _light(board: EpuckHardware, words: list[str]) -> Action:
    sensor, counts = _of_sensor(words)
    if not 0 <= counts <= LARGEST_COUNT:
        raise ValueError(f"ambient light is 0 to {LARGEST_COUNT} counts, not {counts:g}")
    return lambda: board.ir.set_ambient(sensor, int(counts))


def _selector(board: EpuckHardware, words: list[str]) -> Action:
    _count(words, 1)
    position = int(words[0])
    if not 0 <= position < 16:
        raise ValueError(f"the selector has positions 0 to 15, not {position}")
    return lambda: setattr(board.selector, "position", position)


def _remote(board: EpuckHardware, words: list[str]) -> Action:
    _count(words, 1, 2)
    command = KEYS[words[0]] if words[0] in KEYS else int(words[0])
    address = int(words[1]) if len(words) > 1 else 0
    if not 0 <= command < 64 or not 0 <= address < 32:
        raise ValueError("RC-5 has commands 0 to 63 and addresses 0 to 31")

    def press() -> None:
        with suppress(ValueError):  # the queue is full: drop the key press
            board.remote.press(command, address)

    return press


def _battery(board: EpuckHardware, words: list[str]) -> Action:
    _count(words, 1)
    volts = float(words[0])
    if not 0 <= volts <= 5:
        raise ValueError(f"a battery has 0 to 5 V, not {volts:g}")
    return lambda: setattr(board.battery, "volts", volts)


def _tilt(board: EpuckHardware, words: list[str]) -> Action:
    _count(words, 3)
    x, y, z = (float(word) for word in words)
    if not all(abs(one) <= MOST_G for one in (x, y, z)):
        raise ValueError(f"acceleration is {-MOST_G} to {MOST_G} g along each axis")
    return lambda: board.accelerometer.set_g(x, y, z)


def _uart(board: EpuckHardware, number: int, words: list[str]) -> Action:
    _count(words, 1, 2)
    text = ast.literal_eval(words[0])
    if not isinstance(text, str):
        raise ValueError('expected a quoted text like "hello\\r"')
    if len(words) > 1 and words[1] not in _ERRORS:
        raise ValueError(f"expected one of {', '.join(_ERRORS)} behind the text")
    data = text.encode("latin-1")
    errors = _ERRORS[words[1]] if len(words) > 1 else 0
    line = board.bluetooth if number == 1 else board.chip.uart[number]
    return lambda: line.feed(data, line.now + 1, errors=errors)


def _pin(board: EpuckHardware, words: list[str]) -> Action:
    _count(words, 2)
    name, level = words
    parse_pin(name)
    if level not in ("0", "1"):
        raise ValueError(f"a level is 0 or 1, not {level!r}")
    return lambda: board.chip.pins.set(name, int(level))


def _camera(board: EpuckHardware, words: list[str]) -> Action:
    _count(words, 1)
    camera = board.camera
    if camera is None or words[0] not in ("plug", "unplug"):
        raise ValueError("expected `plug` or `unplug`, on a robot with a camera")
    return camera.plug if words[0] == "plug" else camera.unplug


def _picture(board: EpuckHardware, words: list[str]) -> Action:
    _count(words, 1)
    camera = board.camera
    if camera is None:
        raise ValueError("this robot has no camera")
    picture = read_picture(words[0].strip("\"'"))
    return lambda: camera.show(picture)


def _lamp(board: EpuckHardware, words: list[str]) -> Action:
    _count(words, 1)
    brightness = float(words[0])
    camera = board.camera
    if camera is None or not 0 <= brightness <= 1000:
        raise ValueError("brightness is 0 to 1000, on a robot with a camera")
    return lambda: setattr(camera, "lamp", brightness)


def _bluetooth(board: EpuckHardware, words: list[str]) -> Action:
    _count(words, 1)
    if words[0] not in ("up", "down"):
        raise ValueError(f"the link is `up` or `down`, not {words[0]!r}")
    return lambda: setattr(board.bluetooth, "connected", words[0] == "up")


def _noise(board: EpuckHardware, words: list[str]) -> Action:
    _count(words, 1)
    strength = float(words[0])
    if not 0 <= strength <= 100:
        raise ValueError("strength of noise is 0 (none) to 100, 1 = as the reference says")
    return lambda: setattr(board.noise, "strength", strength)


def _i2c(board: EpuckHardware, words: list[str]) -> Action:
    assert board.chip.i2c is not None
    wire = board.chip.i2c.wire
    if words == ["free"]:
        return wire.release
    if words == ["scl"]:
        return lambda: wire.hold(scl=True)
    if len(words) == 2 and words[0] == "sda":
        clocks = int(words[1])
        if not 0 <= clocks <= MOST_CLOCKS:
            raise ValueError(f"SDA is held for 0 (until `free`) to {MOST_CLOCKS} clocks, not {clocks}")
        return lambda: wire.hold(sda=True, clocks=clocks)
    raise ValueError("expected `sda CLOCKS`, `scl` or `free`")


class Stimulus(BoardPart):
    """Player of a script on a board. Its position is in the record, so a restored snapshot continues the script."""

    def __init__(self, board: EpuckHardware) -> None:
        super().__init__("stimulus", board.chip)
        self._board: Final = board
        self._steps: list[StimulusStep] = []
        self._next: Final = self.cell("next")
        self._due: Final = self.slot("next", self._play)

    def load(self, path: Path) -> None:
        """Play the file at `path`, a script or a waveform. Raises StimulusError, OSError.

        Call it after the image is loaded: its clock setting converts seconds to cycles.
        """
        if path.suffix in (".vcd", ".csv"):
            self.play(load_waveform(self._board, path))
        else:
            self.play(parse(self._board, decode_text(read_file(path), str(path)), str(path)))

    def play(self, steps: list[StimulusStep]) -> None:
        """Play `steps`, which are sorted by cycle, instead of an earlier script. Steps in the past run immediately."""
        self._steps = steps
        self._next.value = 0
        if steps:
            self.events.set(self._due, max(steps[0].cycle, self.now + 1))
        else:
            self.events.cancel(self._due)

    def _play(self, due: int) -> None:
        while self._next.value < len(self._steps) and self._steps[self._next.value].cycle <= due:
            step = self._steps[self._next.value]
            self._next.value += 1
            step.action()
        if self._next.value < len(self._steps):
            self.events.set(self._due, self._steps[self._next.value].cycle)
