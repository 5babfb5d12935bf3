DEVICES := infrared update
PROGRAMS := lamp
