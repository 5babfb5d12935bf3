/* Operations of a program, in the order of their codes. Python reads this list, too (program.py). The comment names the
 * operands a, b and c; an operand "pid" is explained at pid_of() in interpreter.c. */
#define OPERATIONS(X)                                                                     \
    X(START_KERNEL)      /* main only; once */                                            \
    X(RUN_SYSTEM_THREAD)                                                                  \
    X(START_PROCESS)     /* slot, script */                                               \
    X(START_WITH)        /* slot, script, configuration */                                \
    X(START_JOINABLE)    /* slot, script, configuration */                                \
    X(KILL)              /* pid */                                                        \
    X(YIELD)                                                                              \
    X(SLEEP)             /* ms */                                                         \
    X(WAIT_FOR_PERIOD)                                                                    \
    X(START_SECTION)                                                                      \
    X(END_SECTION)                                                                        \
    X(PROCESS_STATE)     /* pid */                                                        \
    X(UNUSED_STACK)      /* pid */                                                        \
    X(UNUSED_KERNEL_STACK)                                                                \
    X(SET_SCHEDULER)     /* scheduler */                                                  \
    X(REGISTER)          /* event */                                                      \
    X(UNREGISTER)        /* event */                                                      \
    X(IS_REGISTERED)     /* event */                                                      \
    X(SUBSCRIBE)         /* event, pid, handler + 8 * condition */                        \
    X(UNSUBSCRIBE)       /* event, pid */                                                 \
    X(UNSUBSCRIBE_HANDLER) /* event, pid, handler */                                      \
    X(SEND)              /* event, index into sizes, first byte */                        \
    X(SEND_INT)          /* event, value */                                               \
    X(WAIT_EVENT)        /* event */                                                      \
    X(WAIT_CONDITION)    /* event, condition */                                           \
    X(WAIT_TIMEOUT)      /* event, condition, ms */                                       \
    X(READ)              /* reads the caller's wait result or the event data */           \
    X(CLEAR)                                                                              \
    X(LOST)              /* event */                                                      \
    X(STATISTICS)        /* member */                                                     \
    X(MOTOR_SPEEDS)                                                                       \
    X(LOCK)              /* mutex */                                                      \
    X(LOCK_TIMEOUT)      /* mutex, ms */                                                  \
    X(UNLOCK)            /* mutex */                                                      \
    X(JOIN)              /* pid */                                                        \
    X(JOIN_TIMEOUT)      /* pid, ms */                                                    \
    X(NOTIFY)            /* notification, bits */                                         \
    X(NOTIFY_VALUE)      /* notification, bits, value */                                  \
    X(WAIT_NOTIFICATION) /* notification, bits, ms */                                     \
    X(SIGNAL)            /* semaphore */                                                  \
    X(WAIT_SEMAPHORE)    /* semaphore */                                                  \
    X(WAIT_SEMAPHORE_TIMEOUT) /* semaphore, ms */                                         \
    X(START_TIMER)       /* timer, event, first ms + 16 * period */                       \
    X(STOP_TIMER)        /* timer */                                                      \
    X(PUSH)              /* object, cleanup */                                            \
    X(POP)               /* run */                                                        \
    X(LIMIT)             /* quota, event, most */                                         \
    X(KEEP)              /* quota, event */                                               \
    X(START_SERVICE)     /* service */                                                    \
    X(FEED)                                                                               \
    X(SHARE)             /* event, hops */                                                \
    X(REMOTE_STATISTICS) /* member */                                                     \
    X(ARRIVE)            /* event, robot - 1, value: a frame; its low bit is a hop, its high digit the sequence */ \
    X(TICK)              /* the 1 ms clock ticks */                                       \
    X(SLICE)             /* the slice ends */                                             \
    X(INTERRUPT)         /* script of an ISR */                                           \
    X(LATER)             /* n: the last script runs as ISR at the n-th unlock from here; once */     \
    X(SYSTEM_TIME)                                                                        \
    X(FAIL)              /* allocations that succeed first, then how many fail */
