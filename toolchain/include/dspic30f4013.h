/* SPDX-License-Identifier: MIT */
/* Registers of the dsPIC30F4013.
 * Written by `python -m toolchain.device_header` from the chip's register table; do not edit. */
#ifndef DSPIC30F4013_H
#define DSPIC30F4013_H
#ifndef __dsPIC30F4013__
#error "this header is for the dsPIC30F4013: compile with -mcpu=30F4013"
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
typedef struct { unsigned INT0EP:1; unsigned INT1EP:1; unsigned INT2EP:1; unsigned :11; unsigned DISI:1; unsigned ALTIVT:1; } INTCON2BITS;
extern volatile INTCON2BITS INTCON2bits DSPIC_SFR;
extern volatile unsigned int IFS0 DSPIC_SFR; /* 0x0084 */
typedef struct { unsigned INT0IF:1; unsigned IC1IF:1; unsigned OC1IF:1; unsigned T1IF:1; unsigned IC2IF:1; unsigned OC2IF:1; unsigned T2IF:1; unsigned T3IF:1; unsigned SPI1IF:1; unsigned U1RXIF:1; unsigned U1TXIF:1; unsigned ADIF:1; unsigned NVMIF:1; unsigned SI2CIF:1; unsigned MI2CIF:1; unsigned CNIF:1; } IFS0BITS;
extern volatile IFS0BITS IFS0bits DSPIC_SFR;
extern volatile unsigned int IFS1 DSPIC_SFR; /* 0x0086 */
typedef struct { unsigned INT1IF:1; unsigned IC7IF:1; unsigned IC8IF:1; unsigned OC3IF:1; unsigned OC4IF:1; unsigned T4IF:1; unsigned T5IF:1; unsigned INT2IF:1; unsigned U2RXIF:1; unsigned U2TXIF:1; unsigned :1; unsigned C1IF:1; } IFS1BITS;
extern volatile IFS1BITS IFS1bits DSPIC_SFR;
extern volatile unsigned int IFS2 DSPIC_SFR; /* 0x0088 */
typedef struct { unsigned :9; unsigned DCIIF:1; unsigned LVDIF:1; } IFS2BITS;
extern volatile IFS2BITS IFS2bits DSPIC_SFR;
extern volatile unsigned int IEC0 DSPIC_SFR; /* 0x008C */
typedef struct { unsigned INT0IE:1; unsigned IC1IE:1; unsigned OC1IE:1; unsigned T1IE:1; unsigned IC2IE:1; unsigned OC2IE:1; unsigned T2IE:1; unsigned T3IE:1; unsigned SPI1IE:1; unsigned U1RXIE:1; unsigned U1TXIE:1; unsigned ADIE:1; unsigned NVMIE:1; unsigned SI2CIE:1; unsigned MI2CIE:1; unsigned CNIE:1; } IEC0BITS;
extern volatile IEC0BITS IEC0bits DSPIC_SFR;
extern volatile unsigned int IEC1 DSPIC_SFR; /* 0x008E */
typedef struct { unsigned INT1IE:1; unsigned IC7IE:1; unsigned IC8IE:1; unsigned OC3IE:1; unsigned OC4IE:1; unsigned T4IE:1; unsigned T5IE:1; unsigned INT2IE:1; unsigned U2RXIE:1; unsigned U2TXIE:1; unsigned :1; unsigned C1IE:1; } IEC1BITS;
extern volatile IEC1BITS IEC1bits DSPIC_SFR;
extern volatile unsigned int IEC2 DSPIC_SFR; /* 0x0090 */
typedef struct { unsigned :9; unsigned DCIIE:1; unsigned LVDIE:1; } IEC2BITS;
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
  struct { unsigned U2RXIP:3; unsigned :1; unsigned U2TXIP:3; unsigned :5; unsigned C1IP:3; };
  struct { unsigned U2RXIP0:1; unsigned U2RXIP1:1; unsigned U2RXIP2:1; unsigned :1; unsigned U2TXIP0:1; unsigned U2TXIP1:1; unsigned U2TXIP2:1; unsigned :5; unsigned C1IP0:1; unsigned C1IP1:1; unsigned C1IP2:1; };
} IPC6BITS;
extern volatile IPC6BITS IPC6bits DSPIC_SFR;
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
typedef struct { unsigned CN0IE:1; unsigned CN1IE:1; unsigned CN2IE:1; unsigned CN3IE:1; unsigned CN4IE:1; unsigned CN5IE:1; unsigned CN6IE:1; unsigned CN7IE:1; } CNEN1BITS;
extern volatile CNEN1BITS CNEN1bits DSPIC_SFR;
extern volatile unsigned int CNEN2 DSPIC_SFR; /* 0x00C2 */
typedef struct { unsigned :1; unsigned CN17IE:1; unsigned CN18IE:1; } CNEN2BITS;
extern volatile CNEN2BITS CNEN2bits DSPIC_SFR;
extern volatile unsigned int CNPU1 DSPIC_SFR; /* 0x00C4 */
typedef struct { unsigned CN0PUE:1; unsigned CN1PUE:1; unsigned CN2PUE:1; unsigned CN3PUE:1; unsigned CN4PUE:1; unsigned CN5PUE:1; unsigned CN6PUE:1; unsigned CN7PUE:1; } CNPU1BITS;
extern volatile CNPU1BITS CNPU1bits DSPIC_SFR;
extern volatile unsigned int CNPU2 DSPIC_SFR; /* 0x00C6 */
typedef struct { unsigned :1; unsigned CN17PUE:1; unsigned CN18PUE:1; } CNPU2BITS;
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
typedef struct { unsigned PCFG0:1; unsigned PCFG1:1; unsigned PCFG2:1; unsigned PCFG3:1; unsigned PCFG4:1; unsigned PCFG5:1; unsigned PCFG6:1; unsigned PCFG7:1; unsigned PCFG8:1; unsigned PCFG9:1; unsigned PCFG10:1; unsigned PCFG11:1; unsigned PCFG12:1; } ADPCFGBITS;
extern volatile ADPCFGBITS ADPCFGbits DSPIC_SFR;
extern volatile unsigned int ADCSSL DSPIC_SFR; /* 0x02AA */
typedef struct { unsigned CSSL0:1; unsigned CSSL1:1; unsigned CSSL2:1; unsigned CSSL3:1; unsigned CSSL4:1; unsigned CSSL5:1; unsigned CSSL6:1; unsigned CSSL7:1; unsigned CSSL8:1; unsigned CSSL9:1; unsigned CSSL10:1; unsigned CSSL11:1; unsigned CSSL12:1; } ADCSSLBITS;
extern volatile ADCSSLBITS ADCSSLbits DSPIC_SFR;
extern volatile unsigned int TRISA DSPIC_SFR; /* 0x02C0 */
typedef struct { unsigned :11; unsigned TRISA11:1; } TRISABITS;
extern volatile TRISABITS TRISAbits DSPIC_SFR;
extern volatile unsigned int PORTA DSPIC_SFR; /* 0x02C2 */
typedef struct { unsigned :11; unsigned RA11:1; } PORTABITS;
extern volatile PORTABITS PORTAbits DSPIC_SFR;
extern volatile unsigned int LATA DSPIC_SFR; /* 0x02C4 */
typedef struct { unsigned :11; unsigned LATA11:1; } LATABITS;
extern volatile LATABITS LATAbits DSPIC_SFR;
extern volatile unsigned int TRISB DSPIC_SFR; /* 0x02C6 */
typedef struct { unsigned TRISB0:1; unsigned TRISB1:1; unsigned TRISB2:1; unsigned TRISB3:1; unsigned TRISB4:1; unsigned TRISB5:1; unsigned TRISB6:1; unsigned TRISB7:1; unsigned TRISB8:1; unsigned TRISB9:1; unsigned TRISB10:1; unsigned TRISB11:1; unsigned TRISB12:1; } TRISBBITS;
extern volatile TRISBBITS TRISBbits DSPIC_SFR;
extern volatile unsigned int PORTB DSPIC_SFR; /* 0x02C8 */
typedef struct { unsigned RB0:1; unsigned RB1:1; unsigned RB2:1; unsigned RB3:1; unsigned RB4:1; unsigned RB5:1; unsigned RB6:1; unsigned RB7:1; unsigned RB8:1; unsigned RB9:1; unsigned RB10:1; unsigned RB11:1; unsigned RB12:1; } PORTBBITS;
extern volatile PORTBBITS PORTBbits DSPIC_SFR;
extern volatile unsigned int LATB DSPIC_SFR; /* 0x02CA */
typedef struct { unsigned LATB0:1; unsigned LATB1:1; unsigned LATB2:1; unsigned LATB3:1; unsigned LATB4:1; unsigned LATB5:1; unsigned LATB6:1; unsigned LATB7:1; unsigned LATB8:1; unsigned LATB9:1; unsigned LATB10:1; unsigned LATB11:1; unsigned LATB12:1; } LATBBITS;
extern volatile LATBBITS LATBbits DSPIC_SFR;
extern volatile unsigned int TRISC DSPIC_SFR; /* 0x02CC */
typedef struct { unsigned :13; unsigned TRISC13:1; unsigned TRISC14:1; unsigned TRISC15:1; } TRISCBITS;
extern volatile TRISCBITS TRISCbits DSPIC_SFR;
extern volatile unsigned int PORTC DSPIC_SFR; /* 0x02CE */
typedef struct { unsigned :13; unsigned RC13:1; unsigned RC14:1; unsigned RC15:1; } PORTCBITS;
extern volatile PORTCBITS PORTCbits DSPIC_SFR;
extern volatile unsigned int LATC DSPIC_SFR; /* 0x02D0 */
typedef struct { unsigned :13; unsigned LATC13:1; unsigned LATC14:1; unsigned LATC15:1; } LATCBITS;
extern volatile LATCBITS LATCbits DSPIC_SFR;
extern volatile unsigned int TRISD DSPIC_SFR; /* 0x02D2 */
typedef struct { unsigned TRISD0:1; unsigned TRISD1:1; unsigned TRISD2:1; unsigned TRISD3:1; unsigned :4; unsigned TRISD8:1; unsigned TRISD9:1; } TRISDBITS;
extern volatile TRISDBITS TRISDbits DSPIC_SFR;
extern volatile unsigned int PORTD DSPIC_SFR; /* 0x02D4 */
typedef struct { unsigned RD0:1; unsigned RD1:1; unsigned RD2:1; unsigned RD3:1; unsigned :4; unsigned RD8:1; unsigned RD9:1; } PORTDBITS;
extern volatile PORTDBITS PORTDbits DSPIC_SFR;
extern volatile unsigned int LATD DSPIC_SFR; /* 0x02D6 */
typedef struct { unsigned LATD0:1; unsigned LATD1:1; unsigned LATD2:1; unsigned LATD3:1; unsigned :4; unsigned LATD8:1; unsigned LATD9:1; } LATDBITS;
extern volatile LATDBITS LATDbits DSPIC_SFR;
extern volatile unsigned int TRISF DSPIC_SFR; /* 0x02DE */
typedef struct { unsigned TRISF0:1; unsigned TRISF1:1; unsigned TRISF2:1; unsigned TRISF3:1; unsigned TRISF4:1; unsigned TRISF5:1; unsigned TRISF6:1; } TRISFBITS;
extern volatile TRISFBITS TRISFbits DSPIC_SFR;
extern volatile unsigned int PORTF DSPIC_SFR; /* 0x02E0 */
typedef struct { unsigned RF0:1; unsigned RF1:1; unsigned RF2:1; unsigned RF3:1; unsigned RF4:1; unsigned RF5:1; unsigned RF6:1; } PORTFBITS;
extern volatile PORTFBITS PORTFbits DSPIC_SFR;
extern volatile unsigned int LATF DSPIC_SFR; /* 0x02E2 */
typedef struct { unsigned LATF0:1; unsigned LATF1:1; unsigned LATF2:1; unsigned LATF3:1; unsigned LATF4:1; unsigned LATF5:1; unsigned LATF6:1; } LATFBITS;
extern volatile LATFBITS LATFbits DSPIC_SFR;
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
typedef struct { unsigned ADCMD:1; unsigned C1MD:1; unsigned :1; unsigned SPI1MD:1; unsigned :1; unsigned U1MD:1; unsigned U2MD:1; unsigned I2CMD:1; unsigned DCIMD:1; unsigned :2; unsigned T1MD:1; unsigned T2MD:1; unsigned T3MD:1; unsigned T4MD:1; unsigned T5MD:1; } PMD1BITS;
extern volatile PMD1BITS PMD1bits DSPIC_SFR;
extern volatile unsigned int PMD2 DSPIC_SFR; /* 0x0772 */
typedef struct { unsigned OC1MD:1; unsigned OC2MD:1; unsigned OC3MD:1; unsigned OC4MD:1; unsigned :4; unsigned IC1MD:1; unsigned IC2MD:1; unsigned :4; unsigned IC7MD:1; unsigned IC8MD:1; } PMD2BITS;
extern volatile PMD2BITS PMD2bits DSPIC_SFR;

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
#define _C1IF IFS1bits.C1IF
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
#define _C1IE IEC1bits.C1IE
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
#define _C1IP IPC6bits.C1IP
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
#define _CN17IE CNEN2bits.CN17IE
#define _CN18IE CNEN2bits.CN18IE
#define _CN0PUE CNPU1bits.CN0PUE
#define _CN1PUE CNPU1bits.CN1PUE
#define _CN2PUE CNPU1bits.CN2PUE
#define _CN3PUE CNPU1bits.CN3PUE
#define _CN4PUE CNPU1bits.CN4PUE
#define _CN5PUE CNPU1bits.CN5PUE
#define _CN6PUE CNPU1bits.CN6PUE
#define _CN7PUE CNPU1bits.CN7PUE
#define _CN17PUE CNPU2bits.CN17PUE
#define _CN18PUE CNPU2bits.CN18PUE
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
#define _SPIRBF SPI1STATbits.SPIRBF
#define _SPITBF SPI1STATbits.SPITBF
#define _SPIROV SPI1STATbits.SPIROV
#define _SPISIDL SPI1STATbits.SPISIDL
#define _SPIEN SPI1STATbits.SPIEN
#define _PPRE SPI1CONbits.PPRE
#define _SPRE SPI1CONbits.SPRE
#define _MSTEN SPI1CONbits.MSTEN
#define _CKP SPI1CONbits.CKP
#define _SSEN SPI1CONbits.SSEN
#define _CKE SPI1CONbits.CKE
#define _SMP SPI1CONbits.SMP
#define _MODE16 SPI1CONbits.MODE16
#define _DISSDO SPI1CONbits.DISSDO
#define _SPIFSD SPI1CONbits.SPIFSD
#define _FRMEN SPI1CONbits.FRMEN
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
#define _TRISA11 TRISAbits.TRISA11
#define _RA11 PORTAbits.RA11
#define _LATA11 LATAbits.LATA11
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
#define _TRISC13 TRISCbits.TRISC13
#define _TRISC14 TRISCbits.TRISC14
#define _TRISC15 TRISCbits.TRISC15
#define _RC13 PORTCbits.RC13
#define _RC14 PORTCbits.RC14
#define _RC15 PORTCbits.RC15
#define _LATC13 LATCbits.LATC13
#define _LATC14 LATCbits.LATC14
#define _LATC15 LATCbits.LATC15
#define _TRISD0 TRISDbits.TRISD0
#define _TRISD1 TRISDbits.TRISD1
#define _TRISD2 TRISDbits.TRISD2
#define _TRISD3 TRISDbits.TRISD3
#define _TRISD8 TRISDbits.TRISD8
#define _TRISD9 TRISDbits.TRISD9
#define _RD0 PORTDbits.RD0
#define _RD1 PORTDbits.RD1
#define _RD2 PORTDbits.RD2
#define _RD3 PORTDbits.RD3
#define _RD8 PORTDbits.RD8
#define _RD9 PORTDbits.RD9
#define _LATD0 LATDbits.LATD0
#define _LATD1 LATDbits.LATD1
#define _LATD2 LATDbits.LATD2
#define _LATD3 LATDbits.LATD3
#define _LATD8 LATDbits.LATD8
#define _LATD9 LATDbits.LATD9
#define _TRISF0 TRISFbits.TRISF0
#define _TRISF1 TRISFbits.TRISF1
#define _TRISF2 TRISFbits.TRISF2
#define _TRISF3 TRISFbits.TRISF3
#define _TRISF4 TRISFbits.TRISF4
#define _TRISF5 TRISFbits.TRISF5
#define _TRISF6 TRISFbits.TRISF6
#define _RF0 PORTFbits.RF0
#define _RF1 PORTFbits.RF1
#define _RF2 PORTFbits.RF2
#define _RF3 PORTFbits.RF3
#define _RF4 PORTFbits.RF4
#define _RF5 PORTFbits.RF5
#define _RF6 PORTFbits.RF6
#define _LATF0 LATFbits.LATF0
#define _LATF1 LATFbits.LATF1
#define _LATF2 LATFbits.LATF2
#define _LATF3 LATFbits.LATF3
#define _LATF4 LATFbits.LATF4
#define _LATF5 LATFbits.LATF5
#define _LATF6 LATFbits.LATF6
#define _FILHIT0 C1RX0CONbits.FILHIT0
#define _JTOFF C1RX0CONbits.JTOFF
#define _DBEN C1RX0CONbits.DBEN
#define _RXB0DBEN C1RX0CONbits.RXB0DBEN
#define _ICODE C1CTRLbits.ICODE
#define _OPMODE C1CTRLbits.OPMODE
#define _REQOP C1CTRLbits.REQOP
#define _CANCKS C1CTRLbits.CANCKS
#define _ABAT C1CTRLbits.ABAT
#define _CANSIDL C1CTRLbits.CANSIDL
#define _CANFRZ C1CTRLbits.CANFRZ
#define _CANCAP C1CTRLbits.CANCAP
#define _CSIDL C1CTRLbits.CSIDL
#define _BRP C1CFG1bits.BRP
#define _SJW C1CFG1bits.SJW
#define _PRSEG C1CFG2bits.PRSEG
#define _SEG1PH C1CFG2bits.SEG1PH
#define _SAM C1CFG2bits.SAM
#define _SEG2PHTS C1CFG2bits.SEG2PHTS
#define _SEG2PH C1CFG2bits.SEG2PH
#define _WAKFIL C1CFG2bits.WAKFIL
#define _RXB0IF C1INTFbits.RXB0IF
#define _RXB1IF C1INTFbits.RXB1IF
#define _TXB0IF C1INTFbits.TXB0IF
#define _TXB1IF C1INTFbits.TXB1IF
#define _TXB2IF C1INTFbits.TXB2IF
#define _ERRIF C1INTFbits.ERRIF
#define _WAKIF C1INTFbits.WAKIF
#define _IRXIF C1INTFbits.IRXIF
#define _EWARN C1INTFbits.EWARN
#define _RXWARN C1INTFbits.RXWARN
#define _TXWARN C1INTFbits.TXWARN
#define _RXBP C1INTFbits.RXBP
#define _TXBP C1INTFbits.TXBP
#define _TXBO C1INTFbits.TXBO
#define _RXB1OVFL C1INTFbits.RXB1OVFL
#define _RXB0OVFL C1INTFbits.RXB0OVFL
#define _RX0IF C1INTFbits.RX0IF
#define _RX1IF C1INTFbits.RX1IF
#define _TX0IF C1INTFbits.TX0IF
#define _TX1IF C1INTFbits.TX1IF
#define _TX2IF C1INTFbits.TX2IF
#define _IVRIF C1INTFbits.IVRIF
#define _RXWAR C1INTFbits.RXWAR
#define _TXWAR C1INTFbits.TXWAR
#define _RXEP C1INTFbits.RXEP
#define _TXEP C1INTFbits.TXEP
#define _RX1OVR C1INTFbits.RX1OVR
#define _RX0OVR C1INTFbits.RX0OVR
#define _RXB0IE C1INTEbits.RXB0IE
#define _RXB1IE C1INTEbits.RXB1IE
#define _TXB0IE C1INTEbits.TXB0IE
#define _TXB1IE C1INTEbits.TXB1IE
#define _TXB2IE C1INTEbits.TXB2IE
#define _ERRIE C1INTEbits.ERRIE
#define _WAKIE C1INTEbits.WAKIE
#define _IRXIE C1INTEbits.IRXIE
#define _RX0IE C1INTEbits.RX0IE
#define _RX1IE C1INTEbits.RX1IE
#define _TX0IE C1INTEbits.TX0IE
#define _TX1IE C1INTEbits.TX1IE
#define _TX2IE C1INTEbits.TX2IE
#define _IVRIE C1INTEbits.IVRIE
#define _REC0 C1ECbits.REC0
#define _REC1 C1ECbits.REC1
#define _REC2 C1ECbits.REC2
#define _REC3 C1ECbits.REC3
#define _REC4 C1ECbits.REC4
#define _REC5 C1ECbits.REC5
#define _REC6 C1ECbits.REC6
#define _REC7 C1ECbits.REC7
#define _TEC0 C1ECbits.TEC0
#define _TEC1 C1ECbits.TEC1
#define _TEC2 C1ECbits.TEC2
#define _TEC3 C1ECbits.TEC3
#define _TEC4 C1ECbits.TEC4
#define _TEC5 C1ECbits.TEC5
#define _TEC6 C1ECbits.TEC6
#define _TEC7 C1ECbits.TEC7
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
#define _PROGOP NVMCONbits.PROGOP
#define _TWRI NVMCONbits.TWRI
#define _WRERR NVMCONbits.WRERR
#define _WREN NVMCONbits.WREN
#define _WR NVMCONbits.WR
#define _NVMADR NVMADRUbits.NVMADR
#define _ADCMD PMD1bits.ADCMD
#define _C1MD PMD1bits.C1MD
#define _SPI1MD PMD1bits.SPI1MD
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
#define _IC1MD PMD2bits.IC1MD
#define _IC2MD PMD2bits.IC2MD
#define _IC7MD PMD2bits.IC7MD
#define _IC8MD PMD2bits.IC8MD

#ifdef __cplusplus
}
#endif
#endif

#endif
