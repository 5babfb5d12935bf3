; Entry of the camera's interrupt into the kernel.
#include "isr.inc"
        .text
        isr     __OC8Interrupt, _camera_frame_isr
