/* A kernel test is one function that runs as PID 0 of a fresh kernel. On a host each test has its own
 * process and virtual time: `./kernel_tests` lists the tests, `./kernel_tests NAME [SEED]` runs one and
 * exits with 0 if it passes. target/bugs runs those of three files on the emulated robot, each after
 * a reset. */
#ifndef TEST_H
#define TEST_H

#include "../../../firmware/openswarm/board/host/board.h"
#include "../../../firmware/openswarm/port/posix/host.h"
#include "io.h"
#include "kernel.h"
#include "openswarm.h"
#include "openswarm_io.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#ifdef __dsPIC30F__
#define MANY_TICKS 3000L /* in ms; fewer, because emulation is slower than a host */
#define TEST(identifier, statement) static void __attribute__((unused)) identifier(void)
#define CHECK(condition) ((condition) ? (void)0 : Sys_Assertion_Failed(#condition, __LINE__))
#define CHECK_EQ(got, wanted) CHECK((long)(got) == (long)(wanted))
#else
#include <unistd.h>

#define MANY_TICKS 70000L /* more than a 16-bit counter can count */

typedef struct test {
    const char *name, *says;
    void (*run)(void);
    struct test *next;
} test;

void test_add(test *t);
extern uint32 test_seed; /* seed of the randomised tests */

/* Defines a test. statement: the requirement that it checks, and the source of the requirement. */
#define TEST(identifier, statement)                                                  \
    static void identifier(void);                                                    \
    static test test_##identifier = {#identifier, statement, identifier, NULL};      \
    static void __attribute__((constructor)) add_##identifier(void)                  \
    {                                                                                \
        test_add(&test_##identifier);                                                \
    }                                                                                \
    static void identifier(void)

#define CHECK(condition)                                                             \
    do {                                                                             \
        if (!(condition)) {                                                          \
            dprintf(2, "%s:%d: %s\n", __FILE__, __LINE__, #condition);               \
            _exit(1);                                                                \
        }                                                                            \
    } while (0)

#define CHECK_EQ(got, wanted)                                                        \
    do {                                                                             \
        long got_ = (long)(got), wanted_ = (long)(wanted);                           \
        if (got_ != wanted_) {                                                       \
            dprintf(2, "%s:%d: %s is %ld, not %ld\n", __FILE__, __LINE__, #got, got_, wanted_); \
            _exit(1);                                                                \
        }                                                                            \
    } while (0)

#endif

enum { E1 = SYS_FIRST_USER_EVENT, E2, E3, E4, E_NEVER };

void boot(void);                 /* sets virtual time, initialises and starts the kernel */
uint16 heap_now(void);           /* returns the heap bytes in use */
bool lists_are_well_formed(void); /* checks ring, blocked list and thread states */

extern int deliveries; /* calls of count_delivery */
bool count_delivery(uint16 pid, uint16 id, sys_event_data *data);
void yield_for_ever(void); /* a thread */
void sleep_for_ever(void *unused);
uint16 start_thread(void (*entry)(void *), const void *arg); /* with the default stack; returns its PID */

/* Sequence of events of a test: threads and handlers append characters with note(). */
extern char trace[];
void note(char c);
void note_letter(void *letter); /* a cleanup: appends *letter */

#endif
