DEVICES := update
PROGRAMS := talker
