override DEFINES += -DSYS_DEFAULT_STACK=320 # snprintf, and the interrupts
