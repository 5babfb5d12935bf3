"""UART1 and UART2: registers and FIFOs, frames, the queue towards RX, and the TX pin."""
