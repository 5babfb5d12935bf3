# main becomes the driver's stack of nothing: all work is in threads.
HEAP_ON_kilobot := -DSYS_HEAP=1000
override DEFINES += $(HEAP_ON_$(TARGET))
