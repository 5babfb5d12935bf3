"""Reader of LLVM IR text: values, layout, forward references, refused constructs."""

from __future__ import annotations

import pytest

from toolchain.ir.dump import dump
from toolchain.ir.model import (
    BlockAddress,
    ConstBytes,
    ConstInt,
    GlobalRef,
    Instr,
    UnsupportedError,
    size_of,
    struct_offsets,
)
from toolchain.ir.read import read_module
from toolchain.ir.spec import check

LOOP = """
define dso_local i16 @sum(ptr noundef readonly captures(none) %0, i16 noundef %n) local_unnamed_addr #0 {
  br label %head
head:
  %i = phi i16 [ 0, %1 ], [ %next, %body ]
  %s = phi i32 [ 0, %1 ], [ %t, %body ]
  %c = icmp ult i16 %i, %n
  br i1 %c, label %body, label %done, !llvm.loop !4
body:                                             ; preds = %head
  %p = getelementptr inbounds nuw [2 x i16], ptr %0, i16 %i, i16 1
  %v = load volatile i16, ptr %p, align 2, !tbaa !2
  %w = sext i16 %v to i32
  %t = add nsw i32 %s, %w
  %next = add nuw nsw i16 %i, 1
  br label %head
done:
  %r = trunc i32 %s to i16
  switch i16 %r, label %one [
    i16 -1, label %two
    i16 7, label %one
  ]
one:
  ret i16 %r
two:
  ret i16 0
}
attributes #0 = { nounwind optsize "no-builtins" }
"""


def test_a_function_is_read_with_its_blocks_phis_and_forward_references() -> None:
    """A function is read with its blocks, phis and forward references: phi operands may be defined later (LLVM
    LangRef)."""
    f = read_module(LOOP).functions["sum"]
    assert [b.name for b in f.blocks] == ["1", "head", "body", "done", "one", "two"]
    phi = f.blocks[1].instrs[0]
    assert phi.blocks == ["1", "body"]
    assert isinstance(phi.args[1], Instr)
    assert phi.args[1] is f.blocks[2].instrs[4]
    assert f.blocks[2].instrs[1].volatile
    assert f.blocks[3].instrs[1].extra["cases"] == [0xFFFF, 7]
    assert "optsize" in f.attrs
    assert check(f) == []


def test_dump_of_what_was_read_reads_back_to_the_same_dump() -> None:
    """A dump of the IR is read back to the same dump (engines.md §5)."""
    text = dump(read_module(LOOP).functions["sum"])
    assert dump(read_module(text).functions["sum"]) == text


def test_globals_keep_initialisers_of_every_kind() -> None:
    """Globals keep initialisers of every kind: strings, addresses with offsets, casts, labels, nested aggregates."""
    m = read_module(
        r"""
@s = private unnamed_addr constant [4 x i8] c"a\22\00b", align 1
@p = global ptr getelementptr inbounds (i8, ptr @s, i16 3), align 2
@q = global ptr inttoptr (i16 722 to ptr), align 2
@t = internal global [1 x ptr] [ptr blockaddress(@f, %here)], section "foo"
@d = global double 1.5, align 2
@g = global float 0x3FB99999A0000000
define void @f() {
  br label %here
here:
  ret void
}
"""
    )
    text = m.globals["s"].init
    assert isinstance(text, ConstBytes)
    assert text.data == b'a"\0b'
    address = m.globals["p"].init
    assert isinstance(address, GlobalRef)
    assert (address.name, address.offset) == ("s", 3)
    number = m.globals["q"].init
    assert isinstance(number, ConstInt)
    assert number.value == 722
    label = m.globals["t"].init.elems[0]  # type: ignore[union-attr]
    assert isinstance(label, BlockAddress)
    assert m.globals["t"].section == "foo"
    assert m.globals["d"].init.value == 0x3FF8000000000000  # type: ignore[union-attr]
    assert m.globals["g"].init.value == 0x3DCCCCCD  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("type_text", "size", "offsets"),
    [
        ("{ i8, i16 }", 4, [0, 2]),
        ("{ i8, i8, i8 }", 3, [0, 1, 2]),
        ("{ i8, i32, i8 }", 8, [0, 2, 6]),
        ("<{ i8, i16, i32 }>", 7, [0, 1, 3]),
        ("{}", 0, []),
        ("{ i8, [3 x i16], i64 }", 16, [0, 2, 8]),
    ],
)
def test_struct_layout_is_xc16s(type_text: str, size: int, offsets: list[int]) -> None:
    """The layout of structs equals XC16's (abi-elf.md §1.2)."""
    m = read_module(f"%t = type {type_text}\n@g = external global %t")
    t = m.globals["g"].type
    assert size_of(t) == size
    assert struct_offsets(t)[:-1] == offsets


@pytest.mark.parametrize(
    ("line", "what"),
    [
        ("%x = add <vscale x 4 x i16> %a, %b", "cannot read"),
        ("%x = fadd half 0xH0000, 0xH0000", "floating-point type 'half'"),
        ("%x = add i40000 1, 2", "wider than 32768 bits"),
        ("%x = landingpad { ptr, i32 } cleanup", "instruction 'landingpad'"),
    ],
)
def test_unknown_constructs_are_refused_by_name_with_the_line(line: str, what: str) -> None:
    """A construct outside the grammar is an error with its name and line (engines.md §5)."""
    with pytest.raises(UnsupportedError) as caught:
        read_module(f"define void @f() {{\n  {line}\n  ret void\n}}\n")
    assert what in str(caught.value)


def test_violations_of_well_formedness_are_reported() -> None:
    """The checks of well-formedness report violations."""
    f = read_module(LOOP).functions["sum"]
    use, define = f.blocks[2].instrs[2], f.blocks[2].instrs[1]
    f.blocks[2].instrs[1:3] = [use, define]
    assert any("not defined" in what for what in check(f))
    f.blocks[0].instrs.clear()
    assert any("terminator" in what for what in check(f))


ASSUMPTION = """
declare void @llvm.assume(i1)
declare ptr @g(i16 allocalign, i16)
define ptr @f(ptr %p, i16 %n) {{
  call void @{callee}(i1 true) [ "align"(ptr %p, i16 8), "nonnull"(ptr %p) ]
  %q = call ptr @g(i16 allocalign %n, i16 4)
  ret ptr %q
}}
"""


def test_assumptions_are_hints_and_other_bundles_are_refused() -> None:
    """Operand bundles of llvm.assume are accepted as hints; all others are refused, as they may change a call's
    meaning."""
    module = read_module(ASSUMPTION.format(callee="llvm.assume"))
    f = module.functions["f"]
    assert check(f) == []
    assert [i.op for i in f.blocks[0].instrs] == ["call", "call", "ret"]
    with pytest.raises(UnsupportedError, match="operand bundle"):
        read_module(ASSUMPTION.format(callee="f2"))
