"""Transfer of images to robots: rows and their order, serial port, boot loader session, update messages."""
