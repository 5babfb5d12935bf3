/* Interpreter of random programs of kernel calls (README.md): portable part and machine. */
#ifndef INTERPRETER_H
#define INTERPRETER_H

#include "operations.h"

#include "openswarm.h"

#ifndef MOST_PIDS
#define MOST_PIDS 256 /* greatest PID of a thread with a wait result, plus 1 */
#endif
enum {
    MOST_RECORDS = 300, /* number of records after which a run ends */
    MOST_IDLES = 50,    /* number of times the kernel idles after which a run ends */
    MOST_STARTS = 40,   /* number of thread starts; further ones are skipped */
    SIZES = 15
};

extern const uint16 interpreter_sizes[SIZES]; /* Sizes of state.py */

/* What the program observed: one record per call, and one per entry of a script. */
typedef struct {
    uint8 script, kind; /* number and context of the running script */
    uint8 index, code;  /* of the operation; code is ENTRY (0xFF) when a script begins, END (0xFE) when it ends */
    uint16 pid, result, error, heap, time, extra;
} record;

void interpreter_load(const uint8 *program); /* encoded as program.py describes */
void interpreter_main(void);                 /* never returns */
void interpreter_final_state(void);          /* records the state of the kernel; any context */

/* The machine that runs the interpreter. */
void machine_record(const record *r); /* may end the run */
void machine_start(void);                /* Sys_Start_Kernel */
void machine_tick(void);
void machine_slice(void);
void machine_interrupt(void (*isr)(void));
void machine_interrupt_at_unlock(uint8 n, void (*isr)(void));
void machine_fail(uint8 skip, uint8 count);

#endif
