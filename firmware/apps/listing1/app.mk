# The C library's snprintf needs about 110 bytes of the logging thread's stack, the interrupts another 62.
override DEFINES += $(if $(filter epuck,$(TARGET)),-DSYS_DEFAULT_STACK=256)
