# No kernel: shared with apps/clustering are the camera's configuration and capture, the classifier and the table of speeds.
CAMERA_FOLDERS := $(OS)/board/epuck/camera $(OS)/board/epuck/i2c $(OS)/io/camera
BARE := $(OS)/board/epuck/camera/camera_sensor.c $(OS)/board/epuck/camera/camera_capture.S \
    $(OS)/board/epuck/i2c/i2c_master.c $(OS)/io/camera/line_of_sight.c
INCLUDES = $(addprefix -I,$(CAMERA_FOLDERS)) -I$(OS)/board/epuck -Iapps/clustering
