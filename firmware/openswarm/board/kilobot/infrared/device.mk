# The Kilobot has one pulse receiver instead of eight light receivers: files here replace these of io/infrared.
REPLACED += $(addprefix $(OS)/io/infrared/,link.c detector.c reflections.c range.c)
# Reception runs in its interrupt, on top of any handler: 153 bytes were seen. The heap has the rest of 2 kB.
override DEFINES += $(if $(findstring HAL_KERNEL_STACK,$(DEFINES)),,-DHAL_KERNEL_STACK=208) \
    $(if $(findstring SYS_HEAP,$(DEFINES)),,-DSYS_HEAP=960) \
    $(if $(findstring SYS_REMOTE_MEMORY,$(DEFINES)),,-DSYS_REMOTE_MEMORY=16)
