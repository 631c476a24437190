"""The picture for other programs, as MJPEG over HTTP, from a separate process."""
