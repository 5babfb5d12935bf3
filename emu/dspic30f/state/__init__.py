"""State of the core: fields of the state record, data space, core registers and processor modes."""
