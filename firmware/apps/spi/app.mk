DEVICES := spi
