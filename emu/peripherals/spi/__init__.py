"""Synchronous serial interfaces: SPI1, SPI2 and the data converter interface (DCI)."""
