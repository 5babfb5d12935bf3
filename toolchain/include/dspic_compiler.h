/* What a C compiler for the dsPIC30F must be told outside ISO C, in one spelling for this toolchain and for XC16:
 * interrupt functions, special function registers, inline-assembly clobbers, configuration words. */
#ifndef DSPIC_COMPILER_H
#define DSPIC_COMPILER_H

#if defined(__XC16__) || defined(__C30__)

#define DSPIC_SFR __attribute__((__sfr__))
#define OS_ISR(name) void __attribute__((__interrupt__, __no_auto_psv__)) name(void)
#define OS_ISR_AUTO_PSV(name) void __attribute__((__interrupt__, __auto_psv__)) name(void)
#define OS_ISR_SHADOW(name) void __attribute__((__interrupt__, __no_auto_psv__, __shadow__)) name(void)
#define OS_CONFIG(word, value) int __attribute__((space(prog), section("__" #word ".sec"))) _##word = (value)
#define OS_PERSISTENT __attribute__((persistent))
/* Working registers as the clobber list of an asm statement spells them. */
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

/* The linker gives registers their addresses; the section name tells the compiler that they are near. */
#define DSPIC_SFR __attribute__((__section__("sfr")))
#define OS_ISR(name) __attribute__((__used__, __annotate__("interrupt"), __annotate__("no_auto_psv"))) void name(void)
#define OS_ISR_AUTO_PSV(name) \
  __attribute__((__used__, __annotate__("interrupt"), __annotate__("auto_psv"))) void name(void)
#define OS_ISR_SHADOW(name)                                                                     \
  __attribute__((__used__, __annotate__("interrupt"), __annotate__("no_auto_psv"), __annotate__("shadow"))) void name( \
      void)
#define OS_CONFIG(word, value) \
  __attribute__((__used__, __section__("__" #word ".sec"))) static const unsigned short dspic_config_##word = (value)
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

/* Everything a C function may change (abi-elf.md §2.1), for asm statements that call one. */
#define OS_CALL_CLOBBERS OS_W0, OS_W1, OS_W2, OS_W3, OS_W4, OS_W5, OS_W6, OS_W7, "memory", "cc"

#ifndef _ISR
#define _ISR __attribute__((__interrupt__, __no_auto_psv__))
#define _ISRFAST __attribute__((__interrupt__, __no_auto_psv__, __shadow__))
#endif

/* Configuration words by name, as in Microchip's device headers: _FOSC(CSW_FSCM_OFF & XT_PLL8);
 * field codes: dspic30f6014a.md §2. */
#define _FOSC(value) OS_CONFIG(FOSC, value)
#define _FWDT(value) OS_CONFIG(FWDT, value)
#define _FBORPOR(value) OS_CONFIG(FBORPOR, value)
#define _FGS(value) OS_CONFIG(FGS, value)
#define _FICD(value) OS_CONFIG(FICD, value)

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

#define WDT_ON 0xFFFF
#define WDT_OFF 0x7FFF
#define WDTPSA_1 0xFFCF
#define WDTPSA_8 0xFFDF
#define WDTPSA_64 0xFFEF
#define WDTPSA_512 0xFFFF

#define MCLR_EN 0xFFFF
#define MCLR_DIS 0x7FFF
#define PBOR_ON 0xFFFF
#define PBOR_OFF 0xFF7F
#define BORV_27 0xFFEF
#define BORV_42 0xFFDF
#define BORV_45 0xFFCF
#define PWRT_64 0xFFFF
#define PWRT_16 0xFFFE
#define PWRT_4 0xFFFD
#define PWRT_OFF 0xFFFC

#define CODE_PROT_OFF 0xFFFF
#define CODE_PROT_ON 0xFFFD

#define Nop() __builtin_nop()
#define ClrWdt() __builtin_clrwdt()
#define Sleep() __builtin_pwrsav(0)
#define Idle() __builtin_pwrsav(1)

#endif
