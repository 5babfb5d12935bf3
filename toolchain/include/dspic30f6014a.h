/* SPDX-License-Identifier: MIT */
/* Registers of the dsPIC30F6014A.
 * Written by `python -m toolchain.device_header` from the chip's register table; do not edit. */
#ifndef DSPIC30F6014A_H
#define DSPIC30F6014A_H
#ifndef __dsPIC30F6014A__
#error "this header is for the dsPIC30F6014A: compile with -mcpu=30F6014A"
#endif

#include "dspic_compiler.h"

#ifndef __ASSEMBLER__
#ifdef __cplusplus
extern "C" {
#endif

extern volatile unsigned int WREG0 DSPIC_SFR; /* 0x0000 */
extern volatile unsigned int WREG1 DSPIC_SFR; /* 0x0002 */
extern volatile unsigned int WREG2 DSPIC_SFR; /* 0x0004 */
extern volatile unsigned int WREG3 DSPIC_SFR; /* 0x0006 */
extern volatile unsigned int WREG4 DSPIC_SFR; /* 0x0008 */
extern volatile unsigned int WREG5 DSPIC_SFR; /* 0x000A */
extern volatile unsigned int WREG6 DSPIC_SFR; /* 0x000C */
extern volatile unsigned int WREG7 DSPIC_SFR; /* 0x000E */
extern volatile unsigned int WREG8 DSPIC_SFR; /* 0x0010 */
extern volatile unsigned int WREG9 DSPIC_SFR; /* 0x0012 */
extern volatile unsigned int WREG10 DSPIC_SFR; /* 0x0014 */
extern volatile unsigned int WREG11 DSPIC_SFR; /* 0x0016 */
extern volatile unsigned int WREG12 DSPIC_SFR; /* 0x0018 */
extern volatile unsigned int WREG13 DSPIC_SFR; /* 0x001A */
extern volatile unsigned int WREG14 DSPIC_SFR; /* 0x001C */
extern volatile unsigned int WREG15 DSPIC_SFR; /* 0x001E */
extern volatile unsigned int SPLIM DSPIC_SFR; /* 0x0020 */
extern volatile unsigned int ACCAL DSPIC_SFR; /* 0x0022 */
extern volatile unsigned int ACCAH DSPIC_SFR; /* 0x0024 */
extern volatile unsigned int ACCAU DSPIC_SFR; /* 0x0026 */
extern volatile unsigned int ACCBL DSPIC_SFR; /* 0x0028 */
extern volatile unsigned int ACCBH DSPIC_SFR; /* 0x002A */
extern volatile unsigned int ACCBU DSPIC_SFR; /* 0x002C */
extern volatile unsigned int PCL DSPIC_SFR; /* 0x002E */
extern volatile unsigned int PCH DSPIC_SFR; /* 0x0030 */
extern volatile unsigned int TBLPAG DSPIC_SFR; /* 0x0032 */
extern volatile unsigned int PSVPAG DSPIC_SFR; /* 0x0034 */
extern volatile unsigned int RCOUNT DSPIC_SFR; /* 0x0036 */
extern volatile unsigned int DCOUNT DSPIC_SFR; /* 0x0038 */
extern volatile unsigned int DOSTARTL DSPIC_SFR; /* 0x003A */
extern volatile unsigned int DOSTARTH DSPIC_SFR; /* 0x003C */
extern volatile unsigned int DOENDL DSPIC_SFR; /* 0x003E */
extern volatile unsigned int DOENDH DSPIC_SFR; /* 0x0040 */
extern volatile unsigned int SR DSPIC_SFR; /* 0x0042 */
typedef union {
  struct { unsigned C:1; unsigned Z:1; unsigned OV:1; unsigned N:1; unsigned RA:1; unsigned IPL:3; unsigned DC:1; unsigned DA:1; unsigned SAB:1; unsigned OAB:1; unsigned SB:1; unsigned SA:1; unsigned OB:1; unsigned OA:1; };
  struct { unsigned :5; unsigned IPL0:1; unsigned IPL1:1; unsigned IPL2:1; };
} SRBITS;
extern volatile SRBITS SRbits DSPIC_SFR;
extern volatile unsigned int CORCON DSPIC_SFR; /* 0x0044 */
typedef union {
  struct { unsigned IF:1; unsigned RND:1; unsigned PSV:1; unsigned IPL3:1; unsigned ACCSAT:1; unsigned SATDW:1; unsigned SATB:1; unsigned SATA:1; unsigned DL:3; unsigned EDT:1; unsigned US:1; };
  struct { unsigned :8; unsigned DL0:1; unsigned DL1:1; unsigned DL2:1; };
} CORCONBITS;
extern volatile CORCONBITS CORCONbits DSPIC_SFR;
extern volatile unsigned int MODCON DSPIC_SFR; /* 0x0046 */
typedef union {
  struct { unsigned XWM:4; unsigned YWM:4; unsigned BWM:4; unsigned :2; unsigned YMODEN:1; unsigned XMODEN:1; };
  struct { unsigned XWM0:1; unsigned XWM1:1; unsigned XWM2:1; unsigned XWM3:1; unsigned YWM0:1; unsigned YWM1:1; unsigned YWM2:1; unsigned YWM3:1; unsigned BWM0:1; unsigned BWM1:1; unsigned BWM2:1; unsigned BWM3:1; };
} MODCONBITS;
extern volatile MODCONBITS MODCONbits DSPIC_SFR;
extern volatile unsigned int XMODSRT DSPIC_SFR; /* 0x0048 */
extern volatile unsigned int XMODEND DSPIC_SFR; /* 0x004A */
extern volatile unsigned int YMODSRT DSPIC_SFR; /* 0x004C */
extern volatile unsigned int YMODEND DSPIC_SFR; /* 0x004E */
extern volatile unsigned int XBREV DSPIC_SFR; /* 0x0050 */
typedef union {
  struct { unsigned XB:15; unsigned BREN:1; };
  struct { unsigned XB0:1; unsigned XB1:1; unsigned XB2:1; unsigned XB3:1; unsigned XB4:1; unsigned XB5:1; unsigned XB6:1; unsigned XB7:1; unsigned XB8:1; unsigned XB9:1; unsigned XB10:1; unsigned XB11:1; unsigned XB12:1; unsigned XB13:1; unsigned XB14:1; };
} XBREVBITS;
extern volatile XBREVBITS XBREVbits DSPIC_SFR;
extern volatile unsigned int DISICNT DSPIC_SFR; /* 0x0052 */
typedef union {
  struct { unsigned DISICNT:14; };
  struct { unsigned DISICNT0:1; unsigned DISICNT1:1; unsigned DISICNT2:1; unsigned DISICNT3:1; unsigned DISICNT4:1; unsigned DISICNT5:1; unsigned DISICNT6:1; unsigned DISICNT7:1; unsigned DISICNT8:1; unsigned DISICNT9:1; unsigned DISICNT10:1; unsigned DISICNT11:1; unsigned DISICNT12:1; unsigned DISICNT13:1; };
} DISICNTBITS;
extern volatile DISICNTBITS DISICNTbits DSPIC_SFR;
extern volatile unsigned int INTCON1 DSPIC_SFR; /* 0x0080 */
typedef struct { unsigned :1; unsigned OSCFAIL:1; unsigned STKERR:1; unsigned ADDRERR:1; unsigned MATHERR:1; unsigned :3; unsigned COVTE:1; unsigned OVBTE:1; unsigned OVATE:1; unsigned :4; unsigned NSTDIS:1; } INTCON1BITS;
extern volatile INTCON1BITS INTCON1bits DSPIC_SFR;
extern volatile unsigned int INTCON2 DSPIC_SFR; /* 0x0082 */
typedef struct { unsigned INT0EP:1; unsigned INT1EP:1; unsigned INT2EP:1; unsigned INT3EP:1; unsigned INT4EP:1; unsigned :9; unsigned DISI:1; unsigned ALTIVT:1; } INTCON2BITS;
extern volatile INTCON2BITS INTCON2bits DSPIC_SFR;
extern volatile unsigned int IFS0 DSPIC_SFR; /* 0x0084 */
typedef struct { unsigned INT0IF:1; unsigned IC1IF:1; unsigned OC1IF:1; unsigned T1IF:1; unsigned IC2IF:1; unsigned OC2IF:1; unsigned T2IF:1; unsigned T3IF:1; unsigned SPI1IF:1; unsigned U1RXIF:1; unsigned U1TXIF:1; unsigned ADIF:1; unsigned NVMIF:1; unsigned SI2CIF:1; unsigned MI2CIF:1; unsigned CNIF:1; } IFS0BITS;
extern volatile IFS0BITS IFS0bits DSPIC_SFR;
extern volatile unsigned int IFS1 DSPIC_SFR; /* 0x0086 */
typedef struct { unsigned INT1IF:1; unsigned IC7IF:1; unsigned IC8IF:1; unsigned OC3IF:1; unsigned OC4IF:1; unsigned T4IF:1; unsigned T5IF:1; unsigned INT2IF:1; unsigned U2RXIF:1; unsigned U2TXIF:1; unsigned SPI2IF:1; unsigned C1IF:1; unsigned IC3IF:1; unsigned IC4IF:1; unsigned IC5IF:1; unsigned IC6IF:1; } IFS1BITS;
extern volatile IFS1BITS IFS1bits DSPIC_SFR;
extern volatile unsigned int IFS2 DSPIC_SFR; /* 0x0088 */
typedef struct { unsigned OC5IF:1; unsigned OC6IF:1; unsigned OC7IF:1; unsigned OC8IF:1; unsigned INT3IF:1; unsigned INT4IF:1; unsigned C2IF:1; unsigned :2; unsigned DCIIF:1; unsigned LVDIF:1; } IFS2BITS;
extern volatile IFS2BITS IFS2bits DSPIC_SFR;
extern volatile unsigned int IEC0 DSPIC_SFR; /* 0x008C */
typedef struct { unsigned INT0IE:1; unsigned IC1IE:1; unsigned OC1IE:1; unsigned T1IE:1; unsigned IC2IE:1; unsigned OC2IE:1; unsigned T2IE:1; unsigned T3IE:1; unsigned SPI1IE:1; unsigned U1RXIE:1; unsigned U1TXIE:1; unsigned ADIE:1; unsigned NVMIE:1; unsigned SI2CIE:1; unsigned MI2CIE:1; unsigned CNIE:1; } IEC0BITS;
extern volatile IEC0BITS IEC0bits DSPIC_SFR;
extern volatile unsigned int IEC1 DSPIC_SFR; /* 0x008E */
typedef struct { unsigned INT1IE:1; unsigned IC7IE:1; unsigned IC8IE:1; unsigned OC3IE:1; unsigned OC4IE:1; unsigned T4IE:1; unsigned T5IE:1; unsigned INT2IE:1; unsigned U2RXIE:1; unsigned U2TXIE:1; unsigned SPI2IE:1; unsigned C1IE:1; unsigned IC3IE:1; unsigned IC4IE:1; unsigned IC5IE:1; unsigned IC6IE:1; } IEC1BITS;
extern volatile IEC1BITS IEC1bits DSPIC_SFR;
extern volatile unsigned int IEC2 DSPIC_SFR; /* 0x0090 */
typedef struct { unsigned OC5IE:1; unsigned OC6IE:1; unsigned OC7IE:1; unsigned OC8IE:1; unsigned INT3IE:1; unsigned INT4IE:1; unsigned C2IE:1; unsigned :2; unsigned DCIIE:1; unsigned LVDIE:1; } IEC2BITS;
extern volatile IEC2BITS IEC2bits DSPIC_SFR;
extern volatile unsigned int IPC0 DSPIC_SFR; /* 0x0094 */
typedef union {
  struct { unsigned INT0IP:3; unsigned :1; unsigned IC1IP:3; unsigned :1; unsigned OC1IP:3; unsigned :1; unsigned T1IP:3; };
  struct { unsigned INT0IP0:1; unsigned INT0IP1:1; unsigned INT0IP2:1; unsigned :1; unsigned IC1IP0:1; unsigned IC1IP1:1; unsigned IC1IP2:1; unsigned :1; unsigned OC1IP0:1; unsigned OC1IP1:1; unsigned OC1IP2:1; unsigned :1; unsigned T1IP0:1; unsigned T1IP1:1; unsigned T1IP2:1; };
} IPC0BITS;
extern volatile IPC0BITS IPC0bits DSPIC_SFR;
extern volatile unsigned int IPC1 DSPIC_SFR; /* 0x0096 */
typedef union {
  struct { unsigned IC2IP:3; unsigned :1; unsigned OC2IP:3; unsigned :1; unsigned T2IP:3; unsigned :1; unsigned T3IP:3; };
  struct { unsigned IC2IP0:1; unsigned IC2IP1:1; unsigned IC2IP2:1; unsigned :1; unsigned OC2IP0:1; unsigned OC2IP1:1; unsigned OC2IP2:1; unsigned :1; unsigned T2IP0:1; unsigned T2IP1:1; unsigned T2IP2:1; unsigned :1; unsigned T3IP0:1; unsigned T3IP1:1; unsigned T3IP2:1; };
} IPC1BITS;
extern volatile IPC1BITS IPC1bits DSPIC_SFR;
extern volatile unsigned int IPC2 DSPIC_SFR; /* 0x0098 */
typedef union {
  struct { unsigned SPI1IP:3; unsigned :1; unsigned U1RXIP:3; unsigned :1; unsigned U1TXIP:3; unsigned :1; unsigned ADIP:3; };
  struct { unsigned SPI1IP0:1; unsigned SPI1IP1:1; unsigned SPI1IP2:1; unsigned :1; unsigned U1RXIP0:1; unsigned U1RXIP1:1; unsigned U1RXIP2:1; unsigned :1; unsigned U1TXIP0:1; unsigned U1TXIP1:1; unsigned U1TXIP2:1; unsigned :1; unsigned ADIP0:1; unsigned ADIP1:1; unsigned ADIP2:1; };
} IPC2BITS;
extern volatile IPC2BITS IPC2bits DSPIC_SFR;
extern volatile unsigned int IPC3 DSPIC_SFR; /* 0x009A */
typedef union {
  struct { unsigned NVMIP:3; unsigned :1; unsigned SI2CIP:3; unsigned :1; unsigned MI2CIP:3; unsigned :1; unsigned CNIP:3; };
  struct { unsigned NVMIP0:1; unsigned NVMIP1:1; unsigned NVMIP2:1; unsigned :1; unsigned SI2CIP0:1; unsigned SI2CIP1:1; unsigned SI2CIP2:1; unsigned :1; unsigned MI2CIP0:1; unsigned MI2CIP1:1; unsigned MI2CIP2:1; unsigned :1; unsigned CNIP0:1; unsigned CNIP1:1; unsigned CNIP2:1; };
} IPC3BITS;
extern volatile IPC3BITS IPC3bits DSPIC_SFR;
extern volatile unsigned int IPC4 DSPIC_SFR; /* 0x009C */
typedef union {
  struct { unsigned INT1IP:3; unsigned :1; unsigned IC7IP:3; unsigned :1; unsigned IC8IP:3; unsigned :1; unsigned OC3IP:3; };
  struct { unsigned INT1IP0:1; unsigned INT1IP1:1; unsigned INT1IP2:1; unsigned :1; unsigned IC7IP0:1; unsigned IC7IP1:1; unsigned IC7IP2:1; unsigned :1; unsigned IC8IP0:1; unsigned IC8IP1:1; unsigned IC8IP2:1; unsigned :1; unsigned OC3IP0:1; unsigned OC3IP1:1; unsigned OC3IP2:1; };
} IPC4BITS;
extern volatile IPC4BITS IPC4bits DSPIC_SFR;
extern volatile unsigned int IPC5 DSPIC_SFR; /* 0x009E */
typedef union {
  struct { unsigned OC4IP:3; unsigned :1; unsigned T4IP:3; unsigned :1; unsigned T5IP:3; unsigned :1; unsigned INT2IP:3; };
  struct { unsigned OC4IP0:1; unsigned OC4IP1:1; unsigned OC4IP2:1; unsigned :1; unsigned T4IP0:1; unsigned T4IP1:1; unsigned T4IP2:1; unsigned :1; unsigned T5IP0:1; unsigned T5IP1:1; unsigned T5IP2:1; unsigned :1; unsigned INT2IP0:1; unsigned INT2IP1:1; unsigned INT2IP2:1; };
} IPC5BITS;
extern volatile IPC5BITS IPC5bits DSPIC_SFR;
extern volatile unsigned int IPC6 DSPIC_SFR; /* 0x00A0 */
typedef union {
  struct { unsigned U2RXIP:3; unsigned :1; unsigned U2TXIP:3; unsigned :1; unsigned SPI2IP:3; unsigned :1; unsigned C1IP:3; };
  struct { unsigned U2RXIP0:1; unsigned U2RXIP1:1; unsigned U2RXIP2:1; unsigned :1; unsigned U2TXIP0:1; unsigned U2TXIP1:1; unsigned U2TXIP2:1; unsigned :1; unsigned SPI2IP0:1; unsigned SPI2IP1:1; unsigned SPI2IP2:1; unsigned :1; unsigned C1IP0:1; unsigned C1IP1:1; unsigned C1IP2:1; };
} IPC6BITS;
extern volatile IPC6BITS IPC6bits DSPIC_SFR;
extern volatile unsigned int IPC7 DSPIC_SFR; /* 0x00A2 */
typedef union {
  struct { unsigned IC3IP:3; unsigned :1; unsigned IC4IP:3; unsigned :1; unsigned IC5IP:3; unsigned :1; unsigned IC6IP:3; };
  struct { unsigned IC3IP0:1; unsigned IC3IP1:1; unsigned IC3IP2:1; unsigned :1; unsigned IC4IP0:1; unsigned IC4IP1:1; unsigned IC4IP2:1; unsigned :1; unsigned IC5IP0:1; unsigned IC5IP1:1; unsigned IC5IP2:1; unsigned :1; unsigned IC6IP0:1; unsigned IC6IP1:1; unsigned IC6IP2:1; };
} IPC7BITS;
extern volatile IPC7BITS IPC7bits DSPIC_SFR;
extern volatile unsigned int IPC8 DSPIC_SFR; /* 0x00A4 */
typedef union {
  struct { unsigned OC5IP:3; unsigned :1; unsigned OC6IP:3; unsigned :1; unsigned OC7IP:3; unsigned :1; unsigned OC8IP:3; };
  struct { unsigned OC5IP0:1; unsigned OC5IP1:1; unsigned OC5IP2:1; unsigned :1; unsigned OC6IP0:1; unsigned OC6IP1:1; unsigned OC6IP2:1; unsigned :1; unsigned OC7IP0:1; unsigned OC7IP1:1; unsigned OC7IP2:1; unsigned :1; unsigned OC8IP0:1; unsigned OC8IP1:1; unsigned OC8IP2:1; };
} IPC8BITS;
extern volatile IPC8BITS IPC8bits DSPIC_SFR;
extern volatile unsigned int IPC9 DSPIC_SFR; /* 0x00A6 */
typedef union {
  struct { unsigned INT3IP:3; unsigned :1; unsigned INT4IP:3; unsigned :1; unsigned C2IP:3; };
  struct { unsigned INT3IP0:1; unsigned INT3IP1:1; unsigned INT3IP2:1; unsigned :1; unsigned INT4IP0:1; unsigned INT4IP1:1; unsigned INT4IP2:1; unsigned :1; unsigned C2IP0:1; unsigned C2IP1:1; unsigned C2IP2:1; };
} IPC9BITS;
extern volatile IPC9BITS IPC9bits DSPIC_SFR;
extern volatile unsigned int IPC10 DSPIC_SFR; /* 0x00A8 */
typedef union {
  struct { unsigned :4; unsigned DCIIP:3; unsigned :1; unsigned LVDIP:3; };
  struct { unsigned :4; unsigned DCIIP0:1; unsigned DCIIP1:1; unsigned DCIIP2:1; unsigned :1; unsigned LVDIP0:1; unsigned LVDIP1:1; unsigned LVDIP2:1; };
} IPC10BITS;
extern volatile IPC10BITS IPC10bits DSPIC_SFR;
extern volatile unsigned int INTTREG DSPIC_SFR; /* 0x00B0 */
typedef union {
  struct { unsigned VECNUM:6; unsigned :2; unsigned ILR:4; unsigned :1; unsigned VHOLD:1; unsigned TMODE:1; unsigned IRQTOCPU:1; };
  struct { unsigned VECNUM0:1; unsigned VECNUM1:1; unsigned VECNUM2:1; unsigned VECNUM3:1; unsigned VECNUM4:1; unsigned VECNUM5:1; unsigned :2; unsigned ILR0:1; unsigned ILR1:1; unsigned ILR2:1; unsigned ILR3:1; };
} INTTREGBITS;
extern volatile INTTREGBITS INTTREGbits DSPIC_SFR;
extern volatile unsigned int CNEN1 DSPIC_SFR; /* 0x00C0 */
typedef struct { unsigned CN0IE:1; unsigned CN1IE:1; unsigned CN2IE:1; unsigned CN3IE:1; unsigned CN4IE:1; unsigned CN5IE:1; unsigned CN6IE:1; unsigned CN7IE:1; unsigned CN8IE:1; unsigned CN9IE:1; unsigned CN10IE:1; unsigned CN11IE:1; unsigned CN12IE:1; unsigned CN13IE:1; unsigned CN14IE:1; unsigned CN15IE:1; } CNEN1BITS;
extern volatile CNEN1BITS CNEN1bits DSPIC_SFR;
extern volatile unsigned int CNEN2 DSPIC_SFR; /* 0x00C2 */
typedef struct { unsigned CN16IE:1; unsigned CN17IE:1; unsigned CN18IE:1; unsigned CN19IE:1; unsigned CN20IE:1; unsigned CN21IE:1; unsigned CN22IE:1; unsigned CN23IE:1; } CNEN2BITS;
extern volatile CNEN2BITS CNEN2bits DSPIC_SFR;
extern volatile unsigned int CNPU1 DSPIC_SFR; /* 0x00C4 */
typedef struct { unsigned CN0PUE:1; unsigned CN1PUE:1; unsigned CN2PUE:1; unsigned CN3PUE:1; unsigned CN4PUE:1; unsigned CN5PUE:1; unsigned CN6PUE:1; unsigned CN7PUE:1; unsigned CN8PUE:1; unsigned CN9PUE:1; unsigned CN10PUE:1; unsigned CN11PUE:1; unsigned CN12PUE:1; unsigned CN13PUE:1; unsigned CN14PUE:1; unsigned CN15PUE:1; } CNPU1BITS;
extern volatile CNPU1BITS CNPU1bits DSPIC_SFR;
extern volatile unsigned int CNPU2 DSPIC_SFR; /* 0x00C6 */
typedef struct { unsigned CN16PUE:1; unsigned CN17PUE:1; unsigned CN18PUE:1; unsigned CN19PUE:1; unsigned CN20PUE:1; unsigned CN21PUE:1; unsigned CN22PUE:1; unsigned CN23PUE:1; } CNPU2BITS;
extern volatile CNPU2BITS CNPU2bits DSPIC_SFR;
extern volatile unsigned int TMR1 DSPIC_SFR; /* 0x0100 */
extern volatile unsigned int PR1 DSPIC_SFR; /* 0x0102 */
extern volatile unsigned int T1CON DSPIC_SFR; /* 0x0104 */
typedef union {
  struct { unsigned :1; unsigned TCS:1; unsigned TSYNC:1; unsigned :1; unsigned TCKPS:2; unsigned TGATE:1; unsigned :6; unsigned TSIDL:1; unsigned :1; unsigned TON:1; };
  struct { unsigned :4; unsigned TCKPS0:1; unsigned TCKPS1:1; };
} T1CONBITS;
extern volatile T1CONBITS T1CONbits DSPIC_SFR;
extern volatile unsigned int TMR2 DSPIC_SFR; /* 0x0106 */
extern volatile unsigned int TMR3HLD DSPIC_SFR; /* 0x0108 */
extern volatile unsigned int TMR3 DSPIC_SFR; /* 0x010A */
extern volatile unsigned int PR2 DSPIC_SFR; /* 0x010C */
extern volatile unsigned int PR3 DSPIC_SFR; /* 0x010E */
extern volatile unsigned int T2CON DSPIC_SFR; /* 0x0110 */
typedef union {
  struct { unsigned :1; unsigned TCS:1; unsigned :1; unsigned T32:1; unsigned TCKPS:2; unsigned TGATE:1; unsigned :6; unsigned TSIDL:1; unsigned :1; unsigned TON:1; };
  struct { unsigned :4; unsigned TCKPS0:1; unsigned TCKPS1:1; };
} T2CONBITS;
extern volatile T2CONBITS T2CONbits DSPIC_SFR;
extern volatile unsigned int T3CON DSPIC_SFR; /* 0x0112 */
typedef union {
  struct { unsigned :1; unsigned TCS:1; unsigned :2; unsigned TCKPS:2; unsigned TGATE:1; unsigned :6; unsigned TSIDL:1; unsigned :1; unsigned TON:1; };
  struct { unsigned :4; unsigned TCKPS0:1; unsigned TCKPS1:1; };
} T3CONBITS;
extern volatile T3CONBITS T3CONbits DSPIC_SFR;
extern volatile unsigned int TMR4 DSPIC_SFR; /* 0x0114 */
extern volatile unsigned int TMR5HLD DSPIC_SFR; /* 0x0116 */
extern volatile unsigned int TMR5 DSPIC_SFR; /* 0x0118 */
extern volatile unsigned int PR4 DSPIC_SFR; /* 0x011A */
extern volatile unsigned int PR5 DSPIC_SFR; /* 0x011C */
extern volatile unsigned int T4CON DSPIC_SFR; /* 0x011E */
typedef union {
  struct { unsigned :1; unsigned TCS:1; unsigned :1; unsigned T32:1; unsigned TCKPS:2; unsigned TGATE:1; unsigned :6; unsigned TSIDL:1; unsigned :1; unsigned TON:1; };
  struct { unsigned :4; unsigned TCKPS0:1; unsigned TCKPS1:1; };
} T4CONBITS;
extern volatile T4CONBITS T4CONbits DSPIC_SFR;
extern volatile unsigned int T5CON DSPIC_SFR; /* 0x0120 */
typedef union {
  struct { unsigned :1; unsigned TCS:1; unsigned :2; unsigned TCKPS:2; unsigned TGATE:1; unsigned :6; unsigned TSIDL:1; unsigned :1; unsigned TON:1; };
  struct { unsigned :4; unsigned TCKPS0:1; unsigned TCKPS1:1; };
} T5CONBITS;
extern volatile T5CONBITS T5CONbits DSPIC_SFR;
extern volatile unsigned int IC1BUF DSPIC_SFR; /* 0x0140 */
extern volatile unsigned int IC1CON DSPIC_SFR; /* 0x0142 */
typedef union {
  struct { unsigned ICM:3; unsigned ICBNE:1; unsigned ICOV:1; unsigned ICI:2; unsigned ICTMR:1; unsigned :5; unsigned ICSIDL:1; };
  struct { unsigned ICM0:1; unsigned ICM1:1; unsigned ICM2:1; unsigned :2; unsigned ICI0:1; unsigned ICI1:1; };
} IC1CONBITS;
extern volatile IC1CONBITS IC1CONbits DSPIC_SFR;
extern volatile unsigned int IC2BUF DSPIC_SFR; /* 0x0144 */
extern volatile unsigned int IC2CON DSPIC_SFR; /* 0x0146 */
typedef union {
  struct { unsigned ICM:3; unsigned ICBNE:1; unsigned ICOV:1; unsigned ICI:2; unsigned ICTMR:1; unsigned :5; unsigned ICSIDL:1; };
  struct { unsigned ICM0:1; unsigned ICM1:1; unsigned ICM2:1; unsigned :2; unsigned ICI0:1; unsigned ICI1:1; };
} IC2CONBITS;
extern volatile IC2CONBITS IC2CONbits DSPIC_SFR;
extern volatile unsigned int IC3BUF DSPIC_SFR; /* 0x0148 */
extern volatile unsigned int IC3CON DSPIC_SFR; /* 0x014A */
typedef union {
  struct { unsigned ICM:3; unsigned ICBNE:1; unsigned ICOV:1; unsigned ICI:2; unsigned ICTMR:1; unsigned :5; unsigned ICSIDL:1; };
  struct { unsigned ICM0:1; unsigned ICM1:1; unsigned ICM2:1; unsigned :2; unsigned ICI0:1; unsigned ICI1:1; };
} IC3CONBITS;
extern volatile IC3CONBITS IC3CONbits DSPIC_SFR;
extern volatile unsigned int IC4BUF DSPIC_SFR; /* 0x014C */
extern volatile unsigned int IC4CON DSPIC_SFR; /* 0x014E */
typedef union {
  struct { unsigned ICM:3; unsigned ICBNE:1; unsigned ICOV:1; unsigned ICI:2; unsigned ICTMR:1; unsigned :5; unsigned ICSIDL:1; };
  struct { unsigned ICM0:1; unsigned ICM1:1; unsigned ICM2:1; unsigned :2; unsigned ICI0:1; unsigned ICI1:1; };
} IC4CONBITS;
extern volatile IC4CONBITS IC4CONbits DSPIC_SFR;
extern volatile unsigned int IC5BUF DSPIC_SFR; /* 0x0150 */
extern volatile unsigned int IC5CON DSPIC_SFR; /* 0x0152 */
typedef union {
  struct { unsigned ICM:3; unsigned ICBNE:1; unsigned ICOV:1; unsigned ICI:2; unsigned ICTMR:1; unsigned :5; unsigned ICSIDL:1; };
  struct { unsigned ICM0:1; unsigned ICM1:1; unsigned ICM2:1; unsigned :2; unsigned ICI0:1; unsigned ICI1:1; };
} IC5CONBITS;
extern volatile IC5CONBITS IC5CONbits DSPIC_SFR;
extern volatile unsigned int IC6BUF DSPIC_SFR; /* 0x0154 */
extern volatile unsigned int IC6CON DSPIC_SFR; /* 0x0156 */
typedef union {
  struct { unsigned ICM:3; unsigned ICBNE:1; unsigned ICOV:1; unsigned ICI:2; unsigned ICTMR:1; unsigned :5; unsigned ICSIDL:1; };
  struct { unsigned ICM0:1; unsigned ICM1:1; unsigned ICM2:1; unsigned :2; unsigned ICI0:1; unsigned ICI1:1; };
} IC6CONBITS;
extern volatile IC6CONBITS IC6CONbits DSPIC_SFR;
extern volatile unsigned int IC7BUF DSPIC_SFR; /* 0x0158 */
extern volatile unsigned int IC7CON DSPIC_SFR; /* 0x015A */
typedef union {
  struct { unsigned ICM:3; unsigned ICBNE:1; unsigned ICOV:1; unsigned ICI:2; unsigned ICTMR:1; unsigned :5; unsigned ICSIDL:1; };
  struct { unsigned ICM0:1; unsigned ICM1:1; unsigned ICM2:1; unsigned :2; unsigned ICI0:1; unsigned ICI1:1; };
} IC7CONBITS;
extern volatile IC7CONBITS IC7CONbits DSPIC_SFR;
extern volatile unsigned int IC8BUF DSPIC_SFR; /* 0x015C */
extern volatile unsigned int IC8CON DSPIC_SFR; /* 0x015E */
typedef union {
  struct { unsigned ICM:3; unsigned ICBNE:1; unsigned ICOV:1; unsigned ICI:2; unsigned ICTMR:1; unsigned :5; unsigned ICSIDL:1; };
  struct { unsigned ICM0:1; unsigned ICM1:1; unsigned ICM2:1; unsigned :2; unsigned ICI0:1; unsigned ICI1:1; };
} IC8CONBITS;
extern volatile IC8CONBITS IC8CONbits DSPIC_SFR;
extern volatile unsigned int OC1RS DSPIC_SFR; /* 0x0180 */
extern volatile unsigned int OC1R DSPIC_SFR; /* 0x0182 */
extern volatile unsigned int OC1CON DSPIC_SFR; /* 0x0184 */
typedef union {
  struct { unsigned OCM:3; unsigned OCTSEL:1; unsigned OCFLT:1; unsigned :8; unsigned OCSIDL:1; };
  struct { unsigned OCM0:1; unsigned OCM1:1; unsigned OCM2:1; };
} OC1CONBITS;
extern volatile OC1CONBITS OC1CONbits DSPIC_SFR;
extern volatile unsigned int OC2RS DSPIC_SFR; /* 0x0186 */
extern volatile unsigned int OC2R DSPIC_SFR; /* 0x0188 */
extern volatile unsigned int OC2CON DSPIC_SFR; /* 0x018A */
typedef union {
  struct { unsigned OCM:3; unsigned OCTSEL:1; unsigned OCFLT:1; unsigned :8; unsigned OCSIDL:1; };
  struct { unsigned OCM0:1; unsigned OCM1:1; unsigned OCM2:1; };
} OC2CONBITS;
extern volatile OC2CONBITS OC2CONbits DSPIC_SFR;
extern volatile unsigned int OC3RS DSPIC_SFR; /* 0x018C */
extern volatile unsigned int OC3R DSPIC_SFR; /* 0x018E */
extern volatile unsigned int OC3CON DSPIC_SFR; /* 0x0190 */
typedef union {
  struct { unsigned OCM:3; unsigned OCTSEL:1; unsigned OCFLT:1; unsigned :8; unsigned OCSIDL:1; };
  struct { unsigned OCM0:1; unsigned OCM1:1; unsigned OCM2:1; };
} OC3CONBITS;
extern volatile OC3CONBITS OC3CONbits DSPIC_SFR;
extern volatile unsigned int OC4RS DSPIC_SFR; /* 0x0192 */
extern volatile unsigned int OC4R DSPIC_SFR; /* 0x0194 */
extern volatile unsigned int OC4CON DSPIC_SFR; /* 0x0196 */
typedef union {
  struct { unsigned OCM:3; unsigned OCTSEL:1; unsigned OCFLT:1; unsigned :8; unsigned OCSIDL:1; };
  struct { unsigned OCM0:1; unsigned OCM1:1; unsigned OCM2:1; };
} OC4CONBITS;
extern volatile OC4CONBITS OC4CONbits DSPIC_SFR;
extern volatile unsigned int OC5RS DSPIC_SFR; /* 0x0198 */
extern volatile unsigned int OC5R DSPIC_SFR; /* 0x019A */
extern volatile unsigned int OC5CON DSPIC_SFR; /* 0x019C */
typedef union {
  struct { unsigned OCM:3; unsigned OCTSEL:1; unsigned OCFLT:1; unsigned :8; unsigned OCSIDL:1; };
  struct { unsigned OCM0:1; unsigned OCM1:1; unsigned OCM2:1; };
} OC5CONBITS;
extern volatile OC5CONBITS OC5CONbits DSPIC_SFR;
extern volatile unsigned int OC6RS DSPIC_SFR; /* 0x019E */
extern volatile unsigned int OC6R DSPIC_SFR; /* 0x01A0 */
extern volatile unsigned int OC6CON DSPIC_SFR; /* 0x01A2 */
typedef union {
  struct { unsigned OCM:3; unsigned OCTSEL:1; unsigned OCFLT:1; unsigned :8; unsigned OCSIDL:1; };
  struct { unsigned OCM0:1; unsigned OCM1:1; unsigned OCM2:1; };
} OC6CONBITS;
extern volatile OC6CONBITS OC6CONbits DSPIC_SFR;
extern volatile unsigned int OC7RS DSPIC_SFR; /* 0x01A4 */
extern volatile unsigned int OC7R DSPIC_SFR; /* 0x01A6 */
extern volatile unsigned int OC7CON DSPIC_SFR; /* 0x01A8 */
typedef union {
  struct { unsigned OCM:3; unsigned OCTSEL:1; unsigned OCFLT:1; unsigned :8; unsigned OCSIDL:1; };
  struct { unsigned OCM0:1; unsigned OCM1:1; unsigned OCM2:1; };
} OC7CONBITS;
extern volatile OC7CONBITS OC7CONbits DSPIC_SFR;
extern volatile unsigned int OC8RS DSPIC_SFR; /* 0x01AA */
extern volatile unsigned int OC8R DSPIC_SFR; /* 0x01AC */
extern volatile unsigned int OC8CON DSPIC_SFR; /* 0x01AE */
typedef union {
  struct { unsigned OCM:3; unsigned OCTSEL:1; unsigned OCFLT:1; unsigned :8; unsigned OCSIDL:1; };
  struct { unsigned OCM0:1; unsigned OCM1:1; unsigned OCM2:1; };
} OC8CONBITS;
extern volatile OC8CONBITS OC8CONbits DSPIC_SFR;
extern volatile unsigned int I2CRCV DSPIC_SFR; /* 0x0200 */
typedef union {
  struct { unsigned I2CRCV:8; };
  struct { unsigned I2CRCV0:1; unsigned I2CRCV1:1; unsigned I2CRCV2:1; unsigned I2CRCV3:1; unsigned I2CRCV4:1; unsigned I2CRCV5:1; unsigned I2CRCV6:1; unsigned I2CRCV7:1; };
} I2CRCVBITS;
extern volatile I2CRCVBITS I2CRCVbits DSPIC_SFR;
extern volatile unsigned int I2CTRN DSPIC_SFR; /* 0x0202 */
typedef union {
  struct { unsigned I2CTRN:8; };
  struct { unsigned I2CTRN0:1; unsigned I2CTRN1:1; unsigned I2CTRN2:1; unsigned I2CTRN3:1; unsigned I2CTRN4:1; unsigned I2CTRN5:1; unsigned I2CTRN6:1; unsigned I2CTRN7:1; };
} I2CTRNBITS;
extern volatile I2CTRNBITS I2CTRNbits DSPIC_SFR;
extern volatile unsigned int I2CBRG DSPIC_SFR; /* 0x0204 */
typedef union {
  struct { unsigned I2CBRG:9; };
  struct { unsigned I2CBRG0:1; unsigned I2CBRG1:1; unsigned I2CBRG2:1; unsigned I2CBRG3:1; unsigned I2CBRG4:1; unsigned I2CBRG5:1; unsigned I2CBRG6:1; unsigned I2CBRG7:1; unsigned I2CBRG8:1; };
} I2CBRGBITS;
extern volatile I2CBRGBITS I2CBRGbits DSPIC_SFR;
extern volatile unsigned int I2CCON DSPIC_SFR; /* 0x0206 */
typedef struct { unsigned SEN:1; unsigned RSEN:1; unsigned PEN:1; unsigned RCEN:1; unsigned ACKEN:1; unsigned ACKDT:1; unsigned STREN:1; unsigned GCEN:1; unsigned SMEN:1; unsigned DISSLW:1; unsigned A10M:1; unsigned IPMIEN:1; unsigned SCLREL:1; unsigned I2CSIDL:1; unsigned :1; unsigned I2CEN:1; } I2CCONBITS;
extern volatile I2CCONBITS I2CCONbits DSPIC_SFR;
extern volatile unsigned int I2CSTAT DSPIC_SFR; /* 0x0208 */
typedef union {
  struct { unsigned TBF:1; unsigned RBF:1; unsigned R_NOT_W:1; unsigned S:1; unsigned P:1; unsigned D_NOT_A:1; unsigned I2COV:1; unsigned IWCOL:1; unsigned ADD10:1; unsigned GCSTAT:1; unsigned BCL:1; unsigned :3; unsigned TRSTAT:1; unsigned ACKSTAT:1; };
  struct { unsigned :2; unsigned R_W:1; unsigned :2; unsigned D_A:1; };
} I2CSTATBITS;
extern volatile I2CSTATBITS I2CSTATbits DSPIC_SFR;
extern volatile unsigned int I2CADD DSPIC_SFR; /* 0x020A */
typedef union {
  struct { unsigned I2CADD:10; };
  struct { unsigned I2CADD0:1; unsigned I2CADD1:1; unsigned I2CADD2:1; unsigned I2CADD3:1; unsigned I2CADD4:1; unsigned I2CADD5:1; unsigned I2CADD6:1; unsigned I2CADD7:1; unsigned I2CADD8:1; unsigned I2CADD9:1; };
} I2CADDBITS;
extern volatile I2CADDBITS I2CADDbits DSPIC_SFR;
extern volatile unsigned int U1MODE DSPIC_SFR; /* 0x020C */
typedef union {
  struct { unsigned STSEL:1; unsigned PDSEL:2; unsigned :2; unsigned ABAUD:1; unsigned LPBACK:1; unsigned WAKE:1; unsigned :2; unsigned ALTIO:1; unsigned :2; unsigned USIDL:1; unsigned :1; unsigned UARTEN:1; };
  struct { unsigned :1; unsigned PDSEL0:1; unsigned PDSEL1:1; };
} U1MODEBITS;
extern volatile U1MODEBITS U1MODEbits DSPIC_SFR;
extern volatile unsigned int U1STA DSPIC_SFR; /* 0x020E */
typedef union {
  struct { unsigned URXDA:1; unsigned OERR:1; unsigned FERR:1; unsigned PERR:1; unsigned RIDLE:1; unsigned ADDEN:1; unsigned URXISEL:2; unsigned TRMT:1; unsigned UTXBF:1; unsigned UTXEN:1; unsigned UTXBRK:1; unsigned :3; unsigned UTXISEL:1; };
  struct { unsigned :6; unsigned URXISEL0:1; unsigned URXISEL1:1; };
} U1STABITS;
extern volatile U1STABITS U1STAbits DSPIC_SFR;
extern volatile unsigned int U1TXREG DSPIC_SFR; /* 0x0210 */
typedef union {
  struct { unsigned UTXREG0:1; unsigned UTXREG1:1; unsigned UTXREG2:1; unsigned UTXREG3:1; unsigned UTXREG4:1; unsigned UTXREG5:1; unsigned UTXREG6:1; unsigned UTXREG7:1; unsigned UTXREG8:1; };
  struct { unsigned :8; unsigned UTX8:1; };
} U1TXREGBITS;
extern volatile U1TXREGBITS U1TXREGbits DSPIC_SFR;
extern volatile unsigned int U1RXREG DSPIC_SFR; /* 0x0212 */
typedef union {
  struct { unsigned URXREG0:1; unsigned URXREG1:1; unsigned URXREG2:1; unsigned URXREG3:1; unsigned URXREG4:1; unsigned URXREG5:1; unsigned URXREG6:1; unsigned URXREG7:1; unsigned URXREG8:1; };
  struct { unsigned :8; unsigned URX8:1; };
} U1RXREGBITS;
extern volatile U1RXREGBITS U1RXREGbits DSPIC_SFR;
extern volatile unsigned int U1BRG DSPIC_SFR; /* 0x0214 */
extern volatile unsigned int U2MODE DSPIC_SFR; /* 0x0216 */
typedef union {
  struct { unsigned STSEL:1; unsigned PDSEL:2; unsigned :2; unsigned ABAUD:1; unsigned LPBACK:1; unsigned WAKE:1; unsigned :5; unsigned USIDL:1; unsigned :1; unsigned UARTEN:1; };
  struct { unsigned :1; unsigned PDSEL0:1; unsigned PDSEL1:1; };
} U2MODEBITS;
extern volatile U2MODEBITS U2MODEbits DSPIC_SFR;
extern volatile unsigned int U2STA DSPIC_SFR; /* 0x0218 */
typedef union {
  struct { unsigned URXDA:1; unsigned OERR:1; unsigned FERR:1; unsigned PERR:1; unsigned RIDLE:1; unsigned ADDEN:1; unsigned URXISEL:2; unsigned TRMT:1; unsigned UTXBF:1; unsigned UTXEN:1; unsigned UTXBRK:1; unsigned :3; unsigned UTXISEL:1; };
  struct { unsigned :6; unsigned URXISEL0:1; unsigned URXISEL1:1; };
} U2STABITS;
extern volatile U2STABITS U2STAbits DSPIC_SFR;
extern volatile unsigned int U2TXREG DSPIC_SFR; /* 0x021A */
typedef union {
  struct { unsigned UTXREG0:1; unsigned UTXREG1:1; unsigned UTXREG2:1; unsigned UTXREG3:1; unsigned UTXREG4:1; unsigned UTXREG5:1; unsigned UTXREG6:1; unsigned UTXREG7:1; unsigned UTXREG8:1; };
  struct { unsigned :8; unsigned UTX8:1; };
} U2TXREGBITS;
extern volatile U2TXREGBITS U2TXREGbits DSPIC_SFR;
extern volatile unsigned int U2RXREG DSPIC_SFR; /* 0x021C */
typedef union {
  struct { unsigned URXREG0:1; unsigned URXREG1:1; unsigned URXREG2:1; unsigned URXREG3:1; unsigned URXREG4:1; unsigned URXREG5:1; unsigned URXREG6:1; unsigned URXREG7:1; unsigned URXREG8:1; };
  struct { unsigned :8; unsigned URX8:1; };
} U2RXREGBITS;
extern volatile U2RXREGBITS U2RXREGbits DSPIC_SFR;
extern volatile unsigned int U2BRG DSPIC_SFR; /* 0x021E */
extern volatile unsigned int SPI1STAT DSPIC_SFR; /* 0x0220 */
typedef struct { unsigned SPIRBF:1; unsigned SPITBF:1; unsigned :4; unsigned SPIROV:1; unsigned :6; unsigned SPISIDL:1; unsigned :1; unsigned SPIEN:1; } SPI1STATBITS;
extern volatile SPI1STATBITS SPI1STATbits DSPIC_SFR;
extern volatile unsigned int SPI1CON DSPIC_SFR; /* 0x0222 */
typedef union {
  struct { unsigned PPRE:2; unsigned SPRE:3; unsigned MSTEN:1; unsigned CKP:1; unsigned SSEN:1; unsigned CKE:1; unsigned SMP:1; unsigned MODE16:1; unsigned DISSDO:1; unsigned :1; unsigned SPIFSD:1; unsigned FRMEN:1; };
  struct { unsigned PPRE0:1; unsigned PPRE1:1; unsigned SPRE0:1; unsigned SPRE1:1; unsigned SPRE2:1; };
} SPI1CONBITS;
extern volatile SPI1CONBITS SPI1CONbits DSPIC_SFR;
extern volatile unsigned int SPI1BUF DSPIC_SFR; /* 0x0224 */
extern volatile unsigned int SPI2STAT DSPIC_SFR; /* 0x0226 */
typedef struct { unsigned SPIRBF:1; unsigned SPITBF:1; unsigned :4; unsigned SPIROV:1; unsigned :6; unsigned SPISIDL:1; unsigned :1; unsigned SPIEN:1; } SPI2STATBITS;
extern volatile SPI2STATBITS SPI2STATbits DSPIC_SFR;
extern volatile unsigned int SPI2CON DSPIC_SFR; /* 0x0228 */
typedef union {
  struct { unsigned PPRE:2; unsigned SPRE:3; unsigned MSTEN:1; unsigned CKP:1; unsigned SSEN:1; unsigned CKE:1; unsigned SMP:1; unsigned MODE16:1; unsigned DISSDO:1; unsigned :1; unsigned SPIFSD:1; unsigned FRMEN:1; };
  struct { unsigned PPRE0:1; unsigned PPRE1:1; unsigned SPRE0:1; unsigned SPRE1:1; unsigned SPRE2:1; };
} SPI2CONBITS;
extern volatile SPI2CONBITS SPI2CONbits DSPIC_SFR;
extern volatile unsigned int SPI2BUF DSPIC_SFR; /* 0x022A */
extern volatile unsigned int DCICON1 DSPIC_SFR; /* 0x0240 */
typedef union {
  struct { unsigned COFSM:2; unsigned :3; unsigned DJST:1; unsigned CSDOM:1; unsigned UNFM:1; unsigned COFSD:1; unsigned CSCKE:1; unsigned CSCKD:1; unsigned DLOOP:1; unsigned :1; unsigned DCISIDL:1; unsigned :1; unsigned DCIEN:1; };
  struct { unsigned COFSM0:1; unsigned COFSM1:1; };
} DCICON1BITS;
extern volatile DCICON1BITS DCICON1bits DSPIC_SFR;
extern volatile unsigned int DCICON2 DSPIC_SFR; /* 0x0242 */
typedef union {
  struct { unsigned WS:4; unsigned :1; unsigned COFSG:4; unsigned :1; unsigned BLEN:2; };
  struct { unsigned WS0:1; unsigned WS1:1; unsigned WS2:1; unsigned WS3:1; unsigned :1; unsigned COFSG0:1; unsigned COFSG1:1; unsigned COFSG2:1; unsigned COFSG3:1; unsigned :1; unsigned BLEN0:1; unsigned BLEN1:1; };
} DCICON2BITS;
extern volatile DCICON2BITS DCICON2bits DSPIC_SFR;
extern volatile unsigned int DCICON3 DSPIC_SFR; /* 0x0244 */
typedef union {
  struct { unsigned BCG:12; };
  struct { unsigned BCG0:1; unsigned BCG1:1; unsigned BCG2:1; unsigned BCG3:1; unsigned BCG4:1; unsigned BCG5:1; unsigned BCG6:1; unsigned BCG7:1; unsigned BCG8:1; unsigned BCG9:1; unsigned BCG10:1; unsigned BCG11:1; };
} DCICON3BITS;
extern volatile DCICON3BITS DCICON3bits DSPIC_SFR;
extern volatile unsigned int DCISTAT DSPIC_SFR; /* 0x0246 */
typedef union {
  struct { unsigned TMPTY:1; unsigned TUNF:1; unsigned RFUL:1; unsigned ROV:1; unsigned :4; unsigned SLOT:4; };
  struct { unsigned :8; unsigned SLOT0:1; unsigned SLOT1:1; unsigned SLOT2:1; unsigned SLOT3:1; };
} DCISTATBITS;
extern volatile DCISTATBITS DCISTATbits DSPIC_SFR;
extern volatile unsigned int TSCON DSPIC_SFR; /* 0x0248 */
typedef struct { unsigned TSE0:1; unsigned TSE1:1; unsigned TSE2:1; unsigned TSE3:1; unsigned TSE4:1; unsigned TSE5:1; unsigned TSE6:1; unsigned TSE7:1; unsigned TSE8:1; unsigned TSE9:1; unsigned TSE10:1; unsigned TSE11:1; unsigned TSE12:1; unsigned TSE13:1; unsigned TSE14:1; unsigned TSE15:1; } TSCONBITS;
extern volatile TSCONBITS TSCONbits DSPIC_SFR;
extern volatile unsigned int RSCON DSPIC_SFR; /* 0x024C */
typedef struct { unsigned RSE0:1; unsigned RSE1:1; unsigned RSE2:1; unsigned RSE3:1; unsigned RSE4:1; unsigned RSE5:1; unsigned RSE6:1; unsigned RSE7:1; unsigned RSE8:1; unsigned RSE9:1; unsigned RSE10:1; unsigned RSE11:1; unsigned RSE12:1; unsigned RSE13:1; unsigned RSE14:1; unsigned RSE15:1; } RSCONBITS;
extern volatile RSCONBITS RSCONbits DSPIC_SFR;
extern volatile unsigned int RXBUF0 DSPIC_SFR; /* 0x0250 */
extern volatile unsigned int RXBUF1 DSPIC_SFR; /* 0x0252 */
extern volatile unsigned int RXBUF2 DSPIC_SFR; /* 0x0254 */
extern volatile unsigned int RXBUF3 DSPIC_SFR; /* 0x0256 */
extern volatile unsigned int TXBUF0 DSPIC_SFR; /* 0x0258 */
extern volatile unsigned int TXBUF1 DSPIC_SFR; /* 0x025A */
extern volatile unsigned int TXBUF2 DSPIC_SFR; /* 0x025C */
extern volatile unsigned int TXBUF3 DSPIC_SFR; /* 0x025E */
extern volatile unsigned int ADCBUF0 DSPIC_SFR; /* 0x0280 */
extern volatile unsigned int ADCBUF1 DSPIC_SFR; /* 0x0282 */
extern volatile unsigned int ADCBUF2 DSPIC_SFR; /* 0x0284 */
extern volatile unsigned int ADCBUF3 DSPIC_SFR; /* 0x0286 */
extern volatile unsigned int ADCBUF4 DSPIC_SFR; /* 0x0288 */
extern volatile unsigned int ADCBUF5 DSPIC_SFR; /* 0x028A */
extern volatile unsigned int ADCBUF6 DSPIC_SFR; /* 0x028C */
extern volatile unsigned int ADCBUF7 DSPIC_SFR; /* 0x028E */
extern volatile unsigned int ADCBUF8 DSPIC_SFR; /* 0x0290 */
extern volatile unsigned int ADCBUF9 DSPIC_SFR; /* 0x0292 */
extern volatile unsigned int ADCBUFA DSPIC_SFR; /* 0x0294 */
extern volatile unsigned int ADCBUFB DSPIC_SFR; /* 0x0296 */
extern volatile unsigned int ADCBUFC DSPIC_SFR; /* 0x0298 */
extern volatile unsigned int ADCBUFD DSPIC_SFR; /* 0x029A */
extern volatile unsigned int ADCBUFE DSPIC_SFR; /* 0x029C */
extern volatile unsigned int ADCBUFF DSPIC_SFR; /* 0x029E */
extern volatile unsigned int ADCON1 DSPIC_SFR; /* 0x02A0 */
typedef union {
  struct { unsigned DONE:1; unsigned SAMP:1; unsigned ASAM:1; unsigned :2; unsigned SSRC:3; unsigned FORM:2; unsigned :3; unsigned ADSIDL:1; unsigned :1; unsigned ADON:1; };
  struct { unsigned :5; unsigned SSRC0:1; unsigned SSRC1:1; unsigned SSRC2:1; unsigned FORM0:1; unsigned FORM1:1; };
} ADCON1BITS;
extern volatile ADCON1BITS ADCON1bits DSPIC_SFR;
extern volatile unsigned int ADCON2 DSPIC_SFR; /* 0x02A2 */
typedef union {
  struct { unsigned ALTS:1; unsigned BUFM:1; unsigned SMPI:4; unsigned :1; unsigned BUFS:1; unsigned :2; unsigned CSCNA:1; unsigned :2; unsigned VCFG:3; };
  struct { unsigned :2; unsigned SMPI0:1; unsigned SMPI1:1; unsigned SMPI2:1; unsigned SMPI3:1; unsigned :7; unsigned VCFG0:1; unsigned VCFG1:1; unsigned VCFG2:1; };
} ADCON2BITS;
extern volatile ADCON2BITS ADCON2bits DSPIC_SFR;
extern volatile unsigned int ADCON3 DSPIC_SFR; /* 0x02A4 */
typedef union {
  struct { unsigned ADCS:6; unsigned :1; unsigned ADRC:1; unsigned SAMC:5; };
  struct { unsigned ADCS0:1; unsigned ADCS1:1; unsigned ADCS2:1; unsigned ADCS3:1; unsigned ADCS4:1; unsigned ADCS5:1; unsigned :2; unsigned SAMC0:1; unsigned SAMC1:1; unsigned SAMC2:1; unsigned SAMC3:1; unsigned SAMC4:1; };
} ADCON3BITS;
extern volatile ADCON3BITS ADCON3bits DSPIC_SFR;
extern volatile unsigned int ADCHS DSPIC_SFR; /* 0x02A6 */
typedef union {
  struct { unsigned CH0SA:4; unsigned CH0NA:1; unsigned :3; unsigned CH0SB:4; unsigned CH0NB:1; };
  struct { unsigned CH0SA0:1; unsigned CH0SA1:1; unsigned CH0SA2:1; unsigned CH0SA3:1; unsigned :4; unsigned CH0SB0:1; unsigned CH0SB1:1; unsigned CH0SB2:1; unsigned CH0SB3:1; };
} ADCHSBITS;
extern volatile ADCHSBITS ADCHSbits DSPIC_SFR;
extern volatile unsigned int ADPCFG DSPIC_SFR; /* 0x02A8 */
typedef struct { unsigned PCFG0:1; unsigned PCFG1:1; unsigned PCFG2:1; unsigned PCFG3:1; unsigned PCFG4:1; unsigned PCFG5:1; unsigned PCFG6:1; unsigned PCFG7:1; unsigned PCFG8:1; unsigned PCFG9:1; unsigned PCFG10:1; unsigned PCFG11:1; unsigned PCFG12:1; unsigned PCFG13:1; unsigned PCFG14:1; unsigned PCFG15:1; } ADPCFGBITS;
extern volatile ADPCFGBITS ADPCFGbits DSPIC_SFR;
extern volatile unsigned int ADCSSL DSPIC_SFR; /* 0x02AA */
typedef struct { unsigned CSSL0:1; unsigned CSSL1:1; unsigned CSSL2:1; unsigned CSSL3:1; unsigned CSSL4:1; unsigned CSSL5:1; unsigned CSSL6:1; unsigned CSSL7:1; unsigned CSSL8:1; unsigned CSSL9:1; unsigned CSSL10:1; unsigned CSSL11:1; unsigned CSSL12:1; unsigned CSSL13:1; unsigned CSSL14:1; unsigned CSSL15:1; } ADCSSLBITS;
extern volatile ADCSSLBITS ADCSSLbits DSPIC_SFR;
extern volatile unsigned int TRISA DSPIC_SFR; /* 0x02C0 */
typedef struct { unsigned :6; unsigned TRISA6:1; unsigned TRISA7:1; unsigned :1; unsigned TRISA9:1; unsigned TRISA10:1; unsigned :1; unsigned TRISA12:1; unsigned TRISA13:1; unsigned TRISA14:1; unsigned TRISA15:1; } TRISABITS;
extern volatile TRISABITS TRISAbits DSPIC_SFR;
extern volatile unsigned int PORTA DSPIC_SFR; /* 0x02C2 */
typedef struct { unsigned :6; unsigned RA6:1; unsigned RA7:1; unsigned :1; unsigned RA9:1; unsigned RA10:1; unsigned :1; unsigned RA12:1; unsigned RA13:1; unsigned RA14:1; unsigned RA15:1; } PORTABITS;
extern volatile PORTABITS PORTAbits DSPIC_SFR;
extern volatile unsigned int LATA DSPIC_SFR; /* 0x02C4 */
typedef struct { unsigned :6; unsigned LATA6:1; unsigned LATA7:1; unsigned :1; unsigned LATA9:1; unsigned LATA10:1; unsigned :1; unsigned LATA12:1; unsigned LATA13:1; unsigned LATA14:1; unsigned LATA15:1; } LATABITS;
extern volatile LATABITS LATAbits DSPIC_SFR;
extern volatile unsigned int TRISB DSPIC_SFR; /* 0x02C6 */
typedef struct { unsigned TRISB0:1; unsigned TRISB1:1; unsigned TRISB2:1; unsigned TRISB3:1; unsigned TRISB4:1; unsigned TRISB5:1; unsigned TRISB6:1; unsigned TRISB7:1; unsigned TRISB8:1; unsigned TRISB9:1; unsigned TRISB10:1; unsigned TRISB11:1; unsigned TRISB12:1; unsigned TRISB13:1; unsigned TRISB14:1; unsigned TRISB15:1; } TRISBBITS;
extern volatile TRISBBITS TRISBbits DSPIC_SFR;
extern volatile unsigned int PORTB DSPIC_SFR; /* 0x02C8 */
typedef struct { unsigned RB0:1; unsigned RB1:1; unsigned RB2:1; unsigned RB3:1; unsigned RB4:1; unsigned RB5:1; unsigned RB6:1; unsigned RB7:1; unsigned RB8:1; unsigned RB9:1; unsigned RB10:1; unsigned RB11:1; unsigned RB12:1; unsigned RB13:1; unsigned RB14:1; unsigned RB15:1; } PORTBBITS;
extern volatile PORTBBITS PORTBbits DSPIC_SFR;
extern volatile unsigned int LATB DSPIC_SFR; /* 0x02CA */
typedef struct { unsigned LATB0:1; unsigned LATB1:1; unsigned LATB2:1; unsigned LATB3:1; unsigned LATB4:1; unsigned LATB5:1; unsigned LATB6:1; unsigned LATB7:1; unsigned LATB8:1; unsigned LATB9:1; unsigned LATB10:1; unsigned LATB11:1; unsigned LATB12:1; unsigned LATB13:1; unsigned LATB14:1; unsigned LATB15:1; } LATBBITS;
extern volatile LATBBITS LATBbits DSPIC_SFR;
extern volatile unsigned int TRISC DSPIC_SFR; /* 0x02CC */
typedef struct { unsigned :1; unsigned TRISC1:1; unsigned TRISC2:1; unsigned TRISC3:1; unsigned TRISC4:1; unsigned :8; unsigned TRISC13:1; unsigned TRISC14:1; unsigned TRISC15:1; } TRISCBITS;
extern volatile TRISCBITS TRISCbits DSPIC_SFR;
extern volatile unsigned int PORTC DSPIC_SFR; /* 0x02CE */
typedef struct { unsigned :1; unsigned RC1:1; unsigned RC2:1; unsigned RC3:1; unsigned RC4:1; unsigned :8; unsigned RC13:1; unsigned RC14:1; unsigned RC15:1; } PORTCBITS;
extern volatile PORTCBITS PORTCbits DSPIC_SFR;
extern volatile unsigned int LATC DSPIC_SFR; /* 0x02D0 */
typedef struct { unsigned :1; unsigned LATC1:1; unsigned LATC2:1; unsigned LATC3:1; unsigned LATC4:1; unsigned :8; unsigned LATC13:1; unsigned LATC14:1; unsigned LATC15:1; } LATCBITS;
extern volatile LATCBITS LATCbits DSPIC_SFR;
extern volatile unsigned int TRISD DSPIC_SFR; /* 0x02D2 */
typedef struct { unsigned TRISD0:1; unsigned TRISD1:1; unsigned TRISD2:1; unsigned TRISD3:1; unsigned TRISD4:1; unsigned TRISD5:1; unsigned TRISD6:1; unsigned TRISD7:1; unsigned TRISD8:1; unsigned TRISD9:1; unsigned TRISD10:1; unsigned TRISD11:1; unsigned TRISD12:1; unsigned TRISD13:1; unsigned TRISD14:1; unsigned TRISD15:1; } TRISDBITS;
extern volatile TRISDBITS TRISDbits DSPIC_SFR;
extern volatile unsigned int PORTD DSPIC_SFR; /* 0x02D4 */
typedef struct { unsigned RD0:1; unsigned RD1:1; unsigned RD2:1; unsigned RD3:1; unsigned RD4:1; unsigned RD5:1; unsigned RD6:1; unsigned RD7:1; unsigned RD8:1; unsigned RD9:1; unsigned RD10:1; unsigned RD11:1; unsigned RD12:1; unsigned RD13:1; unsigned RD14:1; unsigned RD15:1; } PORTDBITS;
extern volatile PORTDBITS PORTDbits DSPIC_SFR;
extern volatile unsigned int LATD DSPIC_SFR; /* 0x02D6 */
typedef struct { unsigned LATD0:1; unsigned LATD1:1; unsigned LATD2:1; unsigned LATD3:1; unsigned LATD4:1; unsigned LATD5:1; unsigned LATD6:1; unsigned LATD7:1; unsigned LATD8:1; unsigned LATD9:1; unsigned LATD10:1; unsigned LATD11:1; unsigned LATD12:1; unsigned LATD13:1; unsigned LATD14:1; unsigned LATD15:1; } LATDBITS;
extern volatile LATDBITS LATDbits DSPIC_SFR;
extern volatile unsigned int TRISF DSPIC_SFR; /* 0x02DE */
typedef struct { unsigned TRISF0:1; unsigned TRISF1:1; unsigned TRISF2:1; unsigned TRISF3:1; unsigned TRISF4:1; unsigned TRISF5:1; unsigned TRISF6:1; unsigned TRISF7:1; unsigned TRISF8:1; } TRISFBITS;
extern volatile TRISFBITS TRISFbits DSPIC_SFR;
extern volatile unsigned int PORTF DSPIC_SFR; /* 0x02E0 */
typedef struct { unsigned RF0:1; unsigned RF1:1; unsigned RF2:1; unsigned RF3:1; unsigned RF4:1; unsigned RF5:1; unsigned RF6:1; unsigned RF7:1; unsigned RF8:1; } PORTFBITS;
extern volatile PORTFBITS PORTFbits DSPIC_SFR;
extern volatile unsigned int LATF DSPIC_SFR; /* 0x02E2 */
typedef struct { unsigned LATF0:1; unsigned LATF1:1; unsigned LATF2:1; unsigned LATF3:1; unsigned LATF4:1; unsigned LATF5:1; unsigned LATF6:1; unsigned LATF7:1; unsigned LATF8:1; } LATFBITS;
extern volatile LATFBITS LATFbits DSPIC_SFR;
extern volatile unsigned int TRISG DSPIC_SFR; /* 0x02E4 */
typedef struct { unsigned TRISG0:1; unsigned TRISG1:1; unsigned TRISG2:1; unsigned TRISG3:1; unsigned :2; unsigned TRISG6:1; unsigned TRISG7:1; unsigned TRISG8:1; unsigned TRISG9:1; unsigned :2; unsigned TRISG12:1; unsigned TRISG13:1; unsigned TRISG14:1; unsigned TRISG15:1; } TRISGBITS;
extern volatile TRISGBITS TRISGbits DSPIC_SFR;
extern volatile unsigned int PORTG DSPIC_SFR; /* 0x02E6 */
typedef struct { unsigned RG0:1; unsigned RG1:1; unsigned RG2:1; unsigned RG3:1; unsigned :2; unsigned RG6:1; unsigned RG7:1; unsigned RG8:1; unsigned RG9:1; unsigned :2; unsigned RG12:1; unsigned RG13:1; unsigned RG14:1; unsigned RG15:1; } PORTGBITS;
extern volatile PORTGBITS PORTGbits DSPIC_SFR;
extern volatile unsigned int LATG DSPIC_SFR; /* 0x02E8 */
typedef struct { unsigned LATG0:1; unsigned LATG1:1; unsigned LATG2:1; unsigned LATG3:1; unsigned :2; unsigned LATG6:1; unsigned LATG7:1; unsigned LATG8:1; unsigned LATG9:1; unsigned :2; unsigned LATG12:1; unsigned LATG13:1; unsigned LATG14:1; unsigned LATG15:1; } LATGBITS;
extern volatile LATGBITS LATGbits DSPIC_SFR;
extern volatile unsigned int C1RXF0SID DSPIC_SFR; /* 0x0300 */
typedef union {
  struct { unsigned EXIDE:1; unsigned :1; unsigned SID:11; };
  struct { unsigned :2; unsigned SID0:1; unsigned SID1:1; unsigned SID2:1; unsigned SID3:1; unsigned SID4:1; unsigned SID5:1; unsigned SID6:1; unsigned SID7:1; unsigned SID8:1; unsigned SID9:1; unsigned SID10:1; };
} C1RXF0SIDBITS;
extern volatile C1RXF0SIDBITS C1RXF0SIDbits DSPIC_SFR;
extern volatile unsigned int C1RXF0EIDH DSPIC_SFR; /* 0x0302 */
typedef struct { unsigned EID6:1; unsigned EID7:1; unsigned EID8:1; unsigned EID9:1; unsigned EID10:1; unsigned EID11:1; unsigned EID12:1; unsigned EID13:1; unsigned EID14:1; unsigned EID15:1; unsigned EID16:1; unsigned EID17:1; } C1RXF0EIDHBITS;
extern volatile C1RXF0EIDHBITS C1RXF0EIDHbits DSPIC_SFR;
extern volatile unsigned int C1RXF0EIDL DSPIC_SFR; /* 0x0304 */
typedef union {
  struct { unsigned :10; unsigned EID5_0:6; };
  struct { unsigned :10; unsigned EID5_00:1; unsigned EID5_01:1; unsigned EID5_02:1; unsigned EID5_03:1; unsigned EID5_04:1; unsigned EID5_05:1; };
} C1RXF0EIDLBITS;
extern volatile C1RXF0EIDLBITS C1RXF0EIDLbits DSPIC_SFR;
extern volatile unsigned int C1RXF1SID DSPIC_SFR; /* 0x0308 */
typedef union {
  struct { unsigned EXIDE:1; unsigned :1; unsigned SID:11; };
  struct { unsigned :2; unsigned SID0:1; unsigned SID1:1; unsigned SID2:1; unsigned SID3:1; unsigned SID4:1; unsigned SID5:1; unsigned SID6:1; unsigned SID7:1; unsigned SID8:1; unsigned SID9:1; unsigned SID10:1; };
} C1RXF1SIDBITS;
extern volatile C1RXF1SIDBITS C1RXF1SIDbits DSPIC_SFR;
extern volatile unsigned int C1RXF1EIDH DSPIC_SFR; /* 0x030A */
typedef struct { unsigned EID6:1; unsigned EID7:1; unsigned EID8:1; unsigned EID9:1; unsigned EID10:1; unsigned EID11:1; unsigned EID12:1; unsigned EID13:1; unsigned EID14:1; unsigned EID15:1; unsigned EID16:1; unsigned EID17:1; } C1RXF1EIDHBITS;
extern volatile C1RXF1EIDHBITS C1RXF1EIDHbits DSPIC_SFR;
extern volatile unsigned int C1RXF1EIDL DSPIC_SFR; /* 0x030C */
typedef union {
  struct { unsigned :10; unsigned EID5_0:6; };
  struct { unsigned :10; unsigned EID5_00:1; unsigned EID5_01:1; unsigned EID5_02:1; unsigned EID5_03:1; unsigned EID5_04:1; unsigned EID5_05:1; };
} C1RXF1EIDLBITS;
extern volatile C1RXF1EIDLBITS C1RXF1EIDLbits DSPIC_SFR;
extern volatile unsigned int C1RXF2SID DSPIC_SFR; /* 0x0310 */
typedef union {
  struct { unsigned EXIDE:1; unsigned :1; unsigned SID:11; };
  struct { unsigned :2; unsigned SID0:1; unsigned SID1:1; unsigned SID2:1; unsigned SID3:1; unsigned SID4:1; unsigned SID5:1; unsigned SID6:1; unsigned SID7:1; unsigned SID8:1; unsigned SID9:1; unsigned SID10:1; };
} C1RXF2SIDBITS;
extern volatile C1RXF2SIDBITS C1RXF2SIDbits DSPIC_SFR;
extern volatile unsigned int C1RXF2EIDH DSPIC_SFR; /* 0x0312 */
typedef struct { unsigned EID6:1; unsigned EID7:1; unsigned EID8:1; unsigned EID9:1; unsigned EID10:1; unsigned EID11:1; unsigned EID12:1; unsigned EID13:1; unsigned EID14:1; unsigned EID15:1; unsigned EID16:1; unsigned EID17:1; } C1RXF2EIDHBITS;
extern volatile C1RXF2EIDHBITS C1RXF2EIDHbits DSPIC_SFR;
extern volatile unsigned int C1RXF2EIDL DSPIC_SFR; /* 0x0314 */
typedef union {
  struct { unsigned :10; unsigned EID5_0:6; };
  struct { unsigned :10; unsigned EID5_00:1; unsigned EID5_01:1; unsigned EID5_02:1; unsigned EID5_03:1; unsigned EID5_04:1; unsigned EID5_05:1; };
} C1RXF2EIDLBITS;
extern volatile C1RXF2EIDLBITS C1RXF2EIDLbits DSPIC_SFR;
extern volatile unsigned int C1RXF3SID DSPIC_SFR; /* 0x0318 */
typedef union {
  struct { unsigned EXIDE:1; unsigned :1; unsigned SID:11; };
  struct { unsigned :2; unsigned SID0:1; unsigned SID1:1; unsigned SID2:1; unsigned SID3:1; unsigned SID4:1; unsigned SID5:1; unsigned SID6:1; unsigned SID7:1; unsigned SID8:1; unsigned SID9:1; unsigned SID10:1; };
} C1RXF3SIDBITS;
extern volatile C1RXF3SIDBITS C1RXF3SIDbits DSPIC_SFR;
extern volatile unsigned int C1RXF3EIDH DSPIC_SFR; /* 0x031A */
typedef struct { unsigned EID6:1; unsigned EID7:1; unsigned EID8:1; unsigned EID9:1; unsigned EID10:1; unsigned EID11:1; unsigned EID12:1; unsigned EID13:1; unsigned EID14:1; unsigned EID15:1; unsigned EID16:1; unsigned EID17:1; } C1RXF3EIDHBITS;
extern volatile C1RXF3EIDHBITS C1RXF3EIDHbits DSPIC_SFR;
extern volatile unsigned int C1RXF3EIDL DSPIC_SFR; /* 0x031C */
typedef union {
  struct { unsigned :10; unsigned EID5_0:6; };
  struct { unsigned :10; unsigned EID5_00:1; unsigned EID5_01:1; unsigned EID5_02:1; unsigned EID5_03:1; unsigned EID5_04:1; unsigned EID5_05:1; };
} C1RXF3EIDLBITS;
extern volatile C1RXF3EIDLBITS C1RXF3EIDLbits DSPIC_SFR;
extern volatile unsigned int C1RXF4SID DSPIC_SFR; /* 0x0320 */
typedef union {
  struct { unsigned EXIDE:1; unsigned :1; unsigned SID:11; };
  struct { unsigned :2; unsigned SID0:1; unsigned SID1:1; unsigned SID2:1; unsigned SID3:1; unsigned SID4:1; unsigned SID5:1; unsigned SID6:1; unsigned SID7:1; unsigned SID8:1; unsigned SID9:1; unsigned SID10:1; };
} C1RXF4SIDBITS;
extern volatile C1RXF4SIDBITS C1RXF4SIDbits DSPIC_SFR;
extern volatile unsigned int C1RXF4EIDH DSPIC_SFR; /* 0x0322 */
typedef struct { unsigned EID6:1; unsigned EID7:1; unsigned EID8:1; unsigned EID9:1; unsigned EID10:1; unsigned EID11:1; unsigned EID12:1; unsigned EID13:1; unsigned EID14:1; unsigned EID15:1; unsigned EID16:1; unsigned EID17:1; } C1RXF4EIDHBITS;
extern volatile C1RXF4EIDHBITS C1RXF4EIDHbits DSPIC_SFR;
extern volatile unsigned int C1RXF4EIDL DSPIC_SFR; /* 0x0324 */
typedef union {
  struct { unsigned :10; unsigned EID5_0:6; };
  struct { unsigned :10; unsigned EID5_00:1; unsigned EID5_01:1; unsigned EID5_02:1; unsigned EID5_03:1; unsigned EID5_04:1; unsigned EID5_05:1; };
} C1RXF4EIDLBITS;
extern volatile C1RXF4EIDLBITS C1RXF4EIDLbits DSPIC_SFR;
extern volatile unsigned int C1RXF5SID DSPIC_SFR; /* 0x0328 */
typedef union {
  struct { unsigned EXIDE:1; unsigned :1; unsigned SID:11; };
  struct { unsigned :2; unsigned SID0:1; unsigned SID1:1; unsigned SID2:1; unsigned SID3:1; unsigned SID4:1; unsigned SID5:1; unsigned SID6:1; unsigned SID7:1; unsigned SID8:1; unsigned SID9:1; unsigned SID10:1; };
} C1RXF5SIDBITS;
extern volatile C1RXF5SIDBITS C1RXF5SIDbits DSPIC_SFR;
extern volatile unsigned int C1RXF5EIDH DSPIC_SFR; /* 0x032A */
typedef struct { unsigned EID6:1; unsigned EID7:1; unsigned EID8:1; unsigned EID9:1; unsigned EID10:1; unsigned EID11:1; unsigned EID12:1; unsigned EID13:1; unsigned EID14:1; unsigned EID15:1; unsigned EID16:1; unsigned EID17:1; } C1RXF5EIDHBITS;
extern volatile C1RXF5EIDHBITS C1RXF5EIDHbits DSPIC_SFR;
extern volatile unsigned int C1RXF5EIDL DSPIC_SFR; /* 0x032C */
typedef union {
  struct { unsigned :10; unsigned EID5_0:6; };
  struct { unsigned :10; unsigned EID5_00:1; unsigned EID5_01:1; unsigned EID5_02:1; unsigned EID5_03:1; unsigned EID5_04:1; unsigned EID5_05:1; };
} C1RXF5EIDLBITS;
extern volatile C1RXF5EIDLBITS C1RXF5EIDLbits DSPIC_SFR;
extern volatile unsigned int C1RXM0SID DSPIC_SFR; /* 0x0330 */
typedef union {
  struct { unsigned MIDE:1; unsigned :1; unsigned SID:11; };
  struct { unsigned :2; unsigned SID0:1; unsigned SID1:1; unsigned SID2:1; unsigned SID3:1; unsigned SID4:1; unsigned SID5:1; unsigned SID6:1; unsigned SID7:1; unsigned SID8:1; unsigned SID9:1; unsigned SID10:1; };
} C1RXM0SIDBITS;
extern volatile C1RXM0SIDBITS C1RXM0SIDbits DSPIC_SFR;
extern volatile unsigned int C1RXM0EIDH DSPIC_SFR; /* 0x0332 */
typedef struct { unsigned EID6:1; unsigned EID7:1; unsigned EID8:1; unsigned EID9:1; unsigned EID10:1; unsigned EID11:1; unsigned EID12:1; unsigned EID13:1; unsigned EID14:1; unsigned EID15:1; unsigned EID16:1; unsigned EID17:1; } C1RXM0EIDHBITS;
extern volatile C1RXM0EIDHBITS C1RXM0EIDHbits DSPIC_SFR;
extern volatile unsigned int C1RXM0EIDL DSPIC_SFR; /* 0x0334 */
typedef union {
  struct { unsigned :10; unsigned EID5_0:6; };
  struct { unsigned :10; unsigned EID5_00:1; unsigned EID5_01:1; unsigned EID5_02:1; unsigned EID5_03:1; unsigned EID5_04:1; unsigned EID5_05:1; };
} C1RXM0EIDLBITS;
extern volatile C1RXM0EIDLBITS C1RXM0EIDLbits DSPIC_SFR;
extern volatile unsigned int C1RXM1SID DSPIC_SFR; /* 0x0338 */
typedef union {
  struct { unsigned MIDE:1; unsigned :1; unsigned SID:11; };
  struct { unsigned :2; unsigned SID0:1; unsigned SID1:1; unsigned SID2:1; unsigned SID3:1; unsigned SID4:1; unsigned SID5:1; unsigned SID6:1; unsigned SID7:1; unsigned SID8:1; unsigned SID9:1; unsigned SID10:1; };
} C1RXM1SIDBITS;
extern volatile C1RXM1SIDBITS C1RXM1SIDbits DSPIC_SFR;
extern volatile unsigned int C1RXM1EIDH DSPIC_SFR; /* 0x033A */
typedef struct { unsigned EID6:1; unsigned EID7:1; unsigned EID8:1; unsigned EID9:1; unsigned EID10:1; unsigned EID11:1; unsigned EID12:1; unsigned EID13:1; unsigned EID14:1; unsigned EID15:1; unsigned EID16:1; unsigned EID17:1; } C1RXM1EIDHBITS;
extern volatile C1RXM1EIDHBITS C1RXM1EIDHbits DSPIC_SFR;
extern volatile unsigned int C1RXM1EIDL DSPIC_SFR; /* 0x033C */
typedef union {
  struct { unsigned :10; unsigned EID5_0:6; };
  struct { unsigned :10; unsigned EID5_00:1; unsigned EID5_01:1; unsigned EID5_02:1; unsigned EID5_03:1; unsigned EID5_04:1; unsigned EID5_05:1; };
} C1RXM1EIDLBITS;
extern volatile C1RXM1EIDLBITS C1RXM1EIDLbits DSPIC_SFR;
extern volatile unsigned int C1TX2SID DSPIC_SFR; /* 0x0340 */
typedef union {
  struct { unsigned TXIDE:1; unsigned SRR:1; unsigned SID5_0:6; unsigned :3; unsigned SID10_6:5; };
  struct { unsigned :2; unsigned SID5_00:1; unsigned SID5_01:1; unsigned SID5_02:1; unsigned SID5_03:1; unsigned SID5_04:1; unsigned SID5_05:1; unsigned :3; unsigned SID10_60:1; unsigned SID10_61:1; unsigned SID10_62:1; unsigned SID10_63:1; unsigned SID10_64:1; };
} C1TX2SIDBITS;
extern volatile C1TX2SIDBITS C1TX2SIDbits DSPIC_SFR;
extern volatile unsigned int C1TX2EID DSPIC_SFR; /* 0x0342 */
typedef union {
  struct { unsigned EID13_6:8; unsigned :4; unsigned EID17_14:4; };
  struct { unsigned EID13_60:1; unsigned EID13_61:1; unsigned EID13_62:1; unsigned EID13_63:1; unsigned EID13_64:1; unsigned EID13_65:1; unsigned EID13_66:1; unsigned EID13_67:1; unsigned :4; unsigned EID17_140:1; unsigned EID17_141:1; unsigned EID17_142:1; unsigned EID17_143:1; };
} C1TX2EIDBITS;
extern volatile C1TX2EIDBITS C1TX2EIDbits DSPIC_SFR;
extern volatile unsigned int C1TX2DLC DSPIC_SFR; /* 0x0344 */
typedef union {
  struct { unsigned :3; unsigned DLC:4; unsigned TXRB0:1; unsigned TXRB1:1; unsigned TXRTR:1; unsigned EID5_0:6; };
  struct { unsigned :3; unsigned DLC0:1; unsigned DLC1:1; unsigned DLC2:1; unsigned DLC3:1; unsigned :3; unsigned EID5_00:1; unsigned EID5_01:1; unsigned EID5_02:1; unsigned EID5_03:1; unsigned EID5_04:1; unsigned EID5_05:1; };
} C1TX2DLCBITS;
extern volatile C1TX2DLCBITS C1TX2DLCbits DSPIC_SFR;
extern volatile unsigned int C1TX2B1 DSPIC_SFR; /* 0x0346 */
extern volatile unsigned int C1TX2B2 DSPIC_SFR; /* 0x0348 */
extern volatile unsigned int C1TX2B3 DSPIC_SFR; /* 0x034A */
extern volatile unsigned int C1TX2B4 DSPIC_SFR; /* 0x034C */
extern volatile unsigned int C1TX2CON DSPIC_SFR; /* 0x034E */
typedef union {
  struct { unsigned TXPRI:2; unsigned :1; unsigned TXREQ:1; unsigned TXERR:1; unsigned TXLARB:1; unsigned TXABT:1; };
  struct { unsigned TXPRI0:1; unsigned TXPRI1:1; };
} C1TX2CONBITS;
extern volatile C1TX2CONBITS C1TX2CONbits DSPIC_SFR;
extern volatile unsigned int C1TX1SID DSPIC_SFR; /* 0x0350 */
typedef union {
  struct { unsigned TXIDE:1; unsigned SRR:1; unsigned SID5_0:6; unsigned :3; unsigned SID10_6:5; };
  struct { unsigned :2; unsigned SID5_00:1; unsigned SID5_01:1; unsigned SID5_02:1; unsigned SID5_03:1; unsigned SID5_04:1; unsigned SID5_05:1; unsigned :3; unsigned SID10_60:1; unsigned SID10_61:1; unsigned SID10_62:1; unsigned SID10_63:1; unsigned SID10_64:1; };
} C1TX1SIDBITS;
extern volatile C1TX1SIDBITS C1TX1SIDbits DSPIC_SFR;
extern volatile unsigned int C1TX1EID DSPIC_SFR; /* 0x0352 */
typedef union {
  struct { unsigned EID13_6:8; unsigned :4; unsigned EID17_14:4; };
  struct { unsigned EID13_60:1; unsigned EID13_61:1; unsigned EID13_62:1; unsigned EID13_63:1; unsigned EID13_64:1; unsigned EID13_65:1; unsigned EID13_66:1; unsigned EID13_67:1; unsigned :4; unsigned EID17_140:1; unsigned EID17_141:1; unsigned EID17_142:1; unsigned EID17_143:1; };
} C1TX1EIDBITS;
extern volatile C1TX1EIDBITS C1TX1EIDbits DSPIC_SFR;
extern volatile unsigned int C1TX1DLC DSPIC_SFR; /* 0x0354 */
typedef union {
  struct { unsigned :3; unsigned DLC:4; unsigned TXRB0:1; unsigned TXRB1:1; unsigned TXRTR:1; unsigned EID5_0:6; };
  struct { unsigned :3; unsigned DLC0:1; unsigned DLC1:1; unsigned DLC2:1; unsigned DLC3:1; unsigned :3; unsigned EID5_00:1; unsigned EID5_01:1; unsigned EID5_02:1; unsigned EID5_03:1; unsigned EID5_04:1; unsigned EID5_05:1; };
} C1TX1DLCBITS;
extern volatile C1TX1DLCBITS C1TX1DLCbits DSPIC_SFR;
extern volatile unsigned int C1TX1B1 DSPIC_SFR; /* 0x0356 */
extern volatile unsigned int C1TX1B2 DSPIC_SFR; /* 0x0358 */
extern volatile unsigned int C1TX1B3 DSPIC_SFR; /* 0x035A */
extern volatile unsigned int C1TX1B4 DSPIC_SFR; /* 0x035C */
extern volatile unsigned int C1TX1CON DSPIC_SFR; /* 0x035E */
typedef union {
  struct { unsigned TXPRI:2; unsigned :1; unsigned TXREQ:1; unsigned TXERR:1; unsigned TXLARB:1; unsigned TXABT:1; };
  struct { unsigned TXPRI0:1; unsigned TXPRI1:1; };
} C1TX1CONBITS;
extern volatile C1TX1CONBITS C1TX1CONbits DSPIC_SFR;
extern volatile unsigned int C1TX0SID DSPIC_SFR; /* 0x0360 */
typedef union {
  struct { unsigned TXIDE:1; unsigned SRR:1; unsigned SID5_0:6; unsigned :3; unsigned SID10_6:5; };
  struct { unsigned :2; unsigned SID5_00:1; unsigned SID5_01:1; unsigned SID5_02:1; unsigned SID5_03:1; unsigned SID5_04:1; unsigned SID5_05:1; unsigned :3; unsigned SID10_60:1; unsigned SID10_61:1; unsigned SID10_62:1; unsigned SID10_63:1; unsigned SID10_64:1; };
} C1TX0SIDBITS;
extern volatile C1TX0SIDBITS C1TX0SIDbits DSPIC_SFR;
extern volatile unsigned int C1TX0EID DSPIC_SFR; /* 0x0362 */
typedef union {
  struct { unsigned EID13_6:8; unsigned :4; unsigned EID17_14:4; };
  struct { unsigned EID13_60:1; unsigned EID13_61:1; unsigned EID13_62:1; unsigned EID13_63:1; unsigned EID13_64:1; unsigned EID13_65:1; unsigned EID13_66:1; unsigned EID13_67:1; unsigned :4; unsigned EID17_140:1; unsigned EID17_141:1; unsigned EID17_142:1; unsigned EID17_143:1; };
} C1TX0EIDBITS;
extern volatile C1TX0EIDBITS C1TX0EIDbits DSPIC_SFR;
extern volatile unsigned int C1TX0DLC DSPIC_SFR; /* 0x0364 */
typedef union {
  struct { unsigned :3; unsigned DLC:4; unsigned TXRB0:1; unsigned TXRB1:1; unsigned TXRTR:1; unsigned EID5_0:6; };
  struct { unsigned :3; unsigned DLC0:1; unsigned DLC1:1; unsigned DLC2:1; unsigned DLC3:1; unsigned :3; unsigned EID5_00:1; unsigned EID5_01:1; unsigned EID5_02:1; unsigned EID5_03:1; unsigned EID5_04:1; unsigned EID5_05:1; };
} C1TX0DLCBITS;
extern volatile C1TX0DLCBITS C1TX0DLCbits DSPIC_SFR;
extern volatile unsigned int C1TX0B1 DSPIC_SFR; /* 0x0366 */
extern volatile unsigned int C1TX0B2 DSPIC_SFR; /* 0x0368 */
extern volatile unsigned int C1TX0B3 DSPIC_SFR; /* 0x036A */
extern volatile unsigned int C1TX0B4 DSPIC_SFR; /* 0x036C */
extern volatile unsigned int C1TX0CON DSPIC_SFR; /* 0x036E */
typedef union {
  struct { unsigned TXPRI:2; unsigned :1; unsigned TXREQ:1; unsigned TXERR:1; unsigned TXLARB:1; unsigned TXABT:1; };
  struct { unsigned TXPRI0:1; unsigned TXPRI1:1; };
} C1TX0CONBITS;
extern volatile C1TX0CONBITS C1TX0CONbits DSPIC_SFR;
extern volatile unsigned int C1RX1SID DSPIC_SFR; /* 0x0370 */
typedef union {
  struct { unsigned RXIDE:1; unsigned SRR:1; unsigned SID:11; };
  struct { unsigned :2; unsigned SID0:1; unsigned SID1:1; unsigned SID2:1; unsigned SID3:1; unsigned SID4:1; unsigned SID5:1; unsigned SID6:1; unsigned SID7:1; unsigned SID8:1; unsigned SID9:1; unsigned SID10:1; };
} C1RX1SIDBITS;
extern volatile C1RX1SIDBITS C1RX1SIDbits DSPIC_SFR;
extern volatile unsigned int C1RX1EID DSPIC_SFR; /* 0x0372 */
typedef struct { unsigned EID6:1; unsigned EID7:1; unsigned EID8:1; unsigned EID9:1; unsigned EID10:1; unsigned EID11:1; unsigned EID12:1; unsigned EID13:1; unsigned EID14:1; unsigned EID15:1; unsigned EID16:1; unsigned EID17:1; } C1RX1EIDBITS;
extern volatile C1RX1EIDBITS C1RX1EIDbits DSPIC_SFR;
extern volatile unsigned int C1RX1DLC DSPIC_SFR; /* 0x0374 */
typedef union {
  struct { unsigned DLC:4; unsigned RXRB0:1; unsigned :3; unsigned RXRB1:1; unsigned RXRTR:1; unsigned EID5_0:6; };
  struct { unsigned DLC0:1; unsigned DLC1:1; unsigned DLC2:1; unsigned DLC3:1; unsigned :6; unsigned EID5_00:1; unsigned EID5_01:1; unsigned EID5_02:1; unsigned EID5_03:1; unsigned EID5_04:1; unsigned EID5_05:1; };
} C1RX1DLCBITS;
extern volatile C1RX1DLCBITS C1RX1DLCbits DSPIC_SFR;
extern volatile unsigned int C1RX1B1 DSPIC_SFR; /* 0x0376 */
extern volatile unsigned int C1RX1B2 DSPIC_SFR; /* 0x0378 */
extern volatile unsigned int C1RX1B3 DSPIC_SFR; /* 0x037A */
extern volatile unsigned int C1RX1B4 DSPIC_SFR; /* 0x037C */
extern volatile unsigned int C1RX1CON DSPIC_SFR; /* 0x037E */
typedef union {
  struct { unsigned FILHIT:3; unsigned RXRTRRO:1; unsigned :3; unsigned RXFUL:1; };
  struct { unsigned FILHIT0:1; unsigned FILHIT1:1; unsigned FILHIT2:1; };
} C1RX1CONBITS;
extern volatile C1RX1CONBITS C1RX1CONbits DSPIC_SFR;
extern volatile unsigned int C1RX0SID DSPIC_SFR; /* 0x0380 */
typedef union {
  struct { unsigned RXIDE:1; unsigned SRR:1; unsigned SID:11; };
  struct { unsigned :2; unsigned SID0:1; unsigned SID1:1; unsigned SID2:1; unsigned SID3:1; unsigned SID4:1; unsigned SID5:1; unsigned SID6:1; unsigned SID7:1; unsigned SID8:1; unsigned SID9:1; unsigned SID10:1; };
} C1RX0SIDBITS;
extern volatile C1RX0SIDBITS C1RX0SIDbits DSPIC_SFR;
extern volatile unsigned int C1RX0EID DSPIC_SFR; /* 0x0382 */
typedef struct { unsigned EID6:1; unsigned EID7:1; unsigned EID8:1; unsigned EID9:1; unsigned EID10:1; unsigned EID11:1; unsigned EID12:1; unsigned EID13:1; unsigned EID14:1; unsigned EID15:1; unsigned EID16:1; unsigned EID17:1; } C1RX0EIDBITS;
extern volatile C1RX0EIDBITS C1RX0EIDbits DSPIC_SFR;
extern volatile unsigned int C1RX0DLC DSPIC_SFR; /* 0x0384 */
typedef union {
  struct { unsigned DLC:4; unsigned RXRB0:1; unsigned :3; unsigned RXRB1:1; unsigned RXRTR:1; unsigned EID5_0:6; };
  struct { unsigned DLC0:1; unsigned DLC1:1; unsigned DLC2:1; unsigned DLC3:1; unsigned :6; unsigned EID5_00:1; unsigned EID5_01:1; unsigned EID5_02:1; unsigned EID5_03:1; unsigned EID5_04:1; unsigned EID5_05:1; };
} C1RX0DLCBITS;
extern volatile C1RX0DLCBITS C1RX0DLCbits DSPIC_SFR;
extern volatile unsigned int C1RX0B1 DSPIC_SFR; /* 0x0386 */
extern volatile unsigned int C1RX0B2 DSPIC_SFR; /* 0x0388 */
extern volatile unsigned int C1RX0B3 DSPIC_SFR; /* 0x038A */
extern volatile unsigned int C1RX0B4 DSPIC_SFR; /* 0x038C */
extern volatile unsigned int C1RX0CON DSPIC_SFR; /* 0x038E */
typedef union {
  struct { unsigned FILHIT0:1; unsigned JTOFF:1; unsigned DBEN:1; unsigned RXRTRRO:1; unsigned :3; unsigned RXFUL:1; };
  struct { unsigned FILHIT:1; unsigned :1; unsigned RXB0DBEN:1; };
} C1RX0CONBITS;
extern volatile C1RX0CONBITS C1RX0CONbits DSPIC_SFR;
extern volatile unsigned int C1CTRL DSPIC_SFR; /* 0x0390 */
typedef union {
  struct { unsigned :1; unsigned ICODE:3; unsigned :1; unsigned OPMODE:3; unsigned REQOP:3; unsigned CANCKS:1; unsigned ABAT:1; unsigned CANSIDL:1; unsigned CANFRZ:1; unsigned CANCAP:1; };
  struct { unsigned :1; unsigned ICODE0:1; unsigned ICODE1:1; unsigned ICODE2:1; unsigned :1; unsigned OPMODE0:1; unsigned OPMODE1:1; unsigned OPMODE2:1; unsigned REQOP0:1; unsigned REQOP1:1; unsigned REQOP2:1; };
  struct { unsigned :13; unsigned CSIDL:1; };
} C1CTRLBITS;
extern volatile C1CTRLBITS C1CTRLbits DSPIC_SFR;
extern volatile unsigned int C1CFG1 DSPIC_SFR; /* 0x0392 */
typedef union {
  struct { unsigned BRP:6; unsigned SJW:2; };
  struct { unsigned BRP0:1; unsigned BRP1:1; unsigned BRP2:1; unsigned BRP3:1; unsigned BRP4:1; unsigned BRP5:1; unsigned SJW0:1; unsigned SJW1:1; };
} C1CFG1BITS;
extern volatile C1CFG1BITS C1CFG1bits DSPIC_SFR;
extern volatile unsigned int C1CFG2 DSPIC_SFR; /* 0x0394 */
typedef union {
  struct { unsigned PRSEG:3; unsigned SEG1PH:3; unsigned SAM:1; unsigned SEG2PHTS:1; unsigned SEG2PH:3; unsigned :3; unsigned WAKFIL:1; };
  struct { unsigned PRSEG0:1; unsigned PRSEG1:1; unsigned PRSEG2:1; unsigned SEG1PH0:1; unsigned SEG1PH1:1; unsigned SEG1PH2:1; unsigned :2; unsigned SEG2PH0:1; unsigned SEG2PH1:1; unsigned SEG2PH2:1; };
} C1CFG2BITS;
extern volatile C1CFG2BITS C1CFG2bits DSPIC_SFR;
extern volatile unsigned int C1INTF DSPIC_SFR; /* 0x0396 */
typedef union {
  struct { unsigned RXB0IF:1; unsigned RXB1IF:1; unsigned TXB0IF:1; unsigned TXB1IF:1; unsigned TXB2IF:1; unsigned ERRIF:1; unsigned WAKIF:1; unsigned IRXIF:1; unsigned EWARN:1; unsigned RXWARN:1; unsigned TXWARN:1; unsigned RXBP:1; unsigned TXBP:1; unsigned TXBO:1; unsigned RXB1OVFL:1; unsigned RXB0OVFL:1; };
  struct { unsigned RX0IF:1; unsigned RX1IF:1; unsigned TX0IF:1; unsigned TX1IF:1; unsigned TX2IF:1; unsigned :2; unsigned IVRIF:1; unsigned :1; unsigned RXWAR:1; unsigned TXWAR:1; unsigned RXEP:1; unsigned TXEP:1; unsigned :1; unsigned RX1OVR:1; unsigned RX0OVR:1; };
} C1INTFBITS;
extern volatile C1INTFBITS C1INTFbits DSPIC_SFR;
extern volatile unsigned int C1INTE DSPIC_SFR; /* 0x0398 */
typedef union {
  struct { unsigned RXB0IE:1; unsigned RXB1IE:1; unsigned TXB0IE:1; unsigned TXB1IE:1; unsigned TXB2IE:1; unsigned ERRIE:1; unsigned WAKIE:1; unsigned IRXIE:1; };
  struct { unsigned RX0IE:1; unsigned RX1IE:1; unsigned TX0IE:1; unsigned TX1IE:1; unsigned TX2IE:1; unsigned :2; unsigned IVRIE:1; };
} C1INTEBITS;
extern volatile C1INTEBITS C1INTEbits DSPIC_SFR;
extern volatile unsigned int C1EC DSPIC_SFR; /* 0x039A */
typedef struct { unsigned REC0:1; unsigned REC1:1; unsigned REC2:1; unsigned REC3:1; unsigned REC4:1; unsigned REC5:1; unsigned REC6:1; unsigned REC7:1; unsigned TEC0:1; unsigned TEC1:1; unsigned TEC2:1; unsigned TEC3:1; unsigned TEC4:1; unsigned TEC5:1; unsigned TEC6:1; unsigned TEC7:1; } C1ECBITS;
extern volatile C1ECBITS C1ECbits DSPIC_SFR;
extern volatile unsigned char C1RERRCNT DSPIC_SFR; /* 0x039A */
extern volatile unsigned char C1TERRCNT DSPIC_SFR; /* 0x039B */
extern volatile unsigned int C2RXF0SID DSPIC_SFR; /* 0x03C0 */
typedef union {
  struct { unsigned EXIDE:1; unsigned :1; unsigned SID:11; };
  struct { unsigned :2; unsigned SID0:1; unsigned SID1:1; unsigned SID2:1; unsigned SID3:1; unsigned SID4:1; unsigned SID5:1; unsigned SID6:1; unsigned SID7:1; unsigned SID8:1; unsigned SID9:1; unsigned SID10:1; };
} C2RXF0SIDBITS;
extern volatile C2RXF0SIDBITS C2RXF0SIDbits DSPIC_SFR;
extern volatile unsigned int C2RXF0EIDH DSPIC_SFR; /* 0x03C2 */
typedef struct { unsigned EID6:1; unsigned EID7:1; unsigned EID8:1; unsigned EID9:1; unsigned EID10:1; unsigned EID11:1; unsigned EID12:1; unsigned EID13:1; unsigned EID14:1; unsigned EID15:1; unsigned EID16:1; unsigned EID17:1; } C2RXF0EIDHBITS;
extern volatile C2RXF0EIDHBITS C2RXF0EIDHbits DSPIC_SFR;
extern volatile unsigned int C2RXF0EIDL DSPIC_SFR; /* 0x03C4 */
typedef union {
  struct { unsigned :10; unsigned EID5_0:6; };
  struct { unsigned :10; unsigned EID5_00:1; unsigned EID5_01:1; unsigned EID5_02:1; unsigned EID5_03:1; unsigned EID5_04:1; unsigned EID5_05:1; };
} C2RXF0EIDLBITS;
extern volatile C2RXF0EIDLBITS C2RXF0EIDLbits DSPIC_SFR;
extern volatile unsigned int C2RXF1SID DSPIC_SFR; /* 0x03C8 */
typedef union {
  struct { unsigned EXIDE:1; unsigned :1; unsigned SID:11; };
  struct { unsigned :2; unsigned SID0:1; unsigned SID1:1; unsigned SID2:1; unsigned SID3:1; unsigned SID4:1; unsigned SID5:1; unsigned SID6:1; unsigned SID7:1; unsigned SID8:1; unsigned SID9:1; unsigned SID10:1; };
} C2RXF1SIDBITS;
extern volatile C2RXF1SIDBITS C2RXF1SIDbits DSPIC_SFR;
extern volatile unsigned int C2RXF1EIDH DSPIC_SFR; /* 0x03CA */
typedef struct { unsigned EID6:1; unsigned EID7:1; unsigned EID8:1; unsigned EID9:1; unsigned EID10:1; unsigned EID11:1; unsigned EID12:1; unsigned EID13:1; unsigned EID14:1; unsigned EID15:1; unsigned EID16:1; unsigned EID17:1; } C2RXF1EIDHBITS;
extern volatile C2RXF1EIDHBITS C2RXF1EIDHbits DSPIC_SFR;
extern volatile unsigned int C2RXF1EIDL DSPIC_SFR; /* 0x03CC */
typedef union {
  struct { unsigned :10; unsigned EID5_0:6; };
  struct { unsigned :10; unsigned EID5_00:1; unsigned EID5_01:1; unsigned EID5_02:1; unsigned EID5_03:1; unsigned EID5_04:1; unsigned EID5_05:1; };
} C2RXF1EIDLBITS;
extern volatile C2RXF1EIDLBITS C2RXF1EIDLbits DSPIC_SFR;
extern volatile unsigned int C2RXF2SID DSPIC_SFR; /* 0x03D0 */
typedef union {
  struct { unsigned EXIDE:1; unsigned :1; unsigned SID:11; };
  struct { unsigned :2; unsigned SID0:1; unsigned SID1:1; unsigned SID2:1; unsigned SID3:1; unsigned SID4:1; unsigned SID5:1; unsigned SID6:1; unsigned SID7:1; unsigned SID8:1; unsigned SID9:1; unsigned SID10:1; };
} C2RXF2SIDBITS;
extern volatile C2RXF2SIDBITS C2RXF2SIDbits DSPIC_SFR;
extern volatile unsigned int C2RXF2EIDH DSPIC_SFR; /* 0x03D2 */
typedef struct { unsigned EID6:1; unsigned EID7:1; unsigned EID8:1; unsigned EID9:1; unsigned EID10:1; unsigned EID11:1; unsigned EID12:1; unsigned EID13:1; unsigned EID14:1; unsigned EID15:1; unsigned EID16:1; unsigned EID17:1; } C2RXF2EIDHBITS;
extern volatile C2RXF2EIDHBITS C2RXF2EIDHbits DSPIC_SFR;
extern volatile unsigned int C2RXF2EIDL DSPIC_SFR; /* 0x03D4 */
typedef union {
  struct { unsigned :10; unsigned EID5_0:6; };
  struct { unsigned :10; unsigned EID5_00:1; unsigned EID5_01:1; unsigned EID5_02:1; unsigned EID5_03:1; unsigned EID5_04:1; unsigned EID5_05:1; };
} C2RXF2EIDLBITS;
extern volatile C2RXF2EIDLBITS C2RXF2EIDLbits DSPIC_SFR;
extern volatile unsigned int C2RXF3SID DSPIC_SFR; /* 0x03D8 */
typedef union {
  struct { unsigned EXIDE:1; unsigned :1; unsigned SID:11; };
  struct { unsigned :2; unsigned SID0:1; unsigned SID1:1; unsigned SID2:1; unsigned SID3:1; unsigned SID4:1; unsigned SID5:1; unsigned SID6:1; unsigned SID7:1; unsigned SID8:1; unsigned SID9:1; unsigned SID10:1; };
} C2RXF3SIDBITS;
extern volatile C2RXF3SIDBITS C2RXF3SIDbits DSPIC_SFR;
extern volatile unsigned int C2RXF3EIDH DSPIC_SFR; /* 0x03DA */
typedef struct { unsigned EID6:1; unsigned EID7:1; unsigned EID8:1; unsigned EID9:1; unsigned EID10:1; unsigned EID11:1; unsigned EID12:1; unsigned EID13:1; unsigned EID14:1; unsigned EID15:1; unsigned EID16:1; unsigned EID17:1; } C2RXF3EIDHBITS;
extern volatile C2RXF3EIDHBITS C2RXF3EIDHbits DSPIC_SFR;
extern volatile unsigned int C2RXF3EIDL DSPIC_SFR; /* 0x03DC */
typedef union {
  struct { unsigned :10; unsigned EID5_0:6; };
  struct { unsigned :10; unsigned EID5_00:1; unsigned EID5_01:1; unsigned EID5_02:1; unsigned EID5_03:1; unsigned EID5_04:1; unsigned EID5_05:1; };
} C2RXF3EIDLBITS;
extern volatile C2RXF3EIDLBITS C2RXF3EIDLbits DSPIC_SFR;
extern volatile unsigned int C2RXF4SID DSPIC_SFR; /* 0x03E0 */
typedef union {
  struct { unsigned EXIDE:1; unsigned :1; unsigned SID:11; };
  struct { unsigned :2; unsigned SID0:1; unsigned SID1:1; unsigned SID2:1; unsigned SID3:1; unsigned SID4:1; unsigned SID5:1; unsigned SID6:1; unsigned SID7:1; unsigned SID8:1; unsigned SID9:1; unsigned SID10:1; };
} C2RXF4SIDBITS;
extern volatile C2RXF4SIDBITS C2RXF4SIDbits DSPIC_SFR;
extern volatile unsigned int C2RXF4EIDH DSPIC_SFR; /* 0x03E2 */
typedef struct { unsigned EID6:1; unsigned EID7:1; unsigned EID8:1; unsigned EID9:1; unsigned EID10:1; unsigned EID11:1; unsigned EID12:1; unsigned EID13:1; unsigned EID14:1; unsigned EID15:1; unsigned EID16:1; unsigned EID17:1; } C2RXF4EIDHBITS;
extern volatile C2RXF4EIDHBITS C2RXF4EIDHbits DSPIC_SFR;
extern volatile unsigned int C2RXF4EIDL DSPIC_SFR; /* 0x03E4 */
typedef union {
  struct { unsigned :10; unsigned EID5_0:6; };
  struct { unsigned :10; unsigned EID5_00:1; unsigned EID5_01:1; unsigned EID5_02:1; unsigned EID5_03:1; unsigned EID5_04:1; unsigned EID5_05:1; };
} C2RXF4EIDLBITS;
extern volatile C2RXF4EIDLBITS C2RXF4EIDLbits DSPIC_SFR;
extern volatile unsigned int C2RXF5SID DSPIC_SFR; /* 0x03E8 */
typedef union {
  struct { unsigned EXIDE:1; unsigned :1; unsigned SID:11; };
  struct { unsigned :2; unsigned SID0:1; unsigned SID1:1; unsigned SID2:1; unsigned SID3:1; unsigned SID4:1; unsigned SID5:1; unsigned SID6:1; unsigned SID7:1; unsigned SID8:1; unsigned SID9:1; unsigned SID10:1; };
} C2RXF5SIDBITS;
extern volatile C2RXF5SIDBITS C2RXF5SIDbits DSPIC_SFR;
extern volatile unsigned int C2RXF5EIDH DSPIC_SFR; /* 0x03EA */
typedef struct { unsigned EID6:1; unsigned EID7:1; unsigned EID8:1; unsigned EID9:1; unsigned EID10:1; unsigned EID11:1; unsigned EID12:1; unsigned EID13:1; unsigned EID14:1; unsigned EID15:1; unsigned EID16:1; unsigned EID17:1; } C2RXF5EIDHBITS;
extern volatile C2RXF5EIDHBITS C2RXF5EIDHbits DSPIC_SFR;
extern volatile unsigned int C2RXF5EIDL DSPIC_SFR; /* 0x03EC */
typedef union {
  struct { unsigned :10; unsigned EID5_0:6; };
  struct { unsigned :10; unsigned EID5_00:1; unsigned EID5_01:1; unsigned EID5_02:1; unsigned EID5_03:1; unsigned EID5_04:1; unsigned EID5_05:1; };
} C2RXF5EIDLBITS;
extern volatile C2RXF5EIDLBITS C2RXF5EIDLbits DSPIC_SFR;
extern volatile unsigned int C2RXM0SID DSPIC_SFR; /* 0x03F0 */
typedef union {
  struct { unsigned MIDE:1; unsigned :1; unsigned SID:11; };
  struct { unsigned :2; unsigned SID0:1; unsigned SID1:1; unsigned SID2:1; unsigned SID3:1; unsigned SID4:1; unsigned SID5:1; unsigned SID6:1; unsigned SID7:1; unsigned SID8:1; unsigned SID9:1; unsigned SID10:1; };
} C2RXM0SIDBITS;
extern volatile C2RXM0SIDBITS C2RXM0SIDbits DSPIC_SFR;
extern volatile unsigned int C2RXM0EIDH DSPIC_SFR; /* 0x03F2 */
typedef struct { unsigned EID6:1; unsigned EID7:1; unsigned EID8:1; unsigned EID9:1; unsigned EID10:1; unsigned EID11:1; unsigned EID12:1; unsigned EID13:1; unsigned EID14:1; unsigned EID15:1; unsigned EID16:1; unsigned EID17:1; } C2RXM0EIDHBITS;
extern volatile C2RXM0EIDHBITS C2RXM0EIDHbits DSPIC_SFR;
extern volatile unsigned int C2RXM0EIDL DSPIC_SFR; /* 0x03F4 */
typedef union {
  struct { unsigned :10; unsigned EID5_0:6; };
  struct { unsigned :10; unsigned EID5_00:1; unsigned EID5_01:1; unsigned EID5_02:1; unsigned EID5_03:1; unsigned EID5_04:1; unsigned EID5_05:1; };
} C2RXM0EIDLBITS;
extern volatile C2RXM0EIDLBITS C2RXM0EIDLbits DSPIC_SFR;
extern volatile unsigned int C2RXM1SID DSPIC_SFR; /* 0x03F8 */
typedef union {
  struct { unsigned MIDE:1; unsigned :1; unsigned SID:11; };
  struct { unsigned :2; unsigned SID0:1; unsigned SID1:1; unsigned SID2:1; unsigned SID3:1; unsigned SID4:1; unsigned SID5:1; unsigned SID6:1; unsigned SID7:1; unsigned SID8:1; unsigned SID9:1; unsigned SID10:1; };
} C2RXM1SIDBITS;
extern volatile C2RXM1SIDBITS C2RXM1SIDbits DSPIC_SFR;
extern volatile unsigned int C2RXM1EIDH DSPIC_SFR; /* 0x03FA */
typedef struct { unsigned EID6:1; unsigned EID7:1; unsigned EID8:1; unsigned EID9:1; unsigned EID10:1; unsigned EID11:1; unsigned EID12:1; unsigned EID13:1; unsigned EID14:1; unsigned EID15:1; unsigned EID16:1; unsigned EID17:1; } C2RXM1EIDHBITS;
extern volatile C2RXM1EIDHBITS C2RXM1EIDHbits DSPIC_SFR;
extern volatile unsigned int C2RXM1EIDL DSPIC_SFR; /* 0x03FC */
typedef union {
  struct { unsigned :10; unsigned EID5_0:6; };
  struct { unsigned :10; unsigned EID5_00:1; unsigned EID5_01:1; unsigned EID5_02:1; unsigned EID5_03:1; unsigned EID5_04:1; unsigned EID5_05:1; };
} C2RXM1EIDLBITS;
extern volatile C2RXM1EIDLBITS C2RXM1EIDLbits DSPIC_SFR;
extern volatile unsigned int C2TX2SID DSPIC_SFR; /* 0x0400 */
typedef union {
  struct { unsigned TXIDE:1; unsigned SRR:1; unsigned SID5_0:6; unsigned :3; unsigned SID10_6:5; };
  struct { unsigned :2; unsigned SID5_00:1; unsigned SID5_01:1; unsigned SID5_02:1; unsigned SID5_03:1; unsigned SID5_04:1; unsigned SID5_05:1; unsigned :3; unsigned SID10_60:1; unsigned SID10_61:1; unsigned SID10_62:1; unsigned SID10_63:1; unsigned SID10_64:1; };
} C2TX2SIDBITS;
extern volatile C2TX2SIDBITS C2TX2SIDbits DSPIC_SFR;
extern volatile unsigned int C2TX2EID DSPIC_SFR; /* 0x0402 */
typedef union {
  struct { unsigned EID13_6:8; unsigned :4; unsigned EID17_14:4; };
  struct { unsigned EID13_60:1; unsigned EID13_61:1; unsigned EID13_62:1; unsigned EID13_63:1; unsigned EID13_64:1; unsigned EID13_65:1; unsigned EID13_66:1; unsigned EID13_67:1; unsigned :4; unsigned EID17_140:1; unsigned EID17_141:1; unsigned EID17_142:1; unsigned EID17_143:1; };
} C2TX2EIDBITS;
extern volatile C2TX2EIDBITS C2TX2EIDbits DSPIC_SFR;
extern volatile unsigned int C2TX2DLC DSPIC_SFR; /* 0x0404 */
typedef union {
  struct { unsigned :3; unsigned DLC:4; unsigned TXRB0:1; unsigned TXRB1:1; unsigned TXRTR:1; unsigned EID5_0:6; };
  struct { unsigned :3; unsigned DLC0:1; unsigned DLC1:1; unsigned DLC2:1; unsigned DLC3:1; unsigned :3; unsigned EID5_00:1; unsigned EID5_01:1; unsigned EID5_02:1; unsigned EID5_03:1; unsigned EID5_04:1; unsigned EID5_05:1; };
} C2TX2DLCBITS;
extern volatile C2TX2DLCBITS C2TX2DLCbits DSPIC_SFR;
extern volatile unsigned int C2TX2B1 DSPIC_SFR; /* 0x0406 */
extern volatile unsigned int C2TX2B2 DSPIC_SFR; /* 0x0408 */
extern volatile unsigned int C2TX2B3 DSPIC_SFR; /* 0x040A */
extern volatile unsigned int C2TX2B4 DSPIC_SFR; /* 0x040C */
extern volatile unsigned int C2TX2CON DSPIC_SFR; /* 0x040E */
typedef union {
  struct { unsigned TXPRI:2; unsigned :1; unsigned TXREQ:1; unsigned TXERR:1; unsigned TXLARB:1; unsigned TXABT:1; };
  struct { unsigned TXPRI0:1; unsigned TXPRI1:1; };
} C2TX2CONBITS;
extern volatile C2TX2CONBITS C2TX2CONbits DSPIC_SFR;
extern volatile unsigned int C2TX1SID DSPIC_SFR; /* 0x0410 */
typedef union {
  struct { unsigned TXIDE:1; unsigned SRR:1; unsigned SID5_0:6; unsigned :3; unsigned SID10_6:5; };
  struct { unsigned :2; unsigned SID5_00:1; unsigned SID5_01:1; unsigned SID5_02:1; unsigned SID5_03:1; unsigned SID5_04:1; unsigned SID5_05:1; unsigned :3; unsigned SID10_60:1; unsigned SID10_61:1; unsigned SID10_62:1; unsigned SID10_63:1; unsigned SID10_64:1; };
} C2TX1SIDBITS;
extern volatile C2TX1SIDBITS C2TX1SIDbits DSPIC_SFR;
extern volatile unsigned int C2TX1EID DSPIC_SFR; /* 0x0412 */
typedef union {
  struct { unsigned EID13_6:8; unsigned :4; unsigned EID17_14:4; };
  struct { unsigned EID13_60:1; unsigned EID13_61:1; unsigned EID13_62:1; unsigned EID13_63:1; unsigned EID13_64:1; unsigned EID13_65:1; unsigned EID13_66:1; unsigned EID13_67:1; unsigned :4; unsigned EID17_140:1; unsigned EID17_141:1; unsigned EID17_142:1; unsigned EID17_143:1; };
} C2TX1EIDBITS;
extern volatile C2TX1EIDBITS C2TX1EIDbits DSPIC_SFR;
extern volatile unsigned int C2TX1DLC DSPIC_SFR; /* 0x0414 */
typedef union {
  struct { unsigned :3; unsigned DLC:4; unsigned TXRB0:1; unsigned TXRB1:1; unsigned TXRTR:1; unsigned EID5_0:6; };
  struct { unsigned :3; unsigned DLC0:1; unsigned DLC1:1; unsigned DLC2:1; unsigned DLC3:1; unsigned :3; unsigned EID5_00:1; unsigned EID5_01:1; unsigned EID5_02:1; unsigned EID5_03:1; unsigned EID5_04:1; unsigned EID5_05:1; };
} C2TX1DLCBITS;
extern volatile C2TX1DLCBITS C2TX1DLCbits DSPIC_SFR;
extern volatile unsigned int C2TX1B1 DSPIC_SFR; /* 0x0416 */
extern volatile unsigned int C2TX1B2 DSPIC_SFR; /* 0x0418 */
extern volatile unsigned int C2TX1B3 DSPIC_SFR; /* 0x041A */
extern volatile unsigned int C2TX1B4 DSPIC_SFR; /* 0x041C */
extern volatile unsigned int C2TX1CON DSPIC_SFR; /* 0x041E */
typedef union {
  struct { unsigned TXPRI:2; unsigned :1; unsigned TXREQ:1; unsigned TXERR:1; unsigned TXLARB:1; unsigned TXABT:1; };
  struct { unsigned TXPRI0:1; unsigned TXPRI1:1; };
} C2TX1CONBITS;
extern volatile C2TX1CONBITS C2TX1CONbits DSPIC_SFR;
extern volatile unsigned int C2TX0SID DSPIC_SFR; /* 0x0420 */
typedef union {
  struct { unsigned TXIDE:1; unsigned SRR:1; unsigned SID5_0:6; unsigned :3; unsigned SID10_6:5; };
  struct { unsigned :2; unsigned SID5_00:1; unsigned SID5_01:1; unsigned SID5_02:1; unsigned SID5_03:1; unsigned SID5_04:1; unsigned SID5_05:1; unsigned :3; unsigned SID10_60:1; unsigned SID10_61:1; unsigned SID10_62:1; unsigned SID10_63:1; unsigned SID10_64:1; };
} C2TX0SIDBITS;
extern volatile C2TX0SIDBITS C2TX0SIDbits DSPIC_SFR;
extern volatile unsigned int C2TX0EID DSPIC_SFR; /* 0x0422 */
typedef union {
  struct { unsigned EID13_6:8; unsigned :4; unsigned EID17_14:4; };
  struct { unsigned EID13_60:1; unsigned EID13_61:1; unsigned EID13_62:1; unsigned EID13_63:1; unsigned EID13_64:1; unsigned EID13_65:1; unsigned EID13_66:1; unsigned EID13_67:1; unsigned :4; unsigned EID17_140:1; unsigned EID17_141:1; unsigned EID17_142:1; unsigned EID17_143:1; };
} C2TX0EIDBITS;
extern volatile C2TX0EIDBITS C2TX0EIDbits DSPIC_SFR;
extern volatile unsigned int C2TX0DLC DSPIC_SFR; /* 0x0424 */
typedef union {
  struct { unsigned :3; unsigned DLC:4; unsigned TXRB0:1; unsigned TXRB1:1; unsigned TXRTR:1; unsigned EID5_0:6; };
  struct { unsigned :3; unsigned DLC0:1; unsigned DLC1:1; unsigned DLC2:1; unsigned DLC3:1; unsigned :3; unsigned EID5_00:1; unsigned EID5_01:1; unsigned EID5_02:1; unsigned EID5_03:1; unsigned EID5_04:1; unsigned EID5_05:1; };
} C2TX0DLCBITS;
extern volatile C2TX0DLCBITS C2TX0DLCbits DSPIC_SFR;
extern volatile unsigned int C2TX0B1 DSPIC_SFR; /* 0x0426 */
extern volatile unsigned int C2TX0B2 DSPIC_SFR; /* 0x0428 */
extern volatile unsigned int C2TX0B3 DSPIC_SFR; /* 0x042A */
extern volatile unsigned int C2TX0B4 DSPIC_SFR; /* 0x042C */
extern volatile unsigned int C2TX0CON DSPIC_SFR; /* 0x042E */
typedef union {
  struct { unsigned TXPRI:2; unsigned :1; unsigned TXREQ:1; unsigned TXERR:1; unsigned TXLARB:1; unsigned TXABT:1; };
  struct { unsigned TXPRI0:1; unsigned TXPRI1:1; };
} C2TX0CONBITS;
extern volatile C2TX0CONBITS C2TX0CONbits DSPIC_SFR;
extern volatile unsigned int C2RX1SID DSPIC_SFR; /* 0x0430 */
typedef union {
  struct { unsigned RXIDE:1; unsigned SRR:1; unsigned SID:11; };
  struct { unsigned :2; unsigned SID0:1; unsigned SID1:1; unsigned SID2:1; unsigned SID3:1; unsigned SID4:1; unsigned SID5:1; unsigned SID6:1; unsigned SID7:1; unsigned SID8:1; unsigned SID9:1; unsigned SID10:1; };
} C2RX1SIDBITS;
extern volatile C2RX1SIDBITS C2RX1SIDbits DSPIC_SFR;
extern volatile unsigned int C2RX1EID DSPIC_SFR; /* 0x0432 */
typedef struct { unsigned EID6:1; unsigned EID7:1; unsigned EID8:1; unsigned EID9:1; unsigned EID10:1; unsigned EID11:1; unsigned EID12:1; unsigned EID13:1; unsigned EID14:1; unsigned EID15:1; unsigned EID16:1; unsigned EID17:1; } C2RX1EIDBITS;
extern volatile C2RX1EIDBITS C2RX1EIDbits DSPIC_SFR;
extern volatile unsigned int C2RX1DLC DSPIC_SFR; /* 0x0434 */
typedef union {
  struct { unsigned DLC:4; unsigned RXRB0:1; unsigned :3; unsigned RXRB1:1; unsigned RXRTR:1; unsigned EID5_0:6; };
  struct { unsigned DLC0:1; unsigned DLC1:1; unsigned DLC2:1; unsigned DLC3:1; unsigned :6; unsigned EID5_00:1; unsigned EID5_01:1; unsigned EID5_02:1; unsigned EID5_03:1; unsigned EID5_04:1; unsigned EID5_05:1; };
} C2RX1DLCBITS;
extern volatile C2RX1DLCBITS C2RX1DLCbits DSPIC_SFR;
extern volatile unsigned int C2RX1B1 DSPIC_SFR; /* 0x0436 */
extern volatile unsigned int C2RX1B2 DSPIC_SFR; /* 0x0438 */
extern volatile unsigned int C2RX1B3 DSPIC_SFR; /* 0x043A */
extern volatile unsigned int C2RX1B4 DSPIC_SFR; /* 0x043C */
extern volatile unsigned int C2RX1CON DSPIC_SFR; /* 0x043E */
typedef union {
  struct { unsigned FILHIT:3; unsigned RXRTRRO:1; unsigned :3; unsigned RXFUL:1; };
  struct { unsigned FILHIT0:1; unsigned FILHIT1:1; unsigned FILHIT2:1; };
} C2RX1CONBITS;
extern volatile C2RX1CONBITS C2RX1CONbits DSPIC_SFR;
extern volatile unsigned int C2RX0SID DSPIC_SFR; /* 0x0440 */
typedef union {
  struct { unsigned RXIDE:1; unsigned SRR:1; unsigned SID:11; };
  struct { unsigned :2; unsigned SID0:1; unsigned SID1:1; unsigned SID2:1; unsigned SID3:1; unsigned SID4:1; unsigned SID5:1; unsigned SID6:1; unsigned SID7:1; unsigned SID8:1; unsigned SID9:1; unsigned SID10:1; };
} C2RX0SIDBITS;
extern volatile C2RX0SIDBITS C2RX0SIDbits DSPIC_SFR;
extern volatile unsigned int C2RX0EID DSPIC_SFR; /* 0x0442 */
typedef struct { unsigned EID6:1; unsigned EID7:1; unsigned EID8:1; unsigned EID9:1; unsigned EID10:1; unsigned EID11:1; unsigned EID12:1; unsigned EID13:1; unsigned EID14:1; unsigned EID15:1; unsigned EID16:1; unsigned EID17:1; } C2RX0EIDBITS;
extern volatile C2RX0EIDBITS C2RX0EIDbits DSPIC_SFR;
extern volatile unsigned int C2RX0DLC DSPIC_SFR; /* 0x0444 */
typedef union {
  struct { unsigned DLC:4; unsigned RXRB0:1; unsigned :3; unsigned RXRB1:1; unsigned RXRTR:1; unsigned EID5_0:6; };
  struct { unsigned DLC0:1; unsigned DLC1:1; unsigned DLC2:1; unsigned DLC3:1; unsigned :6; unsigned EID5_00:1; unsigned EID5_01:1; unsigned EID5_02:1; unsigned EID5_03:1; unsigned EID5_04:1; unsigned EID5_05:1; };
} C2RX0DLCBITS;
extern volatile C2RX0DLCBITS C2RX0DLCbits DSPIC_SFR;
extern volatile unsigned int C2RX0B1 DSPIC_SFR; /* 0x0446 */
extern volatile unsigned int C2RX0B2 DSPIC_SFR; /* 0x0448 */
extern volatile unsigned int C2RX0B3 DSPIC_SFR; /* 0x044A */
extern volatile unsigned int C2RX0B4 DSPIC_SFR; /* 0x044C */
extern volatile unsigned int C2RX0CON DSPIC_SFR; /* 0x044E */
typedef union {
  struct { unsigned FILHIT0:1; unsigned JTOFF:1; unsigned DBEN:1; unsigned RXRTRRO:1; unsigned :3; unsigned RXFUL:1; };
  struct { unsigned FILHIT:1; unsigned :1; unsigned RXB0DBEN:1; };
} C2RX0CONBITS;
extern volatile C2RX0CONBITS C2RX0CONbits DSPIC_SFR;
extern volatile unsigned int C2CTRL DSPIC_SFR; /* 0x0450 */
typedef union {
  struct { unsigned :1; unsigned ICODE:3; unsigned :1; unsigned OPMODE:3; unsigned REQOP:3; unsigned CANCKS:1; unsigned ABAT:1; unsigned CANSIDL:1; unsigned CANFRZ:1; unsigned CANCAP:1; };
  struct { unsigned :1; unsigned ICODE0:1; unsigned ICODE1:1; unsigned ICODE2:1; unsigned :1; unsigned OPMODE0:1; unsigned OPMODE1:1; unsigned OPMODE2:1; unsigned REQOP0:1; unsigned REQOP1:1; unsigned REQOP2:1; };
  struct { unsigned :13; unsigned CSIDL:1; };
} C2CTRLBITS;
extern volatile C2CTRLBITS C2CTRLbits DSPIC_SFR;
extern volatile unsigned int C2CFG1 DSPIC_SFR; /* 0x0452 */
typedef union {
  struct { unsigned BRP:6; unsigned SJW:2; };
  struct { unsigned BRP0:1; unsigned BRP1:1; unsigned BRP2:1; unsigned BRP3:1; unsigned BRP4:1; unsigned BRP5:1; unsigned SJW0:1; unsigned SJW1:1; };
} C2CFG1BITS;
extern volatile C2CFG1BITS C2CFG1bits DSPIC_SFR;
extern volatile unsigned int C2CFG2 DSPIC_SFR; /* 0x0454 */
typedef union {
  struct { unsigned PRSEG:3; unsigned SEG1PH:3; unsigned SAM:1; unsigned SEG2PHTS:1; unsigned SEG2PH:3; unsigned :3; unsigned WAKFIL:1; };
  struct { unsigned PRSEG0:1; unsigned PRSEG1:1; unsigned PRSEG2:1; unsigned SEG1PH0:1; unsigned SEG1PH1:1; unsigned SEG1PH2:1; unsigned :2; unsigned SEG2PH0:1; unsigned SEG2PH1:1; unsigned SEG2PH2:1; };
} C2CFG2BITS;
extern volatile C2CFG2BITS C2CFG2bits DSPIC_SFR;
extern volatile unsigned int C2INTF DSPIC_SFR; /* 0x0456 */
typedef union {
  struct { unsigned RXB0IF:1; unsigned RXB1IF:1; unsigned TXB0IF:1; unsigned TXB1IF:1; unsigned TXB2IF:1; unsigned ERRIF:1; unsigned WAKIF:1; unsigned IRXIF:1; unsigned EWARN:1; unsigned RXWARN:1; unsigned TXWARN:1; unsigned RXBP:1; unsigned TXBP:1; unsigned TXBO:1; unsigned RXB1OVFL:1; unsigned RXB0OVFL:1; };
  struct { unsigned RX0IF:1; unsigned RX1IF:1; unsigned TX0IF:1; unsigned TX1IF:1; unsigned TX2IF:1; unsigned :2; unsigned IVRIF:1; unsigned :1; unsigned RXWAR:1; unsigned TXWAR:1; unsigned RXEP:1; unsigned TXEP:1; unsigned :1; unsigned RX1OVR:1; unsigned RX0OVR:1; };
} C2INTFBITS;
extern volatile C2INTFBITS C2INTFbits DSPIC_SFR;
extern volatile unsigned int C2INTE DSPIC_SFR; /* 0x0458 */
typedef union {
  struct { unsigned RXB0IE:1; unsigned RXB1IE:1; unsigned TXB0IE:1; unsigned TXB1IE:1; unsigned TXB2IE:1; unsigned ERRIE:1; unsigned WAKIE:1; unsigned IRXIE:1; };
  struct { unsigned RX0IE:1; unsigned RX1IE:1; unsigned TX0IE:1; unsigned TX1IE:1; unsigned TX2IE:1; unsigned :2; unsigned IVRIE:1; };
} C2INTEBITS;
extern volatile C2INTEBITS C2INTEbits DSPIC_SFR;
extern volatile unsigned int C2EC DSPIC_SFR; /* 0x045A */
typedef struct { unsigned REC0:1; unsigned REC1:1; unsigned REC2:1; unsigned REC3:1; unsigned REC4:1; unsigned REC5:1; unsigned REC6:1; unsigned REC7:1; unsigned TEC0:1; unsigned TEC1:1; unsigned TEC2:1; unsigned TEC3:1; unsigned TEC4:1; unsigned TEC5:1; unsigned TEC6:1; unsigned TEC7:1; } C2ECBITS;
extern volatile C2ECBITS C2ECbits DSPIC_SFR;
extern volatile unsigned char C2RERRCNT DSPIC_SFR; /* 0x045A */
extern volatile unsigned char C2TERRCNT DSPIC_SFR; /* 0x045B */
extern volatile unsigned int RCON DSPIC_SFR; /* 0x0740 */
typedef union {
  struct { unsigned POR:1; unsigned BOR:1; unsigned IDLE:1; unsigned SLEEP:1; unsigned WDTO:1; unsigned SWDTEN:1; unsigned SWR:1; unsigned EXTR:1; unsigned LVDL:4; unsigned LVDEN:1; unsigned BGST:1; unsigned IOPUWR:1; unsigned TRAPR:1; };
  struct { unsigned :8; unsigned LVDL0:1; unsigned LVDL1:1; unsigned LVDL2:1; unsigned LVDL3:1; };
} RCONBITS;
extern volatile RCONBITS RCONbits DSPIC_SFR;
extern volatile unsigned int OSCCON DSPIC_SFR; /* 0x0742 */
typedef union {
  struct { unsigned OSWEN:1; unsigned LPOSCEN:1; unsigned :1; unsigned CF:1; unsigned :1; unsigned LOCK:1; unsigned POST:2; unsigned NOSC:3; unsigned :1; unsigned COSC:3; };
  struct { unsigned :6; unsigned POST0:1; unsigned POST1:1; unsigned NOSC0:1; unsigned NOSC1:1; unsigned NOSC2:1; unsigned :1; unsigned COSC0:1; unsigned COSC1:1; unsigned COSC2:1; };
} OSCCONBITS;
extern volatile OSCCONBITS OSCCONbits DSPIC_SFR;
extern volatile unsigned char OSCCONL DSPIC_SFR; /* 0x0742 */
extern volatile unsigned char OSCCONH DSPIC_SFR; /* 0x0743 */
extern volatile unsigned int OSCTUN DSPIC_SFR; /* 0x0744 */
typedef struct { unsigned TUN0:1; unsigned TUN1:1; unsigned TUN2:1; unsigned TUN3:1; } OSCTUNBITS;
extern volatile OSCTUNBITS OSCTUNbits DSPIC_SFR;
extern volatile unsigned int BSRAM DSPIC_SFR; /* 0x0750 */
typedef struct { unsigned RL_BSR:1; unsigned IR_BSR:1; unsigned IW_BSR:1; } BSRAMBITS;
extern volatile BSRAMBITS BSRAMbits DSPIC_SFR;
extern volatile unsigned int SSRAM DSPIC_SFR; /* 0x0752 */
typedef struct { unsigned RL_SSR:1; unsigned IR_SSR:1; unsigned IW_SSR:1; } SSRAMBITS;
extern volatile SSRAMBITS SSRAMbits DSPIC_SFR;
extern volatile unsigned int NVMCON DSPIC_SFR; /* 0x0760 */
typedef union {
  struct { unsigned PROGOP:7; unsigned :1; unsigned TWRI:1; unsigned :4; unsigned WRERR:1; unsigned WREN:1; unsigned WR:1; };
  struct { unsigned PROGOP0:1; unsigned PROGOP1:1; unsigned PROGOP2:1; unsigned PROGOP3:1; unsigned PROGOP4:1; unsigned PROGOP5:1; unsigned PROGOP6:1; };
} NVMCONBITS;
extern volatile NVMCONBITS NVMCONbits DSPIC_SFR;
extern volatile unsigned int NVMADR DSPIC_SFR; /* 0x0762 */
extern volatile unsigned int NVMADRU DSPIC_SFR; /* 0x0764 */
typedef union {
  struct { unsigned NVMADR:8; };
  struct { unsigned NVMADR0:1; unsigned NVMADR1:1; unsigned NVMADR2:1; unsigned NVMADR3:1; unsigned NVMADR4:1; unsigned NVMADR5:1; unsigned NVMADR6:1; unsigned NVMADR7:1; };
} NVMADRUBITS;
extern volatile NVMADRUBITS NVMADRUbits DSPIC_SFR;
extern volatile unsigned int NVMKEY DSPIC_SFR; /* 0x0766 */
extern volatile unsigned int PMD1 DSPIC_SFR; /* 0x0770 */
typedef struct { unsigned ADCMD:1; unsigned C1MD:1; unsigned C2MD:1; unsigned SPI1MD:1; unsigned SPI2MD:1; unsigned U1MD:1; unsigned U2MD:1; unsigned I2CMD:1; unsigned DCIMD:1; unsigned :2; unsigned T1MD:1; unsigned T2MD:1; unsigned T3MD:1; unsigned T4MD:1; unsigned T5MD:1; } PMD1BITS;
extern volatile PMD1BITS PMD1bits DSPIC_SFR;
extern volatile unsigned int PMD2 DSPIC_SFR; /* 0x0772 */
typedef struct { unsigned OC1MD:1; unsigned OC2MD:1; unsigned OC3MD:1; unsigned OC4MD:1; unsigned OC5MD:1; unsigned OC6MD:1; unsigned OC7MD:1; unsigned OC8MD:1; unsigned IC1MD:1; unsigned IC2MD:1; unsigned IC3MD:1; unsigned IC4MD:1; unsigned IC5MD:1; unsigned IC6MD:1; unsigned IC7MD:1; unsigned IC8MD:1; } PMD2BITS;
extern volatile PMD2BITS PMD2bits DSPIC_SFR;
extern volatile unsigned int PMD3 DSPIC_SFR; /* 0x0774 */

/* Bits whose name is unique on this chip. */
#define _C SRbits.C
#define _Z SRbits.Z
#define _OV SRbits.OV
#define _N SRbits.N
#define _RA SRbits.RA
#define _IPL SRbits.IPL
#define _DC SRbits.DC
#define _DA SRbits.DA
#define _SAB SRbits.SAB
#define _OAB SRbits.OAB
#define _SB SRbits.SB
#define _SA SRbits.SA
#define _OB SRbits.OB
#define _OA SRbits.OA
#define _IF CORCONbits.IF
#define _RND CORCONbits.RND
#define _PSV CORCONbits.PSV
#define _IPL3 CORCONbits.IPL3
#define _ACCSAT CORCONbits.ACCSAT
#define _SATDW CORCONbits.SATDW
#define _SATB CORCONbits.SATB
#define _SATA CORCONbits.SATA
#define _DL CORCONbits.DL
#define _EDT CORCONbits.EDT
#define _US CORCONbits.US
#define _XWM MODCONbits.XWM
#define _YWM MODCONbits.YWM
#define _BWM MODCONbits.BWM
#define _YMODEN MODCONbits.YMODEN
#define _XMODEN MODCONbits.XMODEN
#define _XB XBREVbits.XB
#define _BREN XBREVbits.BREN
#define _DISICNT DISICNTbits.DISICNT
#define _OSCFAIL INTCON1bits.OSCFAIL
#define _STKERR INTCON1bits.STKERR
#define _ADDRERR INTCON1bits.ADDRERR
#define _MATHERR INTCON1bits.MATHERR
#define _COVTE INTCON1bits.COVTE
#define _OVBTE INTCON1bits.OVBTE
#define _OVATE INTCON1bits.OVATE
#define _NSTDIS INTCON1bits.NSTDIS
#define _INT0EP INTCON2bits.INT0EP
#define _INT1EP INTCON2bits.INT1EP
#define _INT2EP INTCON2bits.INT2EP
#define _INT3EP INTCON2bits.INT3EP
#define _INT4EP INTCON2bits.INT4EP
#define _DISI INTCON2bits.DISI
#define _ALTIVT INTCON2bits.ALTIVT
#define _INT0IF IFS0bits.INT0IF
#define _IC1IF IFS0bits.IC1IF
#define _OC1IF IFS0bits.OC1IF
#define _T1IF IFS0bits.T1IF
#define _IC2IF IFS0bits.IC2IF
#define _OC2IF IFS0bits.OC2IF
#define _T2IF IFS0bits.T2IF
#define _T3IF IFS0bits.T3IF
#define _SPI1IF IFS0bits.SPI1IF
#define _U1RXIF IFS0bits.U1RXIF
#define _U1TXIF IFS0bits.U1TXIF
#define _ADIF IFS0bits.ADIF
#define _NVMIF IFS0bits.NVMIF
#define _SI2CIF IFS0bits.SI2CIF
#define _MI2CIF IFS0bits.MI2CIF
#define _CNIF IFS0bits.CNIF
#define _INT1IF IFS1bits.INT1IF
#define _IC7IF IFS1bits.IC7IF
#define _IC8IF IFS1bits.IC8IF
#define _OC3IF IFS1bits.OC3IF
#define _OC4IF IFS1bits.OC4IF
#define _T4IF IFS1bits.T4IF
#define _T5IF IFS1bits.T5IF
#define _INT2IF IFS1bits.INT2IF
#define _U2RXIF IFS1bits.U2RXIF
#define _U2TXIF IFS1bits.U2TXIF
#define _SPI2IF IFS1bits.SPI2IF
#define _C1IF IFS1bits.C1IF
#define _IC3IF IFS1bits.IC3IF
#define _IC4IF IFS1bits.IC4IF
#define _IC5IF IFS1bits.IC5IF
#define _IC6IF IFS1bits.IC6IF
#define _OC5IF IFS2bits.OC5IF
#define _OC6IF IFS2bits.OC6IF
#define _OC7IF IFS2bits.OC7IF
#define _OC8IF IFS2bits.OC8IF
#define _INT3IF IFS2bits.INT3IF
#define _INT4IF IFS2bits.INT4IF
#define _C2IF IFS2bits.C2IF
#define _DCIIF IFS2bits.DCIIF
#define _LVDIF IFS2bits.LVDIF
#define _INT0IE IEC0bits.INT0IE
#define _IC1IE IEC0bits.IC1IE
#define _OC1IE IEC0bits.OC1IE
#define _T1IE IEC0bits.T1IE
#define _IC2IE IEC0bits.IC2IE
#define _OC2IE IEC0bits.OC2IE
#define _T2IE IEC0bits.T2IE
#define _T3IE IEC0bits.T3IE
#define _SPI1IE IEC0bits.SPI1IE
#define _U1RXIE IEC0bits.U1RXIE
#define _U1TXIE IEC0bits.U1TXIE
#define _ADIE IEC0bits.ADIE
#define _NVMIE IEC0bits.NVMIE
#define _SI2CIE IEC0bits.SI2CIE
#define _MI2CIE IEC0bits.MI2CIE
#define _CNIE IEC0bits.CNIE
#define _INT1IE IEC1bits.INT1IE
#define _IC7IE IEC1bits.IC7IE
#define _IC8IE IEC1bits.IC8IE
#define _OC3IE IEC1bits.OC3IE
#define _OC4IE IEC1bits.OC4IE
#define _T4IE IEC1bits.T4IE
#define _T5IE IEC1bits.T5IE
#define _INT2IE IEC1bits.INT2IE
#define _U2RXIE IEC1bits.U2RXIE
#define _U2TXIE IEC1bits.U2TXIE
#define _SPI2IE IEC1bits.SPI2IE
#define _C1IE IEC1bits.C1IE
#define _IC3IE IEC1bits.IC3IE
#define _IC4IE IEC1bits.IC4IE
#define _IC5IE IEC1bits.IC5IE
#define _IC6IE IEC1bits.IC6IE
#define _OC5IE IEC2bits.OC5IE
#define _OC6IE IEC2bits.OC6IE
#define _OC7IE IEC2bits.OC7IE
#define _OC8IE IEC2bits.OC8IE
#define _INT3IE IEC2bits.INT3IE
#define _INT4IE IEC2bits.INT4IE
#define _C2IE IEC2bits.C2IE
#define _DCIIE IEC2bits.DCIIE
#define _LVDIE IEC2bits.LVDIE
#define _INT0IP IPC0bits.INT0IP
#define _IC1IP IPC0bits.IC1IP
#define _OC1IP IPC0bits.OC1IP
#define _T1IP IPC0bits.T1IP
#define _IC2IP IPC1bits.IC2IP
#define _OC2IP IPC1bits.OC2IP
#define _T2IP IPC1bits.T2IP
#define _T3IP IPC1bits.T3IP
#define _SPI1IP IPC2bits.SPI1IP
#define _U1RXIP IPC2bits.U1RXIP
#define _U1TXIP IPC2bits.U1TXIP
#define _ADIP IPC2bits.ADIP
#define _NVMIP IPC3bits.NVMIP
#define _SI2CIP IPC3bits.SI2CIP
#define _MI2CIP IPC3bits.MI2CIP
#define _CNIP IPC3bits.CNIP
#define _INT1IP IPC4bits.INT1IP
#define _IC7IP IPC4bits.IC7IP
#define _IC8IP IPC4bits.IC8IP
#define _OC3IP IPC4bits.OC3IP
#define _OC4IP IPC5bits.OC4IP
#define _T4IP IPC5bits.T4IP
#define _T5IP IPC5bits.T5IP
#define _INT2IP IPC5bits.INT2IP
#define _U2RXIP IPC6bits.U2RXIP
#define _U2TXIP IPC6bits.U2TXIP
#define _SPI2IP IPC6bits.SPI2IP
#define _C1IP IPC6bits.C1IP
#define _IC3IP IPC7bits.IC3IP
#define _IC4IP IPC7bits.IC4IP
#define _IC5IP IPC7bits.IC5IP
#define _IC6IP IPC7bits.IC6IP
#define _OC5IP IPC8bits.OC5IP
#define _OC6IP IPC8bits.OC6IP
#define _OC7IP IPC8bits.OC7IP
#define _OC8IP IPC8bits.OC8IP
#define _INT3IP IPC9bits.INT3IP
#define _INT4IP IPC9bits.INT4IP
#define _C2IP IPC9bits.C2IP
#define _DCIIP IPC10bits.DCIIP
#define _LVDIP IPC10bits.LVDIP
#define _VECNUM INTTREGbits.VECNUM
#define _ILR INTTREGbits.ILR
#define _VHOLD INTTREGbits.VHOLD
#define _TMODE INTTREGbits.TMODE
#define _IRQTOCPU INTTREGbits.IRQTOCPU
#define _CN0IE CNEN1bits.CN0IE
#define _CN1IE CNEN1bits.CN1IE
#define _CN2IE CNEN1bits.CN2IE
#define _CN3IE CNEN1bits.CN3IE
#define _CN4IE CNEN1bits.CN4IE
#define _CN5IE CNEN1bits.CN5IE
#define _CN6IE CNEN1bits.CN6IE
#define _CN7IE CNEN1bits.CN7IE
#define _CN8IE CNEN1bits.CN8IE
#define _CN9IE CNEN1bits.CN9IE
#define _CN10IE CNEN1bits.CN10IE
#define _CN11IE CNEN1bits.CN11IE
#define _CN12IE CNEN1bits.CN12IE
#define _CN13IE CNEN1bits.CN13IE
#define _CN14IE CNEN1bits.CN14IE
#define _CN15IE CNEN1bits.CN15IE
#define _CN16IE CNEN2bits.CN16IE
#define _CN17IE CNEN2bits.CN17IE
#define _CN18IE CNEN2bits.CN18IE
#define _CN19IE CNEN2bits.CN19IE
#define _CN20IE CNEN2bits.CN20IE
#define _CN21IE CNEN2bits.CN21IE
#define _CN22IE CNEN2bits.CN22IE
#define _CN23IE CNEN2bits.CN23IE
#define _CN0PUE CNPU1bits.CN0PUE
#define _CN1PUE CNPU1bits.CN1PUE
#define _CN2PUE CNPU1bits.CN2PUE
#define _CN3PUE CNPU1bits.CN3PUE
#define _CN4PUE CNPU1bits.CN4PUE
#define _CN5PUE CNPU1bits.CN5PUE
#define _CN6PUE CNPU1bits.CN6PUE
#define _CN7PUE CNPU1bits.CN7PUE
#define _CN8PUE CNPU1bits.CN8PUE
#define _CN9PUE CNPU1bits.CN9PUE
#define _CN10PUE CNPU1bits.CN10PUE
#define _CN11PUE CNPU1bits.CN11PUE
#define _CN12PUE CNPU1bits.CN12PUE
#define _CN13PUE CNPU1bits.CN13PUE
#define _CN14PUE CNPU1bits.CN14PUE
#define _CN15PUE CNPU1bits.CN15PUE
#define _CN16PUE CNPU2bits.CN16PUE
#define _CN17PUE CNPU2bits.CN17PUE
#define _CN18PUE CNPU2bits.CN18PUE
#define _CN19PUE CNPU2bits.CN19PUE
#define _CN20PUE CNPU2bits.CN20PUE
#define _CN21PUE CNPU2bits.CN21PUE
#define _CN22PUE CNPU2bits.CN22PUE
#define _CN23PUE CNPU2bits.CN23PUE
#define _TSYNC T1CONbits.TSYNC
#define _I2CRCV I2CRCVbits.I2CRCV
#define _I2CTRN I2CTRNbits.I2CTRN
#define _I2CBRG I2CBRGbits.I2CBRG
#define _SEN I2CCONbits.SEN
#define _RSEN I2CCONbits.RSEN
#define _PEN I2CCONbits.PEN
#define _RCEN I2CCONbits.RCEN
#define _ACKEN I2CCONbits.ACKEN
#define _ACKDT I2CCONbits.ACKDT
#define _STREN I2CCONbits.STREN
#define _GCEN I2CCONbits.GCEN
#define _SMEN I2CCONbits.SMEN
#define _DISSLW I2CCONbits.DISSLW
#define _A10M I2CCONbits.A10M
#define _IPMIEN I2CCONbits.IPMIEN
#define _SCLREL I2CCONbits.SCLREL
#define _I2CSIDL I2CCONbits.I2CSIDL
#define _I2CEN I2CCONbits.I2CEN
#define _TBF I2CSTATbits.TBF
#define _RBF I2CSTATbits.RBF
#define _R_NOT_W I2CSTATbits.R_NOT_W
#define _S I2CSTATbits.S
#define _P I2CSTATbits.P
#define _D_NOT_A I2CSTATbits.D_NOT_A
#define _I2COV I2CSTATbits.I2COV
#define _IWCOL I2CSTATbits.IWCOL
#define _ADD10 I2CSTATbits.ADD10
#define _GCSTAT I2CSTATbits.GCSTAT
#define _BCL I2CSTATbits.BCL
#define _TRSTAT I2CSTATbits.TRSTAT
#define _ACKSTAT I2CSTATbits.ACKSTAT
#define _R_W I2CSTATbits.R_W
#define _D_A I2CSTATbits.D_A
#define _I2CADD I2CADDbits.I2CADD
#define _ALTIO U1MODEbits.ALTIO
#define _COFSM DCICON1bits.COFSM
#define _DJST DCICON1bits.DJST
#define _CSDOM DCICON1bits.CSDOM
#define _UNFM DCICON1bits.UNFM
#define _COFSD DCICON1bits.COFSD
#define _CSCKE DCICON1bits.CSCKE
#define _CSCKD DCICON1bits.CSCKD
#define _DLOOP DCICON1bits.DLOOP
#define _DCISIDL DCICON1bits.DCISIDL
#define _DCIEN DCICON1bits.DCIEN
#define _WS DCICON2bits.WS
#define _COFSG DCICON2bits.COFSG
#define _BLEN DCICON2bits.BLEN
#define _BCG DCICON3bits.BCG
#define _TMPTY DCISTATbits.TMPTY
#define _TUNF DCISTATbits.TUNF
#define _RFUL DCISTATbits.RFUL
#define _ROV DCISTATbits.ROV
#define _SLOT DCISTATbits.SLOT
#define _TSE0 TSCONbits.TSE0
#define _TSE1 TSCONbits.TSE1
#define _TSE2 TSCONbits.TSE2
#define _TSE3 TSCONbits.TSE3
#define _TSE4 TSCONbits.TSE4
#define _TSE5 TSCONbits.TSE5
#define _TSE6 TSCONbits.TSE6
#define _TSE7 TSCONbits.TSE7
#define _TSE8 TSCONbits.TSE8
#define _TSE9 TSCONbits.TSE9
#define _TSE10 TSCONbits.TSE10
#define _TSE11 TSCONbits.TSE11
#define _TSE12 TSCONbits.TSE12
#define _TSE13 TSCONbits.TSE13
#define _TSE14 TSCONbits.TSE14
#define _TSE15 TSCONbits.TSE15
#define _RSE0 RSCONbits.RSE0
#define _RSE1 RSCONbits.RSE1
#define _RSE2 RSCONbits.RSE2
#define _RSE3 RSCONbits.RSE3
#define _RSE4 RSCONbits.RSE4
#define _RSE5 RSCONbits.RSE5
#define _RSE6 RSCONbits.RSE6
#define _RSE7 RSCONbits.RSE7
#define _RSE8 RSCONbits.RSE8
#define _RSE9 RSCONbits.RSE9
#define _RSE10 RSCONbits.RSE10
#define _RSE11 RSCONbits.RSE11
#define _RSE12 RSCONbits.RSE12
#define _RSE13 RSCONbits.RSE13
#define _RSE14 RSCONbits.RSE14
#define _RSE15 RSCONbits.RSE15
#define _DONE ADCON1bits.DONE
#define _SAMP ADCON1bits.SAMP
#define _ASAM ADCON1bits.ASAM
#define _SSRC ADCON1bits.SSRC
#define _FORM ADCON1bits.FORM
#define _ADSIDL ADCON1bits.ADSIDL
#define _ADON ADCON1bits.ADON
#define _ALTS ADCON2bits.ALTS
#define _BUFM ADCON2bits.BUFM
#define _SMPI ADCON2bits.SMPI
#define _BUFS ADCON2bits.BUFS
#define _CSCNA ADCON2bits.CSCNA
#define _VCFG ADCON2bits.VCFG
#define _ADCS ADCON3bits.ADCS
#define _ADRC ADCON3bits.ADRC
#define _SAMC ADCON3bits.SAMC
#define _CH0SA ADCHSbits.CH0SA
#define _CH0NA ADCHSbits.CH0NA
#define _CH0SB ADCHSbits.CH0SB
#define _CH0NB ADCHSbits.CH0NB
#define _PCFG0 ADPCFGbits.PCFG0
#define _PCFG1 ADPCFGbits.PCFG1
#define _PCFG2 ADPCFGbits.PCFG2
#define _PCFG3 ADPCFGbits.PCFG3
#define _PCFG4 ADPCFGbits.PCFG4
#define _PCFG5 ADPCFGbits.PCFG5
#define _PCFG6 ADPCFGbits.PCFG6
#define _PCFG7 ADPCFGbits.PCFG7
#define _PCFG8 ADPCFGbits.PCFG8
#define _PCFG9 ADPCFGbits.PCFG9
#define _PCFG10 ADPCFGbits.PCFG10
#define _PCFG11 ADPCFGbits.PCFG11
#define _PCFG12 ADPCFGbits.PCFG12
#define _PCFG13 ADPCFGbits.PCFG13
#define _PCFG14 ADPCFGbits.PCFG14
#define _PCFG15 ADPCFGbits.PCFG15
#define _CSSL0 ADCSSLbits.CSSL0
#define _CSSL1 ADCSSLbits.CSSL1
#define _CSSL2 ADCSSLbits.CSSL2
#define _CSSL3 ADCSSLbits.CSSL3
#define _CSSL4 ADCSSLbits.CSSL4
#define _CSSL5 ADCSSLbits.CSSL5
#define _CSSL6 ADCSSLbits.CSSL6
#define _CSSL7 ADCSSLbits.CSSL7
#define _CSSL8 ADCSSLbits.CSSL8
#define _CSSL9 ADCSSLbits.CSSL9
#define _CSSL10 ADCSSLbits.CSSL10
#define _CSSL11 ADCSSLbits.CSSL11
#define _CSSL12 ADCSSLbits.CSSL12
#define _CSSL13 ADCSSLbits.CSSL13
#define _CSSL14 ADCSSLbits.CSSL14
#define _CSSL15 ADCSSLbits.CSSL15
#define _TRISA6 TRISAbits.TRISA6
#define _TRISA7 TRISAbits.TRISA7
#define _TRISA9 TRISAbits.TRISA9
#define _TRISA10 TRISAbits.TRISA10
#define _TRISA12 TRISAbits.TRISA12
#define _TRISA13 TRISAbits.TRISA13
#define _TRISA14 TRISAbits.TRISA14
#define _TRISA15 TRISAbits.TRISA15
#define _RA6 PORTAbits.RA6
#define _RA7 PORTAbits.RA7
#define _RA9 PORTAbits.RA9
#define _RA10 PORTAbits.RA10
#define _RA12 PORTAbits.RA12
#define _RA13 PORTAbits.RA13
#define _RA14 PORTAbits.RA14
#define _RA15 PORTAbits.RA15
#define _LATA6 LATAbits.LATA6
#define _LATA7 LATAbits.LATA7
#define _LATA9 LATAbits.LATA9
#define _LATA10 LATAbits.LATA10
#define _LATA12 LATAbits.LATA12
#define _LATA13 LATAbits.LATA13
#define _LATA14 LATAbits.LATA14
#define _LATA15 LATAbits.LATA15
#define _TRISB0 TRISBbits.TRISB0
#define _TRISB1 TRISBbits.TRISB1
#define _TRISB2 TRISBbits.TRISB2
#define _TRISB3 TRISBbits.TRISB3
#define _TRISB4 TRISBbits.TRISB4
#define _TRISB5 TRISBbits.TRISB5
#define _TRISB6 TRISBbits.TRISB6
#define _TRISB7 TRISBbits.TRISB7
#define _TRISB8 TRISBbits.TRISB8
#define _TRISB9 TRISBbits.TRISB9
#define _TRISB10 TRISBbits.TRISB10
#define _TRISB11 TRISBbits.TRISB11
#define _TRISB12 TRISBbits.TRISB12
#define _TRISB13 TRISBbits.TRISB13
#define _TRISB14 TRISBbits.TRISB14
#define _TRISB15 TRISBbits.TRISB15
#define _RB0 PORTBbits.RB0
#define _RB1 PORTBbits.RB1
#define _RB2 PORTBbits.RB2
#define _RB3 PORTBbits.RB3
#define _RB4 PORTBbits.RB4
#define _RB5 PORTBbits.RB5
#define _RB6 PORTBbits.RB6
#define _RB7 PORTBbits.RB7
#define _RB8 PORTBbits.RB8
#define _RB9 PORTBbits.RB9
#define _RB10 PORTBbits.RB10
#define _RB11 PORTBbits.RB11
#define _RB12 PORTBbits.RB12
#define _RB13 PORTBbits.RB13
#define _RB14 PORTBbits.RB14
#define _RB15 PORTBbits.RB15
#define _LATB0 LATBbits.LATB0
#define _LATB1 LATBbits.LATB1
#define _LATB2 LATBbits.LATB2
#define _LATB3 LATBbits.LATB3
#define _LATB4 LATBbits.LATB4
#define _LATB5 LATBbits.LATB5
#define _LATB6 LATBbits.LATB6
#define _LATB7 LATBbits.LATB7
#define _LATB8 LATBbits.LATB8
#define _LATB9 LATBbits.LATB9
#define _LATB10 LATBbits.LATB10
#define _LATB11 LATBbits.LATB11
#define _LATB12 LATBbits.LATB12
#define _LATB13 LATBbits.LATB13
#define _LATB14 LATBbits.LATB14
#define _LATB15 LATBbits.LATB15
#define _TRISC1 TRISCbits.TRISC1
#define _TRISC2 TRISCbits.TRISC2
#define _TRISC3 TRISCbits.TRISC3
#define _TRISC4 TRISCbits.TRISC4
#define _TRISC13 TRISCbits.TRISC13
#define _TRISC14 TRISCbits.TRISC14
#define _TRISC15 TRISCbits.TRISC15
#define _RC1 PORTCbits.RC1
#define _RC2 PORTCbits.RC2
#define _RC3 PORTCbits.RC3
#define _RC4 PORTCbits.RC4
#define _RC13 PORTCbits.RC13
#define _RC14 PORTCbits.RC14
#define _RC15 PORTCbits.RC15
#define _LATC1 LATCbits.LATC1
#define _LATC2 LATCbits.LATC2
#define _LATC3 LATCbits.LATC3
#define _LATC4 LATCbits.LATC4
#define _LATC13 LATCbits.LATC13
#define _LATC14 LATCbits.LATC14
#define _LATC15 LATCbits.LATC15
#define _TRISD0 TRISDbits.TRISD0
#define _TRISD1 TRISDbits.TRISD1
#define _TRISD2 TRISDbits.TRISD2
#define _TRISD3 TRISDbits.TRISD3
#define _TRISD4 TRISDbits.TRISD4
#define _TRISD5 TRISDbits.TRISD5
#define _TRISD6 TRISDbits.TRISD6
#define _TRISD7 TRISDbits.TRISD7
#define _TRISD8 TRISDbits.TRISD8
#define _TRISD9 TRISDbits.TRISD9
#define _TRISD10 TRISDbits.TRISD10
#define _TRISD11 TRISDbits.TRISD11
#define _TRISD12 TRISDbits.TRISD12
#define _TRISD13 TRISDbits.TRISD13
#define _TRISD14 TRISDbits.TRISD14
#define _TRISD15 TRISDbits.TRISD15
#define _RD0 PORTDbits.RD0
#define _RD1 PORTDbits.RD1
#define _RD2 PORTDbits.RD2
#define _RD3 PORTDbits.RD3
#define _RD4 PORTDbits.RD4
#define _RD5 PORTDbits.RD5
#define _RD6 PORTDbits.RD6
#define _RD7 PORTDbits.RD7
#define _RD8 PORTDbits.RD8
#define _RD9 PORTDbits.RD9
#define _RD10 PORTDbits.RD10
#define _RD11 PORTDbits.RD11
#define _RD12 PORTDbits.RD12
#define _RD13 PORTDbits.RD13
#define _RD14 PORTDbits.RD14
#define _RD15 PORTDbits.RD15
#define _LATD0 LATDbits.LATD0
#define _LATD1 LATDbits.LATD1
#define _LATD2 LATDbits.LATD2
#define _LATD3 LATDbits.LATD3
#define _LATD4 LATDbits.LATD4
#define _LATD5 LATDbits.LATD5
#define _LATD6 LATDbits.LATD6
#define _LATD7 LATDbits.LATD7
#define _LATD8 LATDbits.LATD8
#define _LATD9 LATDbits.LATD9
#define _LATD10 LATDbits.LATD10
#define _LATD11 LATDbits.LATD11
#define _LATD12 LATDbits.LATD12
#define _LATD13 LATDbits.LATD13
#define _LATD14 LATDbits.LATD14
#define _LATD15 LATDbits.LATD15
#define _TRISF0 TRISFbits.TRISF0
#define _TRISF1 TRISFbits.TRISF1
#define _TRISF2 TRISFbits.TRISF2
#define _TRISF3 TRISFbits.TRISF3
#define _TRISF4 TRISFbits.TRISF4
#define _TRISF5 TRISFbits.TRISF5
#define _TRISF6 TRISFbits.TRISF6
#define _TRISF7 TRISFbits.TRISF7
#define _TRISF8 TRISFbits.TRISF8
#define _RF0 PORTFbits.RF0
#define _RF1 PORTFbits.RF1
#define _RF2 PORTFbits.RF2
#define _RF3 PORTFbits.RF3
#define _RF4 PORTFbits.RF4
#define _RF5 PORTFbits.RF5
#define _RF6 PORTFbits.RF6
#define _RF7 PORTFbits.RF7
#define _RF8 PORTFbits.RF8
#define _LATF0 LATFbits.LATF0
#define _LATF1 LATFbits.LATF1
#define _LATF2 LATFbits.LATF2
#define _LATF3 LATFbits.LATF3
#define _LATF4 LATFbits.LATF4
#define _LATF5 LATFbits.LATF5
#define _LATF6 LATFbits.LATF6
#define _LATF7 LATFbits.LATF7
#define _LATF8 LATFbits.LATF8
#define _TRISG0 TRISGbits.TRISG0
#define _TRISG1 TRISGbits.TRISG1
#define _TRISG2 TRISGbits.TRISG2
#define _TRISG3 TRISGbits.TRISG3
#define _TRISG6 TRISGbits.TRISG6
#define _TRISG7 TRISGbits.TRISG7
#define _TRISG8 TRISGbits.TRISG8
#define _TRISG9 TRISGbits.TRISG9
#define _TRISG12 TRISGbits.TRISG12
#define _TRISG13 TRISGbits.TRISG13
#define _TRISG14 TRISGbits.TRISG14
#define _TRISG15 TRISGbits.TRISG15
#define _RG0 PORTGbits.RG0
#define _RG1 PORTGbits.RG1
#define _RG2 PORTGbits.RG2
#define _RG3 PORTGbits.RG3
#define _RG6 PORTGbits.RG6
#define _RG7 PORTGbits.RG7
#define _RG8 PORTGbits.RG8
#define _RG9 PORTGbits.RG9
#define _RG12 PORTGbits.RG12
#define _RG13 PORTGbits.RG13
#define _RG14 PORTGbits.RG14
#define _RG15 PORTGbits.RG15
#define _LATG0 LATGbits.LATG0
#define _LATG1 LATGbits.LATG1
#define _LATG2 LATGbits.LATG2
#define _LATG3 LATGbits.LATG3
#define _LATG6 LATGbits.LATG6
#define _LATG7 LATGbits.LATG7
#define _LATG8 LATGbits.LATG8
#define _LATG9 LATGbits.LATG9
#define _LATG12 LATGbits.LATG12
#define _LATG13 LATGbits.LATG13
#define _LATG14 LATGbits.LATG14
#define _LATG15 LATGbits.LATG15
#define _POR RCONbits.POR
#define _BOR RCONbits.BOR
#define _IDLE RCONbits.IDLE
#define _SLEEP RCONbits.SLEEP
#define _WDTO RCONbits.WDTO
#define _SWDTEN RCONbits.SWDTEN
#define _SWR RCONbits.SWR
#define _EXTR RCONbits.EXTR
#define _LVDL RCONbits.LVDL
#define _LVDEN RCONbits.LVDEN
#define _BGST RCONbits.BGST
#define _IOPUWR RCONbits.IOPUWR
#define _TRAPR RCONbits.TRAPR
#define _OSWEN OSCCONbits.OSWEN
#define _LPOSCEN OSCCONbits.LPOSCEN
#define _CF OSCCONbits.CF
#define _LOCK OSCCONbits.LOCK
#define _POST OSCCONbits.POST
#define _NOSC OSCCONbits.NOSC
#define _COSC OSCCONbits.COSC
#define _TUN0 OSCTUNbits.TUN0
#define _TUN1 OSCTUNbits.TUN1
#define _TUN2 OSCTUNbits.TUN2
#define _TUN3 OSCTUNbits.TUN3
#define _RL_BSR BSRAMbits.RL_BSR
#define _IR_BSR BSRAMbits.IR_BSR
#define _IW_BSR BSRAMbits.IW_BSR
#define _RL_SSR SSRAMbits.RL_SSR
#define _IR_SSR SSRAMbits.IR_SSR
#define _IW_SSR SSRAMbits.IW_SSR
#define _PROGOP NVMCONbits.PROGOP
#define _TWRI NVMCONbits.TWRI
#define _WRERR NVMCONbits.WRERR
#define _WREN NVMCONbits.WREN
#define _WR NVMCONbits.WR
#define _NVMADR NVMADRUbits.NVMADR
#define _ADCMD PMD1bits.ADCMD
#define _C1MD PMD1bits.C1MD
#define _C2MD PMD1bits.C2MD
#define _SPI1MD PMD1bits.SPI1MD
#define _SPI2MD PMD1bits.SPI2MD
#define _U1MD PMD1bits.U1MD
#define _U2MD PMD1bits.U2MD
#define _I2CMD PMD1bits.I2CMD
#define _DCIMD PMD1bits.DCIMD
#define _T1MD PMD1bits.T1MD
#define _T2MD PMD1bits.T2MD
#define _T3MD PMD1bits.T3MD
#define _T4MD PMD1bits.T4MD
#define _T5MD PMD1bits.T5MD
#define _OC1MD PMD2bits.OC1MD
#define _OC2MD PMD2bits.OC2MD
#define _OC3MD PMD2bits.OC3MD
#define _OC4MD PMD2bits.OC4MD
#define _OC5MD PMD2bits.OC5MD
#define _OC6MD PMD2bits.OC6MD
#define _OC7MD PMD2bits.OC7MD
#define _OC8MD PMD2bits.OC8MD
#define _IC1MD PMD2bits.IC1MD
#define _IC2MD PMD2bits.IC2MD
#define _IC3MD PMD2bits.IC3MD
#define _IC4MD PMD2bits.IC4MD
#define _IC5MD PMD2bits.IC5MD
#define _IC6MD PMD2bits.IC6MD
#define _IC7MD PMD2bits.IC7MD
#define _IC8MD PMD2bits.IC8MD

#ifdef __cplusplus
}
#endif
#endif

#endif
