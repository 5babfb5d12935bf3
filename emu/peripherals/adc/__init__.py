"""ADC of 12 bits, or of 10 bits with four amplifiers: conversions, decoded settings, rules for native code."""
