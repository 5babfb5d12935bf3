"""Power-on and inputs of robots, and reports of robots that hang or send nothing."""

from __future__ import annotations

import itertools
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from arena.cli import main
from arena.robots.firmware_controller import FirmwareController
from arena.scene.loader import FCY, load_scene
from arena.trial.record import Trial, read_trial
from arena.world.physics import World
from tests.arena.robot_programs import BEGIN, ECHO, SEND_SELECTOR
from tests.watchdog import HANG

ROOT = Path(__file__).resolve().parents[3]
Assembled = Callable[[str], Path]


def run(image: Path, out: Path, *words: object, seconds: float = 1.5) -> tuple[int, Trial]:
    """Run one trial of two robots. Return its exit status and its record."""
    command = ["run", "clustering", "--brain", str(image), "--robots", "2", "--objects", "0", "--trials", "1",
               "--minutes", str(seconds / 60), "--out", str(out), *map(str, words)]  # fmt: skip
    status = main(command)
    return status, read_trial(out / "trial-0001.parquet")


@pytest.mark.parametrize(
    ("handler", "cause"),
    [
        ("__AddressError", "mov #0x1001, w0\n mov [w0], w1"),
        ("__StackError", "mov #0x2000, w0\n mov w0, SPLIM\n mov #0x2100, w15\n push w0"),
        ("__MathError", "mov #1, w2\n mov #0, w3\n repeat #17\n div.u w2, w3"),
    ],
)
def test_firmware_that_stays_in_its_own_trap_handler_is_reported(
    assembled: Assembled, handler: str, cause: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Firmware that loops for ever in its own trap handler is reported, although the emulator does not stop."""
    image = assembled(f"{BEGIN}\n {cause}\n1: bra 1b\n .global {handler}\n{handler}: bra {handler}\n")
    status, trial = run(image, tmp_path)
    assert status == 1
    assert [robot for robot, _, _ in trial.about["faults"]] == [0, 1]
    for _, seconds, why in trial.about["faults"]:
        assert why.startswith(f"sits in the handler of {handler.strip('_')} since 0.")
        assert handler.removeprefix("_") in why
        assert seconds <= 1.0
    assert capsys.readouterr().err.count("sits in the handler") == 2


def test_a_trap_handler_that_returns_is_not_reported(assembled: Assembled, tmp_path: Path) -> None:
    """Firmware whose trap handler fixes the cause and returns, 2,000 times a second, is not reported."""
    image = assembled(f"""{BEGIN}
1:      mov     #1, w2
        mov     #0, w3
        repeat  #17
        div.u   w2, w3
        mov     #2000, w1
2:      dec     w1, w1
        bra     nz, 2b
        btg     LATA, #6
        bclr    TRISA, #6
        bra     1b
        .global __MathError
__MathError: bclr INTCON1, #4
        retfie
""")
    status, trial = run(image, tmp_path)
    assert (status, trial.about["faults"]) == (0, [])


@pytest.mark.slow
def test_a_kernel_that_stopped_itself_is_reported(tmp_path: Path) -> None:
    """A kernel that ended in hal_stop() after a failed assertion is reported, also if a key of the remote control,
    which cannot wake it, is pressed later."""
    source = tmp_path / "apps" / "wrong" / "main.c"
    source.parent.mkdir(parents=True)
    source.write_text("#include <openswarm.h>\nint main(void) { Sys_Init_Kernel(); SYS_ASSERT(0); return 0; }\n")
    made = ["make", "-C", str(ROOT / "firmware"), "APP=wrong", f"APPS={source.parents[1]}", f"OUT={tmp_path / 'out'}",
            f"PYTHON={sys.executable}"]  # fmt: skip
    subprocess.run(made, check=True, capture_output=True, timeout=HANG)
    for key in ("ok", ""):
        status, trial = run(tmp_path / "out" / "firmware.elf", tmp_path / f"run{key}", "--set", f"start.remote={key}")
        assert status == 1
        assert len(trial.about["faults"]) == 2
        assert trial.about["faults"][0][2].startswith("stopped: ")
        assert "the kernel stopped the system; UART1 said why" in trial.about["faults"][0][2]
    assert any("main.c:2" in line["text"] for row in trial.columns["log"] for line in row)


def test_sleep_that_the_watchdog_ends_is_not_reported(assembled: Assembled, tmp_path: Path) -> None:
    """Firmware that sleeps for seconds without an interrupt, until the watchdog wakes it, is not reported."""
    image = assembled(f"{BEGIN}\n bset RCON, #5 ; SWDTEN, about 16 s\n1: pwrsav #0\n bra 1b\n")
    status, trial = run(image, tmp_path)
    assert (status, trial.about["faults"]) == (0, [])


def test_a_silent_robot_is_reported_after_the_time_of_the_scene(assembled: Assembled, tmp_path: Path) -> None:
    """Firmware that moves no wheels, changes no LEDs and sends no byte is reported after the time in the scene."""
    image = assembled(f"{BEGIN}\n1: bra 1b\n")
    quiet = ["--set", "start.silent_s=1"]
    status, trial = run(image, tmp_path / "a", *quiet)
    assert status == 1
    assert [(robot, why[:-6]) for robot, _, why in trial.about["faults"]] == [
        (0, "is silent: no motor step, LED or byte since"),
        (1, "is silent: no motor step, LED or byte since"),
    ]
    status, trial = run(image, tmp_path / "b")
    assert (status, trial.about["faults"]) == (0, [])
    lively = assembled(f"{BEGIN}\n1: mov #65000, w1\n2: repeat #50\n nop\n dec w1, w1\n bra nz, 2b\n mov #'x', w0\n"
                       "mov w0, U1TXREG\n bra 1b\n")  # fmt: skip
    status, trial = run(lively, tmp_path / "c", *quiet)
    assert (status, trial.about["faults"]) == (0, [])


def test_the_remote_control_repeats_its_frame_while_the_key_is_held(talking_image: Path) -> None:
    """The remote control repeats its frame every 113.8 ms (epuck.md §6), so a robot that misses the first frame
    receives a later one."""
    scene = load_scene("clustering").with_values(robots__count=1, objects__count=0, start__remote_held_s=0.5)
    controller = FirmwareController(scene, 1, 0, talking_image)
    edges: list[int] = []
    controller.machine.peripherals.pins.watch("RF6", lambda cycle, _changed, _levels: edges.append(cycle))
    poses = World(scene, 1).poses
    for tick in range(2000):
        controller.machine.run_until((tick + 1) * scene.clock.quantum_tcy)
    assert poses.robots
    begins = [cycle for before, cycle in zip([-FCY, *edges], edges, strict=False) if cycle - before > FCY // 20]
    assert len(begins) == 5
    gaps = [(other - one) / FCY for one, other in itertools.pairwise(begins)]
    assert gaps == pytest.approx([0.1138] * 4, abs=1e-5)


def test_a_robot_powered_on_while_the_key_is_held_receives_the_remaining_frames(talking_image: Path) -> None:
    """A robot that is powered on while the key is held receives the remaining frames, but no partial or earlier
    frame."""
    values = {"robots__count": 1, "objects__count": 0, "start__remote_at_s": 0.0, "start__spread_tcy": 4 * 1_600_000}
    scene = load_scene("clustering").with_values(**values)
    for seed in range(1, 6):
        controller = FirmwareController(scene, seed, 0, talking_image)
        edges: list[int] = []
        controller.machine.peripherals.pins.watch(
            "RF6", lambda cycle, _changed, _levels, edges=edges: edges.append(cycle)
        )
        controller.machine.run_until(FCY)
        begins = [cycle for before, cycle in zip([-FCY, *edges], edges, strict=False) if cycle - before > FCY // 20]
        on_at = controller._on_at
        left = [n * 0.1138 for n in range(5) if n * 0.1138 * FCY >= on_at]
        assert [(cycle + on_at) / FCY for cycle in begins] == pytest.approx(left, abs=1e-3)


@pytest.mark.parametrize("position", [0, 7, 11, 15])
def test_the_switch_has_sixteen_positions(assembled: Assembled, position: int, tmp_path: Path) -> None:
    """The firmware reports the selector position, one of sixteen, that it reads on RG6 to RG9 (epuck.md §2)."""
    image = assembled(f"""{BEGIN}{SEND_SELECTOR}
1:      bra     1b
""")
    _, trial = run(image, tmp_path, "--set", f"start.selector={position}", seconds=0.5)
    said = [line["text"] for row in trial.columns["log"] for line in row]
    assert said == [chr(ord("A") + position)] * 2


def test_a_stimulus_arrives_at_times_of_the_trial(assembled: Assembled, tmp_path: Path) -> None:
    """A stimulus reaches both robots at the same time of the trial, though their power-on times differ. The record is
    the same to the byte for one and two threads."""
    script = '0.5s uart1 "go 7\\n"'
    image = assembled(ECHO)
    records = []
    for jobs in ("1", "2"):
        _, trial = run(image, tmp_path / jobs, "--set", f"start.stimulus={script}", "--jobs", jobs)
        records.append(trial.path.read_bytes())
        lines = [line for row in trial.columns["log"] for line in row]
        assert sorted((line["robot"], line["text"]) for line in lines) == [(0, "go 7"), (1, "go 7")]
        assert [line["cycle"] / FCY for line in lines] == pytest.approx([0.5] * 2, abs=2e-3)
    assert records[0] == records[1]


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ("start.selector=16", "start.selector is 16; expected -1 to 15"),
        ("start.remote=louder", "start.remote is 'louder'; expected standby, swap, sleep, ok, 0 to 63, or empty"),
        ("start.stimulus=1s jump", "start.stimulus:1: expected one of selector, remote,"),
        ("start.silent_s=0", "start.silent_s is 0.0; expected 0.1 to inf"),
    ],
)
def test_invalid_start_values_are_refused(
    setting: str, message: str, talking_image: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Invalid values of `[start]` end with exit status 2 before a trial starts."""
    words = ["run", "clustering", "--brain", str(talking_image), "--trials", "1", "--set", setting]
    assert main([*words, "--out", str(tmp_path)]) == 2
    assert message in capsys.readouterr().err
    assert not list(tmp_path.glob("trial-*"))
