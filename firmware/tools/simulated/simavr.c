/* An ATmega328P for Python (kilobot.py): simavr's library behind a few functions, one instruction at a time.
 *
 *     gcc -O2 -shared -fPIC simavr.c air.c -I/usr/include/simavr -lsimavr -o simavr.so */
#include "simavr.h"

#include <avr_eeprom.h>
#include <avr_extint.h>
#include <avr_uart.h>
#include <sim_elf.h>
#include <sim_interrupts.h>
#include <stdlib.h>
#include <string.h>

static void quiet(avr_t *avr, const int level, const char *format, va_list arguments)
{
    (void)avr, (void)level, (void)format, (void)arguments;
}

static void from_uart(struct avr_irq_t *irq, uint32_t value, void *parameter)
{
    machine *m = parameter;
    (void)irq;
    if (m->written < UART_ROOM) {
        m->uart[m->written++] = (uint8_t)value;
    }
}

static void no_sleep(avr_t *avr, avr_cycle_count_t cycles)
{
    (void)avr, (void)cycles; /* sleep takes no time of the host */
}

machine *machine_open(const char *path, uint32_t hz)
{
    elf_firmware_t firmware;
    uint32_t flags = 0;
    machine *m = calloc(1, sizeof *m);
    memset(&firmware, 0, sizeof firmware);
    avr_global_logger_set(quiet);
    if (m == NULL || elf_read_firmware(path, &firmware) != 0) {
        return NULL;
    }
    m->avr = avr_make_mcu_by_name("atmega328p");
    if (m->avr == NULL || avr_init(m->avr) != 0) {
        return NULL;
    }
    m->avr->frequency = hz;
    avr_load_firmware(m->avr, &firmware);
    m->avr->frequency = hz;
    m->avr->sleep = no_sleep;
    for (uint8_t pin = 0; pin < 2; pin++) { /* else simavr polls a low INT pin in every cycle, even if disabled */
        avr_extint_set_strict_lvl_trig(m->avr, pin, 0);
    }
    m->lowest_sp = 0xFFFF;
    avr_ioctl(m->avr, AVR_IOCTL_UART_GET_FLAGS('0'), &flags);
    flags &= (uint32_t)~(AVR_UART_FLAG_STDIO | AVR_UART_FLAG_POLL_SLEEP);
    avr_ioctl(m->avr, AVR_IOCTL_UART_SET_FLAGS('0'), &flags);
    avr_irq_register_notify(avr_io_getirq(m->avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUTPUT), from_uart, m);
    return m;
}

void machine_close(machine *m)
{
    avr_terminate(m->avr);
    free(m);
}

/* Executes one instruction, or sleeps. Returns RUNS_ON, CRASHED, or DONE: asleep with interrupts off. */
int machine_step(machine *m)
{
    int state = avr_run(m->avr);
    m->avr->run_cycle_count = 1; /* a single instruction also after a sleep */
    uint16_t sp = (uint16_t)(m->avr->data[0x5D] | m->avr->data[0x5E] << 8);
    m->instructions++;
    if (sp >= m->watch_from && sp <= m->watch_to && sp < m->lowest_sp) {
        m->lowest_sp = sp;
    }
    return state == cpu_Done ? DONE : state == cpu_Crashed ? CRASHED : RUNS_ON;
}

/* Executes up to `count` instructions. Returns as machine_step. */
int machine_steps(machine *m, uint32_t count)
{
    int stopped = RUNS_ON;
    while (count-- != 0 && stopped == RUNS_ON) {
        stopped = machine_step(m);
    }
    return stopped;
}

/* Runs at least one step, until the PC is in `places` or cycle `end` is over. Returns AT_PLACE, or as machine_step. */
int machine_run(machine *m, const uint32_t *places, int count, uint64_t end)
{
    while (m->avr->cycle < end) {
        int stopped = machine_step(m);
        if (stopped != RUNS_ON) {
            return stopped;
        }
        for (int i = 0; i < count; i++) {
            if (m->avr->pc == places[i]) {
                return AT_PLACE;
            }
        }
    }
    return RUNS_ON;
}

/* Instructions so far. */
uint64_t machine_instructions(const machine *m)
{
    return m->instructions;
}

uint32_t machine_pc(const machine *m)
{
    return m->avr->pc;
}

uint64_t machine_cycle(const machine *m)
{
    return m->avr->cycle;
}

uint8_t *machine_data(machine *m)
{
    return m->avr->data;
}

/* Sets the flag of an interrupt that the firmware has enabled, by its vector number. */
int machine_interrupt(machine *m, uint8_t vector)
{
    avr_int_table_p table = &m->avr->interrupts;
    for (int i = 0; i < table->vector_count; i++) {
        if (table->vector[i]->vector == vector) {
            return avr_raise_interrupt(m->avr, table->vector[i]);
        }
    }
    return -1;
}

void machine_receive(machine *m, uint8_t byte)
{
    avr_raise_irq(avr_io_getirq(m->avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_INPUT), byte);
}

/* Writes the EEPROM. Returns 0, or 1 if the bytes do not fit. */
int machine_eeprom(machine *m, const uint8_t *bytes, uint32_t offset, uint32_t count)
{
    avr_eeprom_desc_t d = {(uint8_t *)bytes, (uint16_t)offset, count};
    return avr_ioctl(m->avr, AVR_IOCTL_EEPROM_SET, &d) == -2; /* simavr returns -1 for success */
}

/* Copies and removes the bytes that the UART has sent; returns their number. */
uint32_t machine_uart(machine *m, uint8_t *to, uint32_t room)
{
    uint32_t count = m->written < room ? m->written : room;
    memcpy(to, m->uart, count);
    memmove(m->uart, m->uart + count, m->written - count);
    m->written -= count;
    return count;
}

/* Starts to record the lowest stack pointer between two addresses. */
void machine_watch(machine *m, uint16_t from, uint16_t to)
{
    m->watch_from = from;
    m->watch_to = to;
    m->lowest_sp = 0xFFFF;
}

uint16_t machine_lowest(const machine *m)
{
    return m->lowest_sp;
}
