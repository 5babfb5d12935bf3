/* Runs one test of host/SOURCE.c on the robot: `chosen` is its index in TESTS (DEFINES of the Makefile). */
#include "../../host/test.h"

#define PATH_OF(name) HAL_TEXT(../../host/name.c)
#include PATH_OF(SOURCE)
#include "../../host/support.c"

#include <p30F6014A.h>

volatile uint16 chosen __attribute__((used));

static void (*const tests[])(void) = {TESTS};
static void (*device_isr)(void);

/* ---- Functions of host.h implemented with real interrupts --------------------------------------------------------- */

void host_use_virtual_time(void)
{
}

void host_slice(void)
{
    IFS0bits.T2IF = 1;
    __asm__ volatile("nop\n\tnop");
}

void host_tick(void)
{
    IFS0bits.T1IF = 1;
    __asm__ volatile("nop\n\tnop");
}

void host_device(void (*isr)(void))
{
    device_isr = isr;
    IFS1bits.INT1IF = 1;
    __asm__ volatile("nop\n\tnop");
}

__attribute__((used)) void bugs_isr(void)
{
    IFS1bits.INT1IF = 0;
    device_isr();
}

typedef struct {
    sint16 rate, fraction;
    uint16 phases, coils;
} stepper;
extern stepper stepper_left, stepper_right;

int16_t host_left(void)
{
    return (sint16)(-stepper_left.rate / 5);
}

int16_t host_right(void)
{
    return (sint16)(stepper_right.rate / 5);
}

/* ---- Functions at which the test stops ---------------------------------------------------------------------------- */

__attribute__((noinline, used)) void begin(void)
{
    __asm__ volatile("nop" ::: "memory");
}

__attribute__((noinline, used)) void passed(void)
{
    __asm__ volatile("nop" ::: "memory");
}

int main(void)
{
    IPC4bits.INT1IP = 4;
    IEC1bits.INT1IE = 1;
    begin();
    tests[chosen]();
    CHECK(lists_are_well_formed());
    passed();
    return 0;
}
