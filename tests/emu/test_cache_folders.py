"""Cache folders are private at every level; folders that other users can write are not used."""

from __future__ import annotations

import os
import stat
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest

from emu.dspic30f.jit.cache import ObjectCache
from emu.host import disk_cache
from emu.host.paths import runtime_libraries
from emu.host.private_folder import danger
from tests.full_device import FULL_DEVICE, needs_full_device
from toolchain import device_header
from toolchain.driver import driver, runtime_archive

pytestmark = pytest.mark.skipif(os.name != "posix", reason="modes of POSIX")
ARCHIVE = b"!<arch>\n" + bytes(100)


@pytest.fixture(params=[0o077, 0o022, 0o002, 0o000])
def umask(request: pytest.FixtureRequest) -> Iterator[int]:
    """Set the umask of this process; 002 is common for users with a private group."""
    before = os.umask(request.param)
    yield request.param
    os.umask(before)


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the path of an empty cache, whose folder does not exist yet."""
    folder = tmp_path / "new" / "cache"
    monkeypatch.setenv("OPENSWARM_CACHE", str(folder))
    return folder


def fill(cache: Path) -> ObjectCache:
    """Write an object, a run-time library and a device header into the cache."""
    objects = ObjectCache()
    objects.put("00key", b"code")
    runtime_archive._store(runtime_libraries() / "libdspic-0.a", ARCHIVE)
    device_header.folder_of.cache_clear()
    device_header.folder_of("dspic30f4013")
    device_header.folder_of.cache_clear()
    return objects


@pytest.mark.usefixtures("umask")
def test_all_new_folders_are_private(cache: Path) -> None:
    """Every new folder, from the first missing one to the shelves of objects, has mode 0700."""
    objects = fill(cache)
    folders = [cache.parent, cache, *(path for path in cache.rglob("*") if path.is_dir())]
    assert {path.name for path in folders} >= {"new", "cache", "jit", "00", "toolchain", "headers"}
    assert {stat.S_IMODE(path.stat().st_mode) for path in folders} == {0o700}
    assert objects.get("00key") == b"code"


def test_an_entry_of_another_cache_or_name_is_not_used(cache: Path) -> None:
    """An object counts as absent under another name, beside another key or without one; the key is private."""
    objects = fill(cache)
    shelf, key = cache / "jit" / "00", cache / "jit" / "key"
    assert stat.S_IMODE(key.stat().st_mode) == 0o600
    (shelf / "00other").write_bytes((shelf / "00key").read_bytes())
    assert objects.get("00other") is None
    foreign = ObjectCache(cache.parent / "foreign" / "jit")
    foreign.put("00key", b"planted")
    (shelf / "00key").write_bytes((foreign.where / "00" / "00key").read_bytes())
    assert objects.get("00key") is None
    objects.put("00key", b"code")
    assert objects.get("00key") == b"code"
    key.write_bytes(b"short")
    assert objects.get("00key") is None
    objects.put("00key", b"again")
    assert (objects.get("00key"), len(key.read_bytes())) == (b"again", 32)
    key.unlink()
    assert objects.get("00key") is None


def directory(key: Path) -> None:
    key.mkdir()


def dangling_link(key: Path) -> None:
    key.symlink_to(key.with_name("missing"))


def link_to_a_known_key(key: Path) -> None:
    known = key.with_name("known")
    known.write_bytes(bytes(range(32)))
    known.chmod(0o600)
    key.symlink_to(known)


def pipe(key: Path) -> None:
    os.mkfifo(key)


def known_to_others(key: Path) -> None:
    key.write_bytes(bytes(range(32)))
    key.chmod(0o640)


def zeros(key: Path) -> None:
    key.write_bytes(bytes(32))
    key.chmod(0o600)


@pytest.mark.parametrize(
    "damaged",
    [directory, dangling_link, link_to_a_known_key, pipe, known_to_others, zeros],
    ids=lambda one: one.__name__,
)
def test_a_key_that_is_no_secret_file_counts_as_absent(cache: Path, damaged: Callable[[Path], None]) -> None:
    """No object is used beside such a key. Storing an object replaces the key, unless it is a folder."""
    objects = fill(cache)
    key = cache / "jit" / "key"
    key.unlink()
    damaged(key)
    assert objects.get("00key") is None
    objects.put("00key", b"again")
    assert objects.get("00key") == (None if damaged is directory else b"again")
    assert stat.S_ISREG(key.lstat().st_mode) == (damaged is not directory)


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can give a link away")
def test_a_link_of_another_user_is_not_used(cache: Path) -> None:
    """A symbolic link of another user to a private folder is not used: its owner could turn it to another one."""
    fill(cache)
    place = cache.with_name("link")
    place.symlink_to(cache)
    assert not danger(place)
    os.lchown(place, 65534, -1)
    assert danger(place) == "it belongs to another user (uid 65534)"


def test_a_folder_that_others_can_replace_is_not_used(cache: Path) -> None:
    """A folder below one that all users can write is not used, unless the sticky bit protects its name, as in /tmp."""
    fill(cache)
    cache.parent.chmod(0o777)
    assert danger(cache) == "other users can replace it (mode 0777 of the folder around it)"
    assert ObjectCache().get("00key") is None
    cache.parent.chmod(0o1777)
    assert not danger(cache)


@needs_full_device
def test_a_full_disk_leaves_no_half_written_object(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An object that does not fit is not stored, and no part of it remains."""
    objects = fill(cache)
    before = sorted(cache.rglob("*"))

    def mkstemp(dir: Path) -> tuple[int, str]:
        handle, name = tempfile.mkstemp(dir=dir)
        os.close(handle)
        return os.open(FULL_DEVICE, os.O_WRONLY), name

    monkeypatch.setattr(disk_cache, "tempfile", SimpleNamespace(mkstemp=mkstemp))
    objects.put("00other", b"code")
    assert sorted(cache.rglob("*")) == before
    assert (objects.get("00other"), objects.get("00key")) == (None, b"code")


@pytest.mark.parametrize("place", ["", "jit", "jit/00", "toolchain"])
@pytest.mark.parametrize("mode", [0o770, 0o702])
def test_a_folder_that_others_can_write_is_not_used(
    cache: Path, place: str, mode: int, capsys: pytest.CaptureFixture[str]
) -> None:
    """A folder that others can write is neither read nor written, and one sentence names it."""
    fill(cache)
    (cache / place).chmod(mode)
    before = sorted(cache.rglob("*"))
    objects = ObjectCache()
    assert (objects.get("00key") is None) == (place != "toolchain")
    objects.put("00other", b"code")
    archive = next((cache / "toolchain").glob("*.a"))
    assert (runtime_archive._stored(archive) is None) == (place in ("", "toolchain"))
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert f"the cache {cache / place} is not used, because other users can write it (mode {mode:04o})" in said
    if place != "toolchain":
        assert sorted(cache.rglob("*")) == before


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can give a folder away")
def test_a_folder_of_another_user_is_not_used(cache: Path) -> None:
    """A folder of another user is not used, because its owner could replace its content."""
    objects = fill(cache)
    os.chown(cache / "jit", 65534, -1)
    assert danger(cache / "jit") == "it belongs to another user (uid 65534)"
    assert objects.get("00key") is None


def test_a_command_works_without_an_unsafe_cache(cache: Path, tmp_path: Path) -> None:
    """`toolchain cc -c` works with an unsafe cache: it finds its headers and reports the cache in one line."""
    source = tmp_path / "main.c"
    source.write_text("#include <xc.h>\nint main(void) { return LATB; }\n")
    cache.mkdir(parents=True)
    cache.chmod(0o777)
    done = subprocess.run([sys.executable, "-m", "toolchain", "cc", "-c", str(source), "-o", str(tmp_path / "main.o")],
                          capture_output=True, text=True, check=False)  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stderr.count("\n") == 1
    assert "is not used" in done.stderr
    assert not list(cache.iterdir())


@pytest.mark.parametrize(
    "damaged", [(b"", 0, 80), (b"", 0, 0), (b"X", 0, None), (b"", 1, None)], ids=["half", "empty", "longer", "shifted"]
)
def test_a_damaged_runtime_library_counts_as_absent(cache: Path, damaged: tuple[bytes, int, int | None]) -> None:
    """A truncated, empty, extended or shifted run-time library fails its checksum and is ignored."""
    fill(cache)
    (archive,) = (cache / "toolchain").glob("*.a")
    assert runtime_archive._stored(archive) == ARCHIVE
    added, first, end = damaged
    archive.write_bytes(archive.read_bytes()[first:end] + added)
    assert runtime_archive._stored(archive) is None


def test_a_program_links_although_the_cached_library_is_damaged(
    cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """If the cached library is damaged, the compiler builds and stores it again, and the program links.

    The library has only the file that every program needs, because building all of it takes seconds.
    """
    small = tmp_path / "runtime"
    small.mkdir()
    (small / "crt0.s").write_bytes((runtime_archive.RUNTIME_DIR / "crt0.s").read_bytes())
    monkeypatch.setattr(runtime_archive, "RUNTIME_DIR", small)
    archive = runtime_libraries() / f"libdspic-{runtime_archive.fingerprint()}.a"
    runtime_archive._store(archive, ARCHIVE)
    archive.write_bytes(archive.read_bytes()[:-1])
    source = tmp_path / "main.c"
    source.write_text("volatile int a = 7; int main(void) { return a; }\n")
    assert driver.main([str(source), "-o", str(tmp_path / "main.elf")]) == 0
    stored = runtime_archive._stored(archive)
    assert stored is not None
    assert runtime_archive.defined_names(stored)
