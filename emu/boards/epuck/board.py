"""The complete e-puck: hardware, stimulus player, and array access to its inputs and outputs."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Final

from emu.boards.epuck.hardware import EpuckHardware
from emu.boards.epuck.stimulus import Stimulus
from emu.peripherals import Peripherals

if TYPE_CHECKING:  # numpy is imported on the first use of the arrays
    from emu.boards.epuck.exchange import Inputs, Outputs


class Epuck(EpuckHardware):
    """An e-puck of hardware version 1.1 or 1.2.

        >>> from functools import partial
        >>> import emu
        >>> from emu.boards.epuck.board import Epuck
        >>> machine = emu.load("firmware.elf", board=partial(Epuck, selector=3))
        >>> machine.board.selector.position
        3

    `EpuckHardware` describes the parameters.
    """

    def __init__(self, chip: Peripherals, *, camera: str | None = "PO6030K", selector: int = 0, seed: int = 0) -> None:
        super().__init__(chip, camera=camera, selector=selector, seed=seed)
        self.stimulus: Final = Stimulus(self)

    @cached_property
    def outputs(self) -> Outputs:
        """The robot's outputs as arrays."""
        from emu.boards.epuck.exchange import Outputs

        return Outputs(self)

    @cached_property
    def inputs(self) -> Inputs:
        """The robot's inputs as arrays."""
        from emu.boards.epuck.exchange import Inputs

        return Inputs(self)
