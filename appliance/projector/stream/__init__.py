"""The picture for other programs, as MJPEG over HTTP, from a process of its own."""
