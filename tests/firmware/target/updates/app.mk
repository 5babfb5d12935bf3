# The stores of io/update on the chip's flash and EEPROM, without a kernel: what is looked at is where power fails.
BARE := $(OS)/io/update/update.c $(OS)/board/epuck/update/update_cells.c
INCLUDES += -I$(OS)/io/update
