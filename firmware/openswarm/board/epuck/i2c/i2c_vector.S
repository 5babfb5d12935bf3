; Entry of the I2C master's interrupt.
#include "isr.inc"
        .text
        isr     __MI2CInterrupt, _i2c_isr
