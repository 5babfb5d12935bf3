/* Prints the tags of messages of 1 to 32 bytes, with key, nonce and messages of the algorithm's published vectors, and of
 * one as long as the longest program. */
#include "ascon.h"

#include <stdio.h>

enum { SHORT = 32, LONG = 3056 };

int main(void)
{
    static uint8 key[SYS_ASCON_BYTES], nonce[SYS_ASCON_BYTES], message[LONG], tag[SYS_ASCON_BYTES];
    for (uint8 i = 0; i < SYS_ASCON_BYTES; i++) {
        key[i] = i;
        nonce[i] = (uint8)(SYS_ASCON_BYTES + i);
    }
    for (int i = 0; i < LONG; i++) {
        message[i] = (uint8)(0x30 + i);
    }
    for (int size = 1; size <= LONG; size = size == SHORT ? LONG : size + 1) {
        sys_ascon mac;
        int at = 0;
        Sys_Begin_AsconMac(&mac, key, nonce);
        for (; at + SYS_ASCON_BYTES <= size; at += SYS_ASCON_BYTES) {
            Sys_Add_AsconMac(&mac, message + at);
        }
        Sys_End_AsconMac(&mac, key, message + at, (uint8)(size - at), tag);
        printf("%d ", size);
        for (int i = 0; i < SYS_ASCON_BYTES; i++) {
            printf("%02X", tag[i]);
        }
        printf("\n");
    }
    return 0;
}
