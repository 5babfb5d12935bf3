/* Random histories of the heap; a timer measures the cycles of calls that allocate. No interrupt occurs: the counts are
 * those of the calls alone. */
#include <openswarm.h>
#include <p30F6014A.h>

enum { MEASURED = 0x40, FAT, HELD, OTHERS = 0x80, KINDS = 48, THREADS = 24, HANDLERS = 6, PER_THREAD = 20 /* openswarm.h */ };

volatile uint16 seed __attribute__((used)), steps __attribute__((used));
volatile uint16 bursts __attribute__((used)); /* number of burst lengths in use: 1, 2, 4, ... messages */

typedef struct {
    uint16 least, most;
} range;

volatile struct {
    uint32 sends, starts;
    range send, start, send_refused, start_refused, kill;
} result __attribute__((used));

static uint16 state, threads;
static uint16 pids[THREADS];
static uint8 payload[64];

static uint16 random_below(uint16 limit)
{
    state ^= state << 7;
    state ^= state >> 9;
    state ^= state << 8;
    return state % limit;
}

static void note(volatile range *r, uint16 cycles)
{
    if (cycles < r->least) {
        r->least = cycles;
    }
    if (cycles > r->most) {
        r->most = cycles;
    }
}

static bool handle(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid;
    (void)event;
    (void)data;
    return true;
}

#define HANDLER(name)                                                   \
    static bool name(uint16 pid, uint16 event, sys_event_data *data)    \
    {                                                                   \
        return handle(pid, event, data);                                \
    }
HANDLER(handle_b)
HANDLER(handle_c)
HANDLER(handle_d)
HANDLER(handle_e)
HANDLER(handle_f)
static const sys_handler handlers[HANDLERS] = {handle, handle_b, handle_c, handle_d, handle_e, handle_f};

/* Keeps the result of a wait for some time. */
static void hold(void)
{
    for (;;) {
        sys_event_data *data = Sys_Wait_for_Event(HELD);
        for (uint16 i = random_below(16); i > 0; i--) {
            Sys_Yield();
        }
        if (random_below(2) != 0) {
            Sys_Clear_EventData(&data);
        }
    }
}

__attribute__((noinline)) static void send(void)
{
    uint16 begin = TMR4;
    bool sent = Sys_Send_Event(MEASURED, payload, 2);
    uint16 cycles = TMR4 - begin;
    note(sent ? &result.send : &result.send_refused, cycles);
    result.sends++;
}

__attribute__((noinline)) static void start(void)
{
    uint16 *pid = &pids[random_below(THREADS)];
    if (*pid != 0) {
        uint16 begin = TMR4;
        Sys_Kill_Process(*pid);
        note(&result.kill, TMR4 - begin);
        *pid = 0;
        threads--;
    } else if (random_below(3) == 0) {
        const sys_process_config config = {(void (*)(void *))hold, NULL, 112 + 2 * random_below(100), 0, 0, 0, 0};
        *pid = Sys_Start_ProcessWith(&config);
        threads += *pid != 0;
    } else {
        uint16 begin = TMR4;
        *pid = Sys_Start_Process(hold);
        uint16 cycles = TMR4 - begin;
        note(*pid != 0 ? &result.start : &result.start_refused, *pid != 0 ? cycles - PER_THREAD * threads : cycles);
        threads += *pid != 0;
        result.starts++;
    }
}

/* Returns an event outside the bucket of the measured event, so that finding the measured one takes constant time. */
static uint16 other_event(void)
{
    uint16 kind = random_below(KINDS);
    return OTHERS + kind / 7 * 8 + kind % 7 + 1;
}

static void burst(void)
{
    for (uint16 i = 1u << random_below(bursts); i > 0; i--) {
        switch (random_below(8)) {
        case 0:
            Sys_Send_Event(FAT, payload, random_below(i & 1 ? 64 : 8));
            break;
        case 1:
            Sys_Send_Event(HELD, payload, random_below(24));
            break;
        default:
            send();
        }
        if (random_below(32) == 0) {
            Sys_Register_Event(other_event());
        }
    }
}

static void step(void)
{
    switch (random_below(16)) {
    case 0:
    case 1:
    case 2:
        start();
        break;
    case 3:
    case 4:
        Sys_Register_Event(other_event());
        break;
    case 5:
        Sys_Unregister_Event(other_event());
        break;
    case 6:
    case 7:
        Sys_Subscribe_to_Event(other_event(), 0, handlers[random_below(HANDLERS)], NULL);
        break;
    case 8:
        Sys_Unsubscribe_Handler(other_event(), 0, handlers[random_below(HANDLERS)]);
        break;
    case 9:
    case 10:
    case 11:
        Sys_Yield();
        break;
    default:
        burst();
    }
}

#define STOP(name)                                                    \
    __attribute__((noinline, used)) void name(void)                   \
    {                                                                 \
        __asm__ volatile("nop" ::: "memory");                         \
    }
STOP(history_begins) /* breakpoint: the test sets seed, steps and bursts */
STOP(history_ended)

int main(void)
{
    volatile range *r = &result.send;
    Sys_Init_Kernel();
    Sys_Start_Kernel();
    IEC0bits.T1IE = 0;
    IEC0bits.T2IE = 0;
    IEC0bits.T3IE = 0;
    PR4 = 0xFFFF;
    T4CON = 0x8000;
    Sys_Register_Event(MEASURED);
    Sys_Register_Event(FAT);
    Sys_Register_Event(HELD);
    Sys_Subscribe_to_Event(MEASURED, 0, handle, NULL);
    Sys_Subscribe_to_Event(FAT, 0, handle, NULL);
    Sys_Subscribe_to_Event(HELD, 0, handle, NULL);
    for (; r <= &result.kill; r++) {
        r->least = 0xFFFF;
    }
    history_begins();
    state = seed;
    for (uint16 i = steps; i > 0; i--) {
        step();
    }
    history_ended();
    return 0;
}
