/* Keeps a counter in the last EEPROM word (dspic30f6014a.md §16): reads, erases and programs it; a pin signals
   each step. After a reset, the start-up code finds the state in which the reset interrupted a write. */
#include <p30F6014A.h>
#include <stdint.h>

volatile uint16_t found, errors, starts, done;

static uint16_t stored(void)
{
    uint16_t word;
    TBLPAG = 0x7F;
    __asm__ volatile("mov #0xFFFE, w1\n\ttblrdl [w1], %0" : "=r"(word) : : "r1");
    return word;
}

static void operate(uint16_t operation, uint16_t word)
{
    TBLPAG = 0x7F;
    __asm__ volatile("mov #0xFFFE, w1\n\ttblwtl %0, [w1]" : : "r"(word) : "r1");
    NVMCON = operation;
    __asm__ volatile("disi #5\n\tmov #0x55, w0\n\tmov w0, NVMKEY\n\tmov #0xAA, w0\n\tmov w0, NVMKEY\n\tbset NVMCON, #15\n\tnop\n\tnop"
                     : : : "r0");
    while (NVMCONbits.WR) {
    }
}

int main(void)
{
    starts = RCONbits.EXTR;
    errors = NVMCONbits.WRERR;
    found = stored();
    LATA = 0;
    TRISAbits.TRISA6 = TRISAbits.TRISA7 = 0;
    LATAbits.LATA6 = 1;
    operate(0x4044, 0xFFFF);
    LATAbits.LATA6 = 0;
    LATAbits.LATA7 = 1;
    operate(0x4004, found == 0xFFFF ? 1 : found + 1);
    LATAbits.LATA7 = 0;
    done = stored();
    for (;;) {
    }
}
