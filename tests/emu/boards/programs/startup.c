/* Start-up of the vendor's programs (epuck.md §2, §6, §7.1): reset causes, ports, probes, selector, banner, EEPROM. */
#include "i2c.h"

volatile uint16_t camera_id, accelerometer_id, selector, eeprom_word, ports_ok, battery_ok, remote_idle;

static void port_init(void)
{
    LATA = LATC = LATD = LATF = LATG = 0;
    TRISA = 0;
    TRISCbits.TRISC1 = TRISCbits.TRISC2 = TRISCbits.TRISC13 = 0;
    TRISD &= 0xFF00;
    TRISFbits.TRISF0 = TRISFbits.TRISF7 = TRISFbits.TRISF8 = 0;
    TRISGbits.TRISG0 = TRISGbits.TRISG1 = TRISGbits.TRISG2 = TRISGbits.TRISG3 = 0;
}

static void send(const char *text)
{
    while (*text != '\0') {
        while (U1STAbits.UTXBF) {
        }
        U1TXREG = (uint8_t)*text++;
    }
}

int main(void)
{
    port_init();
    ports_ok = (PORTG & 0x000C) == 0; /* SCL and SDA are driven low */
    if (RCONbits.POR) {
        RCONbits.POR = 0;
        __asm__ volatile("reset");
    }
    U1BRG = 7;
    U1MODE = 0x8000;
    U1STA = 0x0400;
    i2c_init();
    accelerometer_id = i2c_read_register(0x3C, 0x0F);
    LATCbits.LATC13 = 0;
    for (volatile int i = 0; i < 100; i++) {
    }
    LATCbits.LATC13 = 1;
    camera_id = i2c_read_register(0xDC, 0) << 8 | i2c_read_register(0xDC, 1);
    selector = PORTG >> 6 & 0xF;
    battery_ok = PORTFbits.RF1;
    remote_idle = PORTFbits.RF6;
    TBLPAG = 0x7F;
    __asm__ volatile("mov #0xFFFE, w1\n\ttblrdl [w1], w0\n\tmov w0, _eeprom_word" : : : "r0", "r1", "memory");
    send("\f\aWELCOME to the SerCom protocol on e-Puck\r\nthe EPFL education robot type \"H\" for help\r\n");
    return 0;
}
