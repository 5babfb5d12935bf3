; The thread whose registers are checked, and the injected interrupt.
#include "../checker.inc"

        isr     __INT1Interrupt, _points_isr
