/* Firmware of the examples in the Python reference: a line on UART1, a counter, and a function with a fault. */
#include <stdio.h>

volatile int count;
volatile struct {
    int left, right;
} speed = {100, -100};

__attribute__((noinline)) int twice(int value)
{
    return 2 * value;
}

__attribute__((noinline, used)) int broken(void)
{
    return *(volatile int *)0x801; /* odd address: an address error */
}

int main(void)
{
    printf("ready\n");
    for (;;) {
        count++;
        speed.left = twice(speed.right);
    }
}
