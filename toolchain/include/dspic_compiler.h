/* SPDX-License-Identifier: MIT */
/* Extensions to ISO C for the dsPIC30F, in one spelling for this toolchain and for XC16:
 * interrupt functions, special function registers, inline-assembly clobbers, configuration words. */
#ifndef DSPIC_COMPILER_H
#define DSPIC_COMPILER_H

#if defined(__XC16__) || defined(__C30__)

#define DSPIC_SFR __attribute__((__sfr__))
#define OS_ISR(name) void __attribute__((__interrupt__, __no_auto_psv__)) name(void)
#define OS_ISR_AUTO_PSV(name) void __attribute__((__interrupt__, __auto_psv__)) name(void)
#define OS_ISR_SHADOW(name) void __attribute__((__interrupt__, __no_auto_psv__, __shadow__)) name(void)
#define DSPIC_CONFIG(section_name, variable, value) \
  int __attribute__((space(prog), section(section_name))) variable = (value)
#define OS_PERSISTENT __attribute__((persistent))
/* Working registers as spelled in the clobber list of an asm statement. */
#define OS_W0 "w0"
#define OS_W1 "w1"
#define OS_W2 "w2"
#define OS_W3 "w3"
#define OS_W4 "w4"
#define OS_W5 "w5"
#define OS_W6 "w6"
#define OS_W7 "w7"
#define OS_W8 "w8"
#define OS_W9 "w9"
#define OS_W10 "w10"
#define OS_W11 "w11"
#define OS_W12 "w12"
#define OS_W13 "w13"
#define OS_W14 "w14"

#else

/* The linker assigns the addresses of registers; the section name marks them as near for the compiler. */
#define DSPIC_SFR __attribute__((__section__("sfr")))
#define OS_ISR(name) __attribute__((__used__, __annotate__("interrupt"), __annotate__("no_auto_psv"))) void name(void)
#define OS_ISR_AUTO_PSV(name) \
  __attribute__((__used__, __annotate__("interrupt"), __annotate__("auto_psv"))) void name(void)
#define OS_ISR_SHADOW(name)                                                                     \
  __attribute__((__used__, __annotate__("interrupt"), __annotate__("no_auto_psv"), __annotate__("shadow"))) void name( \
      void)
#ifdef __clang__ /* a semicolon may follow or not */
#define DSPIC_CONFIG_END ;
#else
#define DSPIC_CONFIG_END
#endif
#define DSPIC_CONFIG(section_name, variable, value) \
  __attribute__((__used__, __section__(section_name))) static const unsigned short variable = (value) DSPIC_CONFIG_END
#define OS_PERSISTENT __attribute__((__section__(".pbss")))
#define OS_W0 "r0"
#define OS_W1 "r1"
#define OS_W2 "r2"
#define OS_W3 "r3"
#define OS_W4 "r4"
#define OS_W5 "r5"
#define OS_W6 "r6"
#define OS_W7 "r7"
#define OS_W8 "r8"
#define OS_W9 "r9"
#define OS_W10 "r10"
#define OS_W11 "r11"
#define OS_W12 "r12"
#define OS_W13 "r13"
#define OS_W14 "r14"

#endif

/* All registers that a C function may change (abi-elf.md §2.1), for asm statements that call one. */
#define OS_CALL_CLOBBERS OS_W0, OS_W1, OS_W2, OS_W3, OS_W4, OS_W5, OS_W6, OS_W7, "memory", "cc"

/* Functions and placement of variables by the macros of Microchip's device headers; N: alignment in bytes. */
#if defined(__XC16__) || defined(__C30__)
#ifndef _ISR
#define _ISR __attribute__((__interrupt__, __no_auto_psv__))
#define _ISRFAST __attribute__((__interrupt__, __no_auto_psv__, __shadow__))
#endif
#ifndef _XBSS
#define _PERSISTENT __attribute__((persistent))
#define _NEAR __attribute__((near))
#define _XBSS(N) __attribute__((space(xmemory), aligned(N)))
#define _XDATA(N) __attribute__((space(xmemory), aligned(N)))
#define _YBSS(N) __attribute__((space(ymemory), aligned(N)))
#define _YDATA(N) __attribute__((space(ymemory), aligned(N)))
#define _EEDATA(N) __attribute__((space(eedata), aligned(N)))
#endif
#else
#ifndef _ISR
#define _ISR __attribute__((__used__, __annotate__("interrupt"), __annotate__("no_auto_psv")))
#define _ISRFAST \
  __attribute__((__used__, __annotate__("interrupt"), __annotate__("no_auto_psv"), __annotate__("shadow")))
#endif
#ifndef _XBSS /* numbers make section names unique: constants and variables cannot share a section */
#define __dspic_text(x) #x
#define __dspic_number(x) __dspic_text(x)
#define __dspic_space(name) __section__(name __dspic_number(__COUNTER__))
#define _PERSISTENT __attribute__((__section__(".pbss")))
#define _NEAR __attribute__((__dspic_space(".near.")))
#define _XBSS(N) __attribute__((__dspic_space(".xmemory."), __aligned__(N)))
#define _XDATA(N) __attribute__((__dspic_space(".xmemory."), __aligned__(N)))
#define _YBSS(N) __attribute__((__dspic_space(".ymemory."), __aligned__(N)))
#define _YDATA(N) __attribute__((__dspic_space(".ymemory."), __aligned__(N)))
#define _EEDATA(N) __attribute__((__used__, __dspic_space(".eedata."), __aligned__(N)))
#endif
#endif

/* Configuration words by name, as in Microchip's device headers: _FOSC(CSW_FSCM_OFF & XT_PLL8), semicolon optional;
 * field codes: dspic30f6014a.md §2. The word's name is never a macro argument: programs define macros called FOSC. */
#define _FOSC(value) DSPIC_CONFIG("__FOSC.sec", _FOSC, value)
#define _FWDT(value) DSPIC_CONFIG("__FWDT.sec", _FWDT, value)
#define _FBORPOR(value) DSPIC_CONFIG("__FBORPOR.sec", _FBORPOR, value)
#define _FBS(value) DSPIC_CONFIG("__FBS.sec", _FBS, value)
#define _FSS(value) DSPIC_CONFIG("__FSS.sec", _FSS, value)
#define _FGS(value) DSPIC_CONFIG("__FGS.sec", _FGS, value)
#define _FICD(value) DSPIC_CONFIG("__FICD.sec", _FICD, value)

#define CSW_FSCM_OFF 0xFFFF
#define CSW_ON_FSCM_OFF 0x7FFF
#define CSW_FSCM_ON 0x3FFF
#define FRC_PLL4 0xFFE1
#define FRC_PLL8 0xFFEA
#define FRC_PLL16 0xFFE3
#define XT_PLL4 0xFFE5
#define XT_PLL8 0xFFE6
#define XT_PLL16 0xFFE7
#define ECIO_PLL4 0xFFED
#define ECIO_PLL8 0xFFEE
#define ECIO_PLL16 0xFFEF
#define HS2_PLL4 0xFFF1
#define HS2_PLL8 0xFFF2
#define HS2_PLL16 0xFFF3
#define HS3_PLL4 0xFFF5
#define HS3_PLL8 0xFFF6
#define HS3_PLL16 0xFFF7
#define XTL 0xFBE0
#define HS 0xFBE2
#define XT 0xFBE4
#define EC 0xFBEB
#define ECIO 0xFBEC
#define LPRC 0xFAFF
#define FRC 0xF9FF
#define PRI 0xFFFF
#define PRIOSC_PLL 0xFFFF
#define LP 0xF8FF

#define WDT_ON 0xFFFF
#define WDT_OFF 0x7FFF
#define WDTPSA_1 0xFFCF
#define WDTPSA_8 0xFFDF
#define WDTPSA_64 0xFFEF
#define WDTPSA_512 0xFFFF
#define WDTA_1 0xFFCF
#define WDTA_8 0xFFDF
#define WDTA_64 0xFFEF
#define WDTA_512 0xFFFF
#define WDTB_1 0xFFF0
#define WDTB_2 0xFFF1
#define WDTB_3 0xFFF2
#define WDTB_4 0xFFF3
#define WDTB_5 0xFFF4
#define WDTB_6 0xFFF5
#define WDTB_7 0xFFF6
#define WDTB_8 0xFFF7
#define WDTB_9 0xFFF8
#define WDTB_10 0xFFF9
#define WDTB_11 0xFFFA
#define WDTB_12 0xFFFB
#define WDTB_13 0xFFFC
#define WDTB_14 0xFFFD
#define WDTB_15 0xFFFE
#define WDTB_16 0xFFFF
#define WDTPSB_1 0xFFF0
#define WDTPSB_2 0xFFF1
#define WDTPSB_3 0xFFF2
#define WDTPSB_4 0xFFF3
#define WDTPSB_5 0xFFF4
#define WDTPSB_6 0xFFF5
#define WDTPSB_7 0xFFF6
#define WDTPSB_8 0xFFF7
#define WDTPSB_9 0xFFF8
#define WDTPSB_10 0xFFF9
#define WDTPSB_11 0xFFFA
#define WDTPSB_12 0xFFFB
#define WDTPSB_13 0xFFFC
#define WDTPSB_14 0xFFFD
#define WDTPSB_15 0xFFFE
#define WDTPSB_16 0xFFFF

#define MCLR_EN 0xFFFF
#define MCLR_DIS 0x7FFF
#define PBOR_ON 0xFFFF
#define PBOR_OFF 0xFF7F
#define BORV_20 0xFFFF
#define BORV20 0xFFFF
#define BORV27 0xFFEF
#define BORV42 0xFFDF
#define BORV45 0xFFCF
#define BORV_27 0xFFEF
#define BORV_42 0xFFDF
#define BORV_45 0xFFCF
#define PWRT_64 0xFFFF
#define PWRT_16 0xFFFE
#define PWRT_4 0xFFFD
#define PWRT_OFF 0xFFFC

#define CODE_PROT_OFF 0xFFFF
#define CODE_PROT_ON 0xFFFD
#define GWRP_OFF 0xFFFF
#define GWRP_ON 0xFFFE
#define GSS_OFF 0xFFFF
#define GSS_ON 0xFFFD
#define GSS_STD 0xFFFD
#define GSS_HIGH 0xFFFB

#define WR_PROTECT_BOOT_OFF 0xFFFF
#define WR_PROTECT_BOOT_ON 0xFFFE
#define NO_BOOT_CODE 0xFFFF
#define STRD_SMALL_BOOT_CODE 0xFFFD
#define STRD_MEDIUM_BOOT_CODE 0xFFFB
#define STRD_LARGE_BOOT_CODE 0xFFF9
#define HIGH_SMALL_BOOT_CODE 0xFFF5
#define HIGH_MEDIUM_BOOT_CODE 0xFFF3
#define HIGH_LARGE_BOOT_CODE 0xFFF1
#define NO_BOOT_EEPROM 0xFFFF
#define SMALL_BOOT_EEPROM 0xFEFF
#define NO_BOOT_RAM 0xFFFF
#define SMALL_BOOT_RAM 0xEFFF
#define MED_BOOT_RAM 0xDFFF
#define LARGE_BOOT_RAM 0xCFFF

#define WR_PROT_SEC_OFF 0xFFFF
#define WR_PROT_SEC_ON 0xFFFE
#define NO_SEC_CODE 0xFFFF
#define STRD_SMALL_SEC_CODE 0xFFFD
#define STRD_MED_SEC_CODE 0xFFFB
#define STRD_LAR_SEC_CODE 0xFFF9
#define HIGH_SMALL_SEC_CODE 0xFFF5
#define HIGH_MEDIUM_SEC_CODE 0xFFF3
#define HIGH_LARGE_SEC_CODE 0xFFF1
#define NO_SEC_EEPROM 0xFFFF
#define SMALL_SEC_EEPROM 0xFEFF
#define MED_SEC_EEPROM 0xFDFF
#define LAR_SEC_EEPROM 0xFCFF
#define NO_SEC_RAM 0xFFFF
#define SMALL_SEC_RAM 0xEFFF
#define MED_SEC_RAM 0xDFFF
#define LARGE_SEC_RAM 0xCFFF

#define ICS_PGD 0xFFFF
#define ICS_EMU1 0xFFFE
#define ICS_EMU2 0xFFFD
#define ICS_EMU3 0xFFFC
#define ICS_PGD1 0xFFFE
#define ICS_PGD2 0xFFFD
#define ICS_PGD3 0xFFFC
#define PGD 0xFFFF
#define PGD1 0xFFFE
#define PGD2 0xFFFD
#define PGD3 0xFFFC

#define Nop() __builtin_nop()
#define ClrWdt() __builtin_clrwdt()
#define Sleep() __builtin_pwrsav(0)
#define Idle() __builtin_pwrsav(1)

/* CPU priority, as in Microchip's device headers. */
#define SET_CPU_IPL(level) __builtin_set_isr_state(level)
#define SET_AND_SAVE_CPU_IPL(saved, level)  \
  do {                                      \
    (saved) = __builtin_get_isr_state();    \
    __builtin_set_isr_state(level);         \
  } while (0)
#define RESTORE_CPU_IPL(saved) __builtin_set_isr_state(saved)

#endif
