/* What the robots spread: from its start on the body LED is on. Built by `openswarm program`. */
#include <openswarm_io.h>

int main(void)
{
    return Sys_Set_LED(SYS_LED_BODY, true) ? 0 : 1;
}
