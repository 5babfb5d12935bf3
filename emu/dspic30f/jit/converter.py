"""The analog converter in native code: whole rounds of conversions as events.

The rules are those of emu/peripherals/adc.py for what emu/peripherals/adccourse.py publishes as plain; inputs are
numbers that hold, or were foretold to. Everything else is left to the device.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from emu.dspic30f.core import Core

SAMPLING: Final = 2
"""A state of the device."""
_BUFFERS: Final = 16


@dataclass(frozen=True)
class ConverterPlaces:
    """Byte offsets in the record, bits of ADCON1, and the event slot."""

    con1: int
    samp: int
    done: int
    buffers: int
    cells: tuple[tuple[str, int], ...]
    """Cells of the device by name."""
    slot: int
    due: int
    deadline: int
    flag: int
    flag_bit: int
    rise: int

    def at(self, cell: str) -> int:
        """Offset of a cell of the device."""
        return dict(self.cells)[cell]


def converter_of(core: Core) -> ConverterPlaces | None:
    """From a wired core; None without a converter."""
    names, fields, sfrs = core.events.names, core.record.fields, core.chip.sfrs
    if "adc.step" not in names or "adc.native" not in fields:
        return None
    con1, slot, site = sfrs["ADCON1"], names.index("adc.step"), core.chip.adc
    flag_name, bit = core.chip.interrupts[site.irq].flag
    flag = sfrs[flag_name].address
    samp, done = (1 << con1.fields[name][0] for name in ("SAMP", "DONE"))
    return ConverterPlaces(
        con1.address, samp, done, sfrs["ADCBUF0"].address,
        tuple((name[4:], field.offset) for name, field in fields.items() if name.startswith("adc.")),
        slot, fields["events.due"].offset + 8 * slot, fields["events.deadline"].offset,
        flag, bit, fields["irq.since"].offset + 8 * ((flag >> 1) % 4 * 16 + bit))


def event_text(p: ConverterPlaces) -> str:
    """IR of the block `t<slot>` of the service function: all conversions up to the interrupt that is due (%least1).

    First everything is looked at, then everything is done; `%python` while nothing has been done.
    """
    n = f"t{p.slot}"
    loads = {"native": "i8", "state": "i8", "use_b": "i8", "count": "i8", "next": "i8", "scan": "i8", "half": "i8",
             "results": "i8", "length": "i8", "sampling": "i32", "conversion": "i32", "mark": "i64"}
    lines = [f"{n}:"]
    for name, kind in loads.items():
        lines += [_at(f"{n}.p.{name}", p.at(name)), f"  %{n}.r.{name} = load {kind}, ptr %{n}.p.{name}"]
        lines.append(f"  %{n}.{name} = add i64 %{n}.r.{name}, 0" if kind == "i64"
                     else f"  %{n}.{name} = zext {kind} %{n}.r.{name} to i64")
    for name, offset in (("con1", p.con1), ("flag", p.flag), ("rise", p.rise), ("stands", p.at("stands_until")),
                         ("held", p.at("held")), ("from", p.at("level_from")), ("level", p.at("input")),
                         ("channels", p.at("channels")), ("buffers", p.buffers)):
        lines.append(_at(f"{n}.q.{name}", offset))
    lines.append(_look_text(n) + _convert_text(n) + _finish_text(n, p))
    return "\n".join(lines)


def _at(name: str, offset: int) -> str:
    return f"  %{name} = getelementptr i8, ptr %rec, i64 {offset}"


def _look_text(n: str) -> str:
    """Is it a plain round that ends now, and are all its inputs known?"""
    return f"""  %{n}.step = add i64 %{n}.sampling, %{n}.conversion
  %{n}.begun2 = shl i64 %{n}.mark, 1
  %{n}.begun = add i64 %{n}.begun2, %{n}.half
  %{n}.missing = sub i64 %{n}.results, %{n}.count
  %{n}.time = mul i64 %{n}.missing, %{n}.step
  %{n}.end = add i64 %{n}.begun, %{n}.time
  %{n}.end1 = add i64 %{n}.end, 1
  %{n}.ends = lshr i64 %{n}.end1, 1
  %{n}.c1 = icmp ne i64 %{n}.native, 0
  %{n}.c2 = icmp eq i64 %{n}.state, {SAMPLING}
  %{n}.c3 = icmp eq i64 %{n}.use_b, 0
  %{n}.c4 = icmp ult i64 %{n}.count, %{n}.results
  %{n}.c5 = icmp ult i64 %{n}.scan, %{n}.length
  %{n}.c6 = icmp eq i64 %{n}.ends, %least1
  %{n}.c12 = and i1 %{n}.c1, %{n}.c2
  %{n}.c34 = and i1 %{n}.c3, %{n}.c4
  %{n}.c56 = and i1 %{n}.c5, %{n}.c6
  %{n}.c14 = and i1 %{n}.c12, %{n}.c34
  %{n}.plain = and i1 %{n}.c14, %{n}.c56
  br i1 %{n}.plain, label %{n}.look, label %python
{n}.look:
  %{n}.li = phi i64 [ 0, %{n} ], [ %{n}.li1, %{n}.known ]
  %{n}.lp = phi i64 [ %{n}.scan, %{n} ], [ %{n}.lp1, %{n}.known ]
  %{n}.lt = phi i64 [ %{n}.begun, %{n} ], [ %{n}.lt1, %{n}.known ]
  %{n}.lcp = getelementptr i8, ptr %{n}.q.channels, i64 %{n}.lp
  %{n}.lc8 = load i8, ptr %{n}.lcp
  %{n}.lc = zext i8 %{n}.lc8 to i64
  %{n}.lfp = getelementptr i64, ptr %{n}.q.from, i64 %{n}.lc
  %{n}.lf = load i64, ptr %{n}.lfp
  %{n}.ls = add i64 %{n}.lt, %{n}.sampling
  %{n}.ls1 = add i64 %{n}.ls, 1
  %{n}.sampled = lshr i64 %{n}.ls1, 1
  %{n}.holds = icmp ule i64 %{n}.lf, %{n}.sampled
  br i1 %{n}.holds, label %{n}.known, label %python
{n}.known:
  %{n}.lt1 = add i64 %{n}.lt, %{n}.step
  %{n}.lpn = add i64 %{n}.lp, 1
  %{n}.lpw = icmp uge i64 %{n}.lpn, %{n}.length
  %{n}.lp1 = select i1 %{n}.lpw, i64 0, i64 %{n}.lpn
  %{n}.li1 = add i64 %{n}.li, 1
  %{n}.lmore = icmp ult i64 %{n}.li1, %{n}.missing
  br i1 %{n}.lmore, label %{n}.look, label %{n}.convert
"""


def _convert_text(n: str) -> str:
    """Results to the buffers, from the place the last one left."""
    return f"""{n}.convert:
  %{n}.i = phi i64 [ 0, %{n}.known ], [ %{n}.i1, %{n}.convert ]
  %{n}.place = phi i64 [ %{n}.scan, %{n}.known ], [ %{n}.place1, %{n}.convert ]
  %{n}.cp = getelementptr i8, ptr %{n}.q.channels, i64 %{n}.place
  %{n}.ch8 = load i8, ptr %{n}.cp
  %{n}.ch = zext i8 %{n}.ch8 to i64
  %{n}.lvp = getelementptr i16, ptr %{n}.q.level, i64 %{n}.ch
  %{n}.lv = load i16, ptr %{n}.lvp
  %{n}.code = lshr i16 %{n}.lv, 4
  %{n}.to = add i64 %{n}.next, %{n}.i
  %{n}.to16 = and i64 %{n}.to, {_BUFFERS - 1}
  %{n}.bp = getelementptr i16, ptr %{n}.q.buffers, i64 %{n}.to16
  store i16 %{n}.code, ptr %{n}.bp
  %{n}.placen = add i64 %{n}.place, 1
  %{n}.wraps = icmp uge i64 %{n}.placen, %{n}.length
  %{n}.place1 = select i1 %{n}.wraps, i64 0, i64 %{n}.placen
  %{n}.i1 = add i64 %{n}.i, 1
  %{n}.more = icmp ult i64 %{n}.i1, %{n}.missing
  br i1 %{n}.more, label %{n}.convert, label %{n}.finish
"""


def _finish_text(n: str, p: ConverterPlaces) -> str:
    """Sampling goes on, the next interrupt is planned, this one requested."""
    bits = p.samp | p.done
    return f"""{n}.finish:
  store i16 %{n}.code, ptr %{n}.q.held
  store i8 0, ptr %{n}.p.scan
  store i8 0, ptr %{n}.p.count
  store i8 0, ptr %{n}.p.next
  %{n}.mark1 = lshr i64 %{n}.end, 1
  store i64 %{n}.mark1, ptr %{n}.p.mark
  %{n}.half1 = trunc i64 %{n}.end to i8
  %{n}.half2 = and i8 %{n}.half1, 1
  store i8 %{n}.half2, ptr %{n}.p.half
  %{n}.w1 = load i16, ptr %{n}.q.con1
  %{n}.w2 = or i16 %{n}.w1, {bits}
  store i16 %{n}.w2, ptr %{n}.q.con1
  %{n}.s1 = add i64 %{n}.end1, %{n}.sampling
  %{n}.s2 = lshr i64 %{n}.s1, 1
  store i64 %{n}.s2, ptr %{n}.q.stands
  %{n}.d1 = mul i64 %{n}.results, %{n}.step
  %{n}.d2 = add i64 %{n}.end1, %{n}.d1
  %{n}.d3 = lshr i64 %{n}.d2, 1
  store i64 %{n}.d3, ptr %p.who
  %{n}.word = load i16, ptr %{n}.q.flag
  %{n}.new = or i16 %{n}.word, {1 << p.flag_bit if p.flag_bit < 15 else -0x8000}
  store i16 %{n}.new, ptr %{n}.q.flag
  %{n}.same = icmp eq i16 %{n}.new, %{n}.word
  br i1 %{n}.same, label %fire, label %{n}.rises
{n}.rises:
  store i64 %least1, ptr %{n}.q.rise
  br label %fire"""
