/* SPDX-License-Identifier: MIT */
/* Memory map of QEMU's virt machine (hw/riscv/virt.c; docs/reference/ports.md, section 9), also for the port. */
#ifndef SOC_H
#define SOC_H

#define CLINT_BASE 0x02000000
#define MTIME_HZ 10000000
#define PLIC_BASE 0x0C000000
#define UART_BASE 0x10000000
#define FINISHER 0x00100000 /* sifive_test */

/* Ends QEMU with status 1: after a fault, or when main returns. */
#define SOC_STOP() (REGISTER(FINISHER) = 1u << 16 | 0x3333)

#endif
