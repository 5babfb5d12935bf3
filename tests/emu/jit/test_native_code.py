"""Native code on random firmware: the whole record equals that of the plain interpreter at random stops."""

from __future__ import annotations

import random
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from emu.dspic30f.jit import engine as jit_engine
from emu.dspic30f.jit import hot_regions
from emu.dspic30f.jit.cache import ObjectCache
from emu.dspic30f.jit.engine import JitEngine
from emu.dspic30f.jit.translate.region import Region, Step
from emu.machine.machine import Machine
from tests.emu.jit.comparison.compiled_program import compile_eagerly
from tests.emu.jit.comparison.random_firmware import (
    Firmware,
    difference,
    literal,
    load,
    random_firmware,
    started,
    to_sfr,
    words_of,
)


@pytest.fixture(autouse=True)
def own_cache(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    """Use an empty cache instead of the user's cache."""
    monkeypatch.setenv("OPENSWARM_CACHE", str(tmp_path_factory.getbasetemp() / "objects"))


def eager(engine: str = "jit", ipl_slip: int = 0) -> Machine:
    """Return a machine that compiles each address before it runs it."""
    machine = Machine(engine=engine, ipl_slip=ipl_slip)
    compile_eagerly(machine)
    return machine


def pair(firmware: Firmware, ipl_slip: int = 0) -> Iterator[Machine]:
    """Yield two machines with the same firmware, one per engine."""
    for engine in ("plain", "jit"):
        machine = eager(engine, ipl_slip)
        load(machine, firmware)
        yield machine


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
def test_random_firmware_gives_equal_records_at_random_stops(seed: int) -> None:
    """engines.md §4.3: the same seed gives the same bytes in the same cycle in both engines."""
    plain, native = pair(random_firmware(seed), ipl_slip=seed % 2)
    generator = random.Random(seed)
    for _ in range(10):
        cycles = generator.randrange(1, 500)
        one, other = plain.run(cycles), native.run(cycles)
        assert one == other
        assert not difference(plain, native)
        if one.reason != "limit":
            break


def test_a_snapshot_of_one_engine_goes_on_in_the_other() -> None:
    """A snapshot of one engine continues in the other with the same result, because all state is in the record."""
    plain, native = pair(random_firmware(3))
    native.run(700)
    plain.restore(native.snapshot())
    assert plain.run(500) == native.run(500)
    assert not difference(plain, native)
    native.restore(plain.snapshot())
    assert plain.run(500) == native.run(500)
    assert not difference(plain, native)


def counting_firmware() -> Firmware:
    """Return an endless loop that counts in W1, with a T1 interrupt every 100 Tcy that counts in W2."""
    counting = words_of("INC{.B} Ws, Wd", B=0, s=2, p=0, d=2, q=0)
    sfrs = (("PR1", 99), ("IEC0", 8), ("T1CON", 0x8000))
    firmware, at = started(dict.fromkeys(range(15), 0) | {15: 0x900}, sfrs, counting)
    firmware.put(at, words_of("INC{.B} Ws, Wd", B=0, s=1, p=0, d=1, q=0) + words_of("BRA Expr", n=-2))
    return firmware


def test_interrupts_are_entered_and_left_without_python() -> None:
    """engines.md §4.3: acceptance of an interrupt, exception entry and RETFIE are native."""
    plain, native = pair(counting_firmware())
    for machine in (plain, native):
        machine.run(50_000)
    assert not difference(plain, native)
    assert isinstance(native.runner, JitEngine)
    assert native.runner.interrupts > 450
    assert native.runner.counts.interpreted < 40


def test_a_write_of_splim_in_the_cycle_of_an_event_is_native() -> None:
    """No event of a device reads SPLIM, so a write may precede an event that is due in the same cycle. The periods of
    the timer and of the loop have no common divisor, so events meet each of its cycles."""
    sfrs = (("PR1", 98), ("IEC0", 8), ("T1CON", 0x8000))
    counting = words_of("INC{.B} Ws, Wd", B=0, s=2, p=0, d=2, q=0)
    firmware, at = started(dict.fromkeys(range(15), 0) | {15: 0x900}, sfrs, counting)
    loop = to_sfr("SPLIM", 0x1000) + words_of("INC{.B} Ws, Wd", B=0, s=1, p=0, d=1, q=0)
    firmware.put(at, loop + words_of("BRA Expr", n=-len(loop) - 1))
    plain, native = pair(firmware)
    for length in (*range(1, 40), 50_000):
        assert plain.run(length) == native.run(length)
        assert not difference(plain, native)
    assert isinstance(native.runner, JitEngine)
    assert native.runner.interrupts > 450
    assert native.runner.counts.interpreted < 20


def test_returns_in_which_an_event_is_due_are_native() -> None:
    """RETURN and RETFIE with an event due in their last cycle are native. They take two cycles if an interrupt is
    then accepted (isa.md §7.4), which the boundary decides."""
    firmware = counting_firmware()
    at = next(a for a in range(0x100, 0x400, 2) if firmware.flash.get(a) == words_of("BRA Expr", n=-2)[0])
    firmware.put(at, words_of("RCALL Expr", n=1) + words_of("BRA Expr", n=-2) + words_of("RETURN"))
    plain, native = pair(firmware)
    for _ in range(50):
        assert plain.run(1_009) == native.run(1_009)
        assert not difference(plain, native)
    assert isinstance(native.runner, JitEngine)
    assert native.runner.interrupts > 450
    assert native.runner.counts.interpreted < 20


@pytest.mark.parametrize("bit", [0, 7, 15])
def test_flags_that_software_sets_are_native(bit: int) -> None:
    """isa.md §14.3: an interrupt request by BSET is native, and is visible from the next cycle on, whether it is
    enabled or not."""
    firmware = counting_firmware()
    at = next(a for a in range(0x100, 0x400, 2) if firmware.flash.get(a) == words_of("BRA Expr", n=-2)[0])
    byte, place = 0x84 + bit // 8, bit % 8
    firmware.put(0x14 + 2 * bit, [0x1100])
    handler = words_of("INC{.B} Ws, Wd", B=0, s=3, p=0, d=3, q=0)
    firmware.put(0x1100, handler + words_of("BCLR{.B} f, #bit4", f=byte, b=place) + words_of("RETFIE"))
    enables = [*to_sfr("IEC0", 8 | 1 << bit)]
    loop = words_of("BSET{.B} f, #bit4", f=byte, b=place) + words_of("INC{.B} Ws, Wd", B=0, s=4, p=0, d=4, q=0)
    loop += [*enables, *to_sfr("IEC0", 8), *words_of("BSET{.B} f, #bit4", f=byte, b=place)]
    loop += words_of("BCLR{.B} f, #bit4", f=byte, b=place)
    firmware.put(at, loop + words_of("BRA Expr", n=-len(loop) - 1))
    plain, native = pair(firmware)
    for cycles in (1_000, 1, 17, 20_000, 313):
        assert plain.run(cycles) == native.run(cycles)
        assert not difference(plain, native)
    assert native.w[3] > 500
    assert isinstance(native.runner, JitEngine)
    assert native.runner.counts.interpreted < 40


@pytest.mark.parametrize("watchdog", [False, True])
def test_clearing_the_watchdog_blocking_and_table_writes_are_native(watchdog: bool) -> None:
    """A boot loader's loop with CLRWDT, DISI and table writes is native while the watchdog is off; latches and NVMADR
    have the right values."""
    firmware = counting_firmware()
    at = next(a for a in range(0x100, 0x400, 2) if firmware.flash.get(a) == words_of("BRA Expr", n=-2)[0])
    loop = [*words_of("CLRWDT"), *words_of("DISI #lit14", k=3), *to_sfr("TBLPAG", 0x7F), *literal(0xF000, 4)]
    loop += words_of("TBLWTL{.B} Ws, [Wd]", B=0, s=1, p=0, d=4, q=2)
    loop += words_of("TBLWTH{.B} Ws, [Wd]", B=1, s=1, p=0, d=4, q=3)
    loop += [*to_sfr("TBLPAG", 0), *words_of("TBLWTL{.B} Ws, [Wd]", B=1, s=1, p=0, d=4, q=3)]
    firmware.put(at, loop + words_of("BRA Expr", n=-len(loop) - 2))
    plain, native = pair(firmware)
    for machine in (plain, native):
        if not watchdog:
            machine.program.put(machine.chip.config["FWDT"].address, 0x7FFF)
            machine.reset("POR")
    for cycles in (1, 50_000, 17, 3_000):
        assert plain.run(cycles) == native.run(cycles)
        assert not difference(plain, native)
    assert isinstance(native.runner, JitEngine)
    assert (native.runner.counts.interpreted > 1_000) == watchdog


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
def test_hooks_are_called_at_each_arrival_and_the_code_around_them_is_native(seed: int) -> None:
    """Hooks in translated code are called in the same cycles as in the interpreter and leave the same records."""
    firmware = random_firmware(seed)
    generator = random.Random(seed)
    hooked = generator.sample(sorted(firmware.flash), 40)
    machines, calls = [], []
    for machine in pair(firmware, ipl_slip=seed % 2):
        seen: list[tuple[int, int]] = []
        for pc in hooked:
            machine.hook_pc(pc, lambda m=machine, c=seen: c.append((m.pc, m.cycle)))
        machines.append(machine)
        calls.append(seen)
    plain, native = machines
    for _ in range(8):
        cycles = generator.randrange(1, 600)
        assert plain.run(cycles) == native.run(cycles)
        assert not difference(plain, native)
    assert calls[0] == calls[1]


def test_a_hook_in_a_loop_leaves_its_instruction_native() -> None:
    """A hook in a loop costs one call of Python per arrival; the hooked instruction itself is native."""
    seen: list[list[int]] = []
    for machine in pair(counting_firmware()):
        calls: list[int] = []
        machine.hook_pc(0x1002, lambda m=machine, c=calls: c.append(m.cycle))
        machine.run(20_000)
        seen.append(calls)
    assert seen[0] == seen[1]
    assert len(seen[0]) > 150
    assert isinstance(machine.runner, JitEngine)
    assert machine.runner.counts.interpreted < 40


def test_reprogrammed_flash_is_translated_anew() -> None:
    """Self-programming discards native code, and the new code is translated."""
    plain, native = pair(counting_firmware())
    for machine in (plain, native):
        machine.run(3_000)
        machine.program.put_flash(0x1000, words_of("DEC{.B} Ws, Wd", B=0, s=2, p=0, d=2, q=0))
        machine.run(3_000)
    assert not difference(plain, native)
    assert native.w[2] == 0xFFFF  # 29 increments, 30 decrements


def test_a_damaged_object_on_disk_counts_as_absent(tmp_path: Path) -> None:
    """A damaged object on disk fails its checksum and is compiled again."""
    cache = ObjectCache(tmp_path)
    key = cache.key(b"one")
    cache.put(key, b"some code")
    assert cache.get(key) == b"some code"
    file = tmp_path / key[:2] / key
    file.write_bytes(file.read_bytes()[:-1] + b"X")
    assert cache.get(key) is None
    file.write_bytes(b"short")
    assert cache.get(key) is None
    assert cache.key(b"on", b"e") != key


def test_a_folder_that_cannot_be_written_only_costs_the_cache(tmp_path: Path) -> None:
    """If the cache folder cannot be written, nothing is stored and no error is raised."""
    blocked = tmp_path / "file"
    blocked.write_text("in the way")
    cache = ObjectCache(blocked)
    cache.put(cache.key(b"one"), b"code")
    assert cache.get(cache.key(b"one")) is None
    assert cache.stores == 0


def test_vectors_are_not_executed_as_instructions() -> None:
    """isa.md §14.4, cause 5: a jump into vector space is an address error in native code too."""
    firmware = counting_firmware()
    firmware.put(0x08, [0x1100])
    firmware.put(0x1100, words_of("CLR{.B} f", B=0, f=0x80) + words_of("BRA Expr", n=-1))
    firmware.put(0x180, words_of("GOTO Expr", n=0x5C))
    plain, native = pair(firmware)
    for machine in (plain, native):
        machine.run(1_000)
        machine.pc = 0x180
        machine.run(50)
    assert plain.pc == 0x1102
    assert not difference(plain, native)


def test_accumulators_are_one_thing_by_name_and_by_address() -> None:
    """isa.md §2.1: DSP instructions and data accesses to all six accumulator words, as words and bytes, agree in one
    block."""
    firmware, at = started({n: 0x1234 * n & 0xFFFF for n in range(15)} | {15: 0x900})
    loop = [
        0xCA0001,  # LAC W1, A
        0xEE2022,  # NEG ACCAL
        0xEE4024,  # NEG.B ACCAH, WREG
        0xCB0000,  # ADD A
        0x800134,  # MOV ACCAU, W4
        0xEC602C,  # INC.B ACCBU
        0x880147,  # MOV W7, ACCBL
        0xCB8000,  # ADD B
        0x880125,  # MOV W5, ACCAH
        0x800156,  # MOV ACCBH, W6
        0xEC602B,  # INC.B ACCBH + 1
        0xE80081,  # INC W1, W1
        0xE88285,  # INC2 W5, W5
    ]
    firmware.put(at, loop + words_of("BRA Expr", n=-len(loop) - 1))
    plain, native = pair(firmware)
    for length in (*range(1, 40), 997, 5003):
        assert plain.run(length) == native.run(length)
        assert not difference(plain, native)
    runner = native.runner
    assert isinstance(runner, JitEngine)
    assert runner.counts.interpreted < 10


def test_registers_of_a_module_that_goes_off_and_on_are_its_own_again() -> None:
    """dspic30f6014a.md §4: while T2MD is set, PR2 reads 0 and ignores writes; afterwards the same native instructions
    access it again."""
    firmware, at = started({n: 3 * n for n in range(15)} | {15: 0x900})
    sfrs = Machine(engine="plain").chip.sfrs
    bit = sfrs["PMD1"].fields["T2MD"][0]
    loop = words_of("BTG{.B} f, #bit4", f=sfrs["PMD1"].address + (bit >> 3), b=bit & 7)
    loop += to_sfr("T2CON", 0x8000)
    loop += words_of("MOV{.W} Wns, f", s=1, f=sfrs["PR2"].address)
    loop += words_of("MOV{.W} f, Wnd", f=sfrs["PR2"].address, d=4)
    loop += words_of("MOV{.W} f, Wnd", f=sfrs["TMR2"].address, d=5)
    loop += words_of("INC2{.B} Ws, Wd", B=0, s=1, p=0, d=1, q=0)
    firmware.put(at, loop + words_of("BRA Expr", n=-len(loop) - 1))
    plain, native = pair(firmware)
    for length in (*range(1, 60), 997, 5003):
        assert plain.run(length) == native.run(length)
        assert not difference(plain, native)


@pytest.mark.parametrize("wait", [True, False])
def test_a_region_that_runs_long_is_compiled_again_and_replaced(
    wait: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Code of a hot region, from this process or the compile process, replaces the first code; the state is the same.
    Another machine with the program starts with the better code."""
    monkeypatch.setenv("OPENSWARM_CACHE", str(tmp_path))
    monkeypatch.setattr(hot_regions, "HOT_CYCLES", 3_000)
    monkeypatch.setattr(jit_engine, "SAMPLE_CYCLES", 100)
    plain, native = pair(counting_firmware())
    native.runner.wait = wait
    first: dict[int, int] = {}
    replaced: set[int] = set()
    for _ in range(2_000):
        assert plain.run(1_000) == native.run(1_000)
        now = {word: address for word, address in enumerate(native.runner._code.blocks) if address}
        replaced = {word for word, address in first.items() if now[word] != address}
        if replaced:
            break
        first |= now
        if native.runner.compiler.busy:
            time.sleep(0.01)
    assert not difference(plain, native)
    assert replaced
    assert native.runner.counts.hot
    another = eager()
    another.runner.share_group = object()
    load(another, counting_firmware())
    another.run(3_000)
    if wait:  # otherwise the regions depend on when code arrives
        assert all(another.runner._code.blocks[word] == now[word] for word in replaced)
    assert not difference(plain, native)


def test_an_address_is_sampled_for_a_region_that_is_translated_later() -> None:
    """A thread of another machine may translate a region while this one looks for a sampled address."""
    regions: dict[int, Region] = {}
    hot = hot_regions.HotRegions(regions)
    assert hot.sample(0x104, hot_regions.HOT_CYCLES) is None

    class Steps(dict[int, Step]):
        def __contains__(self, pc: object) -> bool:
            regions.setdefault(0x200, Region(0x200))
            return super().__contains__(pc)

    step = Step(0x104, *[None] * 4)  # type: ignore[arg-type]
    regions[0x100] = Region(0x100, Steps({0x104: step}))
    assert hot.sample(0x300, 1) is None
    assert 0x200 in regions
    assert hot.sample(0x104, hot_regions.HOT_CYCLES) is regions[0x100]
    assert hot.sample(0x104, hot_regions.HOT_CYCLES) is None


def test_machines_with_one_program_share_what_was_translated() -> None:
    """Machines with the same program share translations; a machine that programs its flash has its own translations."""
    first, second, third = eager(), eager(), eager()
    for machine in (first, second, third):
        load(machine, counting_firmware())
    third.program.put_flash(0x1000, words_of("DEC{.B} Ws, Wd", B=0, s=2, p=0, d=2, q=0))
    for machine in (first, second, third):
        machine.run(3_000)
    assert not difference(first, second)
    assert first.w[2] != third.w[2]
    held = [{id(code) for code in machine.runner.translated()} for machine in (first, second, third)]
    assert held[0] == held[1]
    assert not held[0] & held[2]
    assert [bool(machine.runner.counts.regions) for machine in (first, second, third)] == [True, False, True]
    second.program.put_flash(0x1000, words_of("DEC{.B} Ws, Wd", B=0, s=2, p=0, d=2, q=0))
    second.run(100)
    assert {id(code) for code in second.runner.translated()} <= held[2]


def test_a_timer_that_stops_in_idle_goes_on_behind_it() -> None:
    """dspic30f6014a.md §4: TSIDL stops timer 2 only during Idle; it counts again when native code continues after the
    wake-up."""
    sfrs = (("PR1", 99), ("IPC0", 0x4444), ("IEC0", 8), ("PR2", 0xFFFF), ("T2CON", 0xA000), ("T1CON", 0x8000))
    firmware, at = started({15: 0x900}, sfrs, seed=2)
    idle = words_of("PWRSAV #lit1", k=1)
    firmware.put(at, words_of("NOP") + idle + words_of("NOP") * 9 + words_of("BRA Expr", n=-12))
    plain, native = pair(firmware)
    counts = []
    for machine in (plain, native):
        machine.run(10_000)
        counts.append(machine.read("TMR2"))
    assert counts[0] == counts[1]
    assert 500 < counts[0] < 8_000
    assert not difference(plain, native)


def test_a_request_below_the_priority_ends_idle_in_the_same_cycle() -> None:
    """isa.md §11: a request with a level not above the CPU's priority ends Idle without an exception, in the same cycle
    as in the interpreter."""
    sfrs = (("PR1", 99), ("IPC0", 0x4444), ("IEC0", 8), ("T1CON", 0x8000), ("SR", 0xE0))
    firmware, at = started({2: 0, 15: 0x900}, sfrs)
    at = firmware.put(at, words_of("PWRSAV #lit1", k=1) + words_of("BCLR{.B} f, #bit4", f=0x84, b=3))
    firmware.put(at, words_of("INC{.B} Ws, Wd", B=0, s=2, p=0, d=2, q=0) + words_of("BRA Expr", n=-4))
    plain, native = pair(firmware)
    for machine in (plain, native):
        machine.run(10_000)
    assert plain.w[2] > 90
    assert not difference(plain, native)
