/* A kernel test: one function, run as PID 0 of a fresh kernel. On a host each has a process of its own and virtual
 * time:
 *     ./kernel_tests            list        ./kernel_tests NAME [SEED]   run one; exit status 0 = passed
 * target/bugs runs the tests of original_bugs.c on the emulated robot, each from reset. */
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
#define MANY_TICKS 3000L /* an emulated robot is slower */
#define TEST(identifier, statement) static void __attribute__((unused)) identifier(void)
#define CHECK(condition) ((condition) ? (void)0 : Sys_Assertion_Failed(#condition, __LINE__))
#define CHECK_EQ(got, wanted) CHECK((long)(got) == (long)(wanted))
#else
#include <unistd.h>

#define MANY_TICKS 70000L /* more than 16 bits */

typedef struct test {
    const char *name, *says;
    void (*run)(void);
    struct test *next;
} test;

void test_add(test *t);
extern uint32 test_seed; /* seed of randomised tests */

/* says: the requirement that the test checks, and its source. */
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

void boot(void);                 /* virtual time, Sys_Init_Kernel, Sys_Start_Kernel */
uint16 heap_now(void);           /* bytes in use */
bool lists_are_well_formed(void); /* ring, blocked list, states */

extern int deliveries; /* to count_delivery */
bool count_delivery(uint16 pid, uint16 id, sys_event_data *data);
void yield_for_ever(void); /* a thread */

/* What happened, in order: a short text both threads and handlers append to. */
extern char trace[];
void note(char c);

#endif
