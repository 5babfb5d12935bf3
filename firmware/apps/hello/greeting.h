#ifndef GREETING_H
#define GREETING_H

void greet(void); /* a thread function */

#endif
