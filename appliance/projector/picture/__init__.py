"""The picture: the dance drawn in its looks, before it is fitted to the wall."""
