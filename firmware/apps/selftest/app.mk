DEVICES := camera i2c remote analog led bluetooth battery
# snprintf needs about 110 bytes of a thread's stack, the interrupts another 62.
override DEFINES += -DSYS_DEFAULT_STACK=384
