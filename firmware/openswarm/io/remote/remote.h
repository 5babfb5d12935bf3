/* SPDX-License-Identifier: MIT */
/* Infrared remote control: SYS_IO_REMOTECONTROL, once per key press, however long the key is held. */
#ifndef REMOTE_H
#define REMOTE_H

#include "openswarm.h"

typedef struct {
    uint8 address; /* 0-31: type of the addressed device */
    uint8 command; /* 0-63 */
    bool toggle;   /* changes with every press */
} sys_remote_frame;

/* Receives a new frame and may change the command; true: it is sent as SYS_IO_REMOTECONTROL. ISR context. */
typedef bool (*sys_remote_processor)(sys_remote_frame *frame);
/* MTHI | no | 6 | 4 | none.  NULL: every frame is sent. */
sys_remote_processor Sys_Set_RemoteProcessor(sys_remote_processor processor);

/* M | no | - | 40 | MEMORY.  Between Sys_Init_Kernel and Sys_Start_Kernel. */
bool Sys_Start_Remote(void);

#endif
