/* SPDX-License-Identifier: MIT */
/* XC16's device builtins (abi-elf.md §2.9) for this compiler; the driver includes this file before every C source. */
#ifndef DSPIC_BUILTINS_H
#define DSPIC_BUILTINS_H
#ifndef __ASSEMBLER__
#pragma GCC system_header

#ifdef __cplusplus
extern "C" {
#endif

/* Qualifiers of XC16 that change how a pointer is read, which this compiler does not have. */
#define __eds__ _Pragma("GCC error \"__eds__ is not supported: read flash by __builtin_tblrdl, or set PSVPAG\"")
#define __psv__ _Pragma("GCC error \"__psv__ is not supported: read flash by __builtin_tblrdl, or set PSVPAG\"")
#define __prog__ _Pragma("GCC error \"__prog__ is not supported: read flash by __builtin_tblrdl, or set PSVPAG\"")

#define __builtin_nop() __asm__ volatile("nop")
#define __builtin_clrwdt() __asm__ volatile("clrwdt")
#define __builtin_pwrsav(mode) __asm__ volatile("pwrsav #%0" ::"i"(mode) : "memory")
#define __builtin_disi(cycles) __asm__ volatile("disi #%0" ::"i"(cycles) : "memory")
#define __builtin_software_breakpoint() __asm__ volatile(".pword 0xDA4000" ::: "memory")

/* Each argument is below the previous one, rounded to words (abi-elf.md §2.4). Clang's own version reads the address of a
 * struct instead of the struct. */
#define __builtin_va_arg(list, type) (*(__typeof__(type) *)((list) -= (sizeof(type) + 1) & ~1u))

/* No code, because there is no cache; clang's version of this builtin does not support a 16-bit int. */
#define __builtin_prefetch(address, ...) ((void)(address))

/* Names of GCC that clang does not define. */
#define __builtin_isinff(x) __builtin_isinf(x)
#define __builtin_isinfl(x) __builtin_isinf(x)
#define __builtin_isnanf(x) __builtin_isnan(x)
#define __builtin_isnanl(x) __builtin_isnan(x)
#define __builtin_imaxabs(x) __builtin_llabs(x)
__attribute__((__noreturn__)) void __dspic_exit(int status) __asm__("exit");
#define __builtin_exit __dspic_exit

int __dspic_puts(const char *text) __asm__("puts");
#define __builtin_puts __dspic_puts

/* GCC's buffer has five words, jmp_buf ten: the former holds the address of a jmp_buf in the function's frame. */
int __dspic_setjmp(unsigned int *environment) __asm__("setjmp") __attribute__((__returns_twice__));
__attribute__((__noreturn__)) void __dspic_longjmp(unsigned int *environment, int value) __asm__("longjmp");
#define __builtin_setjmp(buffer) \
  __dspic_setjmp(*(unsigned int **)(buffer) = (unsigned int *)__builtin_alloca(20))
#define __builtin_longjmp(buffer, value) __dspic_longjmp(*(unsigned int **)(buffer), value)

/* One unlocked byte write: two keys and the value in consecutive byte moves (dspic30f6014a.md §3). */
#define __dspic_unlocked_write(address, key1, key2, value)                          \
  __asm__ volatile("mov.b %0,[%3]\n\tmov.b %1,[%3]\n\tmov.b %2,[%3]" ::"r"(key1),   \
                   "r"(key2), "r"((unsigned)(value)), "r"((unsigned)(address)) : "memory")
#define __builtin_write_OSCCONL(value) __dspic_unlocked_write(0x742u, 0x46u, 0x57u, value)
#define __builtin_write_OSCCONH(value) __dspic_unlocked_write(0x743u, 0x78u, 0x9Au, value)
#define __builtin_write_NVM()                                                                    \
  __asm__ volatile("mov %0,_NVMKEY\n\tmov %1,_NVMKEY\n\tbset _NVMCON,#15\n\tnop\n\tnop" ::"r"(0x55u), \
                   "r"(0xAAu) : "memory")

#define __dspic_table_read(instruction, offset)                                               \
  (__extension__({                                                                            \
    unsigned int __value;                                                                     \
    __asm__ volatile(instruction " [%1],%0" : "=r"(__value) : "r"((unsigned int)(offset)));   \
    __value;                                                                                  \
  }))
#define __builtin_tblrdl(offset) __dspic_table_read("tblrdl", offset)
#define __builtin_tblrdh(offset) __dspic_table_read("tblrdh", offset)
#define __builtin_tblrdlb(offset) ((unsigned char)__dspic_table_read("tblrdl.b", offset))
#define __builtin_tblrdhb(offset) ((unsigned char)__dspic_table_read("tblrdh.b", offset))
#define __dspic_table_write(instruction, offset, value) \
  __asm__ volatile(instruction " %0,[%1]" ::"r"((unsigned int)(value)), "r"((unsigned int)(offset)) : "memory")
#define __builtin_tblwtl(offset, value) __dspic_table_write("tblwtl", offset, value)
#define __builtin_tblwth(offset, value) __dspic_table_write("tblwth", offset, value)
#define __builtin_tblwtlb(offset, value) __dspic_table_write("tblwtl.b", offset, value)
#define __builtin_tblwthb(offset, value) __dspic_table_write("tblwth.b", offset, value)

#define __dspic_address(operator, object)                                     \
  (__extension__({                                                            \
    unsigned int __value;                                                     \
    __asm__("mov #" operator "(%1),%0" : "=r"(__value) : "i"(object));        \
    __value;                                                                  \
  }))
#define __builtin_tblpage(object) __dspic_address("tblpage", object)
#define __builtin_tbloffset(object) __dspic_address("tbloffset", object)
#define __builtin_tbladdress(object) \
  ((unsigned long)__builtin_tblpage(object) << 16 | __builtin_tbloffset(object))
#define __builtin_psvpage(object) __dspic_address("psvpage", object)
#define __builtin_psvoffset(object) __dspic_address("psvoffset", object)

#define __builtin_mulss(a, b) ((long)(int)(a) * (int)(b))
#define __builtin_muluu(a, b) ((unsigned long)(unsigned int)(a) * (unsigned int)(b))
#define __builtin_mulsu(a, b) ((long)(int)(a) * (long)(unsigned int)(b))
#define __builtin_mulus(a, b) ((long)(unsigned int)(a) * (long)(int)(b))

/* Hardware divisions of 32 by 16 bits; the result is undefined if the quotient does not fit 16 bits (isa.md §6.7). */
int __dspic_divsd(long dividend, int divisor);
unsigned int __dspic_divud(unsigned long dividend, unsigned int divisor);
int __dspic_modsd(long dividend, int divisor);
unsigned int __dspic_modud(unsigned long dividend, unsigned int divisor);
int __dspic_divmodsd(long dividend, int divisor, int *remainder);
unsigned int __dspic_divmodud(unsigned long dividend, unsigned int divisor, unsigned int *remainder);
int __dspic_divf(int numerator, int denominator);
#define __builtin_divsd __dspic_divsd
#define __builtin_divud __dspic_divud
#define __builtin_modsd __dspic_modsd
#define __builtin_modud __dspic_modud
#define __builtin_divmodsd __dspic_divmodsd
#define __builtin_divmodud __dspic_divmodud
#define __builtin_divf __dspic_divf

#define __builtin_btg(object, bit)                                                          \
  do {                                                                                      \
    __asm__ volatile("btg [%0],#%1" ::"r"(object), "i"(bit) : "memory");                    \
  } while (0)

/* One instruction each (isa.md §6): position of the first 1 from the left or right, and of the first non-sign bit. */
#define __dspic_find(instruction, value)                                             \
  (__extension__({                                                                   \
    int __place;                                                                     \
    __asm__(instruction " %1,%0" : "=r"(__place) : "r"((unsigned int)(value)) : "cc"); \
    __place;                                                                         \
  }))
#define __builtin_ff1l(value) __dspic_find("ff1l", value)
#define __builtin_ff1r(value) __dspic_find("ff1r", value)
#define __builtin_fbcl(value) __dspic_find("fbcl", value)

/* SR<7:5> is the CPU priority (isa.md §2.3). */
#define __builtin_get_isr_state()                                                       \
  (__extension__({                                                                      \
    unsigned int __value;                                                               \
    __asm__ volatile("mov _SR,%0\n\tlsr %0,#5,%0\n\tand %0,#7,%0" : "=r"(__value));     \
    __value;                                                                            \
  }))
void __dspic_set_isr_state(unsigned int level);
#define __builtin_set_isr_state(level) __dspic_set_isr_state(level)
#define __builtin_disable_interrupts() __dspic_set_isr_state(7)
#define __builtin_enable_interrupts() __dspic_set_isr_state(0)

#ifdef __cplusplus
}
#endif
#endif
#endif
