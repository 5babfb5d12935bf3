"""UART1 and UART2: registers and FIFOs, frames, the RX line and the TX pin."""
