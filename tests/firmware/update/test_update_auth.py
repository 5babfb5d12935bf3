"""Authenticated updates (io/update_auth): forged, replayed, truncated and downgraded programs are refused."""

from __future__ import annotations

import csv
import re
from pathlib import Path

import pytest

import emu
from emu.image.loader import load_image
from openswarm.cli import main
from openswarm.flashing.ascon import tag
from openswarm.flashing.authentication import authenticated, key_row, read_key
from openswarm.flashing.loaders import LOADERS, ROW_BYTES
from openswarm.flashing.program import ROWS, Program
from openswarm.flashing.rows import rows
from tests.firmware.update.host_programs import OPENSWARM, on_host, run_on_host
from tests.firmware.update.test_update import ACTIVATE, CONFIRM, RECEIVE, TARGET_APPS, Robot, rows_of

AUTH = OPENSWARM / "io" / "update_auth"
ASCON = (f"-I{AUTH}", AUTH / "ascon.c")
OPTION = ("-DSYS_UPDATE_AUTH", *ASCON, AUTH / "update_auth.c")
ATTACKED = ("-Wno-unused-function", *OPTION)
VECTORS = Path(__file__).parents[2] / "vectors" / "ascon_aead128.csv"
KEPT = 0x7FFFF8
"""Program address of the first word of the data EEPROM that update_auth uses."""
LONGEST = 3056
"""Bytes of the longest program without its tag."""


def vectors() -> dict[int, str]:
    """Return the published tags by length of the message."""
    with VECTORS.open(newline="") as file:
        return {int(row["bytes"]): row["tag"] for row in csv.DictReader(file)}


def message(size: int) -> bytes:
    return bytes(0x30 + at & 0xFF for at in range(size))


def test_tags_are_those_of_ascon_aead128(tmp_path):
    """Firmware and host compute the tags of the algorithm's published vectors, and agree on a long message.

    NIST SP 800-232 is little-endian and has another initial value than version 1.2 of the algorithm, so that vectors of
    the older version differ.
    """
    key, nonce = bytes(range(16)), bytes(range(16, 32))
    known = vectors()
    assert sorted(known) == list(range(1, 33))
    ours = {size: tag(key, nonce, message(size)).hex().upper() for size in (*known, LONGEST)}
    assert {size: ours[size] for size in known} == known
    made = dict(line.split() for line in on_host("mac", tmp_path, ASCON).splitlines())
    assert {int(size): text for size, text in made.items()} == ours


@pytest.mark.slow
def test_forged_and_replayed_programs_are_refused(tmp_path):
    """Every single bit of a program, of its version and size, and of each frame of a transfer is changed once.

    CRCs are right. Also refused: every other number of rows, tags of keys with one other bit, a robot's erased key, and
    versions that the robot had before, although a transfer that never ended has erased the highest one. Advertisements
    and their proofs are attacked in the same way; those that are not believed erase and activate nothing. A forger who
    replays advertisements of two newer programs in turn, and sends false data, makes the robot begin four transfers.
    """
    said = on_host("forged", tmp_path, ATTACKED)
    forgeries, keys, replays, frames, advertisements, spoiled = map(int, re.findall(r"(\d+) \w", said))
    assert forgeries == 3 * ROW_BYTES * 8 + 24 + ROWS + 2
    assert (keys, replays) == (16 * 8 + 1, 10)
    assert advertisements == 2 * (2 * 64 + 16 * 8 + 1) + 4
    assert spoiled == 4
    assert frames % 64 == 0
    assert frames > 3 * 20 * 64


@pytest.mark.slow
@pytest.mark.parametrize(
    ("line", "replacement", "failure"),
    [
        ("difference |= ", "difference &= ", "a program with a changed bit"),
        ("return all != 0xFF;", "return true;", "a robot without a key takes nothing"),
        ("proof[i] = tag[i];", "proof[i] = 0;", "an advertisement or a proof with a changed bit"),
        ("return version > highest();", "return version > 0 * highest();", "a version that is not above all before"),
    ],
)
def test_the_attacks_succeed_without_a_check(tmp_path, line, replacement, failure):
    text = (AUTH / "update_auth.c").read_text()
    assert text.count(line) == 1
    weak = tmp_path / "weak.c"
    weak.write_text(text.replace(line, replacement))
    done = run_on_host("forged", tmp_path, "-Wno-unused-function", "-DSYS_UPDATE_AUTH", *ASCON, weak)
    assert done.returncode == 1
    assert failure in done.stdout


@pytest.mark.slow
def test_power_may_fail_at_every_operation(tmp_path):
    """Updates with tags and kept versions survive a power failure at each operation, and one at the next start.

    10,000 damaged programs with right CRCs are refused.
    """
    said = on_host("power", tmp_path, OPTION)
    assert re.findall(r"(\d+) operations", said) == ["15", "23", "15"]
    assert [int(pairs) for pairs in re.findall(r"(\d+) pairs", said)] == [203, 351, 93]
    assert int(re.search(r"(\d+) damaged images refused", said)[1]) >= 10_000


@pytest.mark.slow
def test_neighbours_may_say_anything(tmp_path):
    assert int(re.search(r"(\d+) messages", on_host("hostile", tmp_path, OPTION))[1]) > 100_000


class RobotWithKey(Robot):
    """A robot that authenticates the programs that it receives through its RAM."""

    def provision(self, key: bytes) -> None:
        self.key = key
        slot, words = key_row(self.machine.image, key)
        for at, word in enumerate(words):
            self.machine.program.put(slot + 2 * at, word)

    def tell(self, command: int, version: int) -> None:
        program = authenticated(Program(version, (rows_of(version),), 16), self.key)
        facts = version.to_bytes(2, "little") + bytes([1, 0]) + program.crc.to_bytes(4, "little")
        for name, data in (("facts", facts), ("bytes", program.rows[0]), ("command", bytes([command, 0]))):
            at = self.machine.address_of(name)
            self.machine.record.bytes[at : at + len(data)] = data
        while self.run():
            pass

    def kept(self) -> list[int]:
        """Return the words of the data EEPROM with the kept version."""
        return [self.machine.program.word(KEPT + 2 * cell) for cell in range(4)]


@pytest.mark.slow
def test_a_robot_keeps_the_highest_version_in_its_eeprom(image):
    """The emulated chip runs programs with tags, keeps the version before each in turn, and refuses a replay."""
    sources = ("io/update/update", "board/epuck/update/update_cells", "io/update_auth/ascon",
               "io/update_auth/update_auth", "board/epuck/update_auth/key_cells")  # fmt: skip
    bare = " ".join(f"openswarm/{name}.c" for name in sources) + " openswarm/board/epuck/update_auth/key_slot.S"
    robot = RobotWithKey(emu.load(image("updates", TARGET_APPS, "DEFINES=-DSYS_UPDATE_AUTH", f"BARE={bare}")))
    robot.provision(bytes(range(1, 17)))
    assert robot.boot("POR") == 0
    seen = []
    for version in (1, 2, 3):
        robot.tell(RECEIVE, version)
        robot.tell(ACTIVATE, version)
        assert robot.boot("POR") == version
        robot.tell(CONFIRM, version)
        assert robot.machine.peek("refused") == 0
        seen.append(robot.kept())
    assert seen == [[0xFFFF] * 4, [1, 0xFFFE, 0xFFFF, 0xFFFF], [1, 0xFFFE, 2, 0xFFFD]]
    robot.tell(RECEIVE, 2)
    assert robot.machine.peek("refused") == 3  # begin, row and end
    robot.provision(bytes(range(2, 18)))
    assert robot.boot("POR") == 0  # another key: no program of the old one


@pytest.mark.parametrize(("unused", "rows"), [(0, 3), (15, 3), (16, 2), (90, 2)])
def test_the_tag_is_at_the_end_of_the_last_row(unused, rows):
    """The tag takes bytes that the program does not use, or a row of its own."""
    key, body = bytes(range(16)), bytes(2 * ROW_BYTES - unused) + b"\xff" * unused
    made = authenticated(Program(0x1234, (body[:ROW_BYTES], body[ROW_BYTES:]), unused), key)
    sent = b"".join(made.rows)
    assert (made.version, len(made.rows)) == (0x1234, rows)
    assert sent[: 2 * ROW_BYTES - unused] == body[: 2 * ROW_BYTES - unused]
    assert sent[-16:] == tag(key, bytes([0x34, 0x12, rows]) + bytes(13), sent[:-16])


def test_a_full_program_has_no_room_for_a_tag():
    with pytest.raises(ValueError, match="the program leaves 15 bytes of its 32 rows; its tag needs 16"):
        authenticated(Program(1, (bytes(ROW_BYTES),) * ROWS, 15), bytes(16))


@pytest.mark.parametrize(
    ("text", "mode", "reason"),
    [
        ("00112233445566778899aabbccddeef", 0o600, "expected a key of 32 hexadecimal digits"),
        ("00112233445566778899aabbccddeeff00", 0o600, "expected a key of 32 hexadecimal digits"),
        ("geheim" * 5, 0o600, "expected a key of 32 hexadecimal digits"),
        ("ff" * 16, 0o600, "a key of equal bytes is no secret"),
        ("00" * 16, 0o600, "a key of equal bytes is no secret"),
        ("0" * 70, 0o600, "expected a key of 32 hexadecimal digits"),
        ("00112233445566778899aabbccddeeff", 0o640, "other users can read this key"),
        ("00112233445566778899aabbccddeeff", 0o604, "other users can read this key"),
    ],
)
def test_bad_key_files_are_refused_without_their_content(tmp_path, capsys, text, mode, reason):
    """The command refuses the key before it opens the port, with status 2 and without a byte of the key."""
    key = tmp_path / "swarm.key"
    key.write_text(text)
    key.chmod(mode)
    source = tmp_path / "lamp.c"
    source.write_text("int main(void) { return 0; }\n")
    lamp = tmp_path / "lamp.elf"
    assert main(["program", str(source), "--version", "2", "-o", str(lamp)]) == 0
    capsys.readouterr()
    assert main(["flash", str(lamp), "--port", "/dev/null", "--key", str(key)]) == 2
    said = capsys.readouterr()
    assert reason in said.err
    assert said.err.count("\n") == 1
    assert text[:6] not in said.err + said.out


def test_a_key_file_is_read_with_its_end_of_line(tmp_path):
    key = tmp_path / "swarm.key"
    key.write_text("00112233445566778899AABBccddeeff\n")
    key.chmod(0o600)
    assert read_key(key) == bytes.fromhex("00112233445566778899aabbccddeeff")
    with pytest.raises(ValueError, match="expected a regular file"):
        read_key(tmp_path)


@pytest.mark.parametrize(
    ("address", "reason"),
    [
        (LOADERS[0x91].start, "no row of flash below the boot loader"),
        (LOADERS[0x91].entry_row, "no row of flash below the boot loader"),
        (0x7FFC00, "no row of flash below the boot loader"),
        (0x167C2, "no row of flash below the boot loader"),
        (0, "has words at 0x000000, where the key of the swarm is kept"),
    ],
)
def test_a_key_slot_elsewhere_is_refused(tmp_path, address, reason):
    """Firmware names the slot by a symbol; a wrong one cannot make the command write the loader's or its own rows."""
    (tmp_path / "lamp.c").write_text("int main(void) { return 0; }\n")
    image = load_image(emu.build(tmp_path / "lamp.c", output=tmp_path / "lamp.elf"))
    assert rows(image, LOADERS[0x91], [(0x167C0, [0] * 32)])[-2] == (0x167C0, [0] * 32)
    with pytest.raises(ValueError, match=reason):
        rows(image, LOADERS[0x91], [(address, [0] * 32)])


def test_firmware_without_the_option_takes_no_key(tmp_path):
    (tmp_path / "lamp.c").write_text("int main(void) { return 0; }\n")
    image = load_image(emu.build(tmp_path / "lamp.c", output=tmp_path / "lamp.elf"))
    with pytest.raises(ValueError, match="keeps no key: expected the ELF file of firmware with DEVICES := update"):
        key_row(image, bytes(16))
