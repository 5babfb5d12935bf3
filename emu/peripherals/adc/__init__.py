"""The 12-bit ADC: registers, conversion schedule, rules for native code."""
