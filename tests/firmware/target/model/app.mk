override DEFINES += -include $(APPS)/$(APP)/within_calls.h
