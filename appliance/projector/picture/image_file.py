"""Image files of a show as textures: no larger than the picture needs."""

from __future__ import annotations

from pathlib import Path

import moderngl
import numpy as np
from numpy.typing import NDArray
from PIL import ExifTags
from PIL import Image as Files

Image = NDArray[np.uint8]
MOST_PIXELS = 64_000_000  # in a file: more would hold up the projector's start
LINES, MOST_WIDE = 1080, 4096  # most lines and columns of a texture: more not every graphics chip takes

_UPRIGHT = {  # by the orientation that a camera notes (Exif 2.3, tag 274)
    2: Files.Transpose.FLIP_LEFT_RIGHT,
    3: Files.Transpose.ROTATE_180,
    4: Files.Transpose.FLIP_TOP_BOTTOM,
    5: Files.Transpose.TRANSPOSE,
    6: Files.Transpose.ROTATE_270,
    7: Files.Transpose.TRANSVERSE,
    8: Files.Transpose.ROTATE_90,
}


def read_image(path: Path | str, lines: int = LINES) -> Image:
    """(height, width, 4) red, green, blue, alpha, top row first, of at most `lines` rows and
    MOST_WIDE columns.

    Raises OSError for what is no image, or one of too many pixels.
    """
    try:
        with Files.open(path, formats=("PNG", "JPEG")) as file:
            if file.width * file.height > MOST_PIXELS:
                raise OSError(f"it has more than {MOST_PIXELS // 1_000_000} million pixels")
            turn = _UPRIGHT.get(file.getexif().get(ExifTags.Base.Orientation, 1))
            image = file.convert("RGBA")
            image = image if turn is None else image.transpose(turn)
            shrunk = min(1.0, lines / image.height, MOST_WIDE / image.width)
            size = max(1, round(image.width * shrunk)), max(1, round(image.height * shrunk))
            return np.asarray(image if image.size == size else image.resize(size, Files.Resampling.LANCZOS))
    except (ValueError, SyntaxError, Files.DecompressionBombError) as error:
        raise OSError(str(error)) from error


def texture_of(gl: moderngl.Context, image: Image) -> moderngl.Texture:
    """On the GPU, its lowest row first, colours multiplied by alpha."""
    alpha = image[..., 3:].astype(np.float32) / 255
    flat = np.concatenate([np.round(image[..., :3] * alpha), image[..., 3:]], axis=2).astype(np.uint8)
    texture = gl.texture((image.shape[1], image.shape[0]), 4, np.ascontiguousarray(flat[::-1]).tobytes())
    texture.repeat_x = texture.repeat_y = False
    texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
    return texture
