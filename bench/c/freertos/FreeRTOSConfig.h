/* Configuration of FreeRTOS for the comparison with OpenSwarm (bench/kernel/rtos.py): the minimum for the measured
 * functions, which are preemption with time slices, delays, deletion and queues. */
#ifndef FREERTOS_CONFIG_H
#define FREERTOS_CONFIG_H

#include <p30F6014A.h>

#define configCPU_CLOCK_HZ 14745600UL
#define configTICK_RATE_HZ 1000
#define configTICK_TYPE_WIDTH_IN_BITS TICK_TYPE_WIDTH_16_BITS
#define configKERNEL_INTERRUPT_PRIORITY 1
#define configUSE_PREEMPTION 1
#define configUSE_TIME_SLICING 1
#define configUSE_IDLE_HOOK 0
#define configUSE_TICK_HOOK 0
#define configIDLE_SHOULD_YIELD 1
#define configMAX_PRIORITIES 3
#define configMAX_TASK_NAME_LEN 4
#define configMINIMAL_STACK_SIZE 105 /* words; the value that the port recommends for the idle task */
#define configTOTAL_HEAP_SIZE 4096
#define configSUPPORT_DYNAMIC_ALLOCATION 1
#define INCLUDE_vTaskDelay 1
#define INCLUDE_vTaskDelete 1

#endif
