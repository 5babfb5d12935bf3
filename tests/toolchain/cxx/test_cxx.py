"""Freestanding C++17: the language, headers of libc++, and refused features."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cases import check_all
from tests.fuzz.seeds import base_seed
from tests.toolchain.c_programs import build, run
from toolchain import cli

PROGRAMS = Path(__file__).parent
SOURCES = sorted(path.name for path in PROGRAMS.glob("*.cpp"))
MODES = [("-Os", "-fno-lto"), ("-O0", "-flto"), ("-O2", "-fno-lto"), ("-O0", "-fno-lto"), ("-O2", "-flto")]
"""Modes besides -Os of the whole program; each program is built in one of them, which the commit determines."""


def compiled(source: Path, folder: Path, *options: str) -> int:
    return cli.main(["c++", *options, str(source), "-o", str(folder / "a.elf")])


@pytest.mark.slow
@pytest.mark.parametrize("program", SOURCES)
def test_program(program: str, tmp_path: Path) -> None:
    """Each C++ program returns 0; otherwise the number of its first failing check."""
    other = MODES[(base_seed() + SOURCES.index(program)) % len(MODES)]
    for level, lto in (("-Os", "-flto"), other):
        options = [level, lto, "-Wall", "-Werror", "-Wl,--heap=256"]
        built = build([PROGRAMS / program], tmp_path / "a.elf", *options)
        assert (built.status, built.messages) == (0, "")
        assert run(tmp_path / "a.elf").status == 0, (level, lto)


HEADERS = [
    "array", "algorithm", "atomic", "chrono", "functional", "limits", "memory", "numeric", "optional", "ratio",
    "string", "string_view", "tuple", "type_traits", "utility", "variant", "vector", "cassert", "cctype",
    "cfloat", "cinttypes", "climits", "cmath", "csetjmp", "cstdarg", "cstddef", "cstdint", "cstdio", "cstdlib",
    "cstring", "ctime", "new", "initializer_list", "iterator",
]  # fmt: skip


@pytest.mark.slow
def test_headers_compile(tmp_path: Path) -> None:
    def check(header: str) -> None:
        (tmp_path / "a.cpp").write_text(f"#include <{header}>\nint main() {{ return 0; }}\n")
        assert cli.main(["c++", "-c", "-Wall", "-Werror", str(tmp_path / "a.cpp"), "-o", str(tmp_path / "a.o")]) == 0

    check_all(check, HEADERS)


def test_c_and_cxx_in_one_program(tmp_path: Path) -> None:
    """C and C++ files form one program: `cc` selects the language by suffix, `c++` compiles .c as C++."""
    (tmp_path / "a.c").write_text("int add(int a, int b) { return a + b; }\nint class;\n")
    (tmp_path / "b.cpp").write_text('extern "C" int add(int, int);\nint main() { return add(40, 2); }\n')
    both = [str(tmp_path / "a.c"), str(tmp_path / "b.cpp")]
    assert cli.main(["cc", "-Os", *both, "-o", str(tmp_path / "a.elf")]) == 0
    assert run(tmp_path / "a.elf").status == 42
    assert cli.main(["c++", "-Os", *both, "-o", str(tmp_path / "b.elf")]) == 1


REFUSED = {
    "int main() { throw 1; }": "cannot use 'throw' with exceptions disabled",
    "#include <typeinfo>\nint main() { int x = 0; return typeid(x).name()[0]; }": "use of typeid requires -frtti",
    "struct A { virtual void f(); }; struct B : A {}; B *g(A *a) { return dynamic_cast<B *>(a); } int main() {}":
        "use of dynamic_cast requires -frtti",
}  # fmt: skip


@pytest.mark.parametrize("source", REFUSED)
def test_what_is_not_there_is_refused(source: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "a.cpp").write_text(source)
    assert compiled(tmp_path / "a.cpp", tmp_path) == 1
    assert REFUSED[source] in capfd.readouterr().err
    assert not (tmp_path / "a.elf").exists()


def test_new_without_room_ends_the_program(tmp_path: Path) -> None:
    """If memory is exhausted, new ends the program, because there are no exceptions; nothrow new returns null."""
    source = """
    #include <new>
    int main()
    {
        char *volatile p = new (std::nothrow) char[500];
        if (p)
            return 1;
        p = new char[500];
        return 2;
    }
    """
    (tmp_path / "a.cpp").write_text(source)
    assert compiled(tmp_path / "a.cpp", tmp_path, "-O0", "-Wl,--heap=64") == 0
    assert run(tmp_path / "a.elf").status not in (1, 2)
