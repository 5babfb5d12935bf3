"""Reading and writing picture files."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from emu.host.files import atomic_file

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


def read_picture(path: str | os.PathLike[str]) -> NDArray[np.uint8]:
    """Read a PNG, JPEG or similar file as an array of height x width x 3: red, green, blue.

    Raises OSError if the file cannot be read, ValueError if it does not contain a picture.
    """
    import numpy as np
    from PIL import Image, UnidentifiedImageError

    try:
        with Image.open(path) as image:
            return np.asarray(image.convert("RGB"), dtype=np.uint8)
    except (UnidentifiedImageError, Image.DecompressionBombError, SyntaxError, EOFError) as error:
        raise ValueError(f"{path}: not a picture: {error}") from None
    except OSError as error:
        if error.errno is not None:
            raise
        raise ValueError(f"{path}: not a picture: {error}") from None


def write_picture(path: str | os.PathLike[str], pixels: NDArray[np.uint8], enlarge: int = 1) -> None:
    """Write height x width x 3 pixels as PNG, atomically. Each pixel becomes `enlarge` x `enlarge` pixels.

    Raises OSError.
    """
    import numpy as np
    from PIL import Image

    large = np.repeat(np.repeat(pixels, enlarge, axis=0), enlarge, axis=1)
    with atomic_file(path) as part:
        Image.fromarray(np.ascontiguousarray(large)).save(part, format="PNG")
