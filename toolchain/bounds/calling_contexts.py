"""Analysis of functions by calling context, with memoised results and a general context for frequent callees."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import Counter
from typing import Final

from emu.dspic30f.isa.flow import Branch
from toolchain.abi.target import SFR_END
from toolchain.bounds.abstract.conditions import flag_setter_index
from toolchain.bounds.abstract.state import INHERITED, NO_ADDRESS, AbstractState
from toolchain.bounds.abstract.values import RAM_POINTER, WORD, Value, extremes, interval, is_ram_address
from toolchain.bounds.annotations.flow_facts import FlowFacts
from toolchain.bounds.graph import FunctionGraph, GraphBuilder, Loop, merge_loops
from toolchain.bounds.preserved import PreservedRegisters
from toolchain.bounds.result import FunctionResult, Scope
from toolchain.bounds.transfer import ImageModel, TransferFunctions, is_constant

MAX_CONTEXTS: Final = 8
"""Maximum number of calling contexts of one function that are analysed separately."""
MAX_EXPOSED_CONTEXTS: Final = 40
"""The same for callees that may access the caller's frame, whose contents the general context makes unknown."""
CALLER_FRAME_BYTES: Final = 64
"""Bytes below the callee's frame that the general context reserves for accesses to the caller's frame."""
FIRST_RAM_ADDRESS: Final = SFR_END
"""First RAM address; smaller values are taken as numbers."""


class AnalysisCache:
    """Results that all analysed entries of one image share."""

    def __init__(self, graph: GraphBuilder) -> None:
        self.graph: Final = graph
        self.preserved: Final = PreservedRegisters(graph)
        self.codes: Final[dict[int, FunctionGraph]] = {}
        self.results: Final[dict[object, FunctionResult]] = {}
        """Results by function, calling context and whether iterations are shared."""


class CallContexts(ABC):
    """Results of the functions of one image by calling context; `execute` is the analysis of one function."""

    def __init__(self, model: ImageModel, cache: AnalysisCache, flow_facts: FlowFacts, sharing: bool = False) -> None:
        """Prepare the analysis; `sharing`: results list iterations that loops share in `shared_iterations`."""
        self.model, self.graph, self.flow_facts, self.sharing = model, cache.graph, flow_facts, sharing
        self.transfer: Final = TransferFunctions(model)
        self.preserved, self.codes, self.results = cache.preserved, cache.codes, cache.results
        self.nonterminating: Final[set[int]] = set()
        """Heads of loops that did not terminate in an earlier execution."""
        self.truncated: Final[set[int]] = set()
        """Heads of loops whose execution stopped after MAX_ITERATIONS (LONG_LOOP)."""
        self.context_counts: Final[Counter[int]] = Counter()
        self.bounded_counts: Final[Counter[int]] = Counter()
        """By function: number of contexts, and of those with a bound."""
        self.call_stack: list[int] = []
        self.steps = 0
        """Number of instructions executed so far."""

    @abstractmethod
    def execute(self, code: FunctionGraph, state: AbstractState) -> FunctionResult:
        """Execute a function abstractly from one entry state."""

    def code(self, entry: int) -> FunctionGraph:
        """Return the control-flow graph of a function."""
        if entry not in self.codes:
            self.codes[entry] = code = self.graph.code(entry)
            code.order = merge_loops(code.order, self.flow_facts.merged_loops(code))
            code.has_frame = any(step.insn.row.mnemonic == "LNK" for b in code.blocks.values() for step in b.steps)
            for block in code.blocks.values():
                if block.steps[-1].flow is Branch:
                    block.flag_setter = flag_setter_index(block.steps)
        return self.codes[entry]

    def run(self, entry: int, state: AbstractState) -> FunctionResult:
        """Return the result of a function entered in `state`; its times count from the entry."""
        state.shift(-state.time)
        state.masked_since = [None if s is None else INHERITED for s in state.masked_since]
        state.waits = frozenset()
        key = self._key(entry, state)
        found = self.results.get(key)
        if found is None:
            self.context_counts[entry] += 1
            self.call_stack.append(entry)
            found = self.execute(self.code(entry), state)
            self.call_stack.pop()
            self.results[key] = found
            self.bounded_counts[entry] += not found.unbounded
        return found

    def _key(self, entry: int, state: AbstractState) -> object:
        """Return the memoisation key of a context.

        It contains the enclosing scopes of shared iterations, and the active functions with annotated recursion.
        """
        around = [one for one in self.call_stack if one in self.flow_facts.sharing_scopes] if self.sharing else []
        active = [one for one in self.call_stack if one in self.flow_facts.recursion_depths]
        return entry, self.sharing, tuple(dict.fromkeys(around)), tuple(active), state.key()

    def sharing_scope(self, code: FunctionGraph, loop: Loop, total: int | None) -> tuple[Scope, int] | None:
        """Return the scope (active call or whole analysis) in which a loop shares iterations, and their number."""
        if not self.sharing or len(loop.heads) != 1:
            return None
        shared = self.flow_facts.shared_iterations(code, loop)
        for entry in self.call_stack:
            if entry in shared:
                text, iterations = shared[entry]
                return (entry, text), iterations
        return None if total is None else ((None, str(loop.head)), total)

    def call_share(self, pc: int, target: int) -> tuple[Scope, int] | None:
        """Return the CALL_SHARE scope of the call of `target` at `pc`, and the number of such calls in the scope."""
        times = self.flow_facts.call_counts(pc, target) if self.sharing else {}
        for entry in self.call_stack:
            if entry in times:
                text, most = times[entry]
                return (entry, text), most
        return None

    def call(self, entry: int, state: AbstractState, one_of_many: bool) -> tuple[FunctionResult, bool]:
        """Return the result of a called function, and whether the general context was used.

        The general context covers all calls.  It is used for functions with many contexts, and for `one_of_many`
        targets of a pointer.  If it has no bound but separate contexts do, the context of the call is analysed.
        """
        key = self._key(entry, state)
        if entry in self.call_stack:
            return self.run(entry, state), False  # the recursion ends by its arguments, so the context must be kept
        exposed = state.lowest_leak < NO_ADDRESS or any(map(self.model.stack_areas.points_into, state.w[:8]))
        if (
            not is_constant(state.w[15])
            or key in self.results
            or (not one_of_many and self.context_counts[entry] < (MAX_EXPOSED_CONTEXTS if exposed else MAX_CONTEXTS))
        ):
            return self.run(entry, state), False
        stack = self.model.stack_areas.index(state.w[15])
        if stack is None:
            return self.run(entry, state), False
        general = AbstractState()
        general.w[:8] = map(generalised_argument, state.w[:8])
        general.w[15] = self.general_top(state.w[15])
        general.ipl, general.stall = state.ipl, state.stall
        general.masked_since, general.do_loops = state.masked_since.copy(), state.do_loops
        general.disi_end, general.time = state.disi_end, state.time
        general.mem = {a: v for a, v in state.mem.items() if (a if a >= 0 else ~a) & ~1 in self.model.tracked_words}
        found = self.run(entry, general)
        if found.unbounded and self.bounded_counts[entry]:
            return self.run(entry, state), False
        return found.relocated(stack, state.w[15] - self.general_top(state.w[15])), True

    def general_top(self, top: int) -> int:
        """Return W15 at the entry of the general context on the stack that contains `top`."""
        stack = self.model.stack_areas.index(top)
        assert stack is not None
        return self.model.stack_areas.ranges[stack][0] + CALLER_FRAME_BYTES


def generalised_argument(value: Value) -> Value:
    """Generalise an argument: small numbers to a range below a power of two, addresses to RAM or any address."""
    high = extremes(value)[1]
    return (
        interval(0, (1 << high.bit_length()) - 1)
        if high < FIRST_RAM_ADDRESS
        else RAM_POINTER
        if is_ram_address(value)
        else WORD
    )
