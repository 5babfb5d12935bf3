/* Interrupt-driven UART like the vendor library's (dspic30f6014a.md §10): UTXISEL = 1, main writes the first character,
   the ISR the others; each ISR entry clears OERR. Binary commands (epuck.md §6): letter negated, little endian. */
#include <p30F6014A.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#define RING 64
static volatile char in[RING];
static volatile uint8_t in_head, in_tail;
static const char *volatile out;
static volatile uint16_t out_left;
volatile uint16_t steps_wanted_left, steps_wanted_right, resets;
static uint8_t lights;

void __attribute__((interrupt, auto_psv)) _U1RXInterrupt(void)
{
    IFS0bits.U1RXIF = 0;
    U1STAbits.OERR = 0;
    while (U1STAbits.URXDA)
        in[in_head++ % RING] = (char)U1RXREG;
}

void __attribute__((interrupt, auto_psv)) _U1TXInterrupt(void)
{
    IFS0bits.U1TXIF = 0;
    while (out_left && !U1STAbits.UTXBF) {
        U1TXREG = (uint8_t)*out++;
        out_left--;
    }
}

static void send(const char *bytes, uint16_t count)
{
    static char copy[80];
    while (out_left || !U1STAbits.TRMT) {
    }
    memcpy(copy, bytes, count);
    out = copy + 1;
    out_left = count - 1;
    U1TXREG = (uint8_t)copy[0];
}

static char receive(void)
{
    while (in_head == in_tail) {
    }
    return in[in_tail++ % RING];
}

static int16_t receive_word(void)
{
    uint8_t low = (uint8_t)receive();
    return (int16_t)((uint8_t)receive() << 8 | low);
}

static void send_word(int16_t word)
{
    char bytes[2] = {(char)word, (char)(word >> 8)};
    send(bytes, 2);
}

static void binary(char letter)
{
    int i;
    do {
        switch ((char)-letter) {
        case 'D':
            steps_wanted_left = (uint16_t)receive_word();
            steps_wanted_right = (uint16_t)receive_word();
            break;
        case 'E':
            send_word((int16_t)steps_wanted_left);
            send_word((int16_t)steps_wanted_right);
            break;
        case 'L': {
            uint8_t led = (uint8_t)receive();
            uint8_t value = (uint8_t)receive();
            lights = (uint8_t)(value == 2 ? lights ^ 1 << led : value ? lights | 1 << led : lights & ~(1 << led));
            LATA = (uint16_t)((lights & 1) << 6 | (lights & 2) << 6 | (lights & 4) << 7 | (lights & 8) << 9);
            break;
        }
        case 'N':
            for (i = 0; i < 8; i++)
                send_word((int16_t)(100 * i));
            break;
        default:
            return;
        }
        letter = receive();
    } while (letter < 0);
}

static void text(char letter)
{
    char line[40];
    switch (letter) {
    case 'C':
        send(line, (uint16_t)sprintf(line, "c,%d\r\n", (int)(PORTG >> 6 & 15)));
        break;
    case 'V':
        send(line, (uint16_t)sprintf(line, "v,Version %d.%02d %s\r\n", 1, 2, __TIME__[0] ? "test" : ""));
        break;
    case 'R':
        send("r\r\n", 3);
        while (!U1STAbits.TRMT || out_left) {
        }
        __asm__ volatile("reset");
        break;
    case '\r':
    case '\n':
        break;
    default:
        send("z,Command not found\r\n", 21);
        break;
    }
}

int main(void)
{
    static const char banner[] = "\f\aWELCOME to the SerCom protocol on e-Puck\r\n";
    char letter;
    resets = RCON;
    TRISA = 0;
    LATA = 0;
    U1BRG = 7;
    U1MODE = 0x8000;
    U1STA = 0x8400;
    IFS0bits.U1RXIF = IFS0bits.U1TXIF = 0;
    IEC0bits.U1RXIE = IEC0bits.U1TXIE = 1;
    send(banner, sizeof banner - 1);
    for (;;) {
        letter = receive();
        if (letter < 0)
            binary(letter);
        else
            text(letter);
    }
}
