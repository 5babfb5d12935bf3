/* A boot loader (dspic30f6014a.md §16): answers a greeting, receives rows of 32 instructions on UART1, erases and
   programs them, then calls the programmed code; without a greeting it calls that code at once. */
#include <p30F6014A.h>
#include <stdint.h>

#define ROW 0x8000 /* program address */
#define WORDS 32

volatile uint16_t answer, rows, timeouts;
static uint8_t data[3 * WORDS];

static int receive(uint8_t *byte)
{
    uint16_t patience;
    for (patience = 0; patience < 60000; patience++)
        if (U1STAbits.URXDA) {
            *byte = (uint8_t)U1RXREG;
            return 1;
        }
    timeouts++;
    return 0;
}

static void send(uint8_t byte)
{
    while (U1STAbits.UTXBF) {
    }
    U1TXREG = byte;
}

static void operate(uint16_t operation)
{
    NVMCON = operation;
    __asm__ volatile("mov #0x55, w0\n\tmov w0, NVMKEY\n\tmov #0xAA, w0\n\tmov w0, NVMKEY\n\tbset NVMCON, #15\n\tnop\n\tnop"
                     : : : "r0");
    while (NVMCONbits.WR) {
    }
}

static void latch(uint16_t address, uint16_t low, uint16_t high)
{
    __asm__ volatile("tblwtl %1, [%0]\n\ttblwth %2, [%0]" : : "r"(address), "r"(low), "r"(high));
}

static void program(uint16_t row)
{
    uint16_t i;
    TBLPAG = 0;
    latch(row, 0, 0);
    operate(0x4041);
    for (i = 0; i < WORDS; i++)
        latch(row + 2 * i, data[3 * i] | (uint16_t)data[3 * i + 1] << 8, data[3 * i + 2]);
    operate(0x4001);
}

/* The compiler does not treat the function's address as a constant; on this chip it is the program address. */
static uint16_t call(uint16_t address)
{
    uint16_t result;
    __asm__ volatile("call %1\n\tmov w0, %0" : "=r"(result) : "r"(address) : "r0", "memory");
    return result;
}

int main(void)
{
    uint8_t byte, sum, i;
    U1BRG = 7;
    U1MODE = 0x8000;
    U1STA = 0x0400;
    for (;;) {
        if (!receive(&byte)) {
            answer = call(ROW);
            continue;
        }
        if (byte != 0xC1)
            continue;
        send('q');
        send('K');
        sum = 0;
        for (i = 0; i < 3 * WORDS && receive(&data[i]); i++)
            sum += data[i];
        if (i == 3 * WORDS && receive(&byte) && byte == sum) {
            program(ROW);
            rows++;
            send('K');
        } else {
            send('N');
        }
    }
}
