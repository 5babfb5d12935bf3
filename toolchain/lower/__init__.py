"""Back end: legal IR, selection, register allocation, frames, text. The order of passes is in `toolchain.pipeline`."""
