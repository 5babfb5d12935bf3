"""The e-puck's camera: sensor registers, exposure, line timing and the bytes of its pixels."""
