# The C library's snprintf needs about 110 bytes of the logging thread's stack, the interrupts another 62. Microchip's
# library has not been measured.
override DEFINES += $(if $(filter epuck,$(TARGET)),-DSYS_DEFAULT_STACK=$(if $(filter xc16,$(TOOLCHAIN)),640,256))
