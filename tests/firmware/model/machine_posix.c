/* SPDX-License-Identifier: MIT */
/* Runs programs on the POSIX port, each in a process of its own.
 *
 * First it writes the sizes that the model needs, as words: their number, then the sizes in the order of Sizes
 * (state.py). Then it reads programs, each preceded by the number of its bytes, and answers each with a status
 * (0, or that of waitpid), the number of its records, and the records. */
#include "interpreter.h"

#include "board.h"
#include "hal_infrared.h"
#include "host.h"
#include "kernel.h"

#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/time.h>
#include <sys/wait.h>
#include <unistd.h>

enum { MOST_BYTES = 4096, FINAL_RECORDS = 256, PATIENCE_US = 500000 };

typedef struct {
    volatile uint16 count;
    record records[MOST_RECORDS + FINAL_RECORDS];
} log;

static log *shared;
static bool is_final;
static uint8 skipped_allocations, failing_allocations;

/* Replaces the port's function (linker option --wrap): a number of consecutive allocations fail. */
bool __wrap_host_allocation_fails(void);
bool __wrap_host_allocation_fails(void)
{
    if (skipped_allocations != 0) {
        skipped_allocations--;
        return false;
    }
    return failing_allocations != 0 && failing_allocations-- != 0;
}

static void end_run(void)
{
    is_final = true;
    host_at_unlock(0, NULL);
    interpreter_final_state();
    _exit(EXIT_SUCCESS);
}

void machine_record(const record *r)
{
    if (shared->count == MOST_RECORDS + FINAL_RECORDS) {
        abort();
    }
    shared->records[shared->count++] = *r;
    if (shared->count == MOST_RECORDS && !is_final) {
        end_run();
    }
}

static void idle(uint32_t number)
{
    if (number == MOST_IDLES) {
        end_run();
    }
}

void machine_start(void)
{
    Sys_Start_Kernel();
}

void machine_tick(void)
{
    host_tick();
}

void machine_slice(void)
{
    host_slice();
}

void machine_interrupt(void (*isr)(void))
{
    host_device(isr);
}

static void (*isr_at_unlock)(void);

static void raise_at_unlock(void)
{
    host_device(isr_at_unlock);
}

void machine_interrupt_at_unlock(uint8 n, void (*isr)(void))
{
    isr_at_unlock = isr;
    host_at_unlock(n, raise_at_unlock);
}

void machine_fail(uint8 skip, uint8 count)
{
    skipped_allocations = skip;
    failing_allocations = count;
}

#ifdef MODEL_REMOTE
void hal_infrared_start(void)
{
}

void hal_infrared_light(bool on)
{
    (void)on;
}

uint16_t hal_infrared_number(void)
{
    return 0;
}
#endif

static void ignore(uint8 uart, uint8 byte)
{
    (void)uart, (void)byte;
}

static void run(const uint8 *program)
{
    const struct itimerval patience = {{0, 0}, {0, PATIENCE_US}};
    setitimer(ITIMER_PROF, &patience, NULL);
    host_use_virtual_time();
    host_at_idle(idle);
    host_uart_sink(ignore);
    interpreter_load(program);
    interpreter_main();
}

int main(void)
{
    static uint8 program[MOST_BYTES];
    const uint16 count = SIZES;
    FILE *answers = fdopen(dup(STDOUT_FILENO), "wb");
    int nowhere = open("/dev/null", O_WRONLY);
    uint16 length;
    dup2(nowhere, STDOUT_FILENO); /* the kernel's reports */
    shared = mmap(NULL, sizeof *shared, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    fwrite(&count, sizeof count, 1, answers);
    fwrite(interpreter_sizes, sizeof interpreter_sizes, 1, answers);
    while (fread(&length, sizeof length, 1, stdin) == 1 && fread(program, length, 1, stdin) == 1) {
        int status = 0;
        shared->count = 0;
        fflush(answers);
        pid_t child = fork();
        if (child == 0) {
            run(program);
        }
        waitpid(child, &status, 0);
        uint16 head[] = {(uint16)status, shared->count};
        fwrite(head, sizeof head, 1, answers);
        fwrite(shared->records, sizeof(record), shared->count, answers);
    }
    return fclose(answers);
}
