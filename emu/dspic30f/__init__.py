"""The dsPIC30F core: instruction table, state, sequencer, interrupts and the engines that run it."""
