# The robots built with a GCC of Debian. Sets PORT, BOARD, OUT, IMAGE, and GCC with its flags.
ifeq ($(TARGET),kilobot)
PORT := avr
BOARD := kilobot
GCC := avr-gcc
GCC_PACKAGES := gcc-avr avr-libc
GCC_NEEDS := crtatmega328p.o
GCC_FLAGS := -mmcu=atmega328p -DF_CPU=8000000UL -mcall-prologues -mrelax -flto -mstrict-X \
    -fno-tree-phiprop -fno-tree-forwprop -fno-partial-inlining -fno-move-loop-invariants -flto-partition=none \
    -fno-tree-sink -fno-gcse -fno-tree-loop-ivcanon -fno-tree-dominator-opts -fno-tree-loop-im -fira-algorithm=priority
GCC_LINK := $(OS)/port/avr/ram.ld
else ifeq ($(TARGET),epuck2)
PORT := cortex_m
BOARD := epuck2
GCC := arm-none-eabi-gcc
GCC_PACKAGES := gcc-arm-none-eabi libnewlib-arm-none-eabi
GCC_NEEDS := nano.specs
GCC_FLAGS := -mcpu=cortex-m4 -mthumb -mfloat-abi=hard -mfpu=fpv4-sp-d16 -DF_CPU=168000000UL
GCC_LINK := --specs=nano.specs --specs=nosys.specs -nostartfiles -T $(OS)/board/epuck2/flash.ld
else
PORT := riscv
BOARD := qemu_virt
GCC := riscv64-unknown-elf-gcc
GCC_PACKAGES := gcc-riscv64-unknown-elf picolibc-riscv64-unknown-elf
GCC_NEEDS := picolibc.specs
# The older specification counts the control and status registers among the base, as Debian's library folders do.
GCC_FLAGS := -march=rv32imac -mabi=ilp32 -misa-spec=2.2
GCC_LINK := --specs=picolibc.specs -nostartfiles -T $(OS)/board/qemu_virt/memory.ld
endif
OUT ?= build/$(TARGET)/$(APP)
IMAGE := $(OUT)/firmware.elf
GCC_FLAGS += -DSYS_UARTS=1 -ffunction-sections -fdata-sections -fshort-enums -Wl,--gc-sections

# -print-file-name answers with the bare name when there is no such file
ifeq ($(shell command -v $(GCC) >/dev/null && $(GCC) $(filter -m%,$(GCC_FLAGS)) -print-file-name=$(GCC_NEEDS) | grep /),)
$(error $(GCC) for TARGET=$(TARGET) is not installed; Debian packages: $(GCC_PACKAGES))
endif
