/* Full bridge by PWM pairs 1 and 2, encoder, and samples in the middle of each PWM period (DS70135G §14, §15). */
#include "bridge.h"

#include <p30F4011.h>

/* 7.3728 MHz crystal, PLL x16. */
_FOSC(CSW_FSCM_OFF & XT_PLL16);
_FWDT(WDT_OFF);
_FBORPOR(PBOR_OFF & MCLR_EN);

#define ANALOG_INPUTS 0x0047u /* AN0, AN1, AN2 and AN6 */
#define DEMAND_CHANNEL 6u
#define INDEPENDENT_OF_INDEX 0x0700u /* QEIM: x4, counter restarts at MAXCNT */

static volatile bool faulted;

static void encoder_init(void)
{
    MAXCNT = 0xFFFF;
    POSCNT = 0;
    DFLTCON = 0x0080; /* filter: three stable Tcy */
    QEICON = INDEPENDENT_OF_INDEX;
}

static void converter_init(void)
{
    ADPCFG = (uint16_t)~ANALOG_INPUTS;
    ADCON2bits.CHPS = 2;     /* CH0 to CH3 */
    ADCON3bits.ADCS = 9;     /* TAD = 5 Tcy = 170 ns */
    ADCHS = DEMAND_CHANNEL;  /* CH0: AN6; CH1 to CH3: AN0 to AN2 */
    ADCON1bits.SIMSAM = 1;
    ADCON1bits.SSRC = 3; /* the special event of the PWM */
    ADCON1bits.ASAM = 1;
    ADCON1bits.ADON = 1;
}

static void pwm_init(void)
{
    PTPER = BRIDGE_PERIOD - 1;
    SEVTCMP = BRIDGE_PERIOD / 2;
    DTCON1 = BRIDGE_DEAD_TIME;
    FLTACON = 0x0083; /* both legs off while the fault input is low, period by period */
    PWMCON1 = 0x0033; /* pairs 1 and 2, complementary */
    bridge_drive(0);
    PTCONbits.PTOPS = BRIDGE_CONTROL_RATE - 1;
    IFS2 = 0;
    IPC9bits.PWMIP = 4;
    IEC2bits.PWMIE = 1;
    IEC2bits.FLTAIE = 1;
    PTCONbits.PTEN = 1;
}

void bridge_init(void)
{
    encoder_init();
    converter_init();
    pwm_init();
}

void bridge_drive(int16_t voltage)
{
    if (voltage > BRIDGE_FULL) {
        voltage = BRIDGE_FULL;
    } else if (voltage < -BRIDGE_FULL) {
        voltage = -BRIDGE_FULL;
    }
    PWMCON2bits.UDIS = 1; /* both legs change in the same period */
    PDC1 = (uint16_t)((int16_t)BRIDGE_PERIOD + voltage);
    PDC2 = (uint16_t)((int16_t)BRIDGE_PERIOD - voltage);
    PWMCON2bits.UDIS = 0;
}

uint16_t bridge_position(void)
{
    return POSCNT;
}

bridge_samples bridge_measure(void)
{
    return (bridge_samples){.demand = ADCBUF0, .current = ADCBUF1, .supply = ADCBUF2};
}

bool bridge_take_fault(void)
{
    bool was = faulted;
    faulted = false;
    return was;
}

void bridge_wait(void)
{
    Idle();
}

void __attribute__((interrupt, no_auto_psv)) _PWMInterrupt(void)
{
    IFS2bits.PWMIF = 0;
    bridge_control();
}

void __attribute__((interrupt, no_auto_psv)) _FLTAInterrupt(void)
{
    IFS2bits.FLTAIF = 0;
    faulted = true;
}
