"""The e-puck's camera: sensor registers, exposure, line timing and pixel bytes.

    read of PORTD -> Camera.bits -> Scan.line_at -> Readout.put: pixel source, then `encode` (line.c) -> camera.line
                        '-> byte of the cycle from camera.line, if the line has been rendered

`camera.line` is the current line in the record; native code reads it, too. The pixel source is a picture or, in a
trial, `FirmwareController` with the arena's renderer. If native code has the same source, it renders a line by line.c.
"""
