/* SPDX-License-Identifier: MIT */
/* Sample for damaged ELF files of the ATmega328P, with an interrupt handler, locals, a structure and call frames:
 *
 *     avr-gcc -mmcu=atmega328p -Os -gdwarf-2 -gno-record-gcc-switches -fdebug-prefix-map=$PWD=. -nostdlib \
 *         -Wl,-e,__vectors avr.c -o avr.elf
 */
typedef struct {
    int x;
    unsigned char y;
} point;

volatile point where;
static volatile unsigned char ticks;

__attribute__((signal, used, externally_visible)) void __vector_14(void)
{
    ticks++;
}

static __attribute__((noinline, noclone)) int add(int a, unsigned char b)
{
    int sum = a + b;
    where.x += sum;
    return sum;
}

__attribute__((noreturn, used, externally_visible)) void start(void)
{
    __asm__ volatile("eor r1, r1\n\tsei");
    for (int i = 0;; i++) {
        where.x = add(i, ticks);
        where.y++;
    }
}

__attribute__((naked, used, section(".vectors"))) void __vectors(void)
{
    __asm__("jmp start\n\t.rept 25\n\tjmp __vector_14\n\t.endr");
}
