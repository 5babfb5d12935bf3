/* SPDX-License-Identifier: MIT */
/* Contract of a board with the kernel; implemented in board/<robot>/. */
#ifndef HAL_BOARD_H
#define HAL_BOARD_H

void board_init(void);     /* pins and devices, from Sys_Init_Kernel; registers events, enables no interrupt */
void board_start(void);    /* enables device interrupts, from Sys_Start_Kernel */
void board_tick(void);     /* every 1 ms, ISR */
void board_failsafe(void); /* safe state: actuators off, the LED pattern of a fault; any context, also after a fault */
/* Writes text to the report channel (UART1) by polling; everything is masked, the kernel may be damaged. */
void board_report(const char *text);

#endif
