# No kernel, no start-up code, no vectors: the words at the end of flash and the GOTO at 0 that leads there.
BARE := $(OS)/board/epuck/flash/flash_cells.h
INCLUDES = -I$(OS)/board/epuck/flash -I$(APPS)/$(APP)
override DEFINES += -nostartfiles -Wl,--no-isr -Wl,--no-data-init
