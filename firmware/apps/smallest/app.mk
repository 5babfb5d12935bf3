# Nothing but the kernel and one UART of the board: motors, LEDs and selector stay out, and so does their memory.
BARE := $(wildcard $(OS)/kernel/*.c $(OS)/port/$(PORT)/*.[cS] $(addprefix $(OS)/board/$(BOARD)/,uart.c clock.c interrupts.c vectors.S)) \
    $(OS)/io/uart.c
DEFINES_ON_kilobot := -DSYS_REPORTS=0 -DSYS_UART_TX=32 -DSYS_UART_RX=4 -DSYS_LOSS_COUNTERS=0 -DSYS_DEFAULT_STACK=80 -DSYS_HEAP=184 -DHAL_KERNEL_STACK=88
override DEFINES += -DSYS_UARTS=1 $(DEFINES_ON_$(TARGET))
