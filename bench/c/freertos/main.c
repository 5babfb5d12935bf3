/* FreeRTOS program measured by bench/kernel/rtos.py, which selects the running tasks by writing rtos_wanted. */
#include "FreeRTOS.h"
#include "queue.h"
#include "task.h"

enum { TICK = 1, YIELD, QUEUE, STACK_WORDS = 128 };

volatile unsigned rtos_wanted __attribute__((used));
volatile unsigned rtos_free[3] __attribute__((used)); /* free heap: initially, with one more task, with two more */
static QueueHandle_t queue;

#define NOP() __asm__ volatile("nop" ::: "memory")
#define STOP(name)                                                    \
    __attribute__((noinline, used)) void name(void)                   \
    {                                                                 \
        NOP();                                                        \
    }

STOP(rtos_begin)
STOP(rtos_created)
STOP(rtos_received)

__attribute__((noinline, used)) void rtos_spin(void *unused)
{
    (void)unused;
    for (;;) {
        NOP();
    }
}

__attribute__((noinline, used)) void rtos_yield(void *unused)
{
    (void)unused;
    for (;;) {
        taskYIELD();
        NOP();
    }
}

__attribute__((noinline, used)) void rtos_send(void)
{
    unsigned value = 7;
    xQueueSend(queue, &value, 0);
}

static void sender(void *unused)
{
    (void)unused;
    for (;;) {
        rtos_send();
    }
}

static void receiver(void *unused)
{
    unsigned value;
    (void)unused;
    for (;;) {
        xQueueReceive(queue, &value, portMAX_DELAY);
        rtos_received();
    }
}

static void create(TaskFunction_t task, unsigned priority)
{
    xTaskCreate(task, "t", STACK_WORDS, NULL, priority, NULL);
}

/* Functions that must be linked, as in OpenSwarm's program: the equivalents of the calls in the paper's Table I. */
static void use_everything(void *unused)
{
    static volatile unsigned any;
    unsigned value = any;
    (void)unused;
    vTaskDelay(any);
    taskENTER_CRITICAL();
    taskEXIT_CRITICAL();
    vTaskSuspendAll();
    any = xTaskResumeAll() + xTaskGetTickCount() + uxQueueMessagesWaiting(queue);
    any = xQueueSendFromISR(queue, &value, NULL) + xQueueReceiveFromISR(queue, &value, NULL) + xQueueReset(queue);
    vQueueDelete(queue);
    vTaskDelete(NULL);
}

int main(void)
{
    queue = xQueueCreate(4, sizeof(unsigned));
    rtos_begin();
    rtos_free[0] = xPortGetFreeHeapSize();
    create(rtos_wanted == YIELD ? rtos_yield : rtos_wanted == QUEUE ? sender : rtos_spin, 1);
    rtos_free[1] = xPortGetFreeHeapSize();
    create(rtos_wanted == YIELD ? rtos_yield : rtos_wanted == QUEUE ? receiver : rtos_spin, rtos_wanted == QUEUE ? 2 : 1);
    rtos_free[2] = xPortGetFreeHeapSize();
    if (rtos_wanted > QUEUE) {
        create(use_everything, 1);
    }
    rtos_created();
    vTaskStartScheduler();
    return 1;
}
