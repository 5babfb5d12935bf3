"""The runner of external C tests reports passed, failed and skipped tests with reasons."""

from __future__ import annotations

from pathlib import Path

from tests.toolchain.run_c_tests import judge

CYCLES = 2_000_000


def verdict(folder: Path, name: str, text: str) -> tuple[str, str]:
    path = folder / f"{name}.c"
    path.write_text(text)
    found = judge(path, "-Os", CYCLES)
    return found.kind, found.reason


def test_exit_status_zero_passes(tmp_path: Path) -> None:
    """A test passes with exit status 0: by return from main, by exit, or at the end of main (C11 5.1.2.2.3)."""
    assert verdict(tmp_path, "a", "int main(void) { return 0; }")[0] == "passed"
    assert verdict(tmp_path, "b", "void exit(int); int main(void) { exit(0); }")[0] == "passed"
    assert verdict(tmp_path, "c", "int main(void) { }")[0] == "passed"


def test_everything_else_fails_with_its_reason(tmp_path: Path) -> None:
    """A test fails with its reason: exit status, abort, trap, endless loop, undefined symbol."""
    assert verdict(tmp_path, "a", "int main(void) { return 3; }") == ("failed", "exit status 3")
    assert verdict(tmp_path, "b", "void abort(void); int main(void) { abort(); }") == ("failed", "exit status 134")
    odd = 'int main(void) { __asm__ volatile("mov #0x801,w0\\n\\tmov [w0],w0" ::: "r0"); }'
    kind, reason = verdict(tmp_path, "c", odd)
    assert (kind, reason) == ("failed", "trap: address error")
    kind, reason = verdict(tmp_path, "d", "volatile int z; int main(void) { while (!z) { } return 0; }")
    assert (kind, reason.split()[0]) == ("failed", "limit")
    kind, reason = verdict(tmp_path, "e", "int f(void); int main(void) { return f(); }")
    assert kind == "failed"
    assert "undefined symbol _f" in reason


def test_skips_follow_rules(tmp_path: Path) -> None:
    """Tests are skipped for dg- directives, GNU features that clang lacks, memory, or undefined behaviour of 16-bit
    int."""
    skips = {
        "int32": "/* { dg-require-effective-target int32plus } */\nint main(void) { return 1; }",
        "avr": '/* { dg-skip-if "too big" { avr-*-* } } */\nint main(void) { return 1; }',
        "nested": "int main(void) { int f(void) { return 0; } return f(); }",
        "ram": "char big[9000]; int main(void) { for (int i = 0; i < 9000; i++) big[i] = i; return big[77] - 77; }",
        "shift": "volatile int n = 20; int main(void) { return (1 << n) + 1; }",
        "divide": "volatile int z; int main(void) { return 7 / z; }",
        "unset": "int main(void) { int x; return x == 7 ? 0 : 1; }",
        "field": "struct { unsigned long long b : 40; } x = {0x100}; int main(void) { return x.b << 32 != 0; }",
        "file": "#include <unistd.h>\nint main(void) { return 0; }",
    }
    reasons = {name: verdict(tmp_path, name, text) for name, text in skips.items()}
    assert all(kind == "skipped" and reason for kind, reason in reasons.values()), reasons
    assert "32-bit int" in reasons["int32"][1]
    assert "nested functions" in reasons["nested"][1]
    assert "does not fit" in reasons["ram"][1]
