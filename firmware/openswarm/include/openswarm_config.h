/* SPDX-License-Identifier: MIT */
/* Limits of the kernel, in bytes unless stated otherwise. Each may be overridden with -D. */
#ifndef OPENSWARM_CONFIG_H
#define OPENSWARM_CONFIG_H

#include "hal_limits.h" /* from the port: HAL_KERNEL_STACK, HAL_HEAP, HAL_DEFAULT_STACK, HAL_MINIMUM_STACK */

#ifndef SYS_KERNEL_STACK
#define SYS_KERNEL_STACK HAL_KERNEL_STACK /* handlers, ISRs and the scheduler */
#endif
#ifndef SYS_HEAP
#define SYS_HEAP HAL_HEAP /* threads, events, subscriptions, messages */
#endif
#ifndef SYS_DEFAULT_STACK
#define SYS_DEFAULT_STACK HAL_DEFAULT_STACK
#endif
#ifndef SYS_MINIMUM_STACK
#define SYS_MINIMUM_STACK HAL_MINIMUM_STACK
#endif
#ifndef SYS_MAXIMUM_PAYLOAD
#define SYS_MAXIMUM_PAYLOAD 1024 /* of one message */
#endif
#ifndef SYS_LOSS_COUNTERS
#define SYS_LOSS_COUNTERS 4 /* events with their own loss counter; losses of further events are summed under id 0 */
#endif
#ifndef SYS_REPORTS
#define SYS_REPORTS 1 /* 0: faults are neither reported nor kept (openswarm_reset.h): they only stop the system; saves flash */
#endif
#define SYS_STOP_SYSTEM 0
#define SYS_DROP_THREAD 1
#ifndef SYS_ON_OVERFLOW
#define SYS_ON_OVERFLOW SYS_STOP_SYSTEM /* after a thread's stack overflow; SYS_DROP_THREAD: ends only that thread */
#endif
#ifndef SYS_CHECK_LEVELS
#define SYS_CHECK_LEVELS 0 /* 1, Cortex-M: an interrupt whose priority permits no kernel call stops the system by one */
#endif
#ifndef SYS_UARTS
#define SYS_UARTS 2 /* of the robot */
#endif
#ifndef SYS_UART_TX
#define SYS_UART_TX (SYS_HEAP / 3) /* heap bytes for the transmit queue of one UART */
#endif
#ifndef SYS_UART_RX
#define SYS_UART_RX 16 /* largest received chunk passed on as one event */
#endif
#ifndef SYS_1PXSENSOR
#define SYS_1PXSENSOR 0 /* 1: the system registers SYS_IO_1PXSENSOR and starts the camera if the board has one */
#endif

#ifndef SYS_SMALL_PAYLOAD
#define SYS_SMALL_PAYLOAD (17u * HEAP_STEP) /* largest payload that an ISR may send */
#endif

#define HEAP_STEP sizeof(void *) /* granularity of allocations */

#endif
