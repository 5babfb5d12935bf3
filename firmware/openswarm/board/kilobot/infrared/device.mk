# The Kilobot has one receiver of pulses, not eight of light: these files of io/infrared it has its own for.
REPLACED += $(addprefix $(OS)/io/infrared/,link.c detector.c reflections.c range.c)
# What a frame starts runs in its interrupt, on top of any handler: 153 bytes were seen. The heap gets what is left of 2 kB.
override DEFINES += $(if $(findstring HAL_KERNEL_STACK,$(DEFINES)),,-DHAL_KERNEL_STACK=208) \
    $(if $(findstring SYS_HEAP,$(DEFINES)),,-DSYS_HEAP=960)
