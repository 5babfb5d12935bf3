/* The conformance suite: behaviour required of every port, checked only through the public interface and with real
 * time. The same source runs on every CPU and on hosts. See README.md. */
#ifndef CONFORMANCE_H
#define CONFORMANCE_H

#include <openswarm.h>
#include <openswarm_io.h>

enum { E1 = SYS_FIRST_USER_EVENT, E2, E3, E4, E_NEVER };

/* Counts a check; reports a failed one on UART1 as file letter and line, because RAM is too small for text. */
void check_line(bool holds, char file, uint16 line);
#define CHECK(condition) check_line((condition), FILE_LETTER, __LINE__)

uint16 heap_now(void); /* heap bytes in use */

/* Records a character: threads and handlers append, forget() clears the record. */
void note(char c);
void forget(void);
bool noted(const char *text);

uint16 start(void (*entry)(void *), void *arg, uint8 priority); /* returns the PID, or 0 on failure */

/* Whether a call failed with this error. */
static inline bool refused_as(bool done, sys_error error)
{
    return !done && Sys_Get_LastError() == error;
}

void spin_for_ever(void *unused); /* options.c: a thread that never waits; counts in rounds_spun */
extern volatile uint16 rounds_spun;

void check_threads(void);   /* threads.c: switching, sleeping, killing, critical sections, schedulers */
void check_events(void);    /* events.c: registration to delivery, waits, memory */
void check_attacks(void);   /* attacks.c: floods, deaths, unbalanced calls, numbers that wrap */
void check_options(void);   /* options.c: mutex, join, cleanup; only with -DSUITE_OF_OPTIONS */
void check_limits(void);    /* limits.c: quota, service; in the same image */
void check_waits(void);     /* waits.c: semaphore, notification, timer; in the same image */
void check_registers(void); /* registers.c: registers of a thread survive preemption */

#endif
