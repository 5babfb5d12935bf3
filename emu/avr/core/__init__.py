"""The ATmega328P in C: state record, interpreter made from the instruction table, devices; compiled on first use."""
