# The C library's sprintf needs about 110 bytes of the logging thread's stack, the interrupts another 62. Microchip's
# library has not been measured; avr-libc's takes about 120, newlib-nano's about 400.
STACK_ON_epuck := $(if $(filter xc16,$(TOOLCHAIN)),640,256)
STACK_ON_kilobot := 208
STACK_ON_epuck2 := 640
override DEFINES += $(STACK_ON_$(TARGET):%=-DSYS_DEFAULT_STACK=%)
# The system registers SYS_IO_1PXSENSOR, as the paper says; what sends it is the camera, where the board has one.
override DEFINES += -DSYS_1PXSENSOR=1
DEVICES := $(if $(wildcard openswarm/board/$(BOARD)/camera),camera i2c)
