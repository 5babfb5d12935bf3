# main runs the checks as PID 0, on its own stack: on a Kilobot the heap leaves it room, and holds a slice of ticks.
HEAP_ON_kilobot := -DSYS_HEAP=840
override DEFINES += $(HEAP_ON_$(TARGET))
