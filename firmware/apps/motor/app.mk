# No kernel, no e-puck: a motor board with a dsPIC30F4011.
override DEFINES += -mcpu=30F4011
BARE := $(APPS)/motor/drive/bridge.c $(APPS)/motor/drive/serial.c
INCLUDES = -I$(APPS)/motor
