"""Emission of assembly text: functions in machine form, variables, interrupt functions, constructors."""
