/* SPDX-License-Identifier: MIT */
/* Control and status registers of machine mode (RISC-V privileged architecture 20211203, 3.1) and the registers of the
 * CLINT, whose address the chip defines (soc.h). Also read by switch.S. */
#ifndef REGISTERS_H
#define REGISTERS_H

#include "soc.h"

#define MSTATUS_MIE 8             /* interrupts are enabled */
#define MSTATUS_RESUME 0x1880     /* MPP, MPIE: mret stays in machine mode and enables interrupts */
#define MIE_MSIE 8                /* software interrupt */
#define MIE_DEVICES (1 << 7 | 1 << 11) /* MTIE, MEIE: timer and external interrupts */
#define MTVEC_VECTORED 1
#define CLINT_MSIP (CLINT_BASE + 0x0)
#define CLINT_MTIMECMP (CLINT_BASE + 0x4000)
#define CLINT_MTIME (CLINT_BASE + 0xBFF8)

#ifndef __ASSEMBLER__
#include <stdbool.h>
#include <stdint.h>

#define REGISTER(address) (*(volatile uint32_t *)(address))

#define CSR_READ(name)                                               \
    __extension__({                                                  \
        uint32_t csr_;                                               \
        __asm__ volatile("csrr %0, " #name : "=r"(csr_));            \
        csr_;                                                        \
    })
/* BITS: a constant below 32. CSR_CLEAR returns the previous value of the register. */
#define CSR_CLEAR(name, bits)                                        \
    __extension__({                                                  \
        uint32_t csr_;                                               \
        __asm__ volatile("csrrci %0, " #name ", %1" : "=r"(csr_) : "i"(bits) : "memory"); \
        csr_;                                                        \
    })
#define CSR_SET(name, bits) __asm__ volatile("csrsi " #name ", %0" ::"i"(bits) : "memory")
#endif

#endif
