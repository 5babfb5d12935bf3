/* Registers of a thread survive preemption: integer and floating-point code that uses many registers. */
#include "conformance.h"

#define FILE_LETTER 'r'

enum { THREADS = 3, RUN_MS = 200 };

typedef struct {
    uint32 seed;
    volatile uint16 rounds, wrong;
} worker;

static worker workers[THREADS] = {{1, 0, 0}, {0xBEEF, 0, 0}, {0x12345678, 0, 0}};

/* Keeps eight integers live at once so that they fill the registers. */
static uint32 whole(uint32 a)
{
    uint32 b = a ^ 0x55555555u, c = a + b, d = ~a, e = b * 3u, f = c ^ d, g = a >> 3, h = d - b;
    for (uint8 i = 0; i < 20; i++) {
        a += b ^ h;
        b = b << 1 | b >> 31;
        c ^= a;
        d += c;
        e ^= d >> 2;
        f += e;
        g ^= f << 3;
        h += g;
    }
    return a ^ b ^ c ^ d ^ e ^ f ^ g ^ h;
}

static float fraction(uint32 seed)
{
    float a = (float)(seed & 0xFFu) + 1.0f, b = 2.0f, c = 3.0f, d = 0.5f;
    for (uint8 i = 0; i < 5; i++) {
        b = b * 0.75f + a;
        c = c * 0.5f + b;
        d = d + c * 0.25f;
        a = a + d * 0.125f;
    }
    return a + b + c + d;
}

static void work(void *which)
{
    worker *w = which;
    const uint32 right = whole(w->seed);
    const float right_too = fraction(w->seed);
    for (;;) {
        w->wrong = (uint16)(w->wrong + (whole(w->seed) != right || fraction(w->seed) != right_too));
        w->rounds++;
        (void)Sys_Get_SystemTime(); /* on some hosts time advances in calls only */
    }
}

static bool disturb(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid, (void)event;
    return fraction(data->value) > 0.0f; /* the handler calculates with floating point too */
}

void check_registers(void)
{
    uint16 pids[THREADS];
    for (uint8 i = 0; i < THREADS; i++) {
        pids[i] = start(work, &workers[i], 0);
        CHECK(pids[i] != 0);
    }
    CHECK(Sys_Subscribe_to_Event(SYS_1ms_TIMER, 0, disturb, NULL));
    uint32 begin = Sys_Get_SystemTime();
    while (Sys_Get_SystemTime() - begin < RUN_MS) {
        Sys_Yield();
    }
    CHECK(Sys_Unsubscribe_Handler(SYS_1ms_TIMER, 0, disturb));
    for (uint8 i = 0; i < THREADS; i++) {
        CHECK(workers[i].rounds > 0);
        CHECK(workers[i].wrong == 0);
        CHECK(Sys_Kill_Process(pids[i]));
    }
}
