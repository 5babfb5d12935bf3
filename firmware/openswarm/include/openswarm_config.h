/* Limits of the kernel, in bytes unless said otherwise. Each may be overridden with -D. */
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
#define SYS_LOSS_COUNTERS 4 /* events with a loss counter of their own; losses of further ones are summed under id 0 */
#endif
#ifndef SYS_UART_TX
#define SYS_UART_TX 64 /* transmit ring of each UART; a power of two */
#endif
#ifndef SYS_UART_RX
#define SYS_UART_RX 16 /* largest received chunk passed on as one event */
#endif

/* Blocks up to HEAP_CLASSES steps come from exact-size lists and may be taken in an ISR. */
#define HEAP_STEP sizeof(void *)
#define HEAP_CLASSES 20u
#define SYS_SMALL_PAYLOAD ((HEAP_CLASSES - 3u) * HEAP_STEP) /* a message costs three words beside its payload */

#endif
