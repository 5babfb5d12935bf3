/* The simulated medium between robots. See infrared_air.h. */
#include "infrared_air.h"

unsigned int readings[HAL_INFRARED_SENSORS];
bool own_light;
uint16 fixed_number;

void hal_infrared_start(void)
{
}

void hal_infrared_light(bool on)
{
    own_light = on;
}

uint16_t hal_infrared_number(void)
{
    return fixed_number;
}

void scan_isr(void)
{
    infrared_scanned(readings);
}

void scan_with(uint8 sensor, uint16 depth)
{
    static unsigned part;
    for (uint8 i = 0; i < HAL_INFRARED_SENSORS; i++) {
        readings[i] = (unsigned)(DARK + i - (i == sensor ? depth : 0));
    }
    host_device(scan_isr);
    for (part += 125; part >= 512; part -= 512) {
        host_tick();
    }
}

void scans_in_the_dark(unsigned n)
{
    while (n-- != 0) {
        scan_with(0, 0);
    }
}

void begin_link(void)
{
    host_use_virtual_time();
    Sys_Init_Kernel();
    CHECK(Sys_Start_Infrared());
    Sys_Start_Kernel();
    scans_in_the_dark(2 * EARLY);
}

void record(recording *r)
{
    uint16 before = Sys_Get_InfraredStatistics()->sent;
    unsigned wait = 0;
    memset(r, 0, sizeof *r);
    while (r->length < 9) { /* wait for at least the ones of a preamble: a proximity flash is shorter */
        CHECK(++wait < 5000);
        scan_with(0, 0);
        r->lit[r->length] = true;
        r->length = own_light ? r->length + 1 : 0;
    }
    while (Sys_Get_InfraredStatistics()->sent == before) {
        CHECK(r->length < LONGEST);
        scan_with(0, 0);
        r->lit[r->length++] = own_light;
    }
    scans_in_the_dark(30);
}

void play(const recording *r, uint8 sensor, uint16 depth)
{
    for (unsigned i = 0; i < r->length; i++) {
        scan_with(sensor, r->lit[i] ? depth : 0);
    }
    scans_in_the_dark(40);
}

void say(const char *text, uint16 as, recording *r)
{
    CHECK(Sys_Set_RobotNumber(as));
    CHECK(Sys_Send_Neighbours(text, (uint16)strlen(text)));
    record(r);
}
