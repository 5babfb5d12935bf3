"""Instruments that observe a run: instruction trace, VCD waveforms, coverage, disassembly."""
