"""System functions: oscillator, resets and watchdog, NVM, low-voltage detect, module disable."""
