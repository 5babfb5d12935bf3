"""CAN1 and CAN2: modes, buffers, filters and frames on the wire."""
