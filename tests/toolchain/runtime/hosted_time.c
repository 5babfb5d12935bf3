/* Prints results of time.h for times that are equal on the emulator and on the host, which runs with TZ=UTC. */
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

static uint32_t state = 727;
static uint32_t random32(void)
{
    state ^= state << 13;
    state ^= state >> 17;
    state ^= state << 5;
    return state;
}

int main(void)
{
    char text[240];
    for (int i = 0; i < 70; i++) {
        time_t moment = (int32_t)random32();
        if (i < 40) /* around turns of the year, which are critical for week numbers */
            moment = (time_t)(i - 10) * 31557600 + (int32_t)(random32() % 800000) - 400000;
        struct tm *parts = gmtime(&moment);
        printf("%s", asctime(parts));
        size_t length = strftime(text, sizeof text, "%a %A %b %B %C %d %e %g %G %h %H %I %j %m %M %p %S %u %U %V %w %W %y %Y", parts);
        printf("%d %s\n", (int)length, text);
        length = strftime(text, sizeof text, "%c|%D|%F|%n|%r|%R|%t|%T|%x|%X|%%|%Ey|%Od|%z", parts);
        printf("%d %s\n", (int)length, text);
        parts->tm_mday += (int)(random32() % 2000) - 1000;
        parts->tm_hour += (int)(random32() % 2000) - 1000;
        parts->tm_min += (int)(random32() % 2000) - 1000;
        parts->tm_sec += (int)(random32() % 2000) - 1000;
        parts->tm_mon += (int)(random32() % 50) - 25;
        parts->tm_year = parts->tm_year % 60 + 70;
        struct tm copy = *parts;
        time_t back = mktime(&copy);
        printf("%ld %d %d %d %d\n", (long)back, copy.tm_mon, copy.tm_mday, copy.tm_wday, copy.tm_yday);
        printf("%ld\n", (long)(difftime(back, moment) / 1024));
    }
    struct tm none;
    memset(&none, 0, sizeof none);
    for (size_t size = 0; size < 12; size++) {
        size_t length = strftime(text, size, "%Y-%m", &none);
        printf("%d %s\n", (int)length, length ? text : "");
    }
    return 0;
}
