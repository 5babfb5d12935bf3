DEVICES := infrared
INCLUDES = -Iapps/clocks # rove.h
