/* The conformance suite: what any port must get right, told with nothing but the public interface and time that passes by
 * itself. One text for every CPU and for hosts. README.md. */
#ifndef CONFORMANCE_H
#define CONFORMANCE_H

#include <openswarm.h>
#include <openswarm_io.h>

enum { E1 = SYS_FIRST_USER_EVENT, E2, E3, E4, E_NEVER };

/* Counts, and reports a line that does not hold on UART1. Texts would not fit into a small robot's RAM. */
void check_line(bool holds, char file, uint16 line);
#define CHECK(condition) check_line((condition), FILE_LETTER, __LINE__)

uint16 heap_now(void); /* bytes in use */

/* What happened, in order: threads and handlers append. forget() empties it. */
void note(char c);
void forget(void);
bool noted(const char *text);

uint16 start(void (*entry)(void *), void *arg, uint8 priority); /* PID, or 0 */

void check_threads(void);   /* threads.c: switching, sleeping, killing, critical sections, schedulers */
void check_events(void);    /* events.c: registration to delivery, waits, memory */
void check_attacks(void);   /* attacks.c: floods, deaths, unbalanced calls, numbers that wrap */
void check_options(void);   /* options.c: mutex, join, cleanup, quota, service; with -DSUITE_OF_OPTIONS, alone */
void check_registers(void); /* registers.c: what a thread computes survives preemption */

#endif
