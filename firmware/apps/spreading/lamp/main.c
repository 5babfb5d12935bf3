/* The program that the robots spread: it switches the body LED on. Built by `openswarm program`. */
#include <openswarm_io.h>

int main(void)
{
    return Sys_Set_LED(SYS_LED_BODY, true) ? 0 : 1;
}
